/* The element template in C with one fault planted by -DFAULT=NAME; without it, the sound element. */

#define plyflow_plugin sound_plugin
#include "../../../solver-plugins/template-element-c/element.c"
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
  COUNTER,        /* the force depends on how often it was asked for */
  ASKING,         /* another force when fields are wanted */
  BAD_STATUS,     /* returns 42 */
  MANY_FIELDS,    /* one field more than the manifest names */
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

static int32_t faulty_sizes(const void *it, pf_element_sizes *s) {
  const int32_t code = sizes(it, s);
  if (FAULT == FEW_CONSTANTS)
    s->constants -= 1;
  if (FAULT == FRAME)
    s->constants += 1;
  if (FAULT == MANY_FIELDS)
    s->fields += 1;
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

static const pf_element_functions FAULTY = {
    .size = sizeof FAULTY,
    .create = create,
    .destroy = destroy,
    .sizes = faulty_sizes,
    .initialise = faulty_initialise,
    .forces = faulty_forces,
};

const pf_plugin *plyflow_plugin(void) {
  static pf_plugin plugin;
  plugin = PLUGIN;
  plugin.functions = &FAULTY;
  return &plugin;
}
