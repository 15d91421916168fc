//! A run that is stopped and goes on tells the same as one that was not: what the watch has seen is part of its state.

use crate::common::BuiltIn;
use crate::common::scenes::bag;
use plyflow_forming_explicit::{
    Course, Forming, FormingError, Observer, Outcome, Parameters, Watched, build_global,
    depth_attributes, depth_warnings,
};
use plyflow_mechanics::archive::Archive;
use plyflow_mechanics::energy::Ledger;
use plyflow_sdk::StepError;
use serde_json::json;

/// Keeps the state between two frames as bytes, and stops there.
struct Stop {
    before: usize,
    state: Vec<u8>,
}

impl Observer for Stop {
    fn frame(&mut self, _: &Forming, _: f64) -> Result<(), StepError> {
        if self.state.is_empty() {
            Ok(())
        } else {
            Err("stopped".into())
        }
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn between_frames(&mut self, forming: &mut Forming, course: &mut Course) {
        if course.frame == self.before {
            let mut archive = Archive::Save(&mut self.state);
            course.archive(&mut archive).unwrap();
            forming.archive(&mut archive).unwrap();
        }
    }
}

/// Goes on from such a state, with or without what the watch had seen.
struct GoOn {
    state: Vec<u8>,
    forget: bool,
}

impl Observer for GoOn {
    fn frame(&mut self, _: &Forming, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
    fn resume(&mut self, forming: &mut Forming, course: &mut Course) -> Result<(), StepError> {
        let mut archive = Archive::Load(&self.state);
        course.archive(&mut archive).unwrap();
        forming.archive(&mut archive).unwrap();
        assert!(archive.is_at_end());
        if self.forget {
            course.watched = Watched::default();
        }
        Ok(())
    }
}

/// Runs a model that is made anew, as after a kill.
fn run(p: &Parameters, observer: &mut (dyn Observer + Send)) -> Result<Outcome, FormingError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    pool.unwrap().install(|| {
        let mut forming = build_global(p, &BuiltIn).unwrap();
        forming.run(&p.control(), observer)
    })
}

#[test]
fn a_run_that_goes_on_tells_the_depths_histories_and_warnings_of_one_that_was_not_stopped() {
    const FRAMES: usize = 20;
    const STOP: usize = 14;
    let p = bag(2, |p| {
        p["frames"] = json!(FRAMES);
        p["element_size"] = json!(0.01);
        let process = &mut p["scene"]["process"]["double_diaphragm"];
        for (phase, time) in [("bagging", 0.03), ("lowering", 0.04), ("drawing", 0.05)] {
            process[format!("{phase}_time")] = json!(format!("{time} s"));
        }
    });
    let whole = run(&p, &mut crate::common::Silent).unwrap();
    assert!(whole.cycles > 8000, "the watch looks at everything again");
    let end = whole.history.last().unwrap().time;
    let mut stop = Stop {
        before: STOP,
        state: Vec::new(),
    };
    run(&p, &mut stop).expect_err("stopped");
    let stopped_at = end * STOP as f64 / FRAMES as f64;
    let early = |o: &Outcome| {
        let peaks = o.depths.iter().map(|d| d.peak);
        peaks
            .filter(|p| p.deep.depth > 0.0 && p.time < stopped_at)
            .count()
    };
    assert!(
        early(&whole) > 0,
        "nothing was deepest before it was stopped"
    );
    let on = |forget: bool| {
        let state = stop.state.clone();
        run(&p, &mut GoOn { state, forget }).unwrap()
    };
    let taken_up = on(false);
    assert_eq!(taken_up.depths, whole.depths);
    assert_eq!(taken_up.history, whole.history);
    assert_eq!(taken_up.peaks, whole.peaks);
    assert_eq!(taken_up.warnings, whole.warnings);
    assert_eq!(
        depth_warnings(&taken_up.depths),
        depth_warnings(&whole.depths)
    );
    assert_eq!(
        depth_attributes(&taken_up.depths),
        depth_attributes(&whole.depths)
    );
    // So it would be seen here if the state of the watch were lost.
    let forgotten = on(true);
    assert_eq!(early(&forgotten), 0);
    assert_ne!(forgotten.depths, whole.depths);
    // What moves does not hang on who looks.
    let ledgers = |o: &Outcome| o.history.iter().map(|r| r.ledger).collect::<Vec<_>>();
    assert_eq!(ledgers(&forgotten), ledgers(&whole));
}
