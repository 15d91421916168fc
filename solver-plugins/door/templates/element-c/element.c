/* An element formulation in C: only plyflow.h is needed.
 *
 * A four-node membrane in space with one integration point and hourglass control. Take it as a start: change the
 * manifest, then `initialise` and `forces`. The whole contract stands in plyflow.h; what matters most:
 *
 * - Arrays are [row][lane]: element l of the batch has its value of row r at [r * lanes + l].
 * - Write every output for every lane, read and write nothing else, allocate nothing.
 * - Several threads call one instance at once: no globals, scratch memory on the stack.
 * - force = dW/dx. The structure is pulled by minus this.
 */

#include "plyflow.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_LANES 64 /* the most that a batch has */

/* Documented in schemas/manifest.md. */
static const char MANIFEST[] =
    "{"
    "\"name\": \"my-membrane\", \"version\": \"0.1.0\", \"vendor\": \"You\","
    "\"kind\": \"element\", \"role\": \"element\","
    "\"summary\": \"Four-node membrane with one point and hourglass control, in C.\","
    "\"parameters\": {"
    "  \"hourglass\": {\"type\": \"quantity\", \"dimension\": \"force_per_length\", \"default\": \"300 N/m\","
    "                  \"minimum\": \"0 N/m\", \"doc\": \"Stiffness of the hourglass mode.\"}},"
    "\"inputs\": {}, \"results\": {},"
    "\"fields\": ["
    "  {\"name\": \"shear_angle\", \"unit\": \"rad\", \"doc\": \"Change of the right angle between e1 and e2.\"},"
    "  {\"name\": \"fibre_strain_1\", \"unit\": \"1\", \"doc\": \"Nominal strain along e1.\"},"
    "  {\"name\": \"fibre_strain_2\", \"unit\": \"1\", \"doc\": \"Nominal strain along e2.\"}]"
    "}";

typedef struct instance {
  double hourglass; /* N/m */
} instance;

/* Rows of constants. g_a = B[0][a] (x1 - x3) + B[1][a] (x2 - x4) are the deformed material axes. */
enum { B11, B21, B12, B22, H1, H2, AREA, CONSTANTS };
enum { SHEAR_ANGLE, STRAIN_1, STRAIN_2, FIELDS };

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double a[3], const double b[3], double c[3]) {
  for (int i = 0; i < 3; i++)
    c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static void scale_to_unit(double a[3]) {
  const double length = sqrt(dot(a, a));
  for (int i = 0; i < 3; i++)
    a[i] /= length;
}

/* Largest eigenvalue of [[a, c], [c, b]]. */
static double largest(double a, double b, double c) { return 0.5 * (a + b) + sqrt(0.25 * (a - b) * (a - b) + c * c); }

/* The diagonals and the hourglass pattern of lane l: x1 - x3, x2 - x4, x1 - x2 + x3 - x4. */
static void differences(const double *x, uint32_t lanes, uint32_t l, double d13[3], double d24[3], double h[3]) {
  for (int k = 0; k < 3; k++) {
    const double x1 = x[(0 + k) * lanes + l], x2 = x[(3 + k) * lanes + l];
    const double x3 = x[(6 + k) * lanes + l], x4 = x[(9 + k) * lanes + l];
    d13[k] = x1 - x3;
    d24[k] = x2 - x4;
    h[k] = x1 - x2 + x3 - x4;
  }
}

static int32_t create(pf_str parameters, const pf_material *material, void **out, pf_error *error) {
  (void)material; /* also given in every batch */
  /* JSON as the manifest declares it, defaults filled in, SI numbers: {"hourglass": 300.0}. pf_str has no NUL at its
   * end, so copy before searching. A plugin with more than a number or two wants a JSON library here. */
  char text[256] = "";
  if (parameters.len < sizeof text) memcpy(text, parameters.data, parameters.len);
  const char *key = strstr(text, "\"hourglass\"");
  const char *colon = key ? strchr(key, ':') : NULL;
  instance *i = malloc(sizeof *i);
  if (!i || !colon) { /* never go on with a number that the user did not give */
    snprintf(error->text, sizeof error->text, "hourglass: given %s, expected a number in N/m within %zu bytes of parameters",
             text, sizeof text - 1);
    free(i);
    return PF_ERROR;
  }
  i->hourglass = strtod(colon + 1, NULL);
  *out = i;
  return PF_OK;
}

static void destroy(void *it) { free(it); }

static int32_t sizes(const void *it, pf_element_sizes *s) {
  (void)it;
  /* Field by field: the caller's struct may be shorter than this header's, and what is not assigned is 0 already. */
  s->nodes = 4;
  s->dofs_per_node = 3;
  s->constants = CONSTANTS;
  s->material_points = 1;
  s->fields = FIELDS;
  return PF_OK;
}

/* From the undeformed element: axes, derivatives of the shape functions, area, masses. */
static int32_t initialise(const void *it, const pf_element_batch *b) {
  (void)it;
  const uint32_t lanes = b->lanes;
  pf_material_sizes of_material = {.size = sizeof of_material};
  const int32_t code = b->material->functions->sizes(b->material->instance, &of_material);
  if (code != PF_OK)
    return code;
  for (uint32_t l = 0; l < lanes; l++) {
    double d13[3], d24[3], h[3], n[3], e1[3], e2[3];
    differences(b->position, lanes, l, d13, d24, h);
    cross(d13, d24, n);
    scale_to_unit(n);
    for (int k = 0; k < 3; k++)
      e1[k] = b->axis[k * lanes + l];
    const double off = dot(e1, n); /* the axis lies in the plane up to rounding */
    for (int k = 0; k < 3; k++)
      e1[k] -= off * n[k];
    scale_to_unit(e1);
    cross(n, e1, e2);
    const double u13 = dot(d13, e1), v13 = dot(d13, e2), u24 = dot(d24, e1), v24 = dot(d24, e2);
    const double twice_area = u13 * v24 - u24 * v13;
    const double row[CONSTANTS] = {
        [B11] = v24 / twice_area,  [B21] = -v13 / twice_area, /* d/de1 */
        [B12] = -u24 / twice_area, [B22] = u13 / twice_area,  /* d/de2 */
        [H1] = dot(h, e1),         [H2] = dot(h, e2),         /* the undeformed shape's own pattern */
        [AREA] = 0.5 * twice_area,
    };
    for (int r = 0; r < CONSTANTS; r++)
      b->constants[r * lanes + l] = row[r];
    for (int k = 0; k < 4; k++)
      b->mass[k * lanes + l] = 0.25 * of_material.areal_mass * row[AREA];
  }
  return PF_OK;
}

/* W = area * W_material(C) + hourglass / 2 |q|^2 and its exact derivative. */
static int32_t forces(const void *it, const pf_element_batch *b) {
  const double k = ((const instance *)it)->hourglass;
  const uint32_t lanes = b->lanes;
  const double *c = b->constants;
  /* What the material reads and writes: aligned like all batches, 64 lanes at most. */
  _Alignas(64) double metric[3 * MAX_LANES], stress[3 * MAX_LANES], energy[MAX_LANES], tangent[2 * MAX_LANES];
  for (uint32_t l = 0; l < lanes; l++) {
    double d13[3], d24[3], h[3], g1[3], g2[3];
    differences(b->position, lanes, l, d13, d24, h);
    for (int i = 0; i < 3; i++) {
      g1[i] = c[B11 * lanes + l] * d13[i] + c[B21 * lanes + l] * d24[i];
      g2[i] = c[B12 * lanes + l] * d13[i] + c[B22 * lanes + l] * d24[i];
    }
    metric[l] = dot(g1, g1);
    metric[lanes + l] = dot(g2, g2);
    metric[2 * lanes + l] = dot(g1, g2);
  }

  const pf_membrane_batch sheet = {
      .size = sizeof sheet,
      .lanes = lanes,
      .dt = b->dt,
      .metric = metric,
      .history = b->material_history,
      .stress = stress,
      .energy = energy,
      .stiffness = b->critical_step ? tangent : NULL,
  };
  const int32_t code = b->material->functions->membrane(b->material->instance, &sheet);
  if (code != PF_OK)
    return code;

  pf_material_sizes of_material = {.size = sizeof of_material};
  b->material->functions->sizes(b->material->instance, &of_material);
  for (uint32_t l = 0; l < lanes; l++) {
    const double b11 = c[B11 * lanes + l], b21 = c[B21 * lanes + l], b12 = c[B12 * lanes + l], b22 = c[B22 * lanes + l];
    const double h1 = c[H1 * lanes + l], h2 = c[H2 * lanes + l], area = c[AREA * lanes + l];
    const double s11 = stress[l], s22 = stress[lanes + l], s12 = stress[2 * lanes + l];
    double d13[3], d24[3], h[3], mode = 0;
    differences(b->position, lanes, l, d13, d24, h);
    for (int i = 0; i < 3; i++) {
      const double g1 = b11 * d13[i] + b21 * d24[i], g2 = b12 * d13[i] + b22 * d24[i];
      /* q vanishes for every homogeneous deformation. */
      const double q = h[i] - h1 * g1 - h2 * g2;
      mode += q * q;
      /* dW/dg_a, then dW/d(x1 - x3) and dW/d(x2 - x4). */
      const double p1 = area * (s11 * g1 + s12 * g2) - k * h1 * q;
      const double p2 = area * (s12 * g1 + s22 * g2) - k * h2 * q;
      const double f13 = b11 * p1 + b12 * p2, f24 = b21 * p1 + b22 * p2;
      b->force[(0 + i) * lanes + l] = f13 + k * q;
      b->force[(3 + i) * lanes + l] = f24 - k * q;
      b->force[(6 + i) * lanes + l] = -f13 + k * q;
      b->force[(9 + i) * lanes + l] = -f24 - k * q;
    }
    b->energy[PF_ENERGY_MEMBRANE * lanes + l] = area * energy[l];
    b->energy[PF_ENERGY_BENDING * lanes + l] = 0;
    b->energy[PF_ENERGY_HOURGLASS * lanes + l] = 0.5 * k * mode;

    const double c11 = metric[l], c22 = metric[lanes + l], c12 = metric[2 * lanes + l];
    if (b->fields) {
      b->fields[SHEAR_ANGLE * lanes + l] = asin(fmax(-1, fmin(1, c12 / sqrt(c11 * c22))));
      b->fields[STRAIN_1 * lanes + l] = sqrt(c11) - 1;
      b->fields[STRAIN_2 * lanes + l] = sqrt(c22) - 1;
    }
    if (b->critical_step) {
      /* omega^2 <= (largest stiffness) / (nodal mass), by norms: |dg|^2 <= 2 |B|^2 |du|^2, and the second derivative
       * of W by g is at most (tangent * stretch^2 + tension). */
      const double gradient = largest(b11 * b11 + b12 * b12, b21 * b21 + b22 * b22, b11 * b21 + b12 * b22);
      const double sheet_part = tangent[l] * largest(c11, c22, c12) + fmax(0, largest(s11, s22, s12));
      const double m13 = h1 * b11 + h2 * b12, m24 = h1 * b21 + h2 * b22;
      const double pattern = 4 + 2 * (m13 * m13 + m24 * m24);
      const double stiffness = 2 * area * gradient * sheet_part + k * pattern;
      b->critical_step[l] = 2 * sqrt(0.25 * of_material.areal_mass * area / stiffness);
    }
  }
  return PF_OK;
}

static const pf_element_functions FUNCTIONS = {
    .size = sizeof FUNCTIONS,
    .create = create,
    .destroy = destroy,
    .sizes = sizes,
    .initialise = initialise,
    .forces = forces,
    /* patch_initialise and patch_forces stay NULL: no patch part */
};

static const pf_plugin PLUGIN = {
    .magic = PF_MAGIC,
    .abi_major = PF_ABI_MAJOR,
    .abi_minor = PF_ABI_MINOR,
    .size = sizeof(pf_plugin),
    .kind = PF_KIND_ELEMENT,
    .manifest = {MANIFEST, sizeof MANIFEST - 1},
    .functions = &FUNCTIONS,
};

const pf_plugin *plyflow_plugin(void) { return &PLUGIN; }
