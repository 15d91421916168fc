//! The repository's own materials keep the contract.

mod common;

use common::{
    CRUSHED, FILM, ISOTROPIC, KINKED, LINEAR, TABULATED_FILM, WOVEN, ncf, of_material, sound,
};
use plyflow_conformance::{Check, Outcome, failed};
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::fabric_linear::FabricLinear;
use plyflow_kernels::isotropic::Isotropic;
use plyflow_kernels::marlow::Marlow;
use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MaterialTape, MembraneBatch};

#[test]
fn nothing_is_found_in_the_repository_s_own_materials() {
    let membrane = [
        "sizes",
        "guard-zones",
        "threads",
        "tape",
        "zero-dt",
        "stress",
        "cycle",
        "stiffness",
    ];
    let bending = [
        "bending",
        "bending-repeatable",
        "bending-asking",
        "bending-threads",
        "bending-tape",
        "bending-zero-dt",
        "bending-rest",
        "moment",
        "bending-cycle",
        "tangent",
    ];
    sound(&of_material::<Marlow>(FILM), &membrane);
    sound(&of_material::<Marlow>(TABULATED_FILM), &membrane);
    let mut sheets = vec![
        of_material::<Isotropic>(ISOTROPIC),
        of_material::<FabricLinear>(LINEAR),
        of_material::<Fabric>(WOVEN),
        of_material::<Fabric>(KINKED),
        of_material::<Fabric>(CRUSHED),
    ];
    sheets.extend(["fibre-energy", "hypoelastic"].map(|form| of_material::<Fabric>(&ncf(form))));
    for checks in sheets {
        sound(&checks, &membrane);
        sound(&checks, &bending);
    }
}

fn seen<'a>(checks: &'a [Check], name: &str) -> &'a str {
    let found = checks.iter().find(|c| c.rule.name == name);
    &found.expect(name).seen
}

#[test]
fn verdicts_say_how_far_a_law_was_judged() {
    let checks = of_material::<Fabric>(&ncf("fibre-energy"));
    for name in ["status", "stress", "cycle", "stiffness"] {
        let seen = seen(&checks, name);
        assert!(seen.contains("60 degrees"), "{name}: {seen}");
    }
    for name in ["bending", "moment", "bending-cycle", "tangent"] {
        let seen = seen(&checks, name);
        assert!(seen.contains("500 1/m"), "{name}: {seen}");
    }
    // A radius of 2 mm is none for a sheet of 1 mm.
    let thick = ncf("fibre-energy").replace("4e-4", "1e-3");
    let seen = seen(&of_material::<Fabric>(&thick), "moment").to_owned();
    assert!(seen.contains("200 1/m"), "{seen}");
}

/// A law that takes a short way, with other bits, when all of a batch's chunk are deformed or bent little.
struct Hasty(Isotropic);

fn hasten(n: usize, values: &mut [f64], is_small: impl Fn(usize) -> bool) {
    for c in (0..n).step_by(8) {
        if (c..c + 8).all(&is_small) {
            for row in values.chunks_exact_mut(n) {
                row[c..c + 8].iter_mut().for_each(|s| *s *= 1.0 + 1e-15);
            }
        }
    }
}

impl Material for Hasty {
    const MANIFEST: &'static str = Isotropic::MANIFEST;

    fn create(parameters: &str) -> Result<Self, String> {
        Isotropic::create(parameters).map(Self)
    }

    fn sizes(&self) -> MaterialSizes {
        self.0.sizes()
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        self.0.membrane(b);
        hasten(b.lanes, b.stress, |l| (b.metric[l] - 1.0).abs() < 1e-3);
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        self.0.bending(b);
        hasten(b.lanes, b.moment, |l| b.curvature[l].abs() < 2.0);
    }
}

#[test]
fn a_law_that_depends_on_its_neighbours_is_found_out() {
    let found = failed(&of_material::<Hasty>(ISOTROPIC));
    assert_eq!(found, ["batch-independence", "bending-batch-independence"]);
}

/// A law that is stiffer in steps that take less than a millisecond.
struct Rate(Isotropic);

impl Material for Rate {
    const MANIFEST: &'static str = Isotropic::MANIFEST;

    fn create(parameters: &str) -> Result<Self, String> {
        Isotropic::create(parameters).map(Self)
    }

    fn sizes(&self) -> MaterialSizes {
        self.0.sizes()
    }

    fn membrane(&self, batch: &mut MembraneBatch<'_>) {
        self.0.membrane(batch);
        let dt = batch.dt;
        for s in batch.stress.iter_mut() {
            *s *= 1.0 + 1e-3 / (dt + 1e-3);
        }
    }

    fn bending(&self, batch: &mut BendingBatch<'_>) {
        self.0.bending(batch);
    }
}

#[test]
fn of_a_law_that_depends_on_rates_only_finite_numbers_are_wanted_at_no_step_and_the_verdict_says_so()
 {
    let checks = of_material::<Rate>(ISOTROPIC);
    let seen = seen(&checks, "zero-dt");
    assert!(seen.contains("depends on dt"), "{seen}");
    assert!(!failed(&checks).contains(&"zero-dt"));
}

/// A sheet whose bending is elastic up to a moment at which its layers slip. Rows of history: curvatures and moments of the
/// previous call, work done.
struct Slipping(Isotropic);

impl Slipping {
    /// N m, N
    const ELASTIC: f64 = 1e-2;
    const SLIP: f64 = 0.02;
}

impl Material for Slipping {
    const MANIFEST: &'static str = Isotropic::MANIFEST;

    fn create(parameters: &str) -> Result<Self, String> {
        Isotropic::create(parameters).map(Self)
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            bending_history: 7,
            ..self.0.sizes()
        }
    }

    fn membrane(&self, batch: &mut MembraneBatch<'_>) {
        self.0.membrane(batch);
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        let n = b.lanes;
        for l in 0..n {
            for a in 0..3 {
                let (i, weight) = (a * n + l, if a == 2 { 2.0 } else { 1.0 });
                let (k, old) = (b.history[i], b.history[3 * n + i]);
                let tried = old + Self::ELASTIC * (b.curvature[i] - k);
                let moment = tried.clamp(-Self::SLIP, Self::SLIP);
                b.history[6 * n + l] += weight * 0.5 * (old + moment) * (b.curvature[i] - k);
                (b.history[i], b.history[3 * n + i]) = (b.curvature[i], moment);
                b.moment[i] = moment;
                if let Some(tangent) = b.tangent.as_deref_mut() {
                    tangent[i] = if tried == moment { Self::ELASTIC } else { 0.0 };
                }
            }
            b.energy[l] = b.history[6 * n + l];
        }
    }
}

#[test]
fn nothing_is_found_in_a_law_whose_bending_slips() {
    let checks = of_material::<Slipping>(ISOTROPIC);
    sound(&checks, &["moment", "bending-cycle", "tangent"]);
}

/// Says that it does something else than it does.
struct Liar(Isotropic, &'static str);

impl Material for Liar {
    const MANIFEST: &'static str = Isotropic::MANIFEST;
    fn create(parameters: &str) -> Result<Self, String> {
        let value: serde_json::Value =
            serde_json::from_str(parameters).map_err(|e| e.to_string())?;
        let lies = [
            "another bit",
            "no tape",
            "a row that is not there",
            "nothing of the energy",
            "a metric of its own",
            "a question",
            "a panic",
        ];
        let lie = lies
            .into_iter()
            .find(|lie| value["lie"] == *lie)
            .unwrap_or_default();
        let mut honest = value.clone();
        honest.as_object_mut().ok_or("no object")?.remove("lie");
        Ok(Self(Isotropic::create(&honest.to_string())?, lie))
    }
    fn sizes(&self) -> MaterialSizes {
        self.0.sizes()
    }
    fn membrane(&self, batch: &mut MembraneBatch<'_>) {
        self.0.membrane(batch);
    }
    fn bending(&self, batch: &mut BendingBatch<'_>) {
        self.0.bending(batch);
    }
    fn tape(&self, what: MaterialTape) -> Result<Option<String>, String> {
        let Some(text) = self.0.tape(what)? else {
            return Ok(None);
        };
        Ok(Some(match self.1 {
            "another bit" => text.replacen("subtract", "add", 1),
            "no tape" => "tape of a law".into(),
            "a row that is not there" => text.replacen("load metric 0", "load metric 3", 1),
            "nothing of the energy" => text
                .lines()
                .filter(|l| !l.contains("energy"))
                .map(|l| format!("{l}\n"))
                .collect(),
            "a metric of its own" => text + "store metric 0 1\n",
            "a question" => text.replacen(
                "store stress 0",
                "call law membrane\nresult stress 1\nq = result law stress 0\nstore stress 0 q #",
                1,
            ),
            "a panic" => panic!("it fell over"),
            _ => text,
        }))
    }
}

#[test]
fn a_tape_that_is_not_what_the_law_does_is_found_out() {
    let of = |lie: &str| {
        let parameters = ISOTROPIC.trim_end().trim_end_matches('}');
        let checks = of_material::<Liar>(&format!("{parameters}, \"lie\": \"{lie}\"}}"));
        let bad: Vec<&str> = checks
            .iter()
            .filter(|c| c.outcome == Outcome::Failed)
            .map(|c| c.rule.name)
            .collect();
        (bad.join(" "), seen(&checks, "tape").to_owned())
    };
    assert_eq!(
        of(""),
        (String::new(), "the same bits in 2560 states".into())
    );
    let (bad, told) = of("another bit");
    assert_eq!(bad, "tape");
    assert!(
        told.starts_with("row 0 of 'stress' in lane 0: the function gives "),
        "{told}"
    );
    let (bad, told) = of("no tape");
    assert_eq!(
        (bad.as_str(), told.as_str()),
        ("tape bending-tape", "line 1: expected 'plyflow-tape 1'")
    );
    let (bad, told) = of("a row that is not there");
    assert_eq!(bad, "tape");
    assert!(told.ends_with("'metric' has 3 rows"), "{told}");
    let (_, told) = of("nothing of the energy");
    assert_eq!(told, "it does not write 'energy'");
    let (_, told) = of("a metric of its own");
    assert_eq!(told, "it writes 'metric', which its function does not");
    let (_, told) = of("a question");
    assert_eq!(told, "it calls 'membrane', as elements alone do");
    let (_, told) = of("a panic");
    assert_eq!(
        told,
        "tape returned 3: the component panicked: it fell over"
    );
}
