//! What is demanded of components, in the order in which it is checked.

use crate::check::Rule;

const fn rule(name: &'static str, expected: &'static str, remedy: &'static str) -> Rule {
    Rule {
        name,
        expected,
        remedy,
    }
}

pub(crate) const CREATE: Rule = rule(
    "create",
    "an instance is made from the parameters, and destroyed",
    "look at the text that create gave; parameters arrive as one JSON object in SI numbers",
);
pub(crate) const SIZES: Rule = rule(
    "sizes",
    "3 or 4 nodes, 3 or 6 degrees of freedom, as many fields as the manifest names",
    "compare what `sizes` writes with the manifest's `fields` and with the documentation of the struct in plyflow.h",
);
pub(crate) const STATUS: Rule = rule(
    "status",
    "every call returns PF_OK (0)",
    "find the call that returned something else; 3 is a panic that the SDK caught: its text is on standard error",
);
pub(crate) const GUARDS: Rule = rule(
    "guard-zones",
    "nothing outside of the buffers, no input and (after initialise) no constant is written to",
    "index rows as [row * lanes + lane] with the lanes of the batch, and see that `sizes` declares all rows",
);
pub(crate) const COMPLETE: Rule = rule(
    "complete",
    "every place of every output is written, for all lanes",
    "write all rows for lanes 0 .. batch.lanes, zeros where there is nothing to say",
);
pub(crate) const FINITE: Rule = rule(
    "finite",
    "all outputs are finite numbers, also at strains of 30 % (of a law: and at 60 degrees of shear)",
    "look for divisions, roots and logarithms of what may be zero or negative, and for outputs that are added to instead of overwritten",
);
pub(crate) const REPEATABLE: Rule = rule(
    "repeatable",
    "the same call on the same data gives the same bits, also in another instance",
    "keep no state outside of the history buffers: no globals, no clock, no random numbers",
);
pub(crate) const LANES: Rule = rule(
    "batch-independence",
    "the value in a lane depends on that lane alone, whatever the batch's size and order",
    "look for indices that reach into another lane, for sums over lanes, and for decisions taken for the batch as a whole",
);
pub(crate) const ASKING: Rule = rule(
    "asking",
    "asking for fields, critical step, stiffness or tangent changes nothing else",
    "compute optional outputs beside the others; NULL means that they are not wanted",
);
pub(crate) const THREADS: Rule = rule(
    "threads",
    "several threads that call one instance at once get the bits that one thread gets",
    "keep no scratch memory in globals or in the instance: use the stack",
);
pub(crate) const TAPE: Rule = rule(
    "tape",
    "what `tape` writes, where it writes something, is a tape and gives the bits of the function",
    "write down the operations of the function in its own order, each rounded once, with all that its parameters decide decided (docs/plugins/tape.md)",
);
pub(crate) const REST: Rule = rule(
    "rest",
    "no force and no energy in the reference position",
    "measure deformation against the reference that initialise was given",
);
pub(crate) const MASS: Rule = rule(
    "mass",
    "positive nodal masses that add up to areal mass times undeformed area (and positive rotary inertias)",
    "take areal_mass from the material's sizes and the undeformed area",
);
pub(crate) const BALANCE: Rule = rule(
    "balance",
    "the forces of an element add up to zero, and so do their moments about the origin",
    "an internal force is a derivative of an energy that no rigid motion changes; check the shape functions' derivatives",
);
pub(crate) const FRAME: Rule = rule(
    "frame-invariance",
    "a rotation and a shift of the whole element turn its forces and change no energy",
    "measure strains by F^T F or in axes that turn with the element; with 6 degrees of freedom, turn the history by the spin",
);
pub(crate) const ENERGY: Rule = rule(
    "energy",
    "force (and moment) is the derivative of the energy: dW/dx, by central differences",
    "check signs, factors 2 of the shear terms, thickness and area; report hourglass energy in its row",
);
pub(crate) const WORK: Rule = rule(
    "work",
    "along a path the work of the forces is the change of the energies",
    "a history-dependent law reports the work done as its energy; the history must be that of the last call",
);
pub(crate) const STEP: Rule = rule(
    "critical-step",
    "critical_step is not above the true 2 / omega_max with the masses that initialise wrote",
    "bound the largest eigenvalue of the element's stiffness from above: with the material's `stiffness`, the hourglass stiffness and the stress that the element carries",
);

/// Everything after the calls work at all.
pub(crate) const OF_ELEMENTS: [Rule; 12] = [
    REPEATABLE, LANES, ASKING, THREADS, TAPE, REST, MASS, BALANCE, FRAME, ENERGY, WORK, STEP,
];

pub(crate) const PATCH_GUARDS: Rule = rule("patch-guard-zones", GUARDS.expected, GUARDS.remedy);
pub(crate) const PATCH_COMPLETE: Rule = rule(
    "patch-complete",
    "every output of the patch part is written and finite; forces of unused slots are zero",
    COMPLETE.remedy,
);
pub(crate) const PATCH_REPEATABLE: Rule =
    rule("patch-repeatable", REPEATABLE.expected, REPEATABLE.remedy);
pub(crate) const PATCH_LANES: Rule = rule("patch-batch-independence", LANES.expected, LANES.remedy);
pub(crate) const PATCH_ASKING: Rule = rule("patch-asking", ASKING.expected, ASKING.remedy);
pub(crate) const PATCH_THREADS: Rule = rule("patch-threads", THREADS.expected, THREADS.remedy);
pub(crate) const PATCH_TAPE: Rule = rule("patch-tape", TAPE.expected, TAPE.remedy);
pub(crate) const PATCH_REST: Rule = rule("patch-rest", REST.expected, REST.remedy);
pub(crate) const PATCH_BALANCE: Rule = rule("patch-balance", BALANCE.expected, BALANCE.remedy);
pub(crate) const PATCH_FRAME: Rule = rule("patch-frame-invariance", FRAME.expected, FRAME.remedy);
pub(crate) const PATCH_ENERGY: Rule = rule("patch-energy", ENERGY.expected, ENERGY.remedy);
pub(crate) const PATCH_STIFFNESS: Rule = rule(
    "patch-stiffness",
    "stiffness[node] is not below the row's sum of norms of the 3 x 3 blocks of d2W/dxdx",
    "bound every term by norms, also the part that the moments carry; the solver's time step rests on it",
);

/// The patch part, after its calls work at all.
pub(crate) const OF_PATCHES: [Rule; 10] = [
    PATCH_REPEATABLE,
    PATCH_LANES,
    PATCH_ASKING,
    PATCH_THREADS,
    PATCH_TAPE,
    PATCH_REST,
    PATCH_BALANCE,
    PATCH_FRAME,
    PATCH_ENERGY,
    PATCH_STIFFNESS,
];

pub(crate) const STRESS: Rule = rule(
    "stress",
    "stress is the derivative of the energy: S11 = 2 dW/dC11, S22 = 2 dW/dC22, S12 = dW/dC12",
    "dW = S11 dE11 + S22 dE22 + 2 S12 dE12 with E = (C - 1)/2: C12 stands for both off-diagonals",
);
pub(crate) const CYCLE: Rule = rule(
    "cycle",
    "a closed cycle of strain gives back no more energy than was put in, and the energy is the work done",
    "the energy of a law with history is the work done, and damage and friction only take",
);
pub(crate) const TANGENT: Rule = rule(
    "stiffness",
    "stiffness[0] is not below the largest eigenvalue of dS/dE, stiffness[1] not below dS12/d(2 E12)",
    "the time step rests on this bound: take the largest tangent of the state, never a mean, with the stress terms",
);

pub(crate) const ZERO_DT: Rule = rule(
    "zero-dt",
    "a call with dt = 0 gives finite numbers, and where other dt make no difference it makes none either",
    "the first call of a run has dt = 0: divide nothing by dt, and do not leave out the update when it is 0",
);

pub(crate) const OF_MATERIALS: [Rule; 10] = [
    REPEATABLE, LANES, ASKING, THREADS, TAPE, ZERO_DT, REST, STRESS, CYCLE, TANGENT,
];

pub(crate) const BENDING: Rule = rule(
    "bending",
    "bending writes all of its outputs, finite, between its guard zones",
    "write moment [3][lanes], energy [lanes] and, when asked for, tangent [3][lanes]",
);
pub(crate) const BENDING_LANES: Rule =
    rule("bending-batch-independence", LANES.expected, LANES.remedy);
pub(crate) const BENDING_REPEATABLE: Rule =
    rule("bending-repeatable", REPEATABLE.expected, REPEATABLE.remedy);
pub(crate) const BENDING_ASKING: Rule = rule("bending-asking", ASKING.expected, ASKING.remedy);
pub(crate) const BENDING_THREADS: Rule = rule("bending-threads", THREADS.expected, THREADS.remedy);
pub(crate) const BENDING_TAPE: Rule = rule("bending-tape", TAPE.expected, TAPE.remedy);
pub(crate) const BENDING_ZERO_DT: Rule = rule("bending-zero-dt", ZERO_DT.expected, ZERO_DT.remedy);
pub(crate) const BENDING_REST: Rule = rule(
    "bending-rest",
    "no moment and no energy at zero curvature",
    "moments are those of the change of curvature from the flat reference",
);
pub(crate) const MOMENT: Rule = rule(
    "moment",
    "moment is the derivative of the energy: M11 = dW/dk11, M22 = dW/dk22, 2 M12 = dW/dk12",
    "k12 stands for both off-diagonals: dW = M11 dk11 + M22 dk22 + 2 M12 dk12",
);
pub(crate) const BENDING_TANGENT: Rule = rule(
    "tangent",
    "tangent is dM11/dk11, dM22/dk22, dM12/dk12, by central differences",
    "differentiate the moment law of the state that the call ends in",
);
pub(crate) const BENDING_CYCLE: Rule = rule(
    "bending-cycle",
    "a closed cycle of curvature gives back no more energy than was put in, and the energy is the work done",
    CYCLE.remedy,
);
pub(crate) const OF_BENDING: [Rule; 10] = [
    BENDING_REPEATABLE,
    BENDING_LANES,
    BENDING_ASKING,
    BENDING_THREADS,
    BENDING_TAPE,
    BENDING_ZERO_DT,
    BENDING_REST,
    MOMENT,
    BENDING_CYCLE,
    BENDING_TANGENT,
];
