//! The time loop.

use crate::advance::crew::Crew;
use crate::advance::late;
use crate::course::{Course, HistoryRow, Observer, Outcome};
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::judge::{absurd, diagnosis, scale};
use crate::measure::keep_largest;
use crate::request::Control;
use crate::watch::Watch;
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::backend::Stretch;
use plyflow_mechanics::energy::Ledger;
use std::ops::Range;

/// Rows of the history per frame.
const ROWS_PER_FRAME: u64 = 10;

impl Forming {
    /// Runs to the end of the process with `frames` frames after the first. The step is a whole fraction
    /// of the time between frames, chosen anew at each frame from the elements' critical step.
    ///
    /// # Errors
    /// When the run becomes unstable, its ledger opens beyond a bound, a component fails, or the observer stops it.
    pub fn run(&mut self, control: &Control, observer: &mut dyn Observer) -> Result<Outcome> {
        let mut run = Run::start(self, control, observer)?;
        for frame in run.course.frame..control.frames {
            run.between_frames(frame);
            let steps = run.choose_step()?;
            let each = (steps / ROWS_PER_FRAME).max(1);
            // The first step after a frame has its fields; a row follows it, and each some steps later.
            let mut done = 0;
            while done < steps {
                let next = if done == 0 { 1 } else { steps.min(done + each) };
                run.step(frame, done..next)?;
                if done == 0 {
                    run.write_frame(run.time_of(frame))?;
                }
                if (next - 1).is_multiple_of(each) {
                    run.look(false)?;
                    run.write_row()?;
                }
                done = next;
            }
        }
        run.end()
    }
}

/// A run on its way.
struct Run<'a> {
    forming: &'a mut Forming,
    control: &'a Control,
    observer: &'a mut dyn Observer,
    course: Course,
    watch: Watch,
    crew: Crew,
    /// When it begins and when it ends (s).
    span: [f64; 2],
    /// Energy (J) that is too little to judge.
    least: f64,
    /// Whether what has brought it to its late start is still to be counted as work.
    is_late: bool,
}

impl<'a> Run<'a> {
    /// At the beginning of the process, at a late start, or where an earlier attempt was.
    fn start(
        forming: &'a mut Forming,
        control: &'a Control,
        observer: &'a mut dyn Observer,
    ) -> Result<Self> {
        let span = [forming.load.start(), forming.load.duration()];
        let least = scale::too_little(forming);
        let mut course = Course::default();
        observer.resume(forming, &mut course)?;
        let mut is_late = false;
        if course.history.is_empty() {
            course.start_shift = late::begin(forming, control, observer)?;
            is_late = course.start_shift.is_some();
        }
        Ok(Self {
            watch: Watch::new(forming),
            crew: Crew::default(),
            forming,
            control,
            observer,
            course,
            span,
            least,
            is_late,
        })
    }

    /// Time between two frames (s).
    fn interval(&self) -> f64 {
        (self.span[1] - self.span[0]) / self.control.frames as f64
    }

    /// When a frame is (s).
    fn time_of(&self, frame: usize) -> f64 {
        self.span[0] + self.interval() * frame as f64
    }

    /// Where a run can be taken up again.
    fn between_frames(&mut self, frame: usize) {
        if frame > self.course.frame {
            self.course.frame = frame;
            (self.observer).between_frames(self.forming, &mut self.course);
        }
    }

    /// Sets the step for the next frame, a whole fraction of the interval, and gives their number.
    fn choose_step(&mut self) -> Result<u64> {
        let critical = self.forming.model.critical_step()?;
        let wanted = (self.control.target_step).min(self.control.safety * critical);
        if wanted < 0.02 * self.control.target_step {
            let what = format!(
                "the critical step has fallen to {critical:.3e} s, below 2 % of the wanted one"
            );
            return Err(self.stopped(&what));
        }
        let steps = (self.interval() / wanted).ceil().max(1.0) as u64;
        let step = self.interval() / steps as f64;
        self.forming.model.set_step(step);
        self.course.smallest_step = self.course.smallest_step.min(step);
        self.course.critical_step = critical;
        if let Some(known) = self.course.shorter_steps(step) {
            (self.observer).slower(&diagnosis::slower(self.forming, known));
        }
        Ok(steps)
    }

    /// Steps after a frame, by number; with the first one, fields.
    fn step(&mut self, frame: usize, steps: Range<u64>) -> Result<()> {
        let fields = steps.start == 0;
        let start = self.time_of(frame);
        if let Some(threads) = self.observer.threads() {
            self.crew.change(threads);
        }
        let (forming, stretch) = (&mut *self.forming, Stretch { start, steps });
        match self.crew.work(|| forming.go(&stretch, fields)) {
            Ok(()) => {}
            // The diagnosis has its own cause and remedy.
            Err(MechanicsError::Unstable { cycle, what, .. }) => {
                let what = format!("the run became unstable in cycle {cycle}: {what}");
                return Err(self.stopped(&what));
            }
            Err(e) => return Err(e.into()),
        }
        if std::mem::take(&mut self.is_late) {
            // What brought it here was work.
            self.forming.model.count_drift_as_work();
        }
        Ok(())
    }

    /// Shows a frame. Fields belong to the positions before the step; its motion is far below output precision.
    fn write_frame(&mut self, time: f64) -> Result<()> {
        self.observer.frame(self.forming, time)?;
        keep_largest(&mut self.course.peaks, &self.forming.penetrations(), time);
        Ok(())
    }

    /// Looks at what is in what. `last`: at the end of the run.
    fn look(&mut self, last: bool) -> Result<()> {
        let watched = &mut self.course.watched;
        self.watch.look(self.forming, watched, last);
        match self.watch.gone_through(watched, self.forming) {
            Some(what) => Err(FormingError::Run(what)),
            None => Ok(()),
        }
    }

    /// A row of the history, if the run may go on after it.
    fn write_row(&mut self) -> Result<()> {
        let energies = self.add_row();
        let (history, end) = (&self.course.history, self.span[1]);
        let least = self.least;
        let open = diagnosis::open_ledger(history, end, self.control.drift_bound, least);
        if let Some(what) = open.or_else(|| absurd::flies(history, self.span, least)) {
            return Err(self.stopped(&what));
        }
        Ok(self.observer.tick(self.forming, &energies, end)?)
    }

    /// Adds a row to the history. Gives the energies of what is computed (J).
    fn add_row(&mut self) -> Ledger {
        let (forming, course) = (&*self.forming, &mut self.course);
        let energies = forming.model.energies();
        let row = HistoryRow::of(forming, energies, course.critical_step, &course.watched);
        course.history.push(row);
        energies
    }

    /// The error of a run that goes wrong: what, where, and why probably.
    fn stopped(&self, what: &str) -> FormingError {
        FormingError::Run(diagnosis::of(self.forming, &self.course.history, what))
    }

    /// The last frame and the last row.
    fn end(mut self) -> Result<Outcome> {
        let end = self.span[1];
        let last = Stretch {
            start: end,
            steps: 0..1,
        };
        self.forming.go(&last, true)?;
        self.write_frame(end)?;
        self.look(true)?;
        if let Some(what) = absurd::off_the_tool(self.forming, &self.watch) {
            return Err(FormingError::Absurd(what));
        }
        self.add_row();
        let depths = self.watch.depths(&self.course.watched);
        let cycles = self.forming.model.cycle();
        let last = self.course.history.last();
        let source = last.and_then(|r| diagnosis::source(self.forming, r));
        let bound = self.control.kinetic_bound;
        let mut outcome = Outcome::of(self.course, depths, cycles, bound, self.least, source);
        let at_end = outcome.health.kinetic_ratio_at_end;
        let moving = diagnosis::still_moving(self.forming, at_end);
        let late = outcome.start_shift.and_then(late::too_late);
        outcome.warnings.extend(moving.into_iter().chain(late));
        Ok(outcome)
    }
}
