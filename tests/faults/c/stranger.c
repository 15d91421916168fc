/* A library as a stranger may send it along: it does something as soon as it is loaded. Where MARK is set it appends its name to
 * that file from its constructor. As a step it does what the words in STRANGER say: fork (children in its group, and one that
 * leaves group, session and parent), hang, talk (without end, on its standard error), steer (control characters in its log, on its standard error and in its failure),
 * allocate (more and more memory). */

#include "plyflow.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifndef NAME
#define NAME "stranger"
#endif

#define TEXT(s) ((pf_str){(s), sizeof(s) - 1})

__attribute__((constructor)) static void on_load(void) {
  const char *mark = getenv("MARK");
  FILE *file = mark ? fopen(mark, "a") : NULL;
  if (file) {
    fputs(NAME "\n", file);
    fclose(file);
  }
}

static const char MANIFEST[] =
    "{\"name\": \"" NAME "\", \"version\": \"0.1.0\", \"vendor\": \"A stranger\", \"kind\": \"step\", \"role\": \"example\","
    "\"summary\": \"Does what a stranger wants.\", \"parameters\": {\"limit\": {\"type\": \"quantity\", \"dimension\": \"angle\","
    "\"default\": \"8 deg\", \"doc\": \"A limit.\"}}, \"inputs\": {}, \"output\": {\"kind\": \"example\"},"
    "\"results\": {\"sum\": {\"unit\": \"1\", \"doc\": \"One.\"}}}";

static void rest(void) {
  for (;;)
    sleep(1000);
}

static void start_children(void) {
  if (!fork())
    rest();
  if (!fork()) {
    setsid();
    if (!fork())
      rest();
    _exit(0);
  }
}

static int32_t run(const pf_services *s) {
  const char *wish = getenv("STRANGER");
  if (!wish)
    wish = "";
  if (strstr(wish, "fork"))
    start_children();
  if (strstr(wish, "hang"))
    rest();
  if (strstr(wish, "steer")) {
    fputs("\033[2J on standard error \302\233 2J\n", stderr);
    s->log(s->host, PF_LOG_WARN, TEXT("\033]0;title\007 \r over \342\200\256 back"));
    s->fail(s->host, TEXT("<script>alert(1)</script> \033[31m red"));
    return PF_ERROR;
  }
  while (strstr(wish, "talk"))
    fputs("more and more of what nobody wants to know, line after line without an end\n", stderr);
  /* 64 MiB at a time, and used, as a computation would. */
  for (size_t n = 0; strstr(wish, "allocate"); n++) {
    char *more = malloc(64 << 20);
    if (!more) {
      fputs("memory allocation of 67108864 bytes failed\n", stderr);
      abort();
    }
    memset(more, (int)n, 64 << 20);
  }
  s->attributes_write(s->host, TEXT("{}"));
  return s->result(s->host, TEXT("sum"), 1.0, TEXT("1"), 0);
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
