/* A step in C whose artifact carries curves, a plot of them and two text files. */

#include "plyflow.h"

#define TEXT(s) ((pf_str){(s), sizeof(s) - 1})

static const char MANIFEST[] =
    "{"
    "\"name\": \"curves\", \"version\": \"0.1.0\", \"vendor\": \"Plyflow tests\","
    "\"kind\": \"step\", \"role\": \"test\", \"summary\": \"Curves, a plot and files.\","
    "\"parameters\": {},"
    "\"inputs\": {\"in\": {\"kind\": \"any\", \"required\": false, \"many\": true, \"doc\": \"Anything.\"}},"
    "\"output\": {\"kind\": \"coupon\"},"
    "\"results\": {\"peak\": {\"unit\": \"m\", \"doc\": \"Largest displacement.\"}}"
    "}";

static const char ATTRIBUTES[] =
    "{\"title\": \"A curve in C\","
    "\"plots\": [{\"name\": \"u\", \"title\": \"Displacement of the grip\","
    "  \"x\": {\"label\": \"time\", \"unit\": \"ms\"}, \"y\": {\"label\": \"displacement\", \"unit\": \"mm\"},"
    "  \"series\": [{\"label\": \"this run\", \"x\": \"curves/t\", \"y\": \"curves/u\", \"style\": \"line\"}]}],"
    "\"files\": [{\"name\": \"material.yaml\", \"text\": \"plyflow_material: 1\\n\"},"
    "  {\"name\": \"notes.txt\", \"text\": \"\\u00b5 = 0.3\\n\"}]}";

static int32_t run(const pf_services *s) {
  static const double t[4] = {0.0, 0.1, 0.2, 0.3};
  static const double u[4] = {0.0, 0.01, 0.04, 0.03};
  pf_array_info info = {0};
  info.dtype = PF_F64;
  info.rank = 1;
  info.shape[0] = 4;
  int32_t code = s->array_write(s->host, TEXT("curves/t"), &info, TEXT("s"), t);
  if (code == PF_OK)
    code = s->array_write(s->host, TEXT("curves/u"), &info, TEXT("m"), u);
  if (code == PF_OK)
    code = s->attributes_write(s->host, TEXT(ATTRIBUTES));
  if (code == PF_OK)
    code = s->result(s->host, TEXT("peak"), 0.04, TEXT("m"), 0);
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
