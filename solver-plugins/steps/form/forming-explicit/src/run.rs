//! The time loop: frames, ledger, step control, health.

use crate::absurd;
use crate::assembly::StackSheet;
pub use crate::course::Course;
use crate::diagnosis;
use crate::late::{self, Beginning};
use crate::penetration::{PenetrationPeak, keep_largest};
use crate::press::PressLoad;
use crate::process::Load;
use crate::symmetry::MirroredBody;
use crate::watch::{PairDepth, Watch};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::component::ElementField;
use plyflow_mechanics::contact::{ContactEnergy, OpenPlate, RigidContact, RigidSurface};
use plyflow_mechanics::energy::{EnergyHealth, Ledger, SheetEnergy, judge};
use plyflow_mechanics::model::{Clock, Model};
use plyflow_mechanics::vec3::{V, dot, norm};
use plyflow_model::artifact::Zone;
use plyflow_model::scene::Scene;
use plyflow_tooling::{FieldError, ToolMesh};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Ledger entries per frame.
const LEDGER_PER_FRAME: u64 = 10;

/// A sheet as a body of the artifact.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Index in [`Model::sheets`].
    pub sheet: usize,
    /// `[m]` cells in mesh-local numbers, of the whole body.
    pub cells: Vec<[u32; 4]>,
    /// Where mirror planes bound what is computed: the whole, of which that is the beginning.
    pub mirrored: Option<MirroredBody>,
    /// Quality of a mesh that follows an outline.
    pub quality: Option<plyflow_blank::Quality>,
}

impl Body {
    /// The body of stack sheet `sheet`, number `index` of the model.
    pub fn new(sheet: &StackSheet, index: usize, cells: Vec<[u32; 4]>) -> Self {
        Self {
            name: sheet.scene.name.clone(),
            sheet: index,
            cells,
            mirrored: None,
            quality: None,
        }
    }
}

/// A rigid part besides the tool, as a body of the artifact.
#[derive(Debug, Clone)]
pub struct RigidBody {
    /// Name; contacts with it begin with the name and a slash.
    pub name: String,
    /// Points at the start (m).
    pub points: Vec<V>,
    /// Quads.
    pub cells: Vec<[u32; 4]>,
    /// What they show.
    pub plate: OpenPlate,
}

impl Forming {
    /// By how much (m) what contacts see of a rigid part differs at most from its triangles; none of a part that is a plane.
    pub fn field_error(&self, part: &str) -> f64 {
        let of = self.field_errors.iter().find(|(name, _)| *name == part);
        of.map_or(0.0, |(_, e)| e.largest)
    }
}

impl RigidBody {
    /// The largest difference of its cells, cut along their diagonals, from a plate: at the cells' middles, and those of their sides.
    pub fn error_against(&self, plate: &OpenPlate) -> FieldError {
        let corner = |n: u32| self.points[n as usize];
        let middle = |of: &[V]| -> V {
            std::array::from_fn(|k| of.iter().map(|p| p[k]).sum::<f64>() / of.len() as f64)
        };
        let mut worst = FieldError::default();
        for cell in &self.cells {
            let c = cell.map(corner);
            let sides = (0..4).map(|k| middle(&[c[k], c[(k + 1) % 4]]));
            let diagonals = [middle(&[c[0], c[2]]), middle(&[c[1], c[3]])];
            for at in sides.chain(diagonals) {
                let largest = plate.distance(at).0.abs();
                worst = worst.or(FieldError { largest, at });
            }
        }
        worst
    }

    /// The face of a plate out to a radius that covers `reach` (m), its rounding, and as much of the wall again.
    pub fn plate(name: &str, plate: &OpenPlate, reach: f64) -> Self {
        // Chords of 0.01 mm for what presses have: openings of 70 mm, roundings of 10 mm.
        const AROUND: usize = 192;
        const ALONG: usize = 16;
        let a = plate.opening + plate.edge;
        let mut profile = vec![[1.05 * reach.max(a), 0.0]];
        for i in 0..=ALONG {
            let (s, c) = (std::f64::consts::FRAC_PI_2 * i as f64 / ALONG as f64).fixed_sin_cos();
            profile.push([a - plate.edge * s, plate.edge * (1.0 - c)]);
        }
        profile.push([plate.opening, 2.0 * plate.edge]);
        let mut points = Vec::with_capacity(profile.len() * AROUND);
        for [r, y] in &profile {
            for k in 0..AROUND {
                let (s, c) = (std::f64::consts::TAU * k as f64 / AROUND as f64).fixed_sin_cos();
                points.push([r * c, r * s, plate.height + plate.side * y]);
            }
        }
        let node = |i: usize, k: usize| (i * AROUND + k % AROUND) as u32;
        let cells = (0..profile.len() - 1)
            .flat_map(|i| (0..AROUND).map(move |k| (i, k)))
            .map(|(i, k)| {
                [
                    node(i, k),
                    node(i, k + 1),
                    node(i + 1, k + 1),
                    node(i + 1, k),
                ]
            })
            .collect();
        Self {
            name: name.into(),
            points,
            cells,
            plate: *plate,
        }
    }
}

/// What controls the steps of a run, and when it is given up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Control {
    /// Frames after the first.
    pub frames: usize,
    /// Wanted step (s).
    pub target_step: f64,
    /// Share of the critical step that is used.
    pub safety: f64,
    /// Kinetic over internal energy above which the run is marked.
    pub kinetic_bound: f64,
    /// Energy unaccounted for over the largest work so far beyond which the run stops.
    pub drift_bound: f64,
}

/// A forming run, ready to go.
pub struct Forming {
    /// The model.
    pub model: Model,
    /// Its loads.
    pub load: Load,
    /// The stack, bottom to top.
    pub stack: Vec<StackSheet>,
    /// Bodies of the artifact, bottom to top.
    pub bodies: Vec<Body>,
    /// `[n]` points at the start (m).
    pub reference: Arc<[V]>,
    /// The tool.
    pub tool: ToolMesh,
    /// What else is rigid, to be looked at.
    pub rigid: Vec<RigidBody>,
    /// By rigid part ("tool", "die", "holder"): by how much (m) and where what contacts see differs most from the triangles that are
    /// written of it.
    pub field_errors: Vec<(&'static str, FieldError)>,
    /// What the user should know of the tool.
    pub tool_warnings: Vec<String>,
    /// The zone of a local run.
    pub zone: Option<Zone>,
    /// Where a run that begins late begins.
    pub(crate) start: Option<Beginning>,
    /// Edge of the plies' elements (m).
    pub element_size: f64,
}

/// One line of the history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HistoryRow {
    /// Time (s).
    pub time: f64,
    /// Step that brought it there (s).
    pub time_step: f64,
    /// Critical step of the elements at the last frame (s), of which that is at most the share `step_safety`.
    pub critical_step: f64,
    /// Energies (J).
    pub ledger: Ledger,
    /// Cavity pressure (Pa).
    pub cavity: f64,
    /// Bag pressure (Pa).
    pub bag: f64,
    /// Frame height (m); of a press's punch over its end.
    pub frame: f64,
    /// Force of a press's punch on the plies (N).
    pub punch_force: f64,
    /// Way of a press's holder towards the die (m).
    pub holder_travel: f64,
    /// By sheet of the model.
    pub sheets: Vec<SheetEnergy>,
    /// By interface, in the order of [`Model::interface_energies`].
    pub interfaces: Vec<ContactEnergy>,
    /// How deep (m) bodies are in each other, by pair, in the order of [`Watch::pairs`].
    pub depths: Vec<f64>,
}

/// What came of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The history.
    pub history: Vec<HistoryRow>,
    /// Its health.
    pub health: EnergyHealth,
    /// Steps done.
    pub cycles: u64,
    /// Smallest step used (s).
    pub smallest_step: f64,
    /// Of a run that begins late: how far (m) nodes of plies went there by themselves, 99.9 % quantile.
    pub start_shift: Option<f64>,
    /// Largest penetrations over all frames, in the order of [`Forming::penetrations`].
    pub peaks: Vec<PenetrationPeak>,
    /// What the watch found.
    pub depths: Vec<PairDepth>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Who follows a run.
pub trait Observer {
    /// A frame, with the model's fields of that moment.
    ///
    /// # Errors
    /// Stops the run.
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), plyflow_sdk::StepError>;
    /// Called often; may stop the run.
    ///
    /// # Errors
    /// Stops the run.
    fn tick(
        &mut self,
        forming: &Forming,
        energies: &Ledger,
        end: f64,
    ) -> Result<(), plyflow_sdk::StepError>;
    /// Called often while a run that begins late finds its balance; may stop the run.
    ///
    /// # Errors
    /// Stops the run.
    fn settling(&mut self, _forming: &Forming) -> Result<(), plyflow_sdk::StepError> {
        Ok(())
    }
    /// Called before anything else: may put a run at its start to where an earlier attempt was.
    ///
    /// # Errors
    /// Stops the run.
    fn resume(
        &mut self,
        _forming: &mut Forming,
        _course: &mut Course,
    ) -> Result<(), plyflow_sdk::StepError> {
        Ok(())
    }
    /// Told when the step has halved since the start, or since it was told last.
    fn slower(&mut self, _what: &str) {}
    /// Called between two frames, where a run can be taken up again.
    fn between_frames(&mut self, _forming: &mut Forming, _course: &mut Course) {}
}

impl Forming {
    /// Positions (m) of a body's points now.
    pub fn points(&self, body: &Body) -> Vec<V> {
        self.whole_points(body, self.model.x())
    }

    /// Reference points (m) of a body.
    pub fn reference_points(&self, body: &Body) -> Vec<V> {
        self.whole_points(body, &self.reference)
    }

    fn whole_points(&self, body: &Body, x: &[V]) -> Vec<V> {
        let nodes = &self.model.sheets()[body.sheet].nodes;
        let part: Vec<V> = nodes.iter().map(|n| x[*n as usize]).collect();
        match &body.mirrored {
            Some(m) => m.whole.points(&part),
            None => part,
        }
    }

    /// Values of a field of a body's elements, which have the fields `all`. Needs a step with fields.
    pub fn field(&self, body: &Body, f: &ElementField, all: &[ElementField]) -> Vec<f64> {
        let of = |f: &ElementField| {
            if f.patch {
                self.model.patch_field(body.sheet, f.row)
            } else {
                self.model.mixed_cell_field(body.sheet, f.row, f.elsewhere)
            }
        };
        match &body.mirrored {
            Some(m) => m.field(f, all, of),
            None => of(f),
        }
    }

    /// How often the whole holds what is computed: 1, or with mirror planes 2 or 4.
    pub fn copies(&self) -> f64 {
        self.model.planes().copies() as f64
    }

    /// Where the part of that name has moved (m).
    pub fn shift(&self, part: &str) -> V {
        let of = |c: &&RigidContact| c.name.split('/').next() == Some(part);
        let found = self.model.rigid_contacts().iter().find(of);
        found.map_or([0.0; 3], |c| c.motion.shift)
    }

    /// What changes: the model, and what its loads remember.
    ///
    /// # Errors
    /// When the bytes cannot be written, or are not those of this model.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        self.model.archive(a)?;
        self.load.archive(a)
    }

    fn row(&self, ledger: Ledger, course: &Course) -> HistoryRow {
        let m = &self.model;
        // Of the whole.
        let n = self.copies();
        HistoryRow {
            time: m.time(),
            time_step: m.dt(),
            critical_step: course.critical_step,
            ledger: ledger.times(n),
            cavity: m.pressures().below,
            bag: m.pressures().above,
            frame: self.load.frame_height(m.time()),
            punch_force: n * self.load.press().map_or(0.0, |p| p.punch_force(m)),
            holder_travel: self.load.press().map_or(0.0, PressLoad::holder_travel),
            sheets: m.sheet_energies().iter().map(|e| e.times(n)).collect(),
            interfaces: m.interface_energies().map(|(_, e)| e.times(n)).collect(),
            depths: course.watched.now.iter().map(|d| d.depth).collect(),
        }
    }

    /// Runs to the end of the process with `frames` frames after the first. The step is a whole fraction
    /// of the time between frames, chosen anew at each frame from the elements' critical step.
    ///
    /// # Errors
    /// When the run becomes unstable, its ledger opens beyond a bound, a component fails, or the observer stops it.
    pub fn run(
        &mut self,
        control: &Control,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, plyflow_sdk::StepError> {
        let (begin, end) = (self.load.start(), self.load.duration());
        let interval = (end - begin) / control.frames as f64;
        let mut course = Course::default();
        observer.resume(self, &mut course)?;
        let mut is_late = false;
        if course.history.is_empty() {
            course.start_shift = late::begin(self, control.target_step, control.safety, observer)?;
            is_late = course.start_shift.is_some();
        }
        let mut watch = Watch::new(self);
        for frame in course.frame..control.frames {
            if frame > course.frame {
                course.frame = frame;
                observer.between_frames(self, &mut course);
            }
            let steps = self.choose_step(control, interval, &mut course)?;
            if let Some(known) = course.shorter_steps(self.model.dt()) {
                observer.slower(&diagnosis::slower(self, known));
            }
            let start = begin + interval * frame as f64;
            let is_late = std::mem::take(&mut is_late);
            let course = &mut course;
            self.run_frame(
                control,
                [start, end],
                steps,
                is_late,
                course,
                &mut watch,
                observer,
            )?;
        }
        self.load.apply(&mut self.model, end);
        self.model.step_from(end, true).map_err(|e| e.to_string())?;
        observer.frame(self, end)?;
        keep_largest(&mut course.peaks, &self.penetrations(), end);
        self.look(&mut watch, &mut course, true)?;
        if let Some(what) = absurd::off_the_tool(self, &watch) {
            return Err(what.into());
        }
        let last = self.row(self.model.energies(), &course);
        course.history.push(last);
        let depths = watch.depths(&course.watched);
        Ok(self.outcome(course, depths, control.kinetic_bound))
    }

    /// Looks at what is in what.
    fn look(
        &self,
        watch: &mut Watch,
        course: &mut Course,
        last: bool,
    ) -> Result<(), plyflow_sdk::StepError> {
        watch.look(self, &mut course.watched, last);
        match watch.gone_through(&course.watched, self) {
            Some(what) => Err(what.into()),
            None => Ok(()),
        }
    }

    /// Sets the step for the next frame, a whole fraction of `interval` (s), and gives their number.
    fn choose_step(
        &mut self,
        control: &Control,
        interval: f64,
        course: &mut Course,
    ) -> Result<u64, plyflow_sdk::StepError> {
        let critical = self.model.critical_step().map_err(|e| e.to_string())?;
        let wanted = control.target_step.min(control.safety * critical);
        if wanted < 0.02 * control.target_step {
            let what = format!(
                "the critical step has fallen to {critical:.3e} s, below 2 % of the wanted one"
            );
            return Err(diagnosis::of(self, &course.history, &what).into());
        }
        let steps = (interval / wanted).ceil().max(1.0) as u64;
        self.model.set_step(interval / steps as f64);
        course.smallest_step = course.smallest_step.min(self.model.dt());
        course.critical_step = critical;
        Ok(steps)
    }

    /// The `steps` from one frame, at `start` (s), to the next. `end`: of the whole run (s). `is_late`: whether a run that begins late does so here.
    fn run_frame(
        &mut self,
        control: &Control,
        [start, end]: [f64; 2],
        steps: u64,
        is_late: bool,
        course: &mut Course,
        watch: &mut Watch,
        observer: &mut dyn Observer,
    ) -> Result<(), plyflow_sdk::StepError> {
        for k in 0..steps {
            // Times from the count, not from a sum: frames fall on the same instants in every run.
            let at = start + self.model.dt() * k as f64;
            let clock = Clock::of_step(self.model.cycle());
            self.load.apply(&mut self.model, at);
            self.model.count_loads(clock);
            match self.model.step_from(at, k == 0) {
                Ok(()) => {}
                // The diagnosis has its own cause and remedy.
                Err(MechanicsError::Unstable { cycle, what, .. }) => {
                    let what = format!("the run became unstable in cycle {cycle}: {what}");
                    return Err(diagnosis::of(self, &course.history, &what).into());
                }
                Err(e) => return Err(e.to_string().into()),
            }
            if k == 0 {
                if is_late {
                    // What brought it here was work.
                    self.model.count_drift_as_work();
                }
                // Fields belong to the positions before the step; its motion is far below output
                // precision.
                observer.frame(self, start)?;
                keep_largest(&mut course.peaks, &self.penetrations(), start);
            }
            if k % (steps / LEDGER_PER_FRAME).max(1) == 0 {
                let energies = self.model.energies();
                self.look(watch, course, false)?;
                let row = self.row(energies, course);
                course.history.push(row);
                if let Some(what) =
                    diagnosis::open_ledger(&course.history, end, control.drift_bound)
                        .or_else(|| absurd::flies(&course.history, [self.load.start(), end]))
                {
                    return Err(diagnosis::of(self, &course.history, &what).into());
                }
                observer.tick(self, &energies, end)?;
            }
        }
        Ok(())
    }

    fn outcome(&self, course: Course, depths: Vec<PairDepth>, kinetic_bound: f64) -> Outcome {
        let Course {
            history,
            smallest_step,
            start_shift,
            peaks,
            ..
        } = course;
        let ledgers: Vec<Ledger> = history.iter().map(|r| r.ledger).collect();
        let health = judge(&ledgers);
        let mut warnings = warnings(&health, kinetic_bound);
        warnings.extend(start_shift.and_then(late::too_late));
        Outcome {
            history,
            health,
            cycles: self.model.cycle(),
            smallest_step,
            start_shift,
            peaks,
            depths,
            warnings,
        }
    }

    /// Pressure (Pa) on the face of each of a body's points that looks to the tool.
    pub fn contact_pressure(&self, body: &Body) -> Vec<f64> {
        let m = &self.model;
        let mut force = vec![0.0; m.x().len()];
        // The die of a press lies on the other face, and a mirror plane beside the sheet.
        let facing =
            |c: &&RigidContact| !c.name.starts_with("die/") && !c.name.starts_with("symmetry_");
        for c in m.rigid_contacts().iter().filter(facing) {
            for i in &c.items {
                force[i.node as usize] += f64::from(i.normal_force);
            }
        }
        for c in m.sheet_contacts() {
            for i in c.items.iter().filter(|i| i.active) {
                if c.side > 0.0 {
                    force[i.node as usize] += i.normal_force;
                } else {
                    for (w, n) in i.weights().iter().zip(m.cells()[i.cell as usize]) {
                        force[n as usize] += w * i.normal_force;
                    }
                }
            }
        }
        for i in m.self_contacts().iter().flat_map(|c| &c.items) {
            let slave = &i.slave;
            if !slave.active {
                continue;
            }
            // The slave's face that looks to the tool is pressed from there, and so is the master's, or neither.
            if dot(slave.force, m.normals()[slave.node as usize]) > 0.0 {
                force[slave.node as usize] += slave.normal_force;
            }
            if i.side < 0.0 {
                for (w, n) in slave.weights().iter().zip(m.cells()[slave.cell as usize]) {
                    force[n as usize] += w * slave.normal_force;
                }
            }
        }
        let (nodes, areas) = (&m.sheets()[body.sheet].nodes, m.node_areas(body.sheet));
        let pressure = |(n, area): (&u32, &V)| force[*n as usize] / norm(*area).max(1e-12);
        let part: Vec<f64> = nodes.iter().zip(&areas).map(pressure).collect();
        match &body.mirrored {
            Some(b) => b.whole.at_nodes(|n, _| part[n]),
            None => part,
        }
    }

    /// What to say when plies have touched themselves and the scene does not tell how they rub.
    pub fn frictionless_folds(&self, scene: &Scene) -> Option<String> {
        let contacts = self.model.self_contacts().iter().filter(|c| c.touched);
        let touched: Vec<&str> = contacts.map(|c| c.name.as_str()).collect();
        (scene.friction.fabric_fabric.is_none() && !touched.is_empty()).then(|| {
            format!(
                "friction.fabric_fabric: not given, but plies touched themselves ({}) and slid without friction; expected \
                 the coefficient of fabric on fabric",
                touched.join(", ")
            )
        })
    }
}

/// Share of the work from which on the user is told that it is unaccounted for.
const DRIFT: f64 = 0.01;

fn warnings(h: &EnergyHealth, kinetic_bound: f64) -> Vec<String> {
    let mut list = Vec::new();
    if h.peak_kinetic_ratio > kinetic_bound {
        list.push(format!(
            "kinetic energy reached {:.1} % of internal energy (bound {:.1} %): the run is not \
             quasi-static. Use longer process times or less mass scaling",
            100.0 * h.peak_kinetic_ratio,
            100.0 * kinetic_bound
        ));
    }
    if h.peak_drift_ratio > DRIFT {
        list.push(format!(
            "{:.1} % of the external work is unaccounted for: reduce time_step or step_safety",
            100.0 * h.peak_drift_ratio
        ));
    }
    if h.hourglass_ratio > 0.05 {
        list.push(format!(
            "hourglass energy is {:.1} % of internal energy: refine the mesh",
            100.0 * h.hourglass_ratio
        ));
    }
    list
}
