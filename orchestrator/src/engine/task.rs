//! What a worker is told of an instance: its job.

use super::core::{Core, Id};
use super::executor::Task;
use super::session::Session;
use crate::plan::{Ingredients, InputKey, Key};
use crate::store::ENDING;
use camino::Utf8PathBuf;
use plyflow_model::job::{Checkpoints, DATA_MODEL_VERSION, JOB_VERSION, Job, JobInput, LibraryRef};
use plyflow_workflow::resolved::PluginId;

impl Session<'_> {
    /// What a worker is told of an instance that is to start.
    pub(super) fn task(&mut self, id: Id, threads: u32) -> Task {
        let inputs = self.inputs(id);
        let step = &self.workflow.steps[self.core.instances()[id].step];
        self.serial += 1;
        let tmp = self
            .folder
            .tmp()
            .join(format!("{}-{}", std::process::id(), self.serial));
        let place = |end: &str| Utf8PathBuf::from(format!("{tmp}{end}"));
        let (artifact, record) = (place(ENDING), place(".record.json"));
        self.jobs.insert(id, (artifact.clone(), record.clone()));
        let instance = &self.core.instances()[id];
        let label = self.core.label(id);
        let compared = self.options.compare.contains(&instance.step);
        if let Some(key) = instance.key
            && self.options.force.contains(&instance.step)
        {
            self.begin_anew(&label, &key);
        }
        let library = |p: &PluginId| library(p, &self.options.search_path);
        let job = Job {
            version: JOB_VERSION,
            step: step.in_file().to_owned(),
            item: instance.item.clone(),
            key: instance.key.map(|k| k.hex()).unwrap_or_default(),
            plugin: library(&step.plugin),
            components: step.components.iter().map(library).collect(),
            search_path: self.options.search_path.clone(),
            parameters: step.parameters.clone_value(),
            inputs,
            output_kind: step.output_kind.clone(),
            collection: step.collection,
            threads,
            memory_limit: match step.resources.memory {
                0 => self.options.limits.memory_of(threads),
                stated => stated,
            },
            artifact,
            record,
            scratch: place(".scratch"),
            // What is compared is made from the start.
            checkpoints: (instance.key).filter(|_| !compared).map(|key| Checkpoints {
                folder: self.folder.checkpoints(&label, &key),
                interval: self.options.checkpoint_interval,
            }),
            provenance: self.provenance(id),
        };
        let log = self.folder.log(&label);
        // A log of an earlier attempt must not pass for this one's.
        let _ = std::fs::remove_file(&log);
        Task {
            id,
            job,
            time_limit: step.resources.time_limit,
            log,
        }
    }

    /// What arrives at an instance, with what it cost.
    fn inputs(&mut self, id: Id) -> Vec<JobInput> {
        let givers = self.core.instances()[id].inputs.clone();
        let step = &self.workflow.steps[self.core.instances()[id].step];
        let mut inputs = Vec::with_capacity(givers.len());
        for (wire, giver) in givers {
            let cost = self.cost(giver);
            let given = &self.core.instances()[giver];
            let from = &self.workflow.steps[given.step];
            inputs.push(JobInput {
                port: step.inputs[wire].port.clone(),
                step: from.in_file().to_owned(),
                kind: from.output_kind.clone(),
                item: given.item.clone(),
                artifact: given
                    .key
                    .map(|k| self.store.artifact(&k))
                    .unwrap_or_default(),
                cost,
            });
        }
        inputs
    }

    /// To run again means from the start: but a forced run that was stopped goes on where it was.
    fn begin_anew(&self, label: &str, key: &Key) {
        let forced = self.folder.forced(label, key);
        if !forced.exists() {
            let checkpoints = self.folder.checkpoints(label, key);
            let _ = std::fs::remove_dir_all(&checkpoints);
            let _ = (
                forced.parent().map(std::fs::create_dir_all),
                std::fs::write(&forced, ""),
            );
        }
    }

    /// What the artifact says about its own making; only what its key also holds.
    fn provenance(&self, id: Id) -> serde_json::Value {
        let instance = &self.core.instances()[id];
        let made_by = Ingredients::of(&self.workflow.steps[instance.step]);
        let inputs: Vec<_> = input_keys(&self.core, id)
            .into_iter()
            .map(|i| serde_json::json!({"port": i.port, "step": i.step, "item": i.item, "key": i.key.hex()}))
            .collect();
        serde_json::json!({
            "step": made_by.step,
            "item": instance.item,
            "plugin": made_by.plugin,
            "components": made_by.components,
            "parameters": made_by.parameters,
            "files": made_by.files,
            "inputs": inputs,
            "key": instance.key.map(|k| k.hex()),
            "data_model": DATA_MODEL_VERSION,
        })
    }
}

/// A library as a worker is told of it: one that lies outside of the trusted folders with the bytes that were consented to.
pub(crate) fn library(id: &PluginId, trusted: &[Utf8PathBuf]) -> LibraryRef {
    let folder = id.path.parent();
    let is_trusted = trusted.iter().any(|f| Some(f.as_path()) == folder);
    LibraryRef {
        name: id.name.clone(),
        path: id.path.clone(),
        hash: (!is_trusted).then(|| id.hash.clone()),
    }
}

/// The inputs of an instance as they are in its key.
pub fn input_keys(core: &Core<'_>, id: Id) -> Vec<InputKey> {
    let instance = &core.instances()[id];
    let wires = &core.graph().steps[instance.step].wires;
    let one = |(wire, giver): &(usize, Id)| {
        let given = &core.instances()[*giver];
        Some(InputKey {
            port: wires[*wire].port.clone(),
            step: core.graph().steps[given.step].base.clone(),
            item: given.item.clone(),
            key: given.key?,
        })
    };
    instance.inputs.iter().filter_map(one).collect()
}
