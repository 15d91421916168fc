//! The graph of the steps of a workflow.

use super::keys::{Ingredients, Key};
use petgraph::Direction;
use petgraph::graph::{DiGraph, NodeIndex};
use plyflow_workflow::resolved::{ResolvedInput, ResolvedStep, ResolvedWorkflow};
use std::collections::{BTreeSet, HashMap};

/// One dimension of a step's fan-out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DimensionPlan {
    /// Step whose collection gives the items.
    pub over: usize,
    /// For each dimension of that step: its position in this step's own dimensions.
    pub prefix: Vec<usize>,
}

/// One wire: which instances of `from` arrive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WirePlan {
    /// Port.
    pub port: String,
    /// Giving step.
    pub from: usize,
    /// For each dimension of the giving step: the receiving step's dimension that it is matched with, or
    /// `None` when it is gathered.
    pub matched: Vec<Option<usize>>,
}

/// One step as the engine sees it.
#[derive(Debug, Clone)]
pub struct StepPlan {
    /// Name.
    pub name: String,
    /// Its name in the file, which keys, plugins and artifacts know: that of all points of a study.
    pub base: String,
    /// Digest of its [`Ingredients`]: of everything in the key that is the same for all instances.
    pub recipe: Key,
    /// Fan-out, outermost first.
    pub dimensions: Vec<DimensionPlan>,
    /// Wires in order.
    pub wires: Vec<WirePlan>,
    /// Steps that fan out over this one.
    pub fanned_by: Vec<usize>,
    /// Whether the artifact is a collection.
    pub collection: bool,
    /// Cores asked for; 0: not stated.
    pub cores: u32,
    /// Bytes asked for; 0: not stated.
    pub memory: u64,
    /// Further attempts after a failure.
    pub retries: u32,
    /// Whether this run wants it (`--until`).
    pub wanted: bool,
}

impl StepPlan {
    /// The plan of a step behind these, which `index` has by their names.
    fn of(
        step: &ResolvedStep,
        recipe: Key,
        before: &[Self],
        index: &HashMap<&str, usize>,
    ) -> Result<Self, PlanError> {
        let find = |name: &str| {
            index.get(name).copied().ok_or_else(|| PlanError::Order {
                step: step.name.clone(),
                other: name.to_owned(),
            })
        };
        let own = step.dimensions.iter().map(|d| find(&d.over));
        let own: Vec<usize> = own.collect::<Result<_, _>>()?;
        let position = |d: &DimensionPlan| own.iter().position(|o| *o == d.over);
        let dimension = |over: &usize| {
            let prefix = before[*over].dimensions.iter().map(position);
            let nesting = || PlanError::Nesting {
                step: step.name.clone(),
                over: before[*over].name.clone(),
            };
            Ok(DimensionPlan {
                over: *over,
                prefix: prefix.collect::<Option<_>>().ok_or_else(nesting)?,
            })
        };
        let dimensions = own.iter().map(dimension).collect::<Result<_, _>>()?;
        let wire = |input: &ResolvedInput| {
            let from = find(&input.from)?;
            Ok(WirePlan {
                port: input.port.clone(),
                from,
                matched: before[from].dimensions.iter().map(position).collect(),
            })
        };
        let wires = step.inputs.iter().map(wire).collect::<Result<_, _>>()?;
        Ok(Self {
            name: step.name.clone(),
            base: step.in_file().to_owned(),
            recipe,
            dimensions,
            wires,
            fanned_by: Vec::new(),
            collection: step.collection,
            cores: step.resources.cores,
            memory: step.resources.memory,
            retries: step.retries,
            wanted: true,
        })
    }
}

/// The graph of a workflow.
#[derive(Debug)]
pub struct Graph {
    /// In topological order, as in the workflow.
    pub steps: Vec<StepPlan>,
    /// What a study bears.
    pub bears: Option<Bears>,
    edges: DiGraph<(), ()>,
}

/// How many points of a study may fail before it is stopped, and what is of which point.
#[derive(Debug)]
pub struct Bears {
    /// So many may.
    pub failures: u32,
    /// Positions of the points that a step is of.
    pub points: Vec<Vec<u32>>,
}

impl Bears {
    fn of(workflow: &ResolvedWorkflow) -> Option<Self> {
        let study = workflow.study.as_ref()?;
        let mut points = vec![Vec::new(); workflow.steps.len()];
        for (p, point) in study.points.iter().enumerate() {
            for step in &point.steps {
                if points[*step].last() != Some(&(p as u32)) {
                    points[*step].push(p as u32);
                }
            }
        }
        Some(Self {
            failures: study.at_most_failures?,
            points,
        })
    }
}

/// A workflow that cannot be planned; found by `plyflow validate` before, so only a defect gets here.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum PlanError {
    /// A wire or dimension names a step that does not come before.
    #[error("step '{step}' uses '{other}', which does not come before it in topological order")]
    Order {
        /// The step.
        step: String,
        /// The other.
        other: String,
    },
    /// A dimension's collection has a dimension that the step lacks.
    #[error("step '{step}' fans out over '{over}' without the fan-out that '{over}' itself has")]
    Nesting {
        /// The step.
        step: String,
        /// The collection.
        over: String,
    },
    /// `--until` names no step.
    #[error("there is no step '{0}' in this workflow")]
    NoStep(String),
}

/// Digests of the ingredients of all steps, in order.
pub fn recipes(workflow: &ResolvedWorkflow) -> Vec<Key> {
    let steps = workflow.steps.iter();
    steps.map(|s| Ingredients::of(s).digest()).collect()
}

impl Graph {
    /// Plans a workflow.
    ///
    /// # Errors
    /// When steps are out of order or a nested fan-out is incomplete.
    pub fn new(workflow: &ResolvedWorkflow) -> Result<Self, PlanError> {
        Self::of_recipes(workflow, recipes(workflow))
    }

    /// As [`Graph::new`], with the [`recipes`] of its steps.
    ///
    /// # Errors
    /// As [`Graph::new`].
    pub fn of_recipes(workflow: &ResolvedWorkflow, recipes: Vec<Key>) -> Result<Self, PlanError> {
        let mut index: HashMap<&str, usize> = HashMap::with_capacity(workflow.steps.len());
        let mut edges = DiGraph::new();
        let mut steps: Vec<StepPlan> = Vec::with_capacity(workflow.steps.len());
        for (at, (step, recipe)) in workflow.steps.iter().zip(recipes).enumerate() {
            edges.add_node(());
            let plan = StepPlan::of(step, recipe, &steps, &index)?;
            let overs = plan.dimensions.iter().map(|d| d.over);
            for giver in overs.clone().chain(plan.wires.iter().map(|w| w.from)) {
                edges.update_edge(NodeIndex::new(giver), NodeIndex::new(at), ());
            }
            for over in overs {
                steps[over].fanned_by.push(at);
            }
            index.insert(&step.name, at);
            steps.push(plan);
        }
        let bears = Bears::of(workflow);
        Ok(Self {
            steps,
            bears,
            edges,
        })
    }

    /// Indices of the steps that a name means: the one of that name, or those of all points of a study.
    pub fn named(&self, name: &str) -> Vec<usize> {
        match self.find(name) {
            Some(at) => vec![at],
            None => (0..self.steps.len())
                .filter(|at| self.steps[*at].base == name)
                .collect(),
        }
    }

    /// Index of a step by name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.steps.iter().position(|s| s.name == name)
    }

    /// Wants only the named steps and what they need.
    ///
    /// # Errors
    /// When a name is none of the steps.
    pub fn restrict(&mut self, names: &[String]) -> Result<(), PlanError> {
        if names.is_empty() {
            return Ok(());
        }
        let mut wanted = BTreeSet::new();
        let mut stack = Vec::new();
        for name in names {
            let named = self.named(name);
            if named.is_empty() {
                return Err(PlanError::NoStep(name.clone()));
            }
            stack.extend(named);
        }
        while let Some(at) = stack.pop() {
            if wanted.insert(at) {
                let up = self
                    .edges
                    .neighbors_directed(NodeIndex::new(at), Direction::Incoming);
                stack.extend(up.map(NodeIndex::index));
            }
        }
        for (at, step) in self.steps.iter_mut().enumerate() {
            step.wanted = wanted.contains(&at);
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use plyflow_workflow::resolved::*;

    /// A step for tests: `dims` as names of collections, wires as (port, from).
    pub(crate) fn step(name: &str, dims: &[&str], wires: &[(&str, &str)]) -> ResolvedStep {
        ResolvedStep {
            name: name.into(),
            base: None,
            role: "test".into(),
            plugin: PluginId {
                name: "p".into(),
                version: "1".into(),
                path: "/p.so".into(),
                hash: "00".into(),
            },
            components: vec![],
            parameters: serde_json::json!({}).into(),
            files: vec![],
            inputs: wires
                .iter()
                .map(|(p, f)| ResolvedInput {
                    port: (*p).into(),
                    from: (*f).into(),
                })
                .collect(),
            dimensions: dims
                .iter()
                .map(|d| Dimension {
                    name: (*d).into(),
                    over: (*d).into(),
                })
                .collect(),
            output_kind: "any".into(),
            collection: true,
            resources: Resources {
                cores: 1,
                memory: 0,
                time_limit: 0.0,
            },
            retries: 0,
        }
    }

    pub(crate) fn workflow(steps: Vec<ResolvedStep>) -> ResolvedWorkflow {
        ResolvedWorkflow {
            name: "test".into(),
            file: "/test.yaml".into(),
            description: None,
            steps,
            expectations: vec![],
            limits: None,
            on_failure: FailurePolicy::KeepGoing,
            study: None,
            confirming: None,
        }
    }

    #[test]
    fn until_keeps_the_step_and_what_it_needs_only() {
        let w = workflow(vec![
            step("a", &[], &[]),
            step("b", &["a"], &[]),
            step("c", &[], &[("in", "b")]),
            step("d", &[], &[("in", "a")]),
        ]);
        let mut g = Graph::new(&w).unwrap();
        g.restrict(&["c".into()]).unwrap();
        let wanted: Vec<bool> = g.steps.iter().map(|s| s.wanted).collect();
        assert_eq!(wanted, [true, true, true, false]);
        assert_eq!(
            g.restrict(&["x".into()]),
            Err(PlanError::NoStep("x".into()))
        );
    }

    #[test]
    fn a_nested_collection_needs_its_outer_dimension_in_the_step() {
        let w = workflow(vec![
            step("a", &[], &[]),
            step("b", &["a"], &[]),
            step("c", &["b"], &[]),
        ]);
        let error = Graph::new(&w).unwrap_err();
        assert_eq!(
            error,
            PlanError::Nesting {
                step: "c".into(),
                over: "b".into()
            }
        );
    }
}
