//! Zones of a press and of a stamping, cut out of a run of the whole: they go as it does, between parts that move as they do there.

use crate::common::cut::{Film, cut_out};
use crate::common::scenes::{gentle_press, press};
use crate::common::{BuiltIn, Silent};
use crate::stamping::{block, pad, process, stamped, with};
use crate::steered::{steered, table};
use plyflow_forming_explicit::{
    Forming, HistoryRow, LocalInput, Outcome, Parameters, RecordedWay, build_global, build_local,
};
use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_model::artifact;
use serde_json::json;

/// The name of a part, and its way (m) in a row of a history.
type Way = (&'static str, fn(&HistoryRow) -> f64);

/// Frames of a whole, from which cuts are driven.
const FRAMES: usize = 40;

/// A run of the whole.
struct Whole {
    p: Parameters,
    forming: Forming,
    film: Film,
    history: Vec<HistoryRow>,
}

/// Which part of the flat plies a zone has (m).
type Inside = fn(Vec3) -> bool;

/// All of them.
const ALL: Inside = |_| true;

impl Whole {
    fn formed(mut p: Parameters) -> Self {
        p.frames = FRAMES;
        let mut film = Film::default();
        let mut forming = build_global(&p, &BuiltIn).unwrap();
        let history = forming.run(&p.control(), &mut film).unwrap().history;
        Self {
            p,
            forming,
            film,
            history,
        }
    }

    /// Before anything moves: of a zone that is only built.
    fn at_rest(p: Parameters) -> Self {
        let forming = build_global(&p, &BuiltIn).unwrap();
        let points: Vec<Vec<Vec3>> = forming.bodies.iter().map(|b| forming.points(b)).collect();
        let film = Film {
            time: vec![0.0, 0.1],
            points: vec![points; 2],
            ..Film::default()
        };
        let row = |time: &f64| HistoryRow {
            time: *time,
            parts: vec![[0.0; 2]; 6],
            ..HistoryRow::default()
        };
        Self {
            history: film.time.iter().map(row).collect(),
            p,
            forming,
            film,
        }
    }

    /// What drives a zone from the frame `first` on, as `boundary-interpolation` gives it. `ways`: of which parts, and where a row has them.
    fn zone(&self, inside: Inside, first: usize, ways: &[Way]) -> LocalInput {
        let way = |(name, of): &Way| RecordedWay {
            name: (*name).to_owned(),
            time: self.history.iter().map(|r| r.time).collect(),
            way: self.history.iter().map(of).collect(),
        };
        let bodies = 0..self.forming.bodies.len();
        let sheet = |body| cut_out(&self.forming, &self.film, body, &inside, first).0;
        LocalInput {
            time: self.film.time[first..].to_vec(),
            sheets: bodies.map(sheet).filter(|s| !s.cells.is_empty()).collect(),
            cavity: Vec::new(),
            bag: Vec::new(),
            frame: Vec::new(),
            ways: ways.iter().map(way).collect(),
            zone: artifact::Zone::new("A", [-0.1, -0.1, 0.1, 0.1]),
            element_size: self.p.element_size,
            slower: 1.0,
        }
    }

    fn refused(&self, input: LocalInput) -> String {
        let refused = build_local(&self.p, input, &BuiltIn).err();
        refused.expect("refused").to_string()
    }

    fn run(&self, input: LocalInput, threads: usize) -> (Forming, Outcome) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut forming = build_local(&self.p, input, &BuiltIn).unwrap();
            let outcome = forming.run(&self.p.control(), &mut Silent).unwrap();
            assert!(
                outcome.health.peak_drift_ratio < 0.01,
                "{:?}",
                outcome.health
            );
            (forming, outcome)
        })
    }

    /// Largest and mean distance (m) of the nodes of a zone's first ply from where the whole has them.
    fn distances(&self, zone: &Forming, inside: Inside) -> [f64; 2] {
        let (_, nodes) = cut_out(&self.forming, &self.film, 0, &inside, 0);
        let [own, all] = [zone, &self.forming].map(|f| f.points(&f.bodies[0]));
        let ways = own
            .iter()
            .zip(&nodes)
            .map(|(x, n)| norm(sub(*x, all[*n as usize])));
        let ways: Vec<f64> = ways.collect();
        let mean = ways.iter().sum::<f64>() / ways.len() as f64;
        [ways.iter().fold(0.0, |m: f64, w| m.max(*w)), mean]
    }

    /// That the cut has gone where the whole has it, to within what the splines between frames are off.
    fn assert_driven(&self, zone: &Forming, inside: Inside) {
        let (sheet, nodes) = cut_out(&self.forming, &self.film, 0, &inside, 0);
        assert!(sheet.driven.len() > 5 && sheet.driven.len() < nodes.len() / 2);
        let [own, all] = [zone, &self.forming].map(|f| f.points(&f.bodies[0]));
        for k in &sheet.driven {
            let k = *k as usize;
            let off = norm(sub(own[k], all[nodes[k] as usize]));
            assert!(off < 1e-9, "{off} m");
        }
    }
}

/// Largest distance (m) of a part's way in a zone from that in the whole, over the rows of both, which are at the same times but for a step.
fn off_its_way(whole: &[HistoryRow], zone: &[HistoryRow], of: fn(&HistoryRow) -> f64) -> f64 {
    assert_eq!(whole.len(), zone.len());
    let rows = whole.iter().zip(zone);
    rows.map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
}

const HOLDER: (&str, fn(&HistoryRow) -> f64) = ("holder", |r| r.holder_travel);

#[test]
fn a_zone_of_a_press_goes_as_the_whole_and_its_holder_as_recorded_with_the_same_bits_on_two_threads()
 {
    let whole = Whole::formed(gentle_press("m4", 0.0, &[]));
    // Cut on two sides, free on the others: a corner of the ply under the holder, and half of the dome.
    let inside: Inside = |x| x[0] > -0.026 && x[1] > -0.022;
    let zone = || whole.zone(inside, 0, &[HOLDER]);
    let (forming, outcome) = whole.run(zone(), 1);
    whole.assert_driven(&forming, inside);
    let [largest, mean] = whole.distances(&forming, inside);
    println!("{largest} m, in the mean {mean} m");
    assert!(largest < 2e-4 && mean < 2e-5, "{largest} m, {mean} m");
    let off = off_its_way(&whole.history, &outcome.history, HOLDER.1);
    let travel = whole.history.iter().map(HOLDER.1).fold(0.0, f64::max);
    println!("the holder went {travel} m, in the zone {off} m off that");
    assert!(
        off < 0.05 * travel && travel > 1e-7,
        "{off} m of {travel} m"
    );
    assert!(outcome.history.last().unwrap().punch_force > 0.0);
    let (again, _) = whole.run(zone(), 2);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
    // Without its way nobody knows where the holder is.
    let text = whole.refused(whole.zone(inside, 0, &[]));
    assert!(
        text.contains("'holder' is pressed") && text.contains("Run the run of the whole"),
        "{text}"
    );
}

#[test]
fn a_zone_that_is_the_whole_ply_does_what_the_whole_does() {
    // Under a holder with a gap nothing is recorded: to the last bit.
    let mut p = press(1, &json!({"gap": "0.002 m"}), |p| {
        p["scene"]["process"]["press"]["stroke"] = json!("0.012 m");
        p["scene"]["process"]["press"]["forming_time"] = json!("0.06 s");
    });
    p.element_size = 0.008;
    // Steered fibres have the directions of their place in a zone, too.
    let turning = table(|x, y| 4.0 * x - 9.0 * y);
    for p in [p.clone(), steered(p, &turning)] {
        let whole = Whole::formed(p);
        let (forming, _) = whole.run(whole.zone(ALL, 0, &[]), 1);
        assert!(forming.model.x() == whole.forming.model.x());
        assert!(forming.model.v() == whole.forming.model.v());
    }
    // Under one with a force it stops where it was then, between two rows as well.
    let whole = Whole::formed(gentle_press("m4", 0.0, &[]));
    let (forming, _) = whole.run(whole.zone(ALL, 0, &[HOLDER]), 1);
    let [largest, _] = whole.distances(&forming, ALL);
    println!("under a holder with a force: {largest} m");
    assert!(largest < 1e-4, "{largest} m");
    // One that goes on at half of the speed has punch and holder there at twice the time.
    let mut slow = whole.zone(ALL, 0, &[HOLDER]);
    slow.slower = 2.0;
    slow.time.iter_mut().for_each(|t| *t *= 2.0);
    slow.ways[0].time.iter_mut().for_each(|t| *t *= 2.0);
    let slow = build_local(&whole.p, slow, &BuiltIn).unwrap().load;
    let fast = &whole.forming.load;
    assert!((slow.duration() - 2.0 * fast.duration()).abs() < 1e-12);
    for t in [0.0, 0.013, 0.03, 0.061] {
        let [a, b] = [fast.frame_height(t), slow.frame_height(2.0 * t)];
        assert!((a - b).abs() < 1e-12, "{t} s: {a} m, {b} m");
    }
}

/// A punch that comes down on a block on a spring, a pad on the tool, and a gripper at either end.
fn drawn() -> Parameters {
    let down =
        json!({"table": [{"time": "0 s", "way": "0.0051 m"}, {"time": "0.08 s", "way": "0 m"}]});
    let grip = |x: &str, angle: &str, width: &str| json!({"ply": "ply_1", "centre": [x, "0 m"], "length": "0.002 m", "width": width, "pull": angle, "force": "3 N", "spring": "100 N/m"});
    let mut all = process(&[
        with(pad("punch", 0.055, 0.0053), down),
        with(
            block("holder", 0.055),
            json!({"pressed": {"force": "10 N", "spring": "2000 N/m"}}),
        ),
        with(
            pad("pad", 0.0, 0.0103),
            json!({"pressed": {"force": "40 N", "travel": "0.001 m"}}),
        ),
    ]);
    all["grippers"] = json!([
        grip("0.08 m", "0 deg", "0.06 m"),
        grip("-0.08 m", "180 deg", "0.06 m")
    ]);
    stamped(all, |_| {})
}

/// Ways of the pressed parts of [`drawn`]: rows have tool, punch, holder, pad, and the two grippers.
const PRESSED: [Way; 2] = [("holder", |r| r.parts[2][1]), ("pad", |r| r.parts[3][1])];

#[test]
fn a_zone_of_a_stamping_has_the_parts_and_grippers_of_the_whole_where_they_are_there() {
    let whole = Whole::formed(drawn());
    // Half of the pad, all of punch and holder, and one gripper.
    let inside: Inside = |x| x[0] > -0.01;
    let (forming, outcome) = whole.run(whole.zone(inside, 0, &PRESSED), 1);
    whole.assert_driven(&forming, inside);
    let [largest, mean] = whole.distances(&forming, inside);
    println!("{largest} m, in the mean {mean} m");
    assert!(largest < 2e-4 && mean < 3e-5, "{largest} m, {mean} m");
    let [there, here] = [&whole.history, &outcome.history].map(|h| h.last().unwrap().parts.clone());
    // The punch follows its table; holder and pad go as recorded, within some hundredths of what they went.
    for k in 1..4 {
        let off = (there[k][1] - here[k][1]).abs();
        assert!(
            off <= 0.03 * there[k][1].abs(),
            "part {k}: {} m, {} m",
            there[k][1],
            here[k][1]
        );
    }
    // Punch and holder lie in the zone wholly, the pad to a half and a bit; no part gives more than it gave the whole.
    let share = |k: usize| here[k][0] / there[k][0];
    println!("shares of the forces: {:?}", [1, 2, 3].map(share));
    assert!((share(1) - 1.0).abs() < 0.1 && (share(2) - 1.0).abs() < 0.1);
    // Three of five rows of nodes under it are free; that at x = -8 mm is driven.
    assert!((share(3) - 0.6).abs() < 0.03, "{}", share(3));
    // The gripper in the zone pulls as in the whole, the other one is in the motion of the cut.
    assert!(
        (here[4][0] / there[4][0] - 1.0).abs() < 0.01,
        "{here:?} {there:?}"
    );
    assert_eq!(here[5], [0.0; 2]);
    let (again, _) = whole.run(whole.zone(inside, 0, &PRESSED), 2);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
    // A part that is near no sheet of the zone is none of its faults.
    assert_eq!(forming.load.stamping().unwrap().names().count(), 6);
    let text = whole.refused(whole.zone(inside, 0, &PRESSED[..1]));
    assert!(text.contains("'pad' is pressed"), "{text}");
}

#[test]
fn a_gripper_across_the_cut_has_that_share_of_its_force_which_it_has_of_the_ply() {
    let whole = Whole::at_rest(drawn());
    // Nodes are 8 mm apart across the ply, of 48 mm: the zone has the upper four rows of seven, and half an element of a seventh row.
    let inside: Inside = |x| x[1] > -0.004;
    let zone = build_local(&whole.p, whole.zone(inside, 0, &PRESSED), &BuiltIn).unwrap();
    let grips = &zone.load.stamping().unwrap().grips;
    let shares: f64 = grips[0].nodes.iter().map(|(_, share, _)| share).sum();
    // The row on the cut stands for half of what it stands for in the whole.
    assert!((shares - 3.0 / 6.0).abs() < 1e-9, "{shares}");
    let of_all = build_local(&whole.p, whole.zone(ALL, 0, &PRESSED), &BuiltIn).unwrap();
    for grip in &of_all.load.stamping().unwrap().grips {
        let shares: f64 = grip.nodes.iter().map(|(_, share, _)| share).sum();
        assert!((shares - 1.0).abs() < 1e-12, "{shares}");
    }
}

#[test]
fn a_zone_of_a_stamping_that_begins_late_ends_near_the_whole() {
    let whole = Whole::formed(drawn());
    let inside: Inside = |x| x[0] > -0.01;
    let first = FRAMES / 2;
    let (forming, outcome) = whole.run(whole.zone(inside, first, &PRESSED), 1);
    let first_row = &outcome.history[0];
    assert!((first_row.time - whole.film.time[first]).abs() < 1.1e-5);
    // Punch and holder are there where they were then.
    let then = whole
        .history
        .iter()
        .rfind(|r| r.time <= first_row.time + 1e-9)
        .unwrap();
    for k in 1..3 {
        let off = (then.parts[k][1] - first_row.parts[k][1]).abs();
        assert!(off < 5e-6, "part {k}: {off} m");
    }
    let shift = outcome.start_shift.unwrap();
    let [largest, mean] = whole.distances(&forming, inside);
    println!("{shift} m at the start; {largest} m, in the mean {mean} m");
    assert!(
        shift < 5e-4 && largest < 5e-4 && mean < 1e-4,
        "{shift} {largest} {mean}"
    );
}
