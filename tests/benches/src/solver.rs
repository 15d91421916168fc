//! Whole steps of the solver: without and with contact, by thread, by element size.

use crate::cases::Row;
use plyflow_e2e::{program, repository};
use plyflow_kernels::built_in::{self, BuiltIn};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Where the time of a step goes: what the result is called and what it is.
const PARTS: [(&str, &str); 4] = [
    ("contact_share", "contacts"),
    ("element_share", "elements"),
    ("node_share", "nodes"),
    ("load_share", "loads"),
];

/// One run of a step that computes elements.
#[derive(Clone)]
struct Run {
    elements: f64,
    steps: f64,
    /// Of the step's process: building the model and writing the artifact too (s).
    wall: f64,
    cpu: f64,
    /// Largest resident memory of it (bytes).
    memory: f64,
    drift: f64,
    /// Shares of the steps' wall time, in the order of [`PARTS`]; not numbers without such results.
    shares: [f64; PARTS.len()],
}

impl Run {
    fn element_steps(&self) -> f64 {
        self.elements * self.steps
    }

    /// CPU nanoseconds per element and step.
    fn cost(&self) -> f64 {
        1e9 * self.cpu / self.element_steps()
    }

    fn contact_share(&self) -> f64 {
        self.shares[0]
    }

    /// Where the time of its steps went.
    fn profile<'a>(&'a self, case: &'a str) -> impl Iterator<Item = Row> + 'a {
        let rows = PARTS.iter().zip(self.shares);
        rows.map(move |((_, part), share)| Row::new(format!("{case}, share of {part}"), share, "1"))
    }

    fn row(&self, case: String) -> Row {
        let mut row = Row::new(case, self.cost(), "CPU ns per element-step");
        row.more = json!({
            "elements": self.elements, "steps": self.steps, "wall_s": self.wall, "cpu_s": self.cpu,
            "memory_bytes": self.memory, "drift_ratio": self.drift, "contact_share": self.contact_share(),
        });
        row
    }
}

/// Runs the one step of a workflow text in a copy of the repository's `workflows`, with so many cores.
fn run(place: &Path, workflow: &str, cores: usize) -> Run {
    let store = place.join(".plyflow");
    if store.exists() {
        std::fs::remove_dir_all(&store).expect("the old store can go");
    }
    let file = place.join("bench.yaml");
    std::fs::write(&file, workflow).expect("a workflow");
    let status = Command::new(program())
        .args([
            "run",
            "bench.yaml",
            "--no-report",
            "--quiet",
            "--jobs",
            &cores.to_string(),
        ])
        .current_dir(place)
        .stdout(Stdio::null())
        .status()
        .expect("plyflow starts");
    assert!(status.success(), "{workflow}");
    let out = Command::new(program())
        .args(["results", "bench.yaml", "--format", "json"])
        .current_dir(place)
        .output()
        .expect("plyflow starts");
    let out: Value = serde_json::from_slice(&out.stdout).expect("results in JSON");
    let value = |name: &str| {
        let rows = out["results"].as_array().expect("results");
        let found = rows.iter().find(|r| r["result"] == name);
        found.and_then(|r| r["value"].as_f64()).unwrap_or(f64::NAN)
    };
    let cost = &out["steps"][0]["cost"];
    let spent = |name: &str| cost[name].as_f64().unwrap_or(f64::NAN);
    Run {
        elements: value("elements"),
        steps: value("cycles"),
        wall: spent("wall_seconds"),
        cpu: spent("cpu_seconds"),
        memory: spent("peak_memory"),
        drift: value("drift_ratio"),
        shares: PARTS.map(|(result, _)| value(result)),
    }
}

/// The run with the least CPU time: what disturbs can only add.
fn least(times: usize, one: impl Fn() -> Run) -> Run {
    let runs = (0..times).map(|_| one());
    runs.min_by(|a, b| a.cpu.total_cmp(&b.cpu)).expect("a run")
}

/// CPU nanoseconds per element and step of what a longer run does beyond a shorter one: steps alone, without what is done once.
fn of_steps(short: &Run, long: &Run) -> f64 {
    1e9 * (long.cpu - short.cpu) / (long.element_steps() - short.element_steps())
}

/// A strip of fabric pulled: elements, nodes, ledger, and no contact.
fn strip(element: &str, size: &str, time: &str) -> String {
    format!(
        "plyflow: 1\nname: bench\nsteps:\n  strip:\n    plugin: coupon-bias-extension\n    with: {{element: {{plugin: \
         {element}, with: {{hourglass: 0.5, hourglass_floor: 0 N/m}}}}, material: \
         ../../materials/woven-38616.yaml, length: 300 mm, width: 150 mm, element_size: {size}, displacement: \
         6 mm, pull_time: {time}}}\n"
    )
}

/// The press of `workflows/peers`, its first share of the stroke at the same speed.
fn press(element: &str, size_mm: f64, step_us: f64) -> String {
    format!(
        "plyflow: 1\nname: bench\nsteps:\n  press:\n    plugin: forming-explicit\n    with: {{scene: scene-bench.yaml, \
         element: {{plugin: {element}, with: {{hourglass_floor: 0 N/m}}}}, element_size: {size_mm} mm, time_step: \
         {step_us} us, step_safety: 0.9, least_areal_mass: 0.44 kg/m2, contact_augmentation: 0, tool_grid: 2 \
         mm, frames: 4, kinetic_bound: 1000}}\n"
    )
}

/// A copy of the workflows, with the press's scene cut to a share of its stroke.
fn copy(share: f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let status = Command::new("cp")
        .arg("-r")
        .arg(repository().join("workflows"))
        .arg(folder.path())
        .status();
    assert!(status.is_ok_and(|s| s.success()), "workflows are copied");
    let place = folder.path().join("workflows/peers/hemisphere-press");
    let scene = std::fs::read_to_string(place.join("scene.yaml")).expect("the peer's scene");
    let cut = scene
        .replace("stroke: 50 mm", &format!("stroke: {} mm", 50.0 * share))
        .replace(
            "forming_time: 20 ms",
            &format!("forming_time: {} ms", 20.0 * share),
        );
    assert_ne!(cut, scene, "the scene has another stroke or time");
    std::fs::write(place.join("scene-bench.yaml"), cut).expect("a scene");
    folder
}

/// Whole steps: without contact, with contact, by thread, by element size.
pub fn solver() -> Vec<Row> {
    let mut rows = Vec::new();
    let folder = copy(0.2);
    let strips = folder.path().join("workflows/coupons/angle-study");
    let presses = folder.path().join("workflows/peers/hemisphere-press");
    // Strip and press set the hourglass control of their element, and take a fabric.
    let controlled = |e: &&BuiltIn| e.manifest.contains("\"hourglass_floor\"");
    for element in built_in::elements().filter(controlled).map(|e| e.name) {
        let pulled = |time: &str| least(3, || run(&strips, &strip(element, "3 mm", time), 1));
        let (one, longer) = (pulled("4 ms"), pulled("12 ms"));
        rows.push(one.row(format!("{element}, strip, no contact, 1 thread")));
        rows.push(Row::new(
            format!("{element}, strip, no contact, 1 thread, steps alone"),
            of_steps(&one, &longer),
            "CPU ns per element-step",
        ));
        let with = least(1, || run(&presses, &press(element, 3.0, 1.6), 1));
        rows.push(with.row(format!("{element}, press 3 mm, 1 thread")));
        rows.push(Row::new(
            format!("{element}, press over strip, rate"),
            one.cost() / with.cost(),
            "1",
        ));
    }
    for element in ["rf4", "s4"] {
        let of = |cores| least(1, || run(&presses, &press(element, 2.0, 1.08), cores));
        let (one, two) = (of(1), of(2));
        rows.push(two.row(format!("{element}, press 2 mm, 2 threads")));
        rows.push(Row::new(
            format!("{element}, press 2 mm, 1 thread over 2, wall"),
            one.wall / two.wall,
            "1",
        ));
    }
    rows.extend(by_size(&presses));
    rows.push(whole_stroke(&presses));
    rows.extend(spar(&folder.path().join("workflows/joggle-spar")));
    rows
}

/// Name and what `over` makes of the cost of an element's step (CPU ns), of short runs with one thread, the least of so many `times`: a strip, a
/// press, and a small bag.
pub fn short_runs(times: usize, over: impl Fn(&dyn Fn() -> f64) -> f64) -> Vec<(String, f64)> {
    let folder = copy(0.1);
    let place = |name: &str| folder.path().join("workflows").join(name);
    let bag = "plyflow: 1\nname: bench\nsteps:\n  bag:\n    plugin: forming-explicit\n    with: {scene: block.yaml, element: m4, \
               element_size: 16 mm, diaphragm_element_size: 16 mm, tool_grid: 2 mm, time_step: 20 us, frames: 4}\n";
    let of = |case: &str, place: &Path, workflow: &str| {
        let cost = over(&|| least(times, || run(place, workflow, 1)).cost());
        (format!("{case}, 1 thread"), cost)
    };
    vec![
        of(
            "rf4, strip, no contact",
            &place("coupons/angle-study"),
            &strip("rf4", "4 mm", "2 ms"),
        ),
        of(
            "s4, press 4 mm",
            &place("peers/hemisphere-press"),
            &press("s4", 4.0, 2.1),
        ),
        of("m4, block 16 mm in a bag", &place("hard-cases"), bag),
    ]
}

/// Where the time of a step goes, one thread: in a press, in a bag, and in a bag at rest.
pub fn profile() -> Vec<Row> {
    let folder = copy(0.2);
    let place = |name: &str| folder.path().join("workflows").join(name);
    let mut rows = Vec::new();
    for element in ["rf4", "s4"] {
        let one = run(
            &place("peers/hemisphere-press"),
            &press(element, 2.0, 1.08),
            1,
        );
        rows.extend(one.profile(&format!("{element}, press 2 mm, 1 thread")));
    }
    let one = run(&place("joggle-spar"), &membranes("scene.yaml"), 1);
    rows.extend(one.profile("m4, joggle spar 8 mm, 1 thread"));
    rows.extend(at_rest(&place("flat-tool")));
    rows
}

/// Two threads on two cores where others want them too, on a machine that is quiet but for these: the rate over that without others,
/// and that over the fair share of two threads among them.
pub fn busy() -> Vec<Row> {
    let folder = copy(0.2);
    let place = folder.path().join("workflows/flat-tool");
    // A third of its process: 20 minutes in all on two cores, as seven others leave little of the machine.
    let mut scene =
        std::fs::read_to_string(place.join("scene.yaml")).expect("the flat tool's scene");
    for (whole, third) in [(80, 27), (150, 50), (200, 67), (40, 13)] {
        let cut = scene.replace(&format!("_time: {whole} ms"), &format!("_time: {third} ms"));
        assert_ne!(cut, scene, "the scene has other times");
        scene = cut;
    }
    std::fs::write(place.join("scene-busy.yaml"), scene).expect("a scene");
    let rate = |others: usize| {
        let _others = Others::start(others);
        let one = run(&place, &membranes("scene-busy.yaml"), 2);
        one.steps / one.wall
    };
    let alone = rate(0).max(rate(0));
    let cores = std::thread::available_parallelism().map_or(0, |n| n.get());
    let case = |k: usize| format!("m4, flat tool 8 mm, 2 threads, {k} others on {cores} cores");
    let mut rows = vec![Row::new(case(0), alone, "steps/s")];
    for k in [1, 2, 4, 7] {
        let kept = rate(k) / alone;
        let fair = 2.0 / (k + 2) as f64;
        rows.push(Row::new(
            format!("{}, rate over that alone", case(k)),
            kept,
            "1",
        ));
        rows.push(Row::new(
            format!("{}, over the fair share (bound 0.77)", case(k)),
            kept / fair,
            "1",
        ));
    }
    rows
}

/// Threads that compute without end until this is dropped.
struct Others(Arc<AtomicBool>, Vec<JoinHandle<()>>);

impl Others {
    fn start(count: usize) -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let busy = |_| {
            let ended = ended.clone();
            std::thread::spawn(move || {
                while !ended.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            })
        };
        let threads = (0..count).map(busy).collect();
        Self(ended, threads)
    }
}

impl Drop for Others {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        for thread in self.1.drain(..) {
            thread.join().expect("it only spins");
        }
    }
}

/// The demo's membranes over a scene.
fn membranes(scene: &str) -> String {
    format!(
        "plyflow: 1\nname: bench\nsteps:\n  coarse:\n    plugin: forming-explicit\n    with: {{scene: {scene}, element: m4, \
         element_size: 8 mm, time_step: 12 us, least_areal_mass: 3 kg/m2}}\n"
    )
}

/// The joggle spar's membranes of the demo, the whole process between diaphragms: by thread, and what they would do without contact.
fn spar(place: &Path) -> Vec<Row> {
    let [one, two] = [1, 2].map(|cores| run(place, &membranes("scene.yaml"), cores));
    let mut rows = vec![
        one.row("m4, joggle spar 8 mm, 1 thread".into()),
        two.row("m4, joggle spar 8 mm, 2 threads".into()),
    ];
    rows.push(Row::new(
        "m4, joggle spar 8 mm, 1 thread over 2, wall",
        one.wall / two.wall,
        "1",
    ));
    rows.push(Row::new(
        "m4, joggle spar 8 mm, 1 thread, rate over that without contact",
        1.0 - one.contact_share(),
        "1",
    ));
    rows
}

/// The bag over a flat block, formed and then at rest for longer: what contacts cost while nothing slides.
fn at_rest(place: &Path) -> Vec<Row> {
    let scene = std::fs::read_to_string(place.join("scene.yaml")).expect("the flat tool's scene");
    let rest = |time: &str| {
        let longer = scene.replace("settling_time: 40 ms", &format!("settling_time: {time}"));
        std::fs::write(place.join("scene-bench.yaml"), longer).expect("a scene");
        run(place, &membranes("scene-bench.yaml"), 1)
    };
    let (short, long) = (rest("40 ms"), rest("340 ms"));
    assert!(
        long.steps > 1.3 * short.steps,
        "the scene has another settling time"
    );
    let share = |of: fn(&Run) -> f64| {
        (of(&long) * long.wall - of(&short) * short.wall) / (long.wall - short.wall)
    };
    let case = "m4, flat tool 8 mm, 300 ms of rest, 1 thread";
    vec![
        long.row(case.into()),
        Row::new(
            format!("{case}, the rest alone"),
            of_steps(&short, &long),
            "CPU ns per element-step",
        ),
        Row::new(
            format!("{case}, the rest alone, share of contacts"),
            share(Run::contact_share),
            "1",
        ),
    ]
}

/// The peer's case as its workflow has it, the whole stroke: the wall time that its goal is about.
fn whole_stroke(place: &Path) -> Row {
    let workflow = std::fs::read_to_string(place.join("workflow.yaml")).expect("the peer's case");
    let run = run(place, &workflow, 2);
    let mut row = run.row(String::new());
    row.case = "s4, press 2 mm, whole stroke, 2 threads, wall".into();
    (row.value, row.unit) = (run.wall, "s");
    row
}

/// Cost of the same share of the stroke by element size, and the exponent between neighbours.
fn by_size(place: &Path) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut coarser: Option<(f64, Run)> = None;
    for (size, step) in [(5.0, 2.7), (3.0, 1.62), (2.0, 1.08), (1.0, 0.54)] {
        let one = run(place, &press("s4", size, step), 2);
        rows.push(one.row(format!("s4, press {size} mm, 2 threads")));
        if let Some((h, run)) = coarser.replace((size, one.clone())) {
            rows.push(Row::new(
                format!("s4, press, cost {size} mm over {h} mm, exponent of 1/h"),
                (one.cpu / run.cpu).ln() / (h / size).ln(),
                "1",
            ));
        }
    }
    rows
}
