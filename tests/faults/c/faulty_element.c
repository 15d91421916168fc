/* The element template in C and a small patch part, with one fault planted by -DFAULT=NAME; without it, a sound element.
 */

#define plyflow_plugin sound_plugin
#include "../../../solver-plugins/door/templates/element-c/element.c"
#undef plyflow_plugin

#include <unistd.h>

enum fault {
  NONE,
  PAST_END,       /* writes one row beyond the force */
  BEFORE_START,   /* writes before the energy */
  FEW_CONSTANTS,  /* declares fewer constants than it writes */
  WRONG_STRIDE,   /* writes as if every batch had 8 lanes */
  UNWRITTEN,      /* leaves out the row of bending energy */
  WRITES_INPUT,   /* changes the positions */
  ACCUMULATES,    /* adds to the force instead of overwriting it */
  FRAME,          /* measures a strain along a fixed axis of space */
  ENERGY,         /* force is 1 % off the derivative of the energy */
  BALANCE,        /* the force of one node is lost */
  PRESTRESS,      /* pulls at rest */
  NOT_FINITE,     /* NaN in compression */
  LONG_STEP,      /* forgets the square root of two */
  LIGHT,          /* masses add up to half */
  NEIGHBOUR,      /* a lane feels the next one a little */
  MEAN,           /* energy of a lane holds the mean of the batch */
  RACE,           /* scratch memory in a global */
  STEP_RACE,      /* the same, where the critical step is wanted */
  COUNTER,        /* the force depends on how often it was asked for */
  ASKING,         /* another force when fields are wanted */
  BAD_STATUS,     /* returns 42 */
  MANY_FIELDS,    /* one field more than the manifest names */
  STEP_IN_FIELDS, /* writes the critical step only when fields are wanted too */
  PATCH_RACE,     /* scratch memory of patches in a global */
  PATCH_COUNTER,  /* the patch force depends on how often it was asked for */
  PATCH_ASKING,   /* another patch force when the stiffness is wanted */
  PATCH_IN_FIELDS, /* writes the patch stiffness only when fields are wanted too */
  SEGFAULT,
  ABORT,
  EXIT,
  HANG,
};

#ifndef FAULT
#define FAULT NONE
#endif

static volatile uintptr_t nowhere = 8;
static volatile double shared[12 * MAX_LANES];
static long calls;

/* Springs from the centre of a patch to the others: W = SPRING / 4 sum (|d|^2 - |D|^2)^2, D at rest. */
enum { SLOTS = 11 }; /* five quads around a node */
static const double SPRING = 1e8; /* N/m3 */

static int32_t faulty_sizes(const void *it, pf_element_sizes *s) {
  const int32_t code = sizes(it, s);
  if (FAULT == FEW_CONSTANTS)
    s->constants -= 1;
  if (FAULT == FRAME)
    s->constants += 1;
  if (FAULT == MANY_FIELDS)
    s->fields += 1;
  s->patch_nodes = SLOTS;
  s->patch_constants = SLOTS - 1;
  return code;
}

static int32_t faulty_initialise(const void *it, const pf_element_batch *b) {
  const int32_t code = initialise(it, b);
  for (uint32_t i = 0; FAULT == LIGHT && i < 4 * b->lanes; i++)
    b->mass[i] *= 0.5;
  for (uint32_t l = 0; FAULT == FRAME && l < b->lanes; l++)
    b->constants[CONSTANTS * b->lanes + l] = b->position[l] - b->position[6 * b->lanes + l];
  return code;
}

static int32_t faulty_forces(const void *it, const pf_element_batch *b) {
  const uint32_t n = b->lanes;
  pf_element_batch mine = *b;
  double *x = (double *)b->position;
  double force[12 * MAX_LANES], energy[3 * MAX_LANES];
  switch (FAULT) {
  case SEGFAULT:
    *(volatile int *)nowhere = 1;
    break;
  case ABORT:
    abort();
  case EXIT:
    exit(3);
  case HANG:
    for (;;)
      pause();
  case BAD_STATUS:
    return 42;
  case WRONG_STRIDE:
    mine.lanes = 8;
    break;
  case UNWRITTEN:
    mine.energy = energy;
    break;
  case ACCUMULATES:
    mine.force = force;
    break;
  case STEP_IN_FIELDS:
    if (!b->fields)
      mine.critical_step = NULL;
    break;
  default:
    break;
  }
  const int32_t code = forces(it, &mine);
  if (code != PF_OK)
    return code;
  switch (FAULT) {
  case PAST_END:
    b->force[12 * n] = 0;
    break;
  case BEFORE_START:
    b->energy[-1] = 0;
    break;
  case UNWRITTEN:
    memcpy(b->energy, energy, n * sizeof(double));
    memcpy(b->energy + 2 * n, energy + 2 * n, n * sizeof(double));
    break;
  case WRITES_INPUT:
    x[0] += 1e-12;
    break;
  case ACCUMULATES:
    for (uint32_t i = 0; i < 12 * n; i++)
      b->force[i] += force[i];
    break;
  case FRAME: /* balanced, and the derivative of its energy: only the frame is wrong */
    for (uint32_t l = 0; l < n; l++) {
      /* A spring along x over a diagonal whose length at rest it knows. */
      const double stretch = x[l] - x[6 * n + l] - b->constants[CONSTANTS * n + l];
      b->force[l] += 1e3 * stretch;
      b->force[6 * n + l] -= 1e3 * stretch;
      b->energy[l] += 0.5e3 * stretch * stretch;
    }
    break;
  case ENERGY:
    for (uint32_t i = 0; i < 12 * n; i++)
      b->force[i] *= 1.01;
    break;
  case BALANCE:
    for (uint32_t i = 0; i < 3 * n; i++)
      b->force[i] = 0;
    break;
  case PRESTRESS:
    for (uint32_t l = 0; l < n; l++) {
      b->force[l] += 1;
      b->force[6 * n + l] -= 1;
    }
    break;
  case NOT_FINITE:
    for (uint32_t l = 0; l < n; l++)
      if (b->force[l] > 0)
        b->force[l] = sqrt(-b->force[l]);
    break;
  case LONG_STEP:
    for (uint32_t l = 0; b->critical_step && l < n; l++)
      b->critical_step[l] *= 1.41421356;
    break;
  case NEIGHBOUR:
    for (uint32_t l = 0; l < n; l++)
      b->force[l] += 1e-9 * b->position[(l + 1) % n];
    break;
  case MEAN: {
    double mean = 0;
    for (uint32_t l = 0; l < n; l++)
      mean += b->energy[l] / n;
    for (uint32_t l = 0; l < n; l++)
      b->energy[l] += 1e-6 * mean;
    break;
  }
  case RACE: /* as a Fortran common block or a static work array would do */
    for (uint32_t i = 0; i < 12 * n; i++)
      shared[i] = b->force[i];
    for (uint32_t i = 0; i < 12 * n; i++)
      b->force[i] = shared[i];
    break;
  case STEP_RACE: /* what it makes of the forces for its step is 0 for whoever is alone */
    for (uint32_t i = 0; b->critical_step && i < 12 * n; i++)
      shared[i] = b->force[i];
    for (uint32_t i = 0; b->critical_step && i < 12 * n; i++)
      b->critical_step[i % n] += shared[i] - b->force[i];
    break;
  case COUNTER:
    b->force[0] += 1e-9 * (double)calls++;
    break;
  case ASKING:
    for (uint32_t l = 0; b->fields && l < n; l++)
      b->force[l] *= 1 + 1e-12;
    break;
  default:
    break;
  }
  return PF_OK;
}

/* The vector from the centre to node k of lane l, and its square. */
static double spoke(const double *x, uint32_t n, uint32_t l, int k, double d[3]) {
  for (int c = 0; c < 3; c++)
    d[c] = x[(3 * k + c) * n + l] - x[c * n + l];
  return dot(d, d);
}

static int32_t patch_initialise(const void *it, const pf_patch_batch *b) {
  (void)it;
  double d[3];
  for (uint32_t l = 0; l < b->lanes; l++)
    for (int k = 1; k < SLOTS; k++)
      b->constants[(k - 1) * b->lanes + l] = spoke(b->position, b->lanes, l, k, d);
  return PF_OK;
}

static int32_t patch_forces(const void *it, const pf_patch_batch *b) {
  (void)it;
  static volatile double common[3 * SLOTS * MAX_LANES];
  const uint32_t n = b->lanes;
  const int bounds = b->stiffness && !(FAULT == PATCH_IN_FIELDS && !b->fields);
  memset(b->force, 0, 3 * SLOTS * n * sizeof(double));
  for (uint32_t l = 0; l < n; l++) {
    double energy = 0, centre = 0, d[3];
    for (int k = 1; k < SLOTS; k++) { /* unused slots lie on the centre: d = D = 0 */
      const double square = spoke(b->position, n, l, k, d), longer = square - b->constants[(k - 1) * n + l];
      for (int c = 0; c < 3; c++) {
        b->force[(3 * k + c) * n + l] += SPRING * longer * d[c];
        b->force[c * n + l] -= SPRING * longer * d[c];
      }
      energy += 0.25 * SPRING * longer * longer;
      const double row = 2 * SPRING * (fabs(longer) + 2 * square);
      centre += row;
      if (bounds)
        b->stiffness[k * n + l] = row;
    }
    b->energy[l] = energy;
    if (bounds)
      b->stiffness[l] = centre;
    if (FAULT == PATCH_ASKING && b->stiffness)
      b->force[l] *= 1 + 1e-12;
  }
  if (FAULT == PATCH_COUNTER)
    b->force[0] += 1e-9 * (double)calls++;
  if (FAULT == PATCH_RACE) {
    for (uint32_t i = 0; i < 3 * SLOTS * n; i++)
      common[i] = b->force[i];
    for (uint32_t i = 0; i < 3 * SLOTS * n; i++)
      b->force[i] = common[i];
  }
  return PF_OK;
}

static const pf_element_functions FAULTY = {
    .size = sizeof FAULTY,
    .create = create,
    .destroy = destroy,
    .sizes = faulty_sizes,
    .initialise = faulty_initialise,
    .forces = faulty_forces,
    .patch_initialise = patch_initialise,
    .patch_forces = patch_forces,
};

const pf_plugin *plyflow_plugin(void) {
  static pf_plugin plugin;
  plugin = PLUGIN;
  plugin.functions = &FAULTY;
  return &plugin;
}
