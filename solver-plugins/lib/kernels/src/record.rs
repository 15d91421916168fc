//! Kernels written down: what an element or a material does to one lane, as a [`Tape`].
//!
//! While a [`Recording`] is open on a thread, every kernel on that thread runs with lanes of another kind: [`Recorded`] ones do no arithmetic, they
//! note it. Their values travel through memory as other numbers do, as signalling NaNs that name an operation and a lane. So nothing of a
//! component has to be written for this: it is called as a solver calls it, with buffers of such symbols, and what lies in its outputs
//! afterwards says which operations made them. A number that was computed from a symbol outside of lanes is a quiet NaN, and is found.
//!
//! What a component decides by its parameters is decided here, and stands in the tape as what was chosen. What it decides by the numbers
//! of a state must be a choice of lanes ([`Lanes::select`]).

use crate::lanes::{self, Lanes, WIDTH};
use core::ops::{Add, Div, Mul, Neg, Sub};
use plyflow_sdk::{
    Aligned, BendingBatch, Constants, Element, ElementBatch, ElementTape, LocalMaterial, Material,
    MaterialSizes, MaterialTape, MembraneBatch, PatchBatch, abi,
};
use plyflow_tape::{Builder, Call, Id, Operation, Row, Tape};
use std::cell::RefCell;

/// What is open on a thread.
#[derive(Default)]
struct Open {
    builder: Builder,
    /// The first thing that went wrong: kernels cannot tell it.
    fault: Option<String>,
}

thread_local!(static OPEN: RefCell<Option<Open>> = const { RefCell::new(None) });

/// Does something with what is open.
///
/// # Panics
/// When nothing is: [`Recorded`] lanes are made by a recording alone.
fn with_open<T>(f: impl FnOnce(&mut Open) -> T) -> T {
    OPEN.with_borrow_mut(|open| f(open.as_mut().expect("a recording is open")))
}

/// A signalling NaN that stands for an operation in one lane, or in all of them.
///
/// Bits: 62 to 52 and 50 set, 51 (quiet) and 63 (sign) not; 49: for all lanes; 34 to 3: the operation; 2 to 0: the lane.
mod symbol {
    use super::Id;

    const MARK: u64 = 0x7ff4 << 48;
    const FOR_ALL: u64 = 1 << 49;
    /// What arithmetic makes of a symbol, with either sign.
    const QUIET: u64 = 0x7ffc << 48;

    pub(super) fn in_lane(id: Id, lane: usize) -> f64 {
        f64::from_bits(MARK | u64::from(id.0) << 3 | lane as u64)
    }

    pub(super) fn in_all(id: Id) -> f64 {
        f64::from_bits(MARK | FOR_ALL | u64::from(id.0) << 3)
    }

    /// The operation, when `x` stands for one in this lane.
    pub(super) fn read(x: f64, lane: usize) -> Option<Id> {
        let bits = x.to_bits();
        let id = Id((bits >> 3) as u32);
        let same = |y: f64| y.to_bits() == bits;
        (same(in_lane(id, lane)) || same(in_all(id))).then_some(id)
    }

    /// Whether `x` is what was computed from a symbol, or a symbol of another lane.
    pub(super) fn is_spoilt(x: f64) -> bool {
        let bits = x.to_bits();
        bits & QUIET == QUIET || bits & QUIET == MARK
    }
}

/// What nobody has written yet.
const NOTHING: f64 = f64::from_bits(0x7ff0_0000_dead_0001);

/// The operation or the constant that eight lanes of memory hold.
fn read(lanes: &[f64]) -> Result<Id, String> {
    if let Some(id) = symbol::read(lanes[0], 0) {
        if (0..WIDTH).all(|l| symbol::read(lanes[l], l) == Some(id)) {
            return Ok(id);
        }
        return Err(
            "lanes that do not belong together are read: a row is not where it was written".into(),
        );
    }
    if lanes.iter().any(|x| x.to_bits() == NOTHING.to_bits()) {
        return Err("a row is read that was not written".into());
    }
    if lanes.iter().any(|x| symbol::is_spoilt(*x)) {
        return Err("a number was computed outside of lanes, from what hangs on a state".into());
    }
    if lanes.iter().any(|x| x.to_bits() != lanes[0].to_bits()) {
        return Err("a row is read whose lanes differ, and that is no input".into());
    }
    Ok(with_open(|o| o.builder.constant(lanes[0])))
}

/// As [`read`]; a fault is kept for the end, with any operation in its place.
fn read_or_note(lanes: &[f64]) -> Id {
    read(lanes).unwrap_or_else(|why| {
        with_open(|o| {
            o.fault.get_or_insert(why);
            o.builder.constant(0.0)
        })
    })
}

fn write(id: Id, lanes: &mut [f64]) {
    for (l, x) in lanes.iter_mut().enumerate() {
        *x = symbol::in_lane(id, l);
    }
}

/// Eight lanes that are noted: an operation of the tape that is open on this thread.
#[derive(Clone, Copy)]
pub struct Recorded(Id);

fn push(operation: Operation) -> Recorded {
    Recorded(with_open(|o| o.builder.push(operation)))
}

macro_rules! operator {
    ($trait:ident, $name:ident, $operation:ident) => {
        impl $trait for Recorded {
            type Output = Self;
            fn $name(self, other: Self) -> Self {
                push(Operation::$operation(self.0, other.0))
            }
        }
    };
}
operator!(Add, add, Add);
operator!(Sub, sub, Subtract);
operator!(Mul, mul, Multiply);
operator!(Div, div, Divide);

impl Neg for Recorded {
    type Output = Self;
    fn neg(self) -> Self {
        push(Operation::Negate(self.0))
    }
}

impl Lanes for Recorded {
    /// The operation that gives a truth.
    type Mask = Id;

    fn splat(x: f64) -> Self {
        Self(read_or_note(&[x; WIDTH]))
    }
    fn load(from: &[f64], at: usize) -> Self {
        Self(read_or_note(&from[at..at + WIDTH]))
    }
    fn store(self, to: &mut [f64], at: usize) {
        write(self.0, &mut to[at..at + WIDTH]);
    }
    fn sqrt(self) -> Self {
        push(Operation::Root(self.0))
    }
    fn abs(self) -> Self {
        push(Operation::Magnitude(self.0))
    }
    fn min(self, other: Self) -> Self {
        push(Operation::Least(self.0, other.0))
    }
    fn max(self, other: Self) -> Self {
        push(Operation::Largest(self.0, other.0))
    }
    fn lt(self, other: Self) -> Id {
        push(Operation::Less(self.0, other.0)).0
    }
    /// Not known: a tape has no branches.
    fn all(_: Id) -> bool {
        false
    }
    /// Not known either.
    fn expect(_: Id) {}
    fn select(mask: Id, yes: Self, no: Self) -> Self {
        push(Operation::Select(mask, yes.0, no.0))
    }
    fn copysign(self, sign: Self) -> Self {
        push(Operation::CopySign(self.0, sign.0))
    }
    fn power_of_two(self) -> Self {
        push(Operation::PowerOfTwo(self.0))
    }
    fn lookup<const R: usize, const N: usize>(
        self,
        table: &[[f64; 8]; N],
        first: usize,
    ) -> [Self; R] {
        with_open(|o| {
            let table = o.builder.table(table, first);
            let place = o.builder.push(Operation::Find(table, self.0));
            let entry = |r: usize| Operation::Entry(table, place, r as u16);
            core::array::from_fn(|r| Self(o.builder.push(entry(r))))
        })
    }
}

/// Buffers of symbols, until [`Recording::finish`]. One at a time on a thread.
pub struct Recording {
    /// Kernels look for it.
    _here: lanes::ThisRecords,
    /// Names of the buffers.
    names: Vec<String>,
    stores: Vec<(Row, Id)>,
}

impl Recording {
    /// From here on kernels on this thread are written down.
    ///
    /// # Errors
    /// When they are already.
    pub fn begin() -> Result<Self, String> {
        if OPEN.with_borrow(Option::is_some) {
            return Err("this thread records already".into());
        }
        OPEN.set(Some(Open::default()));
        Ok(Self {
            _here: lanes::ThisRecords::begin(),
            names: Vec::new(),
            stores: Vec::new(),
        })
    }

    fn buffer(&mut self, name: &str, rows: usize, uniform: bool) -> u16 {
        self.names.push(name.to_owned());
        let rows = u16::try_from(rows).expect("at most 65,535 rows");
        with_open(|o| o.builder.buffer(name, rows, uniform))
    }

    /// A buffer `[rows][8]` that the function reads.
    ///
    /// # Panics
    /// With more than 65,535 rows.
    pub fn input(&mut self, name: &str, rows: usize) -> Aligned {
        let buffer = self.buffer(name, rows, false);
        let mut memory = Aligned::zeros(rows * WIDTH);
        for (row, lanes) in memory.chunks_exact_mut(WIDTH).enumerate() {
            let row = row as u16;
            write(push(Operation::Load(Row { buffer, row })).0, lanes);
        }
        memory
    }

    /// A number that all lanes share.
    pub fn number(&mut self, name: &str) -> f64 {
        let buffer = self.buffer(name, 1, true);
        symbol::in_all(push(Operation::Load(Row { buffer, row: 0 })).0)
    }

    /// A buffer `[rows][8]` that the function writes, for [`Recording::output`].
    pub fn room(rows: usize) -> Aligned {
        let mut memory = Aligned::zeros(rows * WIDTH);
        memory.fill(NOTHING);
        memory
    }

    /// What the function has left in a buffer `[rows][8]`: a new one, or the input of that name, of which rows may be as they were.
    ///
    /// # Errors
    /// When a row was not written, or with something that was computed outside of lanes.
    ///
    /// # Panics
    /// With more than 65,535 rows.
    pub fn output(&mut self, name: &str, memory: &[f64]) -> Result<(), String> {
        let known = self.names.iter().position(|n| n == name);
        let buffer = match known {
            Some(i) => i as u16,
            None => self.buffer(name, memory.len() / WIDTH, false),
        };
        for (row, lanes) in memory.chunks_exact(WIDTH).enumerate() {
            let to = Row {
                buffer,
                row: row as u16,
            };
            let value = read(lanes).map_err(|why| format!("row {row} of '{name}': {why}"))?;
            if known.is_none() || value != push(Operation::Load(to)).0 {
                self.stores.push((to, value));
            }
        }
        Ok(())
    }

    /// The tape.
    ///
    /// # Errors
    /// The first thing that went wrong in a kernel.
    pub fn finish(mut self) -> Result<Tape, String> {
        let open = OPEN.take().expect("a recording is open");
        if let Some(why) = open.fault {
            return Err(why);
        }
        let tape = open.builder.finish(std::mem::take(&mut self.stores));
        tape.check().map_err(|fault| fault.0)?;
        Ok(tape)
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        OPEN.set(None);
    }
}

/// A material's answer to a metric. Buffers: `metric` 3, `history`, `dt`; `stress` 3, `energy` 1 and, when asked for, `stiffness` 2 ([`MembraneBatch`]).
///
/// # Errors
/// When it computes outside of lanes.
pub fn membrane(material: &impl Material, stiffness: bool) -> Result<Tape, String> {
    let sizes = material.sizes();
    let mut r = Recording::begin()?;
    let metric = r.input("metric", 3);
    let mut history = r.input("history", sizes.membrane_history);
    let dt = r.number("dt");
    let (mut stress, mut energy) = (Recording::room(3), Recording::room(1));
    let mut tangents = Recording::room(2);
    material.membrane(&mut MembraneBatch {
        lanes: WIDTH,
        dt,
        metric: &metric,
        history: &mut history,
        stress: &mut stress,
        energy: &mut energy,
        stiffness: stiffness.then_some(&mut tangents),
    });
    r.output("stress", &stress)?;
    r.output("energy", &energy)?;
    r.output("history", &history)?;
    if stiffness {
        r.output("stiffness", &tangents)?;
    }
    r.finish()
}

/// A material's answer to a curvature. Buffers: `metric` 3, `curvature` 3, `history`, `dt`; `moment` 3, `energy` 1, `tangent` 3 ([`BendingBatch`]).
///
/// # Errors
/// When it computes outside of lanes.
pub fn bending(material: &impl Material) -> Result<Tape, String> {
    let sizes = material.sizes();
    let mut r = Recording::begin()?;
    let (metric, curvature) = (r.input("metric", 3), r.input("curvature", 3));
    let mut history = r.input("history", sizes.bending_history);
    let dt = r.number("dt");
    let (mut moment, mut energy) = (Recording::room(3), Recording::room(1));
    let mut tangent = Recording::room(3);
    material.bending(&mut BendingBatch {
        lanes: WIDTH,
        dt,
        metric: &metric,
        curvature: &curvature,
        history: &mut history,
        moment: &mut moment,
        energy: &mut energy,
        tangent: Some(&mut tangent),
    });
    r.output("moment", &moment)?;
    r.output("energy", &energy)?;
    r.output("tangent", &tangent)?;
    r.output("history", &history)?;
    r.finish()
}

/// An element's forces, with calls `membrane` and `bending` for its material. Buffers: `position`, `velocity`, `spin` (the latter two where it
/// has them), `constants`, `history`, `material_history`, `dt`; `force`, `moment` (with rotations), `energy` 3 ([`ElementBatch`]).
///
/// # Errors
/// When it computes outside of lanes, or refuses.
pub fn forces(element: &impl Element, material: MaterialSizes) -> Result<Tape, String> {
    let sizes = element.sizes();
    let (components, turns) = (3 * sizes.nodes, sizes.dofs_per_node == 6);
    let asked = LocalMaterial::new(Asked(material))?;
    let mut r = Recording::begin()?;
    let position = r.input("position", components);
    let some = |r: &mut Recording, name: &str, there: bool| match there {
        true => r.input(name, components),
        false => Aligned::zeros(0),
    };
    let velocity = some(&mut r, "velocity", turns && !sizes.ignores_velocity);
    let spin = some(&mut r, "spin", turns);
    let constants = r.input("constants", sizes.constants);
    let mut history = r.input("history", sizes.history);
    let points = sizes.material_points * material.membrane_history;
    let mut material_history = r.input("material_history", points);
    let dt = r.number("dt");
    let mut force = Recording::room(components);
    let mut moment = Recording::room(if turns { components } else { 0 });
    let mut energy = Recording::room(3);
    let code = element.forces(
        &mut ElementBatch {
            lanes: WIDTH,
            dt,
            position: &position,
            velocity: &velocity,
            spin: &spin,
            axis: &[],
            constants: Constants::Fixed(&constants),
            history: &mut history,
            material_history: &mut material_history,
            force: &mut force,
            moment: &mut moment,
            energy: &mut energy,
            fields: None,
            mass: &mut [],
            inertia: &mut [],
            critical_step: None,
        },
        asked.seen(),
    );
    refused(code)?;
    r.output("force", &force)?;
    if turns {
        r.output("moment", &moment)?;
    }
    r.output("energy", &energy)?;
    r.output("history", &history)?;
    r.output("material_history", &material_history)?;
    r.finish()
}

/// The forces of a patch with so many nodes, the centre with them, with a call `bending` for its material. Buffers: `position`, `constants`, `history`, `dt`;
/// `force`, `energy` 1 ([`PatchBatch`]).
///
/// Row 1 of the constants is taken for the number of nodes, as `rf4` has it: with another one it is another function.
///
/// # Errors
/// When it computes outside of lanes, or refuses.
///
/// # Panics
/// When it has no patch part.
pub fn patch_forces(
    element: &impl Element,
    material: MaterialSizes,
    nodes: usize,
) -> Result<Tape, String> {
    let sizes = element.sizes();
    let asked = LocalMaterial::new(Asked(material))?;
    let mut r = Recording::begin()?;
    let position = r.input("position", 3 * sizes.patch_nodes);
    let mut constants = r.input("constants", sizes.patch_constants);
    constants[WIDTH..2 * WIDTH].fill(nodes as f64);
    let mut history = r.input("history", sizes.patch_history + material.bending_history);
    let dt = r.number("dt");
    let (mut force, mut energy) = (Recording::room(3 * sizes.patch_nodes), Recording::room(1));
    let code = element.patch_forces(
        &mut PatchBatch {
            lanes: WIDTH,
            dt,
            position: &position,
            count: &[],
            area: &[],
            axis: &[],
            constants: Constants::Fixed(&constants),
            history: &mut history,
            force: &mut force,
            energy: &mut energy,
            fields: None,
            stiffness: None,
        },
        asked.seen(),
    );
    refused(code)?;
    r.output("force", &force)?;
    r.output("energy", &energy)?;
    r.output("history", &history)?;
    r.finish()
}

/// What a material of this crate answers to [`Material::tape`].
pub(crate) fn of_material(
    material: &impl Material,
    what: MaterialTape,
) -> Result<Option<String>, String> {
    let tape = match what {
        MaterialTape::Membrane => membrane(material, true)?,
        MaterialTape::Bending if !material.sizes().has_bending => return Ok(None),
        MaterialTape::Bending => bending(material)?,
    };
    Ok(Some(tape.to_string()))
}

/// What an element of this crate answers to [`Element::tape`].
pub(crate) fn of_element(
    element: &impl Element,
    what: ElementTape,
    material: MaterialSizes,
) -> Result<Option<String>, String> {
    let most = element.sizes().patch_nodes;
    let tape = match what {
        ElementTape::Forces => forces(element, material)?,
        ElementTape::PatchForces(_) if most == 0 => return Ok(None),
        ElementTape::PatchForces(nodes) if (1..=most).contains(&nodes) => {
            patch_forces(element, material, nodes)?
        }
        ElementTape::PatchForces(nodes) => {
            return Err(format!("a patch of {nodes} nodes; expected 1 to {most}"));
        }
    };
    Ok(Some(tape.to_string()))
}

fn refused(code: i32) -> Result<(), String> {
    if code == abi::PF_OK {
        return Ok(());
    }
    Err(format!("the element refused its batch (code {code})"))
}

/// A material that answers nothing: what it is asked becomes a call.
struct Asked(MaterialSizes);

impl Asked {
    /// A call with what was asked, and its results where the answers go.
    fn note(of: &str, arguments: &[(&str, &[f64])], answers: &mut [(&str, &mut [f64])]) {
        let rows = |memory: &[f64]| memory.chunks_exact(WIDTH).map(read_or_note).collect();
        let named = |(name, memory): &(&str, &[f64])| ((*name).to_owned(), rows(memory));
        let arguments = arguments.iter().map(named).collect();
        let count = |(name, memory): &(&str, &mut [f64])| {
            ((*name).to_owned(), (memory.len() / WIDTH) as u16)
        };
        let results = answers.iter().map(count).collect();
        let call = Call {
            of: of.to_owned(),
            arguments,
            results,
        };
        let call = with_open(|o| o.builder.call(call));
        for (buffer, (_, memory)) in answers.iter_mut().enumerate() {
            for (row, lanes) in memory.chunks_exact_mut(WIDTH).enumerate() {
                let result = Operation::Result(call, buffer as u16, row as u16);
                write(push(result).0, lanes);
            }
        }
    }
}

impl Material for Asked {
    const MANIFEST: &'static str = "{}";

    fn create(_: &str) -> Result<Self, String> {
        Err("it is made where a recording begins".into())
    }

    fn sizes(&self) -> MaterialSizes {
        self.0
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        let (history, dt) = (b.history.to_vec(), [b.dt; WIDTH]);
        let arguments = [("metric", b.metric), ("history", &history), ("dt", &dt)];
        let stiffness = b.stiffness.as_deref_mut().unwrap_or(&mut []);
        let mut answers = [
            ("stress", &mut *b.stress),
            ("energy", &mut *b.energy),
            ("history", &mut *b.history),
            ("stiffness", stiffness),
        ];
        Self::note("membrane", &arguments, &mut answers);
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        let (history, dt) = (b.history.to_vec(), [b.dt; WIDTH]);
        let arguments = [
            ("metric", b.metric),
            ("curvature", b.curvature),
            ("history", &history),
            ("dt", &dt),
        ];
        let tangent = b.tangent.as_deref_mut().unwrap_or(&mut []);
        let mut answers = [
            ("moment", &mut *b.moment),
            ("energy", &mut *b.energy),
            ("tangent", tangent),
            ("history", &mut *b.history),
        ];
        Self::note("bending", &arguments, &mut answers);
    }
}
