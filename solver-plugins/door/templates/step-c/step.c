/* A step of Plyflow in C: only plyflow.h is needed.
 *
 * It multiplies the array "history/time" of its input, writes it with how many values it has, and reports their sum. Take it as a
 * start: change the manifest, then `run`. */

#include "plyflow.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A text constant as pf_str. */
#define TEXT(s) ((pf_str){(s), sizeof(s) - 1})

/* Its keys are those of schemas/manifest.md. */
static const char MANIFEST[] =
    "{"
    "\"name\": \"double-time\", \"version\": \"0.1.0\", \"vendor\": \"You\","
    "\"kind\": \"step\", \"role\": \"example\","
    "\"summary\": \"Multiplies the times of a history.\","
    "\"parameters\": {\"factor\": {\"type\": \"number\", \"default\": 2.0, \"doc\": \"What the times are multiplied by.\"}},"
    "\"inputs\": {\"formed\": {\"kind\": \"forming\", \"doc\": \"An artifact with history/time.\"}},"
    "\"output\": {\"kind\": \"example\"},"
    "\"results\": {\"sum\": {\"unit\": \"s\", \"doc\": \"Sum of the multiplied times.\"}}"
    "}";

/* Tells the user why the step failed and returns the status for it. */
static int32_t failed(const pf_services *s, const char *text) {
  s->fail(s->host, (pf_str){text, strlen(text)});
  return PF_ERROR;
}

/* The number after a key of the parameters; false when there is none. pf_str has no NUL at its end, so copy before searching.
 * A plugin with more than a number or two wants a JSON library here. */
static int number(pf_str parameters, const char *key, double *value) {
  char text[256];
  if (parameters.len >= sizeof text)
    return 0;
  memcpy(text, parameters.data, parameters.len);
  text[parameters.len] = 0;
  const char *at = strstr(text, key);
  const char *colon = at ? strchr(at, ':') : NULL;
  if (colon)
    *value = strtod(colon + 1, NULL);
  return colon != NULL;
}

static int32_t run(const pf_services *s) {
  /* The `with` block in JSON, as the manifest declares it: checked, defaults filled in, SI numbers. {"factor": 2.0} */
  double factor;
  if (!number(s->parameters(s->host), "\"factor\"", &factor))
    return failed(s, "factor: expected a number within 255 bytes of parameters");

  /* The workflow decides which artifacts arrive. This plugin has one port that takes one artifact, so its handle is 0.
   * s->inputs(s->host) lists them in JSON. */
  const uint32_t formed = 0;
  const pf_str path = TEXT("history/time");
  pf_array_info info;
  if (s->array_info(s->host, formed, path, &info) != PF_OK)
    return failed(s, "the input has no array history/time");

  uint64_t count = 1; /* elements: the product of the shape, 1 for a single value */
  for (uint32_t i = 0; i < info.rank; i++)
    count *= info.shape[i];
  double *time = malloc(count ? count * sizeof *time : 1);
  if (!time)
    return failed(s, "out of memory");

  /* Whatever the type in the file, the host converts to what is asked for. */
  int32_t code = s->array_read(s->host, formed, path, PF_F64, time, count * sizeof *time);
  double sum = 0;
  for (uint64_t i = 0; code == PF_OK && i < count; i++) {
    if (i % 1024 == 0 && s->cancelled(s->host)) {
      code = PF_CANCELLED;
      break;
    }
    time[i] *= factor;
    sum += time[i];
  }

  char text[64];
  if (code == PF_OK) {
    snprintf(text, sizeof text, "multiplied %llu times", (unsigned long long)count);
    s->log(s->host, PF_LOG_INFO, (pf_str){text, strlen(text)});
    info.dtype = PF_F64;
    code = s->array_write(s->host, path, &info, TEXT("s"), time);
  }
  if (code == PF_OK) {
    snprintf(text, sizeof text, "{\"count\": %llu}", (unsigned long long)count);
    code = s->attributes_write(s->host, (pf_str){text, strlen(text)});
  }
  if (code == PF_OK)
    code = s->result(s->host, TEXT("sum"), sum, TEXT("s"), 0);
  free(time);
  return code; /* the host knows why a service refused and tells the user */
}

static const pf_step_functions FUNCTIONS = {sizeof FUNCTIONS, run};

static const pf_plugin PLUGIN = {
    .magic = PF_MAGIC,
    .abi_major = PF_ABI_MAJOR,
    .abi_minor = PF_ABI_MINOR,
    .size = sizeof(pf_plugin),
    .kind = PF_KIND_STEP,
    .manifest = {MANIFEST, sizeof MANIFEST - 1},
    .functions = &FUNCTIONS,
};

const pf_plugin *plyflow_plugin(void) { return &PLUGIN; }
