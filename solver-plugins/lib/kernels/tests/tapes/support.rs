//! Tapes beside the kernels that they were recorded from: run one operation after the other, and compiled from their source by the C compiler
//! of this machine. Whoever says another bit is wrong.

use plyflow_tape::{PRELUDE, Taken, Tape};
use std::ffi::{c_double, c_long};
use std::path::Path;
use std::process::Command;

pub const LANES: usize = 64;
/// Batches of so many lanes: 102,400 states of each kind.
pub const BATCHES: usize = 1600;

/// Numbers without a pattern, the same each time (Knuth's MMIX).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }
    /// From 0 to 1.
    pub fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }
    /// Of any size between these, evenly by its logarithm, with either sign.
    pub fn sized(&mut self, least: f64, largest: f64) -> f64 {
        let size = self.between(least.ln(), largest.ln()).exp();
        if self.chance(0.5) { size } else { -size }
    }
    pub fn chance(&mut self, share: f64) -> bool {
        self.share() < share
    }
}

type Function = unsafe extern "C" fn(c_long, *const *mut c_double);

/// Functions made of tapes.
pub struct Compiled(libloading::Library);

/// Compiles them all.
pub fn compiled(tapes: &[(&str, &Tape)]) -> Compiled {
    let folder = tempfile::tempdir().expect("a folder");
    let (source, library) = (
        folder.path().join("tapes.c"),
        folder.path().join("tapes.so"),
    );
    let mut text = PRELUDE.to_owned();
    for (name, tape) in tapes {
        text += &tape.source(name);
        let arguments: Vec<String> = (0..tape.buffers.len()).map(|i| format!("b[{i}]")).collect();
        text += &format!(
            "void {name}_of(long lanes, double **b) {{ {name}(lanes, {}); }}\n",
            arguments.join(", ")
        );
    }
    std::fs::write(&source, text).expect("the source is written");
    compile(&source, &library, &["-ffp-contract=off"]);
    // SAFETY: what was just compiled has nothing that runs when it is loaded.
    Compiled(unsafe { libloading::Library::new(&library) }.expect("the library"))
}

fn compile(source: &Path, library: &Path, more: &[&str]) {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let done = Command::new(&compiler)
        .args([
            "-std=c11",
            "-O1",
            "-shared",
            "-fPIC",
            "-Wall",
            "-Wextra",
            "-Wno-unused-parameter",
            "-Wno-unused-variable",
        ])
        .args(more)
        .args([
            source.as_os_str(),
            "-o".as_ref(),
            library.as_os_str(),
            "-lm".as_ref(),
        ])
        .output()
        .unwrap_or_else(|e| panic!("{compiler}: {e}"));
    let told = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.success() && told.is_empty(),
        "{compiler}: {told}"
    );
}

impl Compiled {
    /// Calls one of them, on one slice for each buffer of its tape.
    pub fn call(&self, name: &str, tape: &Tape, lanes: usize, buffers: &mut [&mut [f64]]) {
        assert_eq!(buffers.len(), tape.buffers.len());
        for (slice, buffer) in buffers.iter().zip(&tape.buffers) {
            let width = if buffer.uniform { 1 } else { lanes };
            assert_eq!(slice.len(), buffer.rows as usize * width, "{}", buffer.name);
        }
        let pointers: Vec<*mut c_double> = buffers.iter_mut().map(|b| b.as_mut_ptr()).collect();
        // SAFETY: the wrapper of this name takes a number of lanes and one pointer a buffer; each has the length that its tape says.
        unsafe {
            let f: libloading::Symbol<'_, Function> =
                self.0.get(format!("{name}_of")).expect("the function");
            f(lanes as c_long, pointers.as_ptr());
        }
    }
}

/// One slice for each buffer of a tape.
#[derive(Clone)]
pub struct Buffers {
    names: Vec<String>,
    slices: Vec<Vec<f64>>,
}

impl Buffers {
    /// Zeros.
    pub fn new(tape: &Tape) -> Self {
        let length = |b: &plyflow_tape::Buffer| b.rows as usize * if b.uniform { 1 } else { LANES };
        Self {
            names: tape.buffers.iter().map(|b| b.name.clone()).collect(),
            slices: tape.buffers.iter().map(|b| vec![0.0; length(b)]).collect(),
        }
    }
    fn place(&self, name: &str) -> usize {
        let found = self.names.iter().position(|n| n == name);
        found.unwrap_or_else(|| panic!("no buffer '{name}'"))
    }
    pub fn get(&self, name: &str) -> &[f64] {
        &self.slices[self.place(name)]
    }
    pub fn get_mut(&mut self, name: &str) -> &mut [f64] {
        let place = self.place(name);
        &mut self.slices[place]
    }
    fn slices(&mut self) -> Vec<&mut [f64]> {
        self.slices.iter_mut().map(|s| &mut s[..]).collect()
    }
}

/// A tape, what was compiled from it, and its name there.
pub struct Both<'a> {
    tape: &'a Tape,
    compiled: &'a Compiled,
    name: &'a str,
    /// How often each choice was taken.
    taken: Taken,
}

impl<'a> Both<'a> {
    pub fn new(tape: &'a Tape, compiled: &'a Compiled, name: &'a str) -> Self {
        let taken = Vec::new();
        Self {
            tape,
            compiled,
            name,
            taken,
        }
    }

    /// Does both to the same buffers, and holds them against `wanted`, which the kernel has left: outputs by name.
    pub fn hold(&mut self, before: &Buffers, wanted: &[(&str, &[f64])]) {
        let mut after = before.clone();
        self.compiled
            .call(self.name, self.tape, LANES, &mut after.slices());
        self.same("compiled", before, &after, wanted);
        let mut after = before.clone();
        let taken = self.tape.run(LANES, &mut after.slices());
        self.same("run", before, &after, wanted);
        self.taken.resize(taken.len(), [0; 2]);
        for (sum, more) in self.taken.iter_mut().zip(taken) {
            *sum = [sum[0] + more[0], sum[1] + more[1]];
        }
    }

    fn same(&self, how: &str, before: &Buffers, after: &Buffers, wanted: &[(&str, &[f64])]) {
        for (name, wanted) in wanted {
            let given = after.get(name);
            assert_eq!(given.len(), wanted.len(), "{}: {name}", self.name);
            // A NaN is a NaN: which bits it has is up to the machine.
            let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            if let Some(i) = (0..given.len()).find(|i| !same(given[*i], wanted[*i])) {
                let lane = i % LANES;
                let told: Vec<String> = before
                    .names
                    .iter()
                    .zip(&before.slices)
                    .map(|(name, slice)| {
                        let of_lane: Vec<f64> = slice
                            .iter()
                            .skip(lane.min(slice.len() - 1))
                            .step_by(LANES)
                            .copied()
                            .collect();
                        format!("{name} {of_lane:?}")
                    })
                    .collect();
                panic!(
                    "{} ({how}), row {} of '{name}': {:e} instead of {:e}, of {}",
                    self.name,
                    i / LANES,
                    given[i],
                    wanted[i],
                    told.join(", ")
                );
            }
        }
    }

    /// Every choice must have gone both ways this often, but for those that cannot: so many are known.
    pub fn all_taken(&self, least: u64, but: usize) {
        let seldom: Vec<(usize, [u64; 2])> = self
            .taken
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, t)| t[0] < least || t[1] < least)
            .collect();
        assert!(
            seldom.len() <= but,
            "{}: choices that were hardly taken: {seldom:?}",
            self.name
        );
    }
}

/// A metric of any kind: near rest, stretched and sheared, folded, collapsed.
pub fn metric(random: &mut Random) -> [f64; 3] {
    let small = random.chance(0.5);
    let stretch = |r: &mut Random| {
        if small {
            r.between(0.97, 1.03)
        } else {
            r.between(-1.5, 1.5).exp()
        }
    };
    let (a, b) = (stretch(random), stretch(random));
    let sine = match random.share() {
        x if x < 0.3 => random.between(-0.05, 0.05),
        x if x < 0.9 => random.between(-1.2, 1.2).sin(),
        // No metric at all: beyond a fold.
        _ => random.between(-3.0, 3.0),
    };
    match random.share() {
        x if x < 0.01 => [0.0; 3],
        x if x < 0.05 => [1.0, 1.0, 0.0],
        x if x < 0.07 => [a * a * 1e-8, b * b, 0.0],
        _ => [a * a, b * b, a * b * sine],
    }
}

pub fn curvature(random: &mut Random) -> [f64; 3] {
    let one = |r: &mut Random| {
        if r.chance(0.05) {
            0.0
        } else {
            r.sized(1e-4, 1e5)
        }
    };
    [one(random), one(random), one(random)]
}
