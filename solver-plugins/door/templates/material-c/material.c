/* A law of a sheet in C: only plyflow.h is needed.
 *
 * A linear orthotropic sheet with a cubic bending law. Take it as a start: change the manifest, then `membrane` and `bending`. The whole
 * contract stands in plyflow.h; what matters most:
 *
 * - Arrays are [row][lane]: row r of point l is at [r * lanes + l].
 * - Write every output for every lane, read and write nothing else, allocate nothing.
 * - Several threads call one instance at once: no globals, scratch memory on the stack.
 * - Stress and moment are derivatives of the energy: check-plugin compares them.
 */

#include "plyflow.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Its keys are those of schemas/manifest.md. */
static const char MANIFEST[] =
    "{\"name\": \"my-sheet\", \"version\": \"0.1.0\", \"vendor\": \"You\", \"kind\": \"material\", \"role\": \"material\","
    "\"summary\": \"A linear orthotropic sheet with a cubic bending law.\","
    "\"parameters\": {\"shear_modulus\": {\"type\": \"quantity\", \"dimension\": \"force_per_length\", \"minimum\": \"0 N/m\","
    "\"default\": \"1000 N/m\", \"doc\": \"Shear stiffness G.\"}},"
    "\"inputs\": {}, \"results\": {}, \"fields\": []}";

static const double K1 = 1e5, K2 = 2e5; /* N/m */
static const double D = 1e-3, CUBIC = 1e-7; /* N m, N m3 */

typedef struct instance {
  double thickness, areal_mass, shear; /* m, kg/m2, N/m */
} instance;

/* The number after a key of the parameters; NAN when there is none. pf_str has no NUL at its end, so copy before searching.
 * A plugin with more than a number or two wants a JSON library here. */
static double number(pf_str parameters, const char *key) {
  char text[512];
  if (parameters.len >= sizeof text)
    return NAN;
  memcpy(text, parameters.data, parameters.len);
  text[parameters.len] = 0;
  const char *at = strstr(text, key);
  const char *colon = at ? strchr(at, ':') : NULL;
  return colon ? strtod(colon + 1, NULL) : NAN;
}

static int32_t create(pf_str parameters, void **out, pf_error *error) {
  /* JSON: the `with` block in SI numbers, and two of the sheet: {"shear_modulus": 1000, "areal_mass": 0.44, "thickness": 0.0004}. */
  instance *i = malloc(sizeof *i);
  if (!i)
    return PF_ERROR;
  i->thickness = number(parameters, "\"thickness\"");
  i->areal_mass = number(parameters, "\"areal_mass\"");
  i->shear = number(parameters, "\"shear_modulus\"");
  if (!(i->thickness > 0 && i->areal_mass > 0 && i->shear >= 0)) { /* never go on with a number that the user did not give */
    snprintf(error->text, sizeof error->text,
             "thickness %g m, areal_mass %g kg/m2, shear_modulus %g N/m: expected numbers above 0, and a shear_modulus of at least 0, "
             "within 511 bytes of parameters",
             i->thickness, i->areal_mass, i->shear);
    free(i);
    return PF_ERROR;
  }
  *out = i;
  return PF_OK;
}

static void destroy(void *it) { free(it); }

static int32_t sizes(const void *it, pf_material_sizes *s) {
  const instance *i = it;
  /* Field by field: the caller's struct may be shorter than this header's, and what is not assigned is 0 already. */
  s->has_bending = 1;
  s->thickness = i->thickness;
  s->areal_mass = i->areal_mass;
  return PF_OK;
}

static int32_t membrane(const void *it, const pf_membrane_batch *b) {
  const double G = ((const instance *)it)->shear;
  const uint32_t n = b->lanes; /* points in this batch; row r of point l is at [r * n + l] */
  for (uint32_t l = 0; l < n; l++) {
    const double e11 = 0.5 * (b->metric[l] - 1), e22 = 0.5 * (b->metric[n + l] - 1), c12 = b->metric[2 * n + l];
    b->stress[l] = K1 * e11;
    b->stress[n + l] = K2 * e22;
    b->stress[2 * n + l] = G * c12; /* S12 = dW/dC12: C12 stands for both off-diagonals */
    b->energy[l] = 0.5 * (K1 * e11 * e11 + K2 * e22 * e22 + G * c12 * c12);
    if (b->stiffness) {
      b->stiffness[l] = K2 > 2 * G ? K2 : 2 * G; /* a bound of the largest tangent: it sets the time step */
      b->stiffness[n + l] = G;
    }
  }
  return PF_OK;
}

static int32_t bending(const void *it, const pf_bending_batch *b) {
  (void)it;
  const uint32_t n = b->lanes;
  for (uint32_t l = 0; l < n; l++) {
    b->energy[l] = 0;
    for (int a = 0; a < 3; a++) {
      const double k = b->curvature[a * n + l], twice = a == 2 ? 2 : 1;
      b->moment[a * n + l] = D * k + CUBIC * k * k * k;
      b->energy[l] += twice * (0.5 * D * k * k + 0.25 * CUBIC * k * k * k * k);
      if (b->tangent)
        b->tangent[a * n + l] = D + 3 * CUBIC * k * k;
    }
  }
  return PF_OK;
}

static const pf_material_functions FUNCTIONS = {
    .size = sizeof FUNCTIONS, .create = create, .destroy = destroy, .sizes = sizes, .membrane = membrane, .bending = bending};

static const pf_plugin PLUGIN = {.magic = PF_MAGIC,
                                 .abi_major = PF_ABI_MAJOR,
                                 .abi_minor = PF_ABI_MINOR,
                                 .size = sizeof(pf_plugin),
                                 .kind = PF_KIND_MATERIAL,
                                 .manifest = {MANIFEST, sizeof MANIFEST - 1},
                                 .functions = &FUNCTIONS};

const pf_plugin *plyflow_plugin(void) { return &PLUGIN; }
