//! The resolved `with` block of a fabric (SI numbers), and the fabric made of it.

use super::bending::{Bending, Law, Laws, Voce};
use super::checks::{self, not_negative, positive};
use super::compression::Crush;
use super::crossing::Crossing;
use super::cubic::Cubic;
use super::hysteresis::Slider;
use super::ply::{Fabric, Form};
use super::shear::Shear;
use super::stitch::Stitch;
use super::yarn::{Branch, Table};
use plyflow_fixed::FixedBits;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    #[serde(default = "fibre_energy")]
    form: Form,
    crossing: Option<f64>,
    fibre_modulus: f64,
    fibre_modulus_2: Option<f64>,
    compression_factor: Option<f64>,
    compression_factor_2: Option<f64>,
    compression: Option<CompressionParameters>,
    compression_2: Option<CompressionParameters>,
    shear: ShearParameters,
    stitch: Option<StitchParameters>,
    bending: Option<BendingParameters>,
    thickness: f64,
    areal_mass: f64,
}

#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
struct CompressionParameters {
    table: CompressionTable,
}

#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
struct CompressionTable {
    strains: Vec<f64>,
    stresses: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShearParameters {
    coefficients: Option<Vec<f64>>,
    limit: Option<f64>,
    table: Option<ShearTable>,
    negative: Option<NegativeParameters>,
    #[serde(default)]
    allow_softening: bool,
    hysteresis: Option<ShearHysteresis>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShearHysteresis {
    force: f64,
    angle: f64,
    #[serde(default)]
    per_tension: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BendingHysteresis {
    moment: f64,
    curvature: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NegativeParameters {
    coefficients: Option<Vec<f64>>,
    limit: Option<f64>,
    table: Option<ShearTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShearTable {
    angles: Vec<f64>,
    forces: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StitchParameters {
    #[serde(default)]
    direction: Direction,
    angles: Vec<f64>,
    forces: Vec<f64>,
}

#[derive(Deserialize, Default, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Direction {
    #[default]
    Positive,
    Negative,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BendingParameters {
    positive: Option<LawParameters>,
    negative: Option<LawParameters>,
    hysteresis: Option<BendingHysteresis>,
    family_1: Option<FamilyParameters>,
    family_2: Option<FamilyParameters>,
    #[serde(default)]
    positive_face: Face,
    #[serde(default)]
    families: Families,
    twist_stiffness: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FamilyParameters {
    positive: LawParameters,
    negative: Option<LawParameters>,
    hysteresis: Option<BendingHysteresis>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LawParameters {
    linear: Option<f64>,
    asymptote: Option<f64>,
    scale: Option<f64>,
    stiffness: Option<f64>,
    table: Option<MomentTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MomentTable {
    curvatures: Vec<f64>,
    moments: Vec<f64>,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Face {
    #[default]
    Up,
    Down,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Families {
    #[default]
    Opposite,
    Same,
}

fn fibre_energy() -> Form {
    Form::FibreEnergy
}

impl Parameters {
    pub(super) fn build(self) -> Result<Fabric, String> {
        let moduli = [
            self.fibre_modulus,
            self.fibre_modulus_2.unwrap_or(self.fibre_modulus),
        ];
        positive("fibre_modulus", moduli[0], "Pa")?;
        positive("fibre_modulus_2", moduli[1], "Pa")?;
        positive("thickness", self.thickness, "m")?;
        positive("areal_mass", self.areal_mass, "kg/m2")?;
        let h = self.thickness;
        let pushed = self.pushed(moduli)?;
        let crossing = self.crossing()?;
        let signed = pushed.crush.is_some() || crossing.is_some();
        let shear = self.shear.build(self.stitch, signed)?;
        let twist = shear.initial_slope() * h * h / 6.0;
        let bending = self.bending.map(|b| b.build(twist, crossing));
        let tension = moduli.map(|modulus| modulus * h);
        Ok(Fabric {
            form: self.form,
            tension,
            compression: [0, 1].map(|family| tension[family] * pushed.factors[family]),
            stiffest: [0, 1].map(|family| {
                let crush = pushed.crush.as_ref();
                crush.map_or(tension[family], |c| {
                    c[family].steepest().max(tension[family])
                })
            }),
            crush: pushed.crush,
            crossing,
            shear,
            bending: bending.transpose()?,
            thickness: h,
            areal_mass: self.areal_mass,
        })
    }
}

/// Fibres in compression.
struct Pushed {
    factors: [f64; 2],
    crush: Option<[Crush; 2]>,
}

impl Parameters {
    /// How the families cross; none where they do at a right angle.
    fn crossing(&self) -> Result<Option<Crossing>, String> {
        let Some(angle) = self.crossing else {
            return Ok(None);
        };
        checks::crossing("crossing", angle)?;
        let crossing = Crossing::new(angle);
        if crossing.is_some() && self.form == Form::Hypoelastic {
            return Err("crossing: given with form 'hypoelastic', whose two frames lie along families at a right angle; expected form 'fibre-energy'".into());
        }
        Ok(crossing)
    }

    /// Whether what is said of compression goes together.
    fn check_compression(&self) -> Result<(), String> {
        let curves = [&self.compression, &self.compression_2];
        let factors = [self.compression_factor, self.compression_factor_2];
        for (k, (curve, factor)) in curves.iter().zip(factors).enumerate() {
            let family = ["", "_2"][k];
            if let Some(factor) = factor.filter(|f| !(0.0..=1.0).contains(f)) {
                return Err(format!(
                    "compression_factor{family}: given {factor}; expected 0 to 1"
                ));
            }
            if factor.is_some() && curve.is_some() {
                return Err(format!(
                    "compression{family}: given together with 'compression_factor{family}'; expected one of them: a curve, or a share of the modulus"
                ));
            }
        }
        let [first, second] = curves.map(Option::is_some);
        if (first || second) && self.form == Form::Hypoelastic {
            return Err("compression: given with form 'hypoelastic', which adds increments of one modulus; expected form 'fibre-energy', or \
                        'compression_factor'"
                .into());
        }
        let second = second || self.compression_factor_2.is_some();
        if first && !second && self.fibre_modulus_2.is_some() {
            return Err("compression_2: not given, and family 2 has a modulus of its own; expected 'compression_2' or 'compression_factor_2': stresses of \
                        the one family are not those of the other"
                .into());
        }
        Ok(())
    }

    /// What fibres with these moduli in tension (Pa) do in compression. A family without words of its own follows the first one.
    fn pushed(&self, moduli: [f64; 2]) -> Result<Pushed, String> {
        self.check_compression()?;
        let first = self.compression_factor.unwrap_or(1.0);
        let factors = [first, self.compression_factor_2.unwrap_or(first)];
        if self.compression.is_none() && self.compression_2.is_none() {
            return Ok(Pushed {
                factors,
                crush: None,
            });
        }
        let h = self.thickness;
        // A share of the modulus is a straight curve, so that both families have one kernel. One without any stiffness stays so.
        let straight = |family: usize| {
            let slope = factors[family] * moduli[family] * h;
            Crush::new(&[0.0, 0.5], &[0.0, 0.5 * slope])
        };
        let curved = |name: &str, c: &CompressionParameters, modulus: f64| {
            let (strains, stresses) = (&c.table.strains, &c.table.stresses);
            checks::compression_table(&format!("{name}.table"), strains, stresses, modulus)?;
            let forces: Vec<f64> = stresses.iter().map(|s| s * h).collect();
            Ok::<_, String>(Crush::new(strains, &forces))
        };
        let crush_1 = match &self.compression {
            Some(c) => curved("compression", c, moduli[0])?,
            None => straight(0),
        };
        let follows = self.compression.is_some() && self.compression_factor_2.is_none();
        let crush_2 = match &self.compression_2 {
            Some(c) => curved("compression_2", c, moduli[1])?,
            None if follows => crush_1.clone(),
            None => straight(1),
        };
        Ok(Pushed {
            factors,
            crush: Some([crush_1, crush_2]),
        })
    }
}

impl ShearParameters {
    /// `signed`: as [`Shear::new`] has it.
    fn build(self, stitch: Option<StitchParameters>, signed: bool) -> Result<Shear, String> {
        let soft = self.allow_softening;
        let positive = branch("shear", self.coefficients, self.limit, self.table, soft)?;
        let negative = match self.negative {
            Some(n) => Some(branch(
                "shear.negative",
                n.coefficients,
                n.limit,
                n.table,
                soft,
            )?),
            None => None,
        };
        let stitch = match stitch {
            Some(s) => {
                let (sign, yarn) = match s.direction {
                    Direction::Positive => (1.0, &positive),
                    Direction::Negative => (-1.0, negative.as_ref().unwrap_or(&positive)),
                };
                checks::stitch(&s.angles, &s.forces, yarn.limit_angle())?;
                Some(Stitch::new(sign, &s.angles, &s.forces))
            }
            None => None,
        };
        let slider = self.hysteresis.map(|h| h.build()).transpose()?;
        Ok(Shear::new(positive, negative, stitch, slider, signed))
    }
}

impl ShearHysteresis {
    fn build(self) -> Result<Slider, String> {
        let path = "shear.hysteresis";
        positive(&format!("{path}.force"), self.force, "N/m")?;
        checks::slips(&format!("{path}.angle"), self.angle)?;
        not_negative(
            &format!("{path}.per_tension"),
            self.per_tension,
            "N/m per N/m",
        )?;
        Ok(Slider {
            limit: self.force,
            stiffness: self.force / self.angle.fixed_sin(),
            per_tension: self.per_tension,
        })
    }
}

impl BendingHysteresis {
    fn build(self, path: &str) -> Result<Slider, String> {
        positive(&format!("{path}.hysteresis.moment"), self.moment, "N")?;
        positive(
            &format!("{path}.hysteresis.curvature"),
            self.curvature,
            "1/m",
        )?;
        Ok(Slider {
            limit: self.moment,
            stiffness: self.moment / self.curvature,
            per_tension: 0.0,
        })
    }
}

/// A law of the yarns over |g|.
fn branch(
    path: &str,
    coefficients: Option<Vec<f64>>,
    limit: Option<f64>,
    table: Option<ShearTable>,
    softening: bool,
) -> Result<Branch, String> {
    match (coefficients, table) {
        (Some(c), None) => {
            let limit = limit.unwrap_or(60f64.to_radians());
            let law = checks::polynomial(path, &c, limit, softening)?;
            Ok(Branch::Polynomial(Box::new(law)))
        }
        (None, Some(t)) => {
            if limit.is_some() {
                return Err(format!(
                    "{path}.limit: given together with {path}.table; expected without: a table ends at its \
                     last angle"
                ));
            }
            let at = format!("{path}.table");
            checks::shear_table(&at, &t.angles, &t.forces, softening)?;
            Ok(Branch::Table(Table::new(&t.angles, &t.forces)))
        }
        (given, _) => Err(format!(
            "{path}: given {} 'coefficients' and 'table'; expected one of them",
            if given.is_some() { "both" } else { "neither" }
        )),
    }
}

impl BendingParameters {
    /// By family, +1 when a positive curvature bends it positively.
    fn signs(&self) -> [f64; 2] {
        let sign = |same: bool| if same { 1.0 } else { -1.0 };
        let first = sign(self.positive_face == Face::Up);
        [first, first * sign(self.families == Families::Same)]
    }

    /// `twist`: dM12/dk12 when none is given. `crossing`: how the families cross, where it is not at a right angle.
    fn build(self, twist: f64, crossing: Option<Crossing>) -> Result<Bending, String> {
        let slider =
            |path: &str, h: Option<BendingHysteresis>| h.map(|h| h.build(path)).transpose();
        let signs = self.signs();
        let mut sliders = [slider("bending", self.hysteresis)?; 2];
        let laws = match (self.positive, self.negative, self.family_1, self.family_2) {
            (Some(p), n, None, None) => {
                let both = pair("bending", p, n)?;
                [both.clone(), both]
            }
            (None, None, Some(a), Some(b)) => {
                if sliders[0].is_some() {
                    return Err("bending.hysteresis: given together with 'family_1' and 'family_2'; expected \
                                'hysteresis' inside of each of them"
                        .into());
                }
                sliders = [
                    slider("bending.family_1", a.hysteresis)?,
                    slider("bending.family_2", b.hysteresis)?,
                ];
                [
                    pair("bending.family_1", a.positive, a.negative)?,
                    pair("bending.family_2", b.positive, b.negative)?,
                ]
            }
            (p, n, a, b) => {
                let given: Vec<&str> = [
                    (p.is_some(), "positive"),
                    (n.is_some(), "negative"),
                    (a.is_some(), "family_1"),
                    (b.is_some(), "family_2"),
                ]
                .iter()
                .filter_map(|(is, name)| is.then_some(*name))
                .collect();
                return Err(format!(
                    "bending: given {given:?}; expected 'positive' (and 'negative' where it differs) for both \
                     families, or 'family_1' and 'family_2' with these inside; leave 'bending' out for a ply \
                     without bending stiffness"
                ));
            }
        };
        let twist = self.twist_stiffness.unwrap_or(twist);
        not_negative("bending.twist_stiffness", twist, "N m")?;
        Ok(Bending {
            laws: Laws::from(laws),
            signs,
            twist,
            crossing,
            sliders: sliders.iter().any(Option::is_some).then_some(sliders),
        })
    }
}

/// Laws of both signs.
fn pair(
    path: &str,
    positive: LawParameters,
    negative: Option<LawParameters>,
) -> Result<[Law; 2], String> {
    let p = positive.build(&format!("{path}.positive"))?;
    let n = match negative {
        Some(n) => n.build(&format!("{path}.negative"))?,
        None => p.clone(),
    };
    Ok([p, n])
}

impl LawParameters {
    fn build(self, path: &str) -> Result<Law, String> {
        let voce = self.linear.is_some() || self.asymptote.is_some() || self.scale.is_some();
        match (voce, self.stiffness, self.table) {
            (true, None, None) => {
                let linear = self.linear.unwrap_or(0.0);
                let asymptote = self.asymptote.unwrap_or(0.0);
                not_negative(&format!("{path}.linear"), linear, "N m")?;
                not_negative(&format!("{path}.asymptote"), asymptote, "N")?;
                let Some(scale) = self.scale.or((asymptote == 0.0).then_some(1.0)) else {
                    return Err(format!(
                        "{path}: given an asymptote of {asymptote} N without 'scale'; expected the \
                         curvature at which it has reached 63 %, such as '0.004 1/mm'"
                    ));
                };
                positive(&format!("{path}.scale"), scale, "1/m")?;
                if linear + asymptote / scale <= 0.0 {
                    return Err(format!(
                        "{path}: given linear 0 N m and asymptote 0 N; expected a bending stiffness \
                         at rest, linear + asymptote / scale, above 0: leave 'bending' out for a ply \
                         without bending"
                    ));
                }
                Ok(Law::Voce(Voce {
                    linear,
                    asymptote,
                    scale,
                }))
            }
            (false, Some(stiffness), None) => {
                positive(&format!("{path}.stiffness"), stiffness, "N m")?;
                Ok(Law::Voce(Voce {
                    linear: stiffness,
                    asymptote: 0.0,
                    scale: 1.0,
                }))
            }
            (false, None, Some(t)) => {
                checks::moment_table(&format!("{path}.table"), &t.curvatures, &t.moments)?;
                Ok(Law::Table(Cubic::new(&t.curvatures, &t.moments)))
            }
            _ => Err(format!(
                "{path}: expected exactly one law: 'linear' with 'asymptote' and 'scale' (Voce), or \
                 'stiffness' (constant), or 'table' with 'curvatures' and 'moments'"
            )),
        }
    }
}
