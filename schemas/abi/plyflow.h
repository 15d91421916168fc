/* plyflow.h: the contract between the Plyflow host and a plugin. ABI 1.2.
 *
 * A plugin is a shared library that exports one symbol:
 *
 *     const pf_plugin *plyflow_plugin(void);
 *
 * It returns a static descriptor. Only C types cross. All quantities are SI (m, kg, s, N, Pa, J,
 * rad). Strings are UTF-8, given by pointer and length, not NUL-terminated, and belong to whoever
 * handed them over; the receiver copies what it keeps. No exception, panic or longjmp may cross.
 *
 * Versioning: a host accepts a plugin whose abi_major equals its own and whose abi_minor is not
 * greater. Structs that have a `size` only grow at their end, the others never; `size` is the size that whoever made the
 * struct was compiled with. In a
 * struct that the other side fills (pf_material_sizes, pf_element_sizes) the caller sets `size` and zeros the rest; the
 * other side writes no more than that many bytes, and leaves `size` as it is: assign fields, never the whole struct, and a
 * field that says "since" a version only where `size` reaches its end.
 */
#ifndef PLYFLOW_H
#define PLYFLOW_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PF_ABI_MAJOR 1u
/* 2: tapes.
 * 1: checkpoints, ignores_velocity. Made more exact before its release: units of what a step writes, `measured`, `size`
 * of the structs of sizes, dt = 0, bounds of 0 in shear, no NULL instances. */
#define PF_ABI_MINOR 2u
#define PF_MAGIC 0x31574F4C46594C50ull /* the bytes "PLYFLOW1" in memory on a little-endian machine */
#define PF_SYMBOL "plyflow_plugin"

typedef struct pf_str {
  const char *data;
  uint64_t len;
} pf_str;

/* Kinds of plugin: what pf_plugin.functions points to. */
#define PF_KIND_STEP 1u     /* pf_step_functions */
#define PF_KIND_ELEMENT 2u  /* pf_element_functions */
#define PF_KIND_MATERIAL 3u /* pf_material_functions */

/* Status codes returned by every function that can fail. */
#define PF_OK 0
#define PF_ERROR 1     /* failed. A step gives the text to pf_services.fail, `create` writes it into its pf_error; other functions of
                          components have the status alone. From a service: called in the wrong order, or the disk failed */
#define PF_CANCELLED 2 /* stopped because pf_services.cancelled said so */
#define PF_PANIC 3     /* the plugin's own net caught a panic; text given to fail */
#define PF_NOT_FOUND 4 /* no such input, array, body, field or component */
#define PF_BAD_SHAPE 5 /* sizes of a buffer and of the data differ */
#define PF_BAD_VALUE 6 /* NaN, infinite or out of the documented range; a name, unit or time that is refused */

typedef struct pf_plugin {
  uint64_t magic;     /* PF_MAGIC */
  uint32_t abi_major; /* PF_ABI_MAJOR */
  uint32_t abi_minor; /* PF_ABI_MINOR */
  uint64_t size;      /* sizeof(pf_plugin) */
  uint32_t kind;      /* PF_KIND_* */
  uint32_t reserved;
  pf_str manifest;       /* JSON; see schemas/manifest.md */
  const void *functions; /* table of the kind */
} pf_plugin;

/* What a plugin exports. A host that includes this header finds it by name and does not call it. */
#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
const pf_plugin *plyflow_plugin(void);

/* ---- arrays ------------------------------------------------------------------------------- */

#define PF_F64 1u
#define PF_F32 2u
#define PF_I64 3u
#define PF_U32 4u
#define PF_U8 5u
#define PF_MAX_RANK 4u

typedef struct pf_array_info {
  uint32_t dtype; /* PF_F64 .. PF_U8 */
  uint32_t rank;  /* 0 (one value) to PF_MAX_RANK */
  uint64_t shape[PF_MAX_RANK]; /* row-major: the last index runs fastest */
} pf_array_info;

#define PF_ON_POINTS 0u
#define PF_ON_CELLS 1u

typedef struct pf_progress {
  uint64_t size;
  double fraction;       /* 0..1 of the step's work */
  double simulated_time; /* s; negative: this step has none */
  double rate;           /* cycles per second; negative: none */
  double energy_ratio;   /* kinetic / internal; negative: none */
  pf_str phase;          /* what is being done now, in a few words */
} pf_progress;

typedef struct pf_component {
  uint32_t kind; /* PF_KIND_ELEMENT or PF_KIND_MATERIAL */
  uint32_t reserved;
  const void *functions; /* stays valid until the process ends */
  pf_str manifest;
} pf_component;

/* log levels */
#define PF_LOG_ERROR 1u
#define PF_LOG_WARN 2u
#define PF_LOG_INFO 3u
#define PF_LOG_DEBUG 4u

/* flags of a result */
#define PF_RESULT_MEASURED 1u /* depends on the machine (seconds, bytes): kept beside the artifact, not in it */

/* ---- services: what the host does for a running step -------------------------------------- *
 * Every call takes `host` (pf_services.host) first. Any thread of the plugin may call, until `run` returns and no later; the
 * host does one call at a time. Strings returned by the host stay valid until `run` returns.
 *
 * A service that answers a status returns PF_OK or what was wrong. To ask for what may not be there (array_info, a field that is
 * optional) and to get PF_NOT_FOUND is no failure. A write that is refused is: the step fails, whatever it does afterwards, because
 * readers could not trust the artifact.
 */
typedef struct pf_services {
  uint64_t size;
  void *host;

  void (*log)(void *host, uint32_t level, pf_str text);
  void (*progress)(void *host, const pf_progress *progress);
  int32_t (*cancelled)(void *host); /* 1: the run is being stopped; return PF_CANCELLED soon */

  void (*fail)(void *host, pf_str text); /* the text of the error that is about to be returned */
  uint32_t (*threads)(void *host);       /* how many threads this step may use now: at first, and never fewer; more while the run has cores that
                                            nothing else can use, so that a long step asks again now and then. What it writes does not depend on it */
  pf_str (*parameters)(void *host);      /* JSON object: the resolved `with` block, SI numbers (in scenes and materials quantities are texts in SI
                                            units, "0.005 m": schemas/manifest.md) */
  pf_str (*scratch)(void *host);         /* a private folder, removed after the step */

  /* Inputs. JSON array, in the order of the workflow:
   * [{"handle":0,"port":"formed","step":"coarse","kind":"forming","item":[0],
   *   "cost":{"wall_seconds":..,"cpu_seconds":..,"peak_memory":..,"threads":..}}]
   * `item` is the input's own fan-out index path ([] when its step is not fanned out). */
  pf_str (*inputs)(void *host);
  pf_str (*item)(void *host); /* JSON: this step's own fan-out index path, e.g. [2]; [] if none */

  /* Reading an input artifact. `handle` as listed by inputs. */
  pf_str (*attributes)(void *host, uint32_t handle); /* JSON object as its plugin wrote it; empty: no such input, or it cannot be read */
  int32_t (*array_info)(void *host, uint32_t handle, pf_str path, pf_array_info *info);
  /* What is stored as another dtype is converted. */
  int32_t (*array_read)(void *host, uint32_t handle, pf_str path, uint32_t dtype, void *buffer, uint64_t bytes);
  /* JSON: {"times":[..],"bodies":[{"name":..,"points":n,"cells":m,"nodes_per_cell":k,"attributes":{..},
   *        "fields":[{"name":..,"on":"points"|"cells","components":c,"unit":".."}]}]}; empty as of attributes */
  pf_str (*meshes)(void *host, uint32_t handle);
  int32_t (*mesh_read)(void *host, uint32_t handle, pf_str body, double *points /* [n][3] */, uint32_t *cells /* [m][k] */);
  int32_t (*frame_points_read)(void *host, uint32_t handle, pf_str body, uint64_t frame, double *points /* [n][3] */);
  int32_t (*frame_field_read)(void *host, uint32_t handle, pf_str body, uint64_t frame, uint32_t on, pf_str name,
                              double *values /* [n or m][components] */, uint64_t count /* of doubles */);

  /* Writing the output artifact. NaN and infinities are refused with PF_BAD_VALUE, and so is what a field, which is kept in single
   * precision, cannot hold (beyond 3e38), and a unit that is not a plain
   * one of SI ("m", "N/m", "1"; not "mm", "deg" or "%"): readers take the numbers as they are. */
  int32_t (*attributes_write)(void *host, pf_str json); /* once; a JSON object */
  int32_t (*array_write)(void *host, pf_str path, const pf_array_info *info, pf_str unit, const void *data);
  /* A body: points [n][3] at its reference position, cells [m][k], k = 3 or 4; same cells in all frames. */
  int32_t (*mesh_define)(void *host, pf_str body, uint64_t n, const double *points, uint64_t m, uint32_t k,
                         const uint32_t *cells, pf_str attributes_json);
  /* Frames: all bodies are defined before the first; each frame gives points of every body whose points
   * move (others keep the reference) and the same set of fields in every frame. */
  int32_t (*frame_begin)(void *host, double time);
  int32_t (*frame_points)(void *host, pf_str body, const double *points, uint64_t n);
  int32_t (*frame_field)(void *host, pf_str body, uint32_t on, pf_str name, uint32_t components, pf_str unit,
                         const double *values, uint64_t count);
  int32_t (*frame_end)(void *host);
  /* A named number for `plyflow results`, in the unit that the manifest declares for it, else PF_BAD_VALUE. What the
   * manifest declares as `measured` is, with and without the flag. */
  int32_t (*result)(void *host, pf_str name, double value, pf_str unit, uint32_t flags);
  /* The output is a collection of n items that later steps may fan out over; `names_json`: array of n labels. */
  int32_t (*collection)(void *host, uint64_t n, pf_str names_json);

  /* A component by name (search path) or path, as given in a parameter of type "element" or "material". */
  int32_t (*find_component)(void *host, uint32_t kind, pf_str name, pf_component *component);

  /* Checkpoints, since ABI 1.1: so that long work that is killed goes on where it was.
   * `checkpoint`: a folder that is kept until the step has succeeded. What lies in it was written by an earlier attempt
   * with the same plugin, components, parameters and inputs; a file may be torn or damaged, and none is required to be
   * there: seal each (a hash of its bytes, its name, and the name of the folder, which is the step's key).
   * The host keeps a small file of its own there, plyflow-cost.json. Empty text: this host keeps nothing.
   * `checkpoint_due`: 1 when enough time has passed since the last one.
   * `checkpoint_saved`: everything is on disk; the cost of the step so far is noted, so that a later attempt adds to it.
   * The artifact must not depend on whether and when a checkpoint was made. */
  pf_str (*checkpoint)(void *host);
  int32_t (*checkpoint_due)(void *host);
  void (*checkpoint_saved)(void *host);
} pf_services;

typedef struct pf_step_functions {
  uint64_t size;
  int32_t (*run)(const pf_services *services);
} pf_step_functions;

/* ---- components ---------------------------------------------------------------------------- *
 * Batched, structure of arrays: an array documented as [a][b][lanes] is contiguous with the lane
 * (element index inside the batch) running fastest. `lanes` is a multiple of 8 from 8 to 64; the
 * tail of a body's last batch repeats its last element. The caller owns all buffers, 64-byte
 * aligned, never overlapping. No allocation inside. An instance does not change after create:
 * several threads call it at once, on different batches. The value in a lane must depend on that
 * lane alone, so that results do not depend on how a body is cut into batches. An output that may be
 * NULL is wanted or not by itself, whatever the others are. A `create` that returns PF_OK and leaves
 * *instance NULL is refused. No function pointer is NULL but where it says so.
 */

#define PF_ERROR_TEXT 512
typedef struct pf_error {
  char text[PF_ERROR_TEXT]; /* NUL-terminated UTF-8 */
} pf_error;

/* -- tapes (since ABI 1.2): what a component does to one lane, for devices that cannot call it --
 *
 * A tape is a text: the operations of one function, one a line, as docs/plugins/tape.md has them. A host may compile it for a device, where it takes the
 * place of the function and must give the same bits; check-plugin holds both against each other. Buffers have the names of the fields of the batch
 * (metric, history, dt, stress, ..); of a patch, as `count` nodes of it are in use, there is one tape for each count. An element asks its
 * material by `call .. membrane` and `call .. bending`. Optional outputs: `stiffness` and `tangent` are wanted, `fields` and `critical_step` not.
 *
 * The text is written in pieces, in order. PF_OK: it is whole. PF_NOT_FOUND: the component has none for this function, and runs where it can be called.
 * Anything else is a fault, with a text in `error`. */
typedef struct pf_writer {
  void *host;
  void (*write)(void *host, pf_str piece);
} pf_writer;

#define PF_TAPE_MEMBRANE 1u
#define PF_TAPE_BENDING 2u
#define PF_TAPE_FORCES 3u
#define PF_TAPE_PATCH_FORCES 4u

/* -- material: the law of a sheet, in resultants (per undeformed area) --
 * Axes: e1, e2 are the orthonormal reference material axes in the undeformed plane; for a biaxial fabric
 * they are its two fibre directions, ordered so that positive shear stretches the stitch. */

typedef struct pf_material_sizes {
  uint64_t size; /* set by the caller: write no more than that */
  uint32_t membrane_history; /* doubles per point */
  uint32_t bending_history;
  uint32_t has_bending; /* 0 or 1 */
  uint32_t reserved;
  double thickness;  /* m; this and the next are those of the parameters */
  double areal_mass; /* kg/m2 */
} pf_material_sizes;

typedef struct pf_membrane_batch {
  uint64_t size;
  uint32_t lanes;
  uint32_t reserved;
  double dt;            /* s, since the previous call; 0 in the first one, and wherever only a state is asked for: finite
                           answers, those of the metric. A law that does not depend on rates gives the same for any dt */
  const double *metric; /* [3][lanes] C11, C22, C12 of C = F^T F in e1, e2 */
  double *history;      /* [membrane_history][lanes]; zeros at the start */
  double *stress;       /* [3][lanes] S11, S22, S12 (N/m), second Piola-Kirchhoff resultants:
                           dW = S11 dE11 + S22 dE22 + 2 S12 dE12, E = (C - 1)/2 */
  double *energy;       /* [lanes] W (J/m2): stored, or the work done when there is no potential */
  double *stiffness;    /* NULL or [2][lanes] (N/m): bounds of the largest tangent dS/dE, above 0, and of the shear tangent
                           dS12/d(2 E12), 0 only for a sheet that has none */
} pf_membrane_batch;

typedef struct pf_bending_batch {
  uint64_t size;
  uint32_t lanes;
  uint32_t reserved;
  double dt;               /* as above */
  const double *metric;    /* [3][lanes] as above */
  const double *curvature; /* [3][lanes] k11, k22, k12 (1/m): n . d2x/dX_a dX_b, n = x,1 x x,2 / |x,1 x x,2| */
  double *history;         /* [bending_history][lanes] */
  double *moment;          /* [3][lanes] M11, M22, M12 (N): dW = M11 dk11 + M22 dk22 + 2 M12 dk12 */
  double *energy;          /* [lanes] (J/m2) */
  double *tangent;         /* NULL or [3][lanes] (N m) dM11/dk11, dM22/dk22, dM12/dk12 */
} pf_bending_batch;

typedef struct pf_material_functions {
  uint64_t size;
  /* parameters: the JSON of the material file's `with` block, SI numbers, plus "thickness", "areal_mass" */
  int32_t (*create)(pf_str parameters_json, void **instance, pf_error *error);
  void (*destroy)(void *instance);
  int32_t (*sizes)(const void *instance, pf_material_sizes *sizes);
  int32_t (*membrane)(const void *instance, const pf_membrane_batch *batch);
  int32_t (*bending)(const void *instance, const pf_bending_batch *batch); /* may be NULL when has_bending is 0 */
  /* Since ABI 1.2; may be NULL. what: PF_TAPE_MEMBRANE or PF_TAPE_BENDING */
  int32_t (*tape)(const void *instance, uint32_t what, const pf_writer *to, pf_error *error);
} pf_material_functions;

typedef struct pf_material {
  const pf_material_functions *functions;
  const void *instance;
} pf_material;

/* -- element --
 * An element formulation has an element part (its own nodes) and may have a patch part: one patch per
 * node that is surrounded by elements, made of that node and of the other nodes of those elements. A
 * rotation-free shell takes its curvature there. Plyflow's own solver makes patches only of materials that have bending.
 *
 * The material that `create` is given and that of every batch are the same one: it outlives the instance, and its functions and
 * instance may be kept (the struct itself may lie elsewhere in each call). */

typedef struct pf_element_sizes {
  uint64_t size;            /* set by the caller: write no more than that */
  uint32_t nodes;           /* of the element part: 3 or 4; check-plugin takes both, Plyflow's own solver quads only */
  uint32_t dofs_per_node;   /* 3; 6 adds rotations (spin in, moment out) */
  uint32_t constants;       /* doubles per element, written by initialise */
  uint32_t history;         /* doubles per element, the element's own */
  uint32_t material_points; /* membrane points per element: each has membrane_history doubles */
  uint32_t fields;          /* doubles per element written when `fields` is not NULL; named in the manifest */
  uint32_t patch_nodes;     /* 0: no patch part; else the most nodes a patch can have (centre first) */
  uint32_t patch_constants;
  uint32_t patch_history; /* besides the material's bending_history */
  uint32_t patch_fields;
  /* Since ABI 1.1. */
  uint32_t ignores_velocity; /* 1: `velocity` may be NULL in every call, which saves gathering it */
  uint32_t reserved;
} pf_element_sizes;

/* rows of pf_element_batch.energy */
#define PF_ENERGY_MEMBRANE 0
#define PF_ENERGY_BENDING 1
#define PF_ENERGY_HOURGLASS 2
#define PF_ENERGIES 3

typedef struct pf_element_batch {
  uint64_t size;
  uint32_t lanes;
  uint32_t reserved;
  double dt;               /* s, step just done; 0 in the first calls, all in one state, and wherever only forces or the critical step of a state are asked for, with
                              velocities and spins of 0 and a copy of the histories: it is no sign that a history is new. Where a run begins late
                              it is led there in few steps, some of a frame each */
  const double *position;  /* [nodes][3][lanes] m (reference positions in initialise) */
  const double *velocity;  /* [nodes][3][lanes] m/s at the half step; NULL in initialise, with 3 dofs per node, and with ignores_velocity */
  const double *spin;      /* [nodes][3][lanes] rad/s or NULL */
  const double *axis;      /* [3][lanes] unit e1 in the undeformed plane; only in initialise */
  double *constants;       /* [constants][lanes]; written by initialise only: batches may share them */
  double *history;         /* [history][lanes]; zeros at the start */
  double *material_history; /* [material_points * membrane_history][lanes] */
  double *force;           /* [nodes][3][lanes] N: internal force, dW/dx; overwritten; NULL in initialise */
  double *moment;          /* [nodes][3][lanes] N m or NULL */
  double *energy;          /* [PF_ENERGIES][lanes] J; overwritten; NULL in initialise */
  double *fields;          /* NULL or [fields][lanes] */
  double *mass;            /* initialise only: [nodes][lanes] kg */
  double *inertia;         /* initialise only: [nodes][lanes] kg m2 or NULL */
  double *critical_step;   /* NULL or [lanes] s: bound of 2/omega_max of this element with the masses it wrote; 0: the element is none any more (inside out), the run stops */
  const pf_material *material;
} pf_element_batch;

typedef struct pf_patch_batch {
  uint64_t size;
  uint32_t lanes;
  uint32_t reserved;
  double dt;
  const double *position; /* [patch_nodes][3][lanes]; unused slots repeat the centre */
  const double *count;    /* [lanes]: nodes in use; only in patch_initialise */
  const double *area;     /* [lanes] undeformed tributary area (m2); only in patch_initialise */
  const double *axis;     /* [3][lanes]; only in patch_initialise */
  double *constants;      /* [patch_constants][lanes]; written by patch_initialise only */
  double *history;        /* [patch_history + bending_history][lanes] */
  double *force;          /* [patch_nodes][3][lanes] N; overwritten; zero in unused slots; NULL in patch_initialise */
  double *energy;         /* [lanes] J of bending; overwritten; NULL in patch_initialise */
  double *fields;         /* NULL or [patch_fields][lanes] */
  double *stiffness;      /* NULL or [patch_nodes][lanes] N/m: bound of each node's row sum |d2W/dxdx| */
  const pf_material *material;
} pf_patch_batch;

typedef struct pf_element_functions {
  uint64_t size;
  int32_t (*create)(pf_str parameters_json, const pf_material *material, void **instance, pf_error *error);
  void (*destroy)(void *instance);
  int32_t (*sizes)(const void *instance, pf_element_sizes *sizes);
  int32_t (*initialise)(const void *instance, const pf_element_batch *batch);
  int32_t (*forces)(const void *instance, const pf_element_batch *batch);
  int32_t (*patch_initialise)(const void *instance, const pf_patch_batch *batch); /* it and the next may be NULL when patch_nodes is 0 */
  int32_t (*patch_forces)(const void *instance, const pf_patch_batch *batch);
  /* Since ABI 1.2; may be NULL. what: PF_TAPE_FORCES, or PF_TAPE_PATCH_FORCES of a patch with `count` nodes in use */
  int32_t (*tape)(const void *instance, uint32_t what, uint32_t count, const pf_writer *to, pf_error *error);
} pf_element_functions;

#ifdef __cplusplus
}
#endif
#endif /* PLYFLOW_H */
