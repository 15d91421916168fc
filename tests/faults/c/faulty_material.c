/* A small linear sheet with bending, with one fault planted by -DFAULT=NAME. */

#include "plyflow.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
  FIXED_SIZES,     /* thickness and areal mass of the one sheet that its author had */
  RACE,            /* scratch memory in a global */
  STIFFNESS_RACE,  /* the same, where the stiffness is wanted */
  DIVIDES_BY_DT,   /* as a law in rates does */
  SKIPS_ZERO_DT,   /* no stress when no time has passed */
  SHEARED_STRESS,  /* a wrong stress from 20 degrees of shear on */
  SHEARED_BOUND,   /* a bound of the tangent that is too low there */
  SHEARED_GAINS,   /* gives back more than it took, from there on */
  SLACK,           /* sound: no stiffness in shear, and a bound of 0 */
  NEGATIVE_BOUND,  /* the same with a bound below 0 */
  BENDING_RACE,    /* scratch memory of bending in a global */
  BENDING_COUNTER, /* the moment depends on how often it was asked for */
  BENDING_ASKING,  /* another moment when the tangent is wanted */
  BENDING_DT,      /* no moment when no time has passed */
  BENDING_GAINS,   /* moments grow with the number of calls */
  SHARP_MOMENT,    /* a wrong moment in sharp folds */
  SEGFAULT,
};

#ifndef FAULT
#define FAULT NONE
#endif

static const char MANIFEST[] = "{\"name\": \"sheet-c\", \"version\": \"0.1.0\", \"vendor\": \"Plyflow tests\","
                               "\"kind\": \"material\", \"role\": \"material\", \"summary\": \"A linear sheet.\","
                               "\"parameters\": {}, \"inputs\": {}, \"results\": {}, \"fields\": []}";

static volatile uintptr_t nowhere = 8;
enum { MAX_LANES = 64 };
static const double K1 = 1e5, K2 = 2e5, G = 1e3, D = 1e-3, CUBIC = 1e-7;

typedef struct sheet {
  double thickness, areal_mass;
} sheet;

static double number(pf_str json, const char *key) {
  char text[512];
  const size_t n = json.len < sizeof text - 1 ? json.len : sizeof text - 1;
  memcpy(text, json.data, n);
  text[n] = 0;
  const char *at = strstr(text, key);
  at = at ? strchr(at, ':') : NULL;
  return at ? strtod(at + 1, NULL) : 0;
}

static int32_t create(pf_str parameters, void **instance, pf_error *error) {
  sheet *made = malloc(sizeof *made);
  if (!made)
    return PF_ERROR;
  made->thickness = number(parameters, "\"thickness\"");
  made->areal_mass = number(parameters, "\"areal_mass\"");
  if (!(made->thickness > 0 && made->areal_mass > 0)) {
    snprintf(error->text, sizeof error->text, "thickness and areal_mass: expected numbers above 0");
    free(made);
    return PF_ERROR;
  }
  *instance = made;
  return PF_OK;
}

static void destroy(void *it) { free(it); }

static int32_t sizes(const void *it, pf_material_sizes *s) {
  const sheet *of = it;
  s->has_bending = 1;
  s->thickness = FAULT == FIXED_SIZES ? 4e-4 : of->thickness;
  s->areal_mass = FAULT == FIXED_SIZES ? 0.44 : of->areal_mass;
  s->membrane_history = FAULT == GAINS || FAULT == SHEARED_GAINS ? 1 : 0;
  s->bending_history = FAULT == BENDING_GAINS ? 1 : 0;
  return PF_OK;
}

static int32_t membrane(const void *it, const pf_membrane_batch *b) {
  (void)it;
  static volatile double shared[3 * MAX_LANES];
  const uint32_t n = b->lanes;
  const double shear = FAULT == SLACK || FAULT == NEGATIVE_BOUND ? 0 : G;
  if (FAULT == SEGFAULT)
    *(volatile int *)nowhere = 1;
  for (uint32_t l = 0; l < n; l++) {
    const double e1 = 0.5 * (b->metric[l] - 1), e2 = 0.5 * (b->metric[n + l] - 1), c12 = b->metric[2 * n + l];
    b->stress[l] = K1 * e1;
    b->stress[n + l] = K2 * e2;
    const int sheared = fabs(c12) > 0.34;
    b->stress[2 * n + l] = shear * c12;
    b->energy[l] = 0.5 * (K1 * e1 * e1 + K2 * e2 * e2 + shear * c12 * c12);
    if (b->stiffness) {
      b->stiffness[l] = FAULT == SMALL_BOUND || (FAULT == SHEARED_BOUND && sheared) ? K1 : K2;
      b->stiffness[n + l] = FAULT == NEGATIVE_BOUND ? -1 : shear;
    }
    if (FAULT == DIVIDES_BY_DT)
      b->stress[l] += 1e-30 / b->dt;
    if (FAULT == SKIPS_ZERO_DT && b->dt == 0)
      b->stress[l] = 0;
    if (FAULT == SHEARED_STRESS && sheared)
      b->stress[2 * n + l] *= 1.001;
    if (FAULT == SHEARED_GAINS) { /* on the way back it is stiffer by a tenth, and its energy says so */
      const int back = fabs(c12) < fabs(b->history[l]);
      b->history[l] = c12;
      if (sheared && back) {
        b->stress[2 * n + l] *= 1.1;
        b->energy[l] += 0.05 * shear * c12 * c12;
      }
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
  if (FAULT == STIFFNESS_RACE && b->stiffness) {
    for (uint32_t l = 0; l < n; l++)
      shared[l] = b->stiffness[l] * (1 + fabs(b->metric[l] - 1));
    for (uint32_t l = 0; l < n; l++)
      b->stiffness[l] = shared[l];
  }
  if (FAULT == RACE) { /* as a Fortran common block or a static work array would do */
    for (uint32_t i = 0; i < 3 * n; i++)
      shared[i] = b->stress[i];
    for (uint32_t i = 0; i < 3 * n; i++)
      b->stress[i] = shared[i];
  }
  return PF_OK;
}

static int32_t bending(const void *it, const pf_bending_batch *b) {
  (void)it;
  static volatile double shared[3 * MAX_LANES];
  static long calls;
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
    if (FAULT == BENDING_ASKING && b->tangent)
      b->moment[l] *= 1 + 1e-12;
    if (FAULT == BENDING_DT && b->dt == 0)
      b->moment[l] = 0;
    if (FAULT == BENDING_GAINS) {
      b->history[l] += 1;
      b->moment[l] *= 1 + 1e-4 * b->history[l];
    }
    if (FAULT == SHARP_MOMENT && fabs(b->curvature[l]) > 100)
      b->moment[l] *= 1.001;
  }
  if (FAULT == BENDING_COUNTER)
    b->moment[0] += 1e-12 * (double)calls++;
  if (FAULT == BENDING_RACE) {
    for (uint32_t i = 0; i < 3 * n; i++)
      shared[i] = b->moment[i];
    for (uint32_t i = 0; i < 3 * n; i++)
      b->moment[i] = shared[i];
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
