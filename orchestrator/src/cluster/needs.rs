//! What an allocation is asked for: its shape, and whether the cluster can ever give it.

use super::slurm::Limits;
use plyflow_model::profile::{Granted, Profile};
use serde::{Deserialize, Serialize};

/// Bytes of a MiB: Slurm counts memory in these.
const MEBIBYTE: u64 = 1 << 20;
/// Memory (MiB) of an allocation besides that of its steps: the program that runs them.
const OWN_MEMORY: u64 = 64;

/// The shape of an allocation: steps that get the same share one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Shape {
    /// Cores of one step.
    pub cores: u32,
    /// Memory of one step (MiB).
    pub memory: u64,
    /// Wall-clock time of the allocation (s).
    pub walltime: u64,
    /// GPUs of the allocation.
    pub gpus: u32,
    /// Steps that run at the same time.
    pub at_once: u32,
    /// Nodes that are not to be used.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
}

impl Shape {
    /// The shape for what a step is granted.
    pub fn of(granted: &Granted) -> Self {
        Self {
            cores: granted.cores.max(1),
            memory: granted.memory.div_ceil(MEBIBYTE).max(1),
            walltime: granted.walltime.max(60.0) as u64,
            gpus: granted.gpus,
            at_once: granted.at_once.max(1),
            without: Vec::new(),
        }
    }

    /// Its name, which is that of a folder.
    pub fn name(&self) -> String {
        let Self {
            cores,
            memory,
            walltime,
            gpus,
            at_once,
            without,
        } = self;
        let mut name = format!("{cores}c-{memory}M-{walltime}s-{gpus}g-x{at_once}");
        if !without.is_empty() {
            let hash = blake3::hash(without.join(",").as_bytes()).to_hex();
            name += &format!("-without-{}", &hash[..8]);
        }
        name
    }

    /// Cores of the allocation.
    pub fn all_cores(&self) -> u32 {
        self.cores.saturating_mul(self.at_once)
    }

    /// Memory of the allocation (MiB).
    pub fn all_memory(&self) -> u64 {
        self.memory
            .saturating_mul(u64::from(self.at_once))
            .saturating_add(OWN_MEMORY)
    }

    /// Memory of one step (bytes).
    pub fn memory_bytes(&self) -> u64 {
        self.memory.saturating_mul(MEBIBYTE)
    }

    /// The same with twice the memory for a step. Where a node has not that much for all steps at once, fewer run at once.
    pub fn with_more_memory(&self, limits: &Limits) -> Option<Self> {
        let mut more = Self {
            memory: self.memory.saturating_mul(2),
            ..self.clone()
        };
        while limits.memory.is_some_and(|most| more.all_memory() > most) {
            match more.at_once {
                1 => return None,
                n => more.at_once = n - 1,
            }
        }
        Some(more)
    }

    /// In words.
    pub fn text(&self) -> String {
        let gpus = match self.gpus {
            0 => String::new(),
            n => format!(", {n} GPU{}", if n == 1 { "" } else { "s" }),
        };
        format!(
            "{} cores, {} MiB{gpus}, {} for {} step{} at a time",
            self.all_cores(),
            self.all_memory(),
            clock(self.walltime),
            self.at_once,
            if self.at_once == 1 { "" } else { "s" }
        )
    }
}

/// What a step is taken to need (s) before one has ended.
pub const GUESS: f64 = 60.0;
/// Work (s) that is worth an allocation.
const WORTH: f64 = 600.0;

/// How many allocations of a shape there should be for so many steps, of which each takes so long (s): each with work for some minutes.
pub fn allocations(shape: &Shape, open: usize, each: f64, most_steps: u32) -> usize {
    let worth = WORTH.min(shape.walltime as f64 / 2.0);
    let at_once = f64::from(shape.at_once);
    let most = f64::from(most_steps).max(1.0);
    let steps = (worth * at_once / each.max(1e-3)).clamp(at_once.min(most), most);
    ((open as f64 / steps).ceil() as usize).max(1)
}

/// A time (s) as Slurm takes it: `days-hours:minutes:seconds`.
pub fn clock(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    format!(
        "{days}-{:02}:{:02}:{:02}",
        rest / 3600,
        rest / 60 % 60,
        rest % 60
    )
}

/// Why the cluster can never give an allocation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Too long.
    #[error(
        "an allocation for '{plugin}' asks for {given} of wall-clock time, and the partition '{partition}' gives at most {most}; lower `walltime` in the profile"
    )]
    Walltime {
        /// Whose steps it is for.
        plugin: String,
        /// Asked for.
        given: String,
        /// The partition.
        partition: String,
        /// Its limit.
        most: String,
    },
    /// More cores than a node has.
    #[error(
        "an allocation for '{plugin}' asks for {given} cores ({at_once} steps at a time), and a node of the partition '{partition}' has at most {most}; lower `cores` or `at_once` in the profile"
    )]
    Cores {
        /// Whose steps it is for.
        plugin: String,
        /// Asked for.
        given: u32,
        /// Steps at a time.
        at_once: u32,
        /// The partition.
        partition: String,
        /// What the largest node has.
        most: u32,
    },
    /// More memory than a node has.
    #[error(
        "an allocation for '{plugin}' asks for {given} MiB of memory ({at_once} steps at a time), and a node of the partition '{partition}' gives at most {most} MiB; lower `memory` or `at_once` in the profile, or `resources: {{memory: ..}}` of the step"
    )]
    Memory {
        /// Whose steps it is for.
        plugin: String,
        /// Asked for (MiB).
        given: u64,
        /// Steps at a time.
        at_once: u32,
        /// The partition.
        partition: String,
        /// What the largest node gives (MiB).
        most: u64,
    },
    /// GPUs where there are none.
    #[error(
        "an allocation for '{plugin}' asks for {given} GPUs, and no node of the partition '{partition}' has any; take `gpus` out of the profile, or name another partition"
    )]
    Gpus {
        /// Whose steps it is for.
        plugin: String,
        /// Asked for.
        given: u32,
        /// The partition.
        partition: String,
    },
    /// It would be told to stop when it has hardly begun.
    #[error(
        "an allocation for '{plugin}' has {walltime} of wall-clock time, and its steps are told to stop {grace} s before the end; let `grace` be at most half of `walltime`"
    )]
    Grace {
        /// Whose steps it is for.
        plugin: String,
        /// Asked for.
        walltime: String,
        /// As the profile says (s).
        grace: f64,
    },
}

/// Why an allocation of this shape is never given; `None` when it may be. What the cluster does not tell of its limits refuses nothing.
pub fn refusal(shape: &Shape, plugin: &str, profile: &Profile, limits: &Limits) -> Option<Refusal> {
    let plugin = plugin.to_owned();
    let partition = limits.partition.clone();
    if profile.grace.si() * 2.0 > shape.walltime as f64 {
        let (walltime, grace) = (clock(shape.walltime), profile.grace.si());
        return Some(Refusal::Grace {
            plugin,
            walltime,
            grace,
        });
    }
    if let Some(most) = limits.seconds.filter(|most| shape.walltime > *most) {
        return Some(Refusal::Walltime {
            plugin,
            given: clock(shape.walltime),
            partition,
            most: clock(most),
        });
    }
    let at_once = shape.at_once;
    if let Some(most) = limits.cores.filter(|most| shape.all_cores() > *most) {
        let given = shape.all_cores();
        return Some(Refusal::Cores {
            plugin,
            given,
            at_once,
            partition,
            most,
        });
    }
    if let Some(most) = limits.memory.filter(|most| shape.all_memory() > *most) {
        let given = shape.all_memory();
        return Some(Refusal::Memory {
            plugin,
            given,
            at_once,
            partition,
            most,
        });
    }
    let given = shape.gpus;
    (given > 0 && limits.gpus == Some(false)).then_some(Refusal::Gpus {
        plugin,
        given,
        partition,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(cores: u32, memory: u64, walltime: u64) -> Shape {
        Shape {
            cores,
            memory,
            walltime,
            gpus: 0,
            at_once: 2,
            without: Vec::new(),
        }
    }

    fn limits() -> Limits {
        Limits {
            partition: "debug".into(),
            seconds: Some(3600),
            cores: Some(4),
            memory: Some(4000),
            gpus: Some(false),
            array: Some(1001),
        }
    }

    #[test]
    fn what_never_fits_is_told_and_what_fits_is_not() {
        let profile = Profile::default();
        let of = |s: &Shape| refusal(s, "forming", &profile, &limits());
        assert_eq!(of(&shape(2, 1000, 3600)), None);
        assert!(matches!(
            of(&shape(3, 1000, 3600)),
            Some(Refusal::Cores { given: 6, .. })
        ));
        assert!(matches!(
            of(&shape(2, 2000, 3600)),
            Some(Refusal::Memory { given: 4064, .. })
        ));
        assert!(matches!(
            of(&shape(2, 1000, 3601)),
            Some(Refusal::Walltime { .. })
        ));
        assert!(matches!(
            of(&shape(2, 1000, 200)),
            Some(Refusal::Grace { .. })
        ));
        let gpu = Shape {
            gpus: 1,
            ..shape(1, 10, 3600)
        };
        assert!(matches!(of(&gpu), Some(Refusal::Gpus { .. })));
        let unknown = refusal(
            &shape(300, 1 << 30, 3600),
            "x",
            &profile,
            &Limits::default(),
        );
        assert_eq!(unknown, None, "a silent cluster refuses nothing");
    }

    #[test]
    fn more_memory_is_for_fewer_steps_at_once_where_a_node_has_no_more() {
        let more = shape(1, 1500, 60).with_more_memory(&limits()).unwrap();
        assert_eq!((more.memory, more.at_once), (3000, 1));
        assert_eq!(more.with_more_memory(&limits()), None);
    }

    #[test]
    fn short_steps_share_an_allocation_and_long_ones_do_not() {
        let shape = shape(1, 100, 7200);
        assert_eq!(allocations(&shape, 200, 0.1, 1000), 1);
        assert_eq!(allocations(&shape, 200, GUESS, 1000), 10);
        assert_eq!(allocations(&shape, 200, 3600.0, 1000), 100, "two at a time");
        assert_eq!(allocations(&shape, 200, 0.1, 50), 4);
    }

    #[test]
    fn a_time_is_written_as_slurm_reads_it() {
        assert_eq!(clock(60), "0-00:01:00");
        assert_eq!(clock(93_784), "1-02:03:04");
    }
}
