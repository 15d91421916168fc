/* A small linear sheet with bending, with one fault planted by -DFAULT=NAME. */

#include "plyflow.h"

#include <math.h>
#include <stdlib.h>

enum fault {
  NONE,
  PAST_END,        /* writes one row beyond the stress */
  NOT_FINITE,      /* NaN in compression */
  PRESTRESS,       /* stress at rest */
  WRONG_SHEAR,     /* S12 without the factor that stands for both off-diagonals */
  SMALL_BOUND,     /* the bound of the tangent is one of the two directions only */
  NEIGHBOUR,       /* a lane feels the next one */
  GAINS,           /* stress grows with the number of calls: energy from nothing */
  WRONG_MOMENT,    /* M12 counts the twist once */
  WRONG_TANGENT,   /* secant instead of tangent */
  BENT_AT_REST,    /* moment at zero curvature */
  SEGFAULT,
};

#ifndef FAULT
#define FAULT NONE
#endif

static const char MANIFEST[] = "{\"name\": \"sheet-c\", \"version\": \"0.1.0\", \"vendor\": \"Plyflow tests\","
                               "\"kind\": \"material\", \"role\": \"material\", \"summary\": \"A linear sheet.\","
                               "\"parameters\": {}, \"inputs\": {}, \"results\": {}, \"fields\": []}";

static volatile uintptr_t nowhere = 8;
static const double K1 = 1e5, K2 = 2e5, G = 1e3, D = 1e-3, CUBIC = 1e-7;

static int32_t create(pf_str parameters, void **instance, pf_error *error) {
  (void)parameters;
  (void)error;
  *instance = malloc(1);
  return PF_OK;
}

static void destroy(void *it) { free(it); }

static int32_t sizes(const void *it, pf_material_sizes *s) {
  (void)it;
  *s = (pf_material_sizes){.size = sizeof *s, .has_bending = 1, .thickness = 4e-4, .areal_mass = 0.44};
  s->membrane_history = FAULT == GAINS ? 1 : 0;
  return PF_OK;
}

static int32_t membrane(const void *it, const pf_membrane_batch *b) {
  (void)it;
  const uint32_t n = b->lanes;
  if (FAULT == SEGFAULT)
    *(volatile int *)nowhere = 1;
  for (uint32_t l = 0; l < n; l++) {
    const double e1 = 0.5 * (b->metric[l] - 1), e2 = 0.5 * (b->metric[n + l] - 1), c12 = b->metric[2 * n + l];
    b->stress[l] = K1 * e1;
    b->stress[n + l] = K2 * e2;
    b->stress[2 * n + l] = G * c12;
    b->energy[l] = 0.5 * (K1 * e1 * e1 + K2 * e2 * e2 + G * c12 * c12);
    if (b->stiffness) {
      b->stiffness[l] = FAULT == SMALL_BOUND ? K1 : K2;
      b->stiffness[n + l] = G;
    }
    if (FAULT == NOT_FINITE && e1 < 0)
      b->energy[l] = sqrt(e1);
    if (FAULT == PRESTRESS)
      b->stress[l] += 1e-3;
    if (FAULT == WRONG_SHEAR)
      b->stress[2 * n + l] *= 0.5;
    if (FAULT == NEIGHBOUR)
      b->stress[l] += 1e-9 * b->metric[(l + 1) % n];
    if (FAULT == GAINS) {
      b->history[l] += 1;
      b->stress[l] *= 1 + 1e-4 * b->history[l];
    }
  }
  if (FAULT == PAST_END)
    b->stress[3 * n] = 0;
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
        b->tangent[a * n + l] = D + (FAULT == WRONG_TANGENT ? 1 : 3) * CUBIC * k * k;
    }
    if (FAULT == WRONG_MOMENT)
      b->moment[2 * n + l] *= 2;
    if (FAULT == BENT_AT_REST)
      b->moment[l] += 1e-3;
  }
  return PF_OK;
}

static const pf_material_functions FUNCTIONS = {
    .size = sizeof FUNCTIONS,
    .create = create,
    .destroy = destroy,
    .sizes = sizes,
    .membrane = membrane,
    .bending = bending,
};

static const pf_plugin PLUGIN = {
    .magic = PF_MAGIC,
    .abi_major = PF_ABI_MAJOR,
    .abi_minor = PF_ABI_MINOR,
    .size = sizeof(pf_plugin),
    .kind = PF_KIND_MATERIAL,
    .manifest = {MANIFEST, sizeof MANIFEST - 1},
    .functions = &FUNCTIONS,
};

const pf_plugin *plyflow_plugin(void) { return &PLUGIN; }
