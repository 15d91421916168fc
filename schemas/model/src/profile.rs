//! A profile: how steps are given to a cluster's scheduler. It says nothing that a result depends on, so it is in no key.

use crate::units::Time;
use crate::workflow::Memory;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of the format of profiles that this crate reads.
pub const PROFILE_VERSION: u32 = 1;

/// A profile file. An allocation is one job of Slurm; it runs many steps, one after the other and side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Version of the format: 1.
    #[schemars(extend("const" = 1))]
    pub plyflow_profile: u32,
    /// Partition; the cluster's default when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partition: Option<String>,
    /// Account that the time is charged to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub account: Option<String>,
    /// Quality of service.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub qos: Option<String>,
    /// Lines of the shell that come first in an allocation, such as `module load plyflow`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub setup: Vec<String>,
    /// Further words for `sbatch`, such as `--constraint=skylake`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub options: Vec<String>,
    /// What a step gets whose plugin is not named under `plugins`.
    #[serde(default)]
    pub each: Needs,
    /// What steps get by their plugin; what is not given here is as above.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub plugins: IndexMap<String, Needs>,
    /// Most allocations that are queued or run at a time.
    #[serde(default = "most_queued")]
    #[schemars(extend("minimum" = 1, "maximum" = 10_000))]
    pub most_queued: u32,
    /// Most steps that one allocation runs.
    #[serde(default = "most_steps")]
    #[schemars(extend("minimum" = 1))]
    pub most_steps: u32,
    /// How long before its wall-clock time ends an allocation tells its steps to write checkpoints and stop.
    #[serde(default = "grace")]
    #[schemars(extend("x-minimum" = "1 s"))]
    pub grace: Time,
    /// How long an allocation without a step waits for one before it ends.
    #[serde(default = "idle")]
    #[schemars(extend("x-minimum" = "0 s"))]
    pub idle: Time,
    /// How long after it was written a file may be seen by other machines at the latest.
    #[serde(default = "settle")]
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settle: Time,
    /// How long an allocation that Slurm calls running may give no sign of life before it is given up.
    #[serde(default = "silence")]
    #[schemars(extend("x-minimum" = "10 s"))]
    pub silence: Time,
}

/// What a step gets, and the allocation in which it runs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Needs {
    /// Cores of one step that states none itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1, "maximum" = 4096))]
    pub cores: Option<u32>,
    /// Memory of one step that states none itself, such as `4 GiB`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// Wall-clock time of an allocation, such as `2 h`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "1 min"))]
    pub walltime: Option<Time>,
    /// GPUs of one step; with them only one step runs at a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("maximum" = 64))]
    pub gpus: Option<u32>,
    /// Steps that run at the same time in an allocation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1, "maximum" = 4096))]
    pub at_once: Option<u32>,
}

const fn most_queued() -> u32 {
    10
}

const fn most_steps() -> u32 {
    1000
}

const fn grace() -> Time {
    Time(120.0)
}

const fn idle() -> Time {
    Time(60.0)
}

const fn settle() -> Time {
    Time(60.0)
}

const fn silence() -> Time {
    Time(600.0)
}

impl Default for Profile {
    fn default() -> Self {
        Self {
            plyflow_profile: PROFILE_VERSION,
            partition: None,
            account: None,
            qos: None,
            setup: Vec::new(),
            options: Vec::new(),
            each: Needs::default(),
            plugins: IndexMap::new(),
            most_queued: most_queued(),
            most_steps: most_steps(),
            grace: grace(),
            idle: idle(),
            settle: settle(),
            silence: silence(),
        }
    }
}

/// What a step gets when the profile says nothing: one core, 2 GiB, an hour.
const WITHOUT: (u32, Memory, Time) = (1, Memory(2 << 30), Time(3600.0));

/// What a step and its allocation get, all said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Granted {
    /// Cores of one step.
    pub cores: u32,
    /// Memory of one step (bytes).
    pub memory: u64,
    /// Wall-clock time of the allocation (s).
    pub walltime: f64,
    /// GPUs of one step.
    pub gpus: u32,
    /// Steps at the same time.
    pub at_once: u32,
}

impl Profile {
    /// What a step of a plugin gets that states this many cores and bytes itself (0: none).
    #[must_use]
    pub fn granted(&self, plugin: &str, cores: u32, memory: u64) -> Granted {
        let own = self.plugins.get(plugin).copied().unwrap_or_default();
        let each = &self.each;
        let stated = |n: u32| (n > 0).then_some(n);
        let gpus = own.gpus.or(each.gpus).unwrap_or(0);
        let at_once = own.at_once.or(each.at_once).unwrap_or(1);
        let memory = match memory {
            0 => own.memory.or(each.memory).unwrap_or(WITHOUT.1).0,
            stated => stated,
        };
        Granted {
            cores: stated(cores)
                .or(own.cores)
                .or(each.cores)
                .unwrap_or(WITHOUT.0),
            memory,
            walltime: own.walltime.or(each.walltime).unwrap_or(WITHOUT.2).0,
            gpus,
            // Slurm gives all GPUs of an allocation to each of its processes.
            at_once: if gpus > 0 { 1 } else { at_once },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_step_states_comes_before_its_plugin_and_that_before_all() {
        let profile: Profile = serde_json::from_value(serde_json::json!({
            "plyflow_profile": 1, "each": {"cores": 2, "memory": "1 GiB", "at_once": 4},
            "plugins": {"forming": {"cores": 8, "walltime": "2 h", "gpus": 1}}
        }))
        .unwrap();
        let forming = profile.granted("forming", 0, 0);
        assert_eq!((forming.cores, forming.memory), (8, 1 << 30));
        assert_eq!(
            (forming.walltime, forming.gpus, forming.at_once),
            (7200.0, 1, 1)
        );
        let other = profile.granted("detect", 3, 5);
        assert_eq!((other.cores, other.memory, other.at_once), (3, 5, 4));
        assert_eq!(other.walltime, 3600.0);
    }
}
