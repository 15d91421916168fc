/* A step in C that reads a binary STL file in mm and gives its facets as the body `hat` of a geometry, with the outline `blank`, which has a hole. */

#include "plyflow.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TEXT(s) ((pf_str){(s), sizeof(s) - 1})

static const char MANIFEST[] =
    "{"
    "\"name\": \"surface\", \"version\": \"0.1.0\", \"vendor\": \"Plyflow tests\","
    "\"kind\": \"step\", \"role\": \"test\", \"summary\": \"A tool and an outline.\","
    "\"parameters\": {\"stl\": {\"type\": \"file\", \"required\": true, \"doc\": \"In mm.\"}},"
    "\"inputs\": {},"
    "\"output\": {\"kind\": \"geometry\"},"
    "\"results\": {}"
    "}";

static int32_t failed(const pf_services *s, const char *text) {
  s->fail(s->host, (pf_str){text, strlen(text)});
  return PF_ERROR;
}

/* The whole file that the parameter `stl` names: {"stl":"/path"}. */
static unsigned char *file(pf_str parameters, size_t *size) {
  char path[4096];
  const char *begin = memchr(parameters.data, '/', parameters.len);
  if (!begin)
    return NULL;
  size_t left = parameters.len - (size_t)(begin - parameters.data);
  const char *end = memchr(begin, '"', left);
  if (!end || (size_t)(end - begin) >= sizeof path)
    return NULL;
  memcpy(path, begin, (size_t)(end - begin));
  path[end - begin] = 0;
  FILE *in = fopen(path, "rb");
  if (!in)
    return NULL;
  unsigned char *bytes = malloc(64u << 20);
  *size = bytes ? fread(bytes, 1, 64u << 20, in) : 0;
  fclose(in);
  return bytes;
}

static int32_t outline(const pf_services *s, pf_str path, const double *corners, uint64_t count) {
  pf_array_info info = {0};
  info.dtype = PF_F64;
  info.rank = 2;
  info.shape[0] = count;
  info.shape[1] = 2;
  return s->array_write(s->host, path, &info, TEXT("m"), corners);
}

static int32_t run(const pf_services *s) {
  static const double blank[8] = {-0.06, -0.05, 0.06, -0.05, 0.06, 0.05, -0.06, 0.05};
  static const double hole[8] = {-0.02, -0.01, -0.02, 0.01, 0.02, 0.01, 0.02, -0.01};
  size_t size = 0;
  unsigned char *bytes = file(s->parameters(s->host), &size);
  if (!bytes || size < 84)
    return failed(s, "the STL file cannot be read");
  uint32_t facets;
  memcpy(&facets, bytes + 80, 4);
  if (size != 84 + 50 * (size_t)facets)
    return failed(s, "the STL file is not binary");
  double *points = malloc((size_t)facets * 9 * sizeof *points);
  uint32_t *cells = malloc((size_t)facets * 3 * sizeof *cells);
  if (!points || !cells)
    return failed(s, "out of memory");
  for (uint32_t f = 0; f < facets; f++) {
    float corners[9];
    memcpy(corners, bytes + 84 + 50 * (size_t)f + 12, sizeof corners);
    for (uint32_t k = 0; k < 9; k++)
      points[9 * (size_t)f + k] = (double)corners[k] * 1e-3;
    for (uint32_t k = 0; k < 3; k++)
      cells[3 * (size_t)f + k] = 3 * f + k;
  }
  int32_t code = s->mesh_define(s->host, TEXT("hat"), 3 * (uint64_t)facets, points, facets, 3, cells, TEXT("{}"));
  if (code == PF_OK)
    code = outline(s, TEXT("outlines/blank/outline"), blank, 4);
  if (code == PF_OK)
    code = outline(s, TEXT("outlines/blank/hole_0"), hole, 4);
  if (code == PF_OK)
    code = s->attributes_write(s->host, TEXT("{\"outlines\": [\"blank\"]}"));
  free(points);
  free(cells);
  free(bytes);
  return code;
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
