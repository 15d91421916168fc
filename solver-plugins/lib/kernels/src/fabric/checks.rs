//! Checks of what a user gives: each says where in `with`, what was given, what is expected, and
//! what to do. Values are SI, because that is what arrives; angles are told in degrees too.

use super::cubic;
use super::yarn::{MAX_COEFFICIENTS, Polynomial};

/// Largest angle of a shear law (rad): 1/cos g must stay of the order of 1.
const LARGEST_ANGLE: f64 = 1.5;
/// Least last angle of a shear table (5 deg, as the least limit of a polynomial): a shorter one is a
/// wrong unit, and all of a forming run would lie beyond it.
const LEAST_LAST_ANGLE: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Largest angle over which friction of the yarns builds up (30 deg): it is that of the corner of a loop.
const LARGEST_SLIP: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Places at which the slope of a polynomial is looked at.
const SAMPLES: usize = 2000;

/// An angle for a message.
fn angle(g: f64) -> String {
    format!("{g:.4} rad ({:.2} deg)", g.to_degrees())
}

/// A finite value above 0.
pub(super) fn positive(name: &str, value: f64, unit: &str) -> Result<(), String> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(format!(
        "{name}: given {value} {unit}; expected a finite value above 0"
    ))
}

/// A finite value of at least 0.
pub(super) fn not_negative(name: &str, value: f64, unit: &str) -> Result<(), String> {
    if value >= 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(format!(
        "{name}: given {value} {unit}; expected a finite value of at least 0"
    ))
}

/// The angle over which friction of the yarns builds up.
pub(super) fn slips(name: &str, angle_given: f64) -> Result<(), String> {
    if angle_given > 0.0 && angle_given <= LARGEST_SLIP {
        return Ok(());
    }
    Err(format!(
        "{name}: given {}; expected more than 0 deg and at most {:.0} deg: the angle over which the force turns round where the shear does",
        angle(angle_given),
        LARGEST_SLIP.to_degrees()
    ))
}

/// Least angle between the families (20 deg), and 180 deg less it the largest: nearer to each other no shear is left before they meet.
const LEAST_CROSSING: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// The angle between the families before forming.
pub(super) fn crossing(name: &str, given: f64) -> Result<(), String> {
    let apart = given.min(std::f64::consts::PI - given);
    if apart >= 0.999_999 * LEAST_CROSSING {
        return Ok(());
    }
    Err(format!(
        "{name}: given {}; expected 20 to 160 deg, counter-clockwise from family 1 to family 2",
        angle(given)
    ))
}

/// What a table holds, for messages.
pub(super) struct Columns {
    pub at: &'static str,
    pub at_unit: &'static str,
    pub value: &'static str,
    pub value_unit: &'static str,
}

pub(super) const SHEAR: Columns = Columns {
    at: "angles",
    at_unit: "rad",
    value: "forces",
    value_unit: "N/m",
};

pub(super) const MOMENT: Columns = Columns {
    at: "curvatures",
    at_unit: "1/m",
    value: "moments",
    value_unit: "N",
};

const COMPRESSION: Columns = Columns {
    at: "strains",
    at_unit: "1",
    value: "stresses",
    value_unit: "Pa",
};

impl Columns {
    fn place(&self, x: f64) -> String {
        if self.at_unit == "rad" {
            angle(x)
        } else if self.at_unit == "1" {
            format!("{x} ({} %)", 100.0 * x)
        } else {
            format!("{x} {} ({} 1/mm)", self.at_unit, x / 1000.0)
        }
    }
}

/// Both columns of a curve through the origin: as long, few enough, finite, places increasing from 0,
/// the first value 0.
pub(super) fn columns(
    path: &str,
    c: &Columns,
    range: std::ops::RangeInclusive<usize>,
    x: &[f64],
    y: &[f64],
) -> Result<(), String> {
    if x.len() != y.len() {
        return Err(format!(
            "{path}: given {} {} and {} {}; expected as many of each",
            x.len(),
            c.at,
            y.len(),
            c.value
        ));
    }
    if !range.contains(&x.len()) {
        return Err(format!(
            "{path}: given {} points; expected {} to {}{}",
            x.len(),
            range.start(),
            range.end(),
            if x.len() > *range.end() {
                "; keep fewer points, closer together where the curve bends"
            } else {
                ""
            }
        ));
    }
    for (name, unit, v) in [(c.at, c.at_unit, x), (c.value, c.value_unit, y)] {
        if let Some(i) = v.iter().position(|a| !a.is_finite()) {
            return Err(format!(
                "{path}.{name}[{i}]: given {} {unit}; expected a finite number",
                v[i]
            ));
        }
    }
    if let Some(i) = (1..x.len()).find(|i| x[*i] <= x[*i - 1]) {
        return Err(format!(
            "{path}.{}[{i}]: given {} after {}; expected increasing {}; sort the points, put one in \
             the place of repeated ones, and give those of the other sign as sizes under 'negative'",
            c.at,
            c.place(x[i]),
            c.place(x[i - 1]),
            c.at
        ));
    }
    Ok(())
}

/// A table through the origin, of 2 to 64 points.
fn table(path: &str, c: &Columns, x: &[f64], y: &[f64]) -> Result<(), String> {
    columns(path, c, 2..=cubic::MAX_POINTS, x, y)?;
    if x[0] != 0.0 || y[0] != 0.0 {
        return Err(format!(
            "{path}: given {} and {} {} as first point; expected 0 and 0 (no force without \
             deformation): put that point in front, or take the offset from the measured values",
            c.place(x[0]),
            y[0],
            c.value_unit
        ));
    }
    Ok(())
}

/// Index of the first value that is not above the one before it (`strict`), or below it.
fn first_fall(y: &[f64], strict: bool) -> Option<usize> {
    (1..y.len()).find(|i| y[*i] < y[*i - 1] || (strict && y[*i] == y[*i - 1]))
}

fn softening_advice(path: &str) -> String {
    let law = path.split('.').next().unwrap_or(path);
    format!(
        "a yarn law that falls is unstable: shear gathers in one row of elements, and the answer \
         depends on the mesh. Fit or smooth the data again, give a peak of the stitch under 'stitch', or \
         write '{law}.allow_softening: true' to take it as it is"
    )
}

/// A shear table: angles (rad) and forces (N/m) over |g|.
pub(super) fn shear_table(path: &str, x: &[f64], y: &[f64], softening: bool) -> Result<(), String> {
    table(path, &SHEAR, x, y)?;
    let last = x[x.len() - 1];
    if last >= LARGEST_ANGLE {
        return Err(format!(
            "{path}.angles[{}]: given {}; expected less than {}; leave the last points out",
            x.len() - 1,
            angle(last),
            angle(LARGEST_ANGLE)
        ));
    }
    if last < 0.999_999 * LEAST_LAST_ANGLE {
        return Err(format!(
            "{path}.angles[{}]: given {} as last angle; expected at least 5 deg: check the unit (rad, deg), \
             or measure further",
            x.len() - 1,
            angle(last)
        ));
    }
    if let Some(i) = (1..y.len()).find(|i| y[*i] <= 0.0) {
        return Err(format!(
            "{path}.forces[{i}]: given {} N/m at {}; expected a force above 0 (sizes; the sign is that \
             of the shear): a force against the shear would drive it on",
            y[i],
            angle(x[i])
        ));
    }
    match first_fall(y, true) {
        Some(i) if !softening => Err(format!(
            "{path}.forces[{i}]: given {} N/m at {} after {} N/m at {}; expected rising forces: {}",
            y[i],
            angle(x[i]),
            y[i - 1],
            angle(x[i - 1]),
            softening_advice(path)
        )),
        _ => Ok(()),
    }
}

/// A bending table: curvatures (1/m) and moments per width (N).
pub(super) fn moment_table(path: &str, x: &[f64], y: &[f64]) -> Result<(), String> {
    table(path, &MOMENT, x, y)?;
    if y[1] <= 0.0 {
        return Err(format!(
            "{path}.moments[1]: given {} N at {}; expected a moment above 0 (sizes): the ply needs \
             a bending stiffness at rest",
            y[1],
            MOMENT.place(x[1])
        ));
    }
    if let Some(i) = first_fall(y, false) {
        return Err(format!(
            "{path}.moments[{i}]: given {} N at {} after {} N; expected moments that do not fall: a \
             negative bending stiffness folds the ply at a point. Smooth the data, or end the table \
             before it falls (the law goes on along its tangent)",
            y[i],
            MOMENT.place(x[i]),
            y[i - 1]
        ));
    }
    Ok(())
}

/// A curve of compression: strains (1) and stresses (Pa), both as sizes, of fibres with the modulus `modulus` (Pa) in tension.
pub(super) fn compression_table(
    path: &str,
    x: &[f64],
    y: &[f64],
    modulus: f64,
) -> Result<(), String> {
    table(path, &COMPRESSION, x, y)?;
    let last = x.len() - 1;
    if x[last] >= 1.0 {
        return Err(format!(
            "{path}.strains[{last}]: given {}; expected less than 1, at which nothing of the length is left: strains are shares (2 % is 0.02)",
            COMPRESSION.place(x[last])
        ));
    }
    if y[1] <= 0.0 {
        return Err(format!(
            "{path}.stresses[1]: given {} Pa at {}; expected a stress above 0 (sizes): fibres without any stiffness in compression have \
             no stable straight state",
            y[1],
            COMPRESSION.place(x[1])
        ));
    }
    if let Some(i) = first_fall(y, false) {
        return Err(format!(
            "{path}.stresses[{i}]: given {} Pa at {} after {} Pa; expected stresses that do not fall: compression would gather in one row of \
             elements, and the answer depend on the mesh. Smooth the data, or end the table before it falls (the law goes on along its tangent)",
            y[i],
            COMPRESSION.place(x[i]),
            y[i - 1]
        ));
    }
    let slope = |i: usize| (y[i] - y[i - 1]) / (x[i] - x[i - 1]);
    match (1..x.len()).find(|i| slope(*i) > modulus * (1.0 + 1e-9)) {
        Some(i) => Err(format!(
            "{path}.stresses[{i}]: given {} Pa at {}, which rises by {} Pa for each strain; expected at most the modulus in tension, {modulus} Pa: fibres \
             are not stiffer in compression. Check the units",
            y[i],
            COMPRESSION.place(x[i]),
            slope(i)
        )),
        None => Ok(()),
    }
}

/// A shear polynomial and its limit angle (rad).
pub(super) fn polynomial(
    path: &str,
    coefficients: &[f64],
    limit: f64,
    softening: bool,
) -> Result<Polynomial, String> {
    let n = coefficients.len();
    if !(2..=MAX_COEFFICIENTS).contains(&n) || coefficients[0] != 0.0 {
        return Err(format!(
            "{path}.coefficients: given {n} coefficients starting with {:?} N/m; expected 2 to \
             {MAX_COEFFICIENTS}, of g^0, g^1, ..., the first 0 N/m (no force without shear)",
            coefficients.first()
        ));
    }
    if let Some(i) = coefficients.iter().position(|c| !c.is_finite()) {
        return Err(format!(
            "{path}.coefficients[{i}]: given {} N/m; expected a finite number",
            coefficients[i]
        ));
    }
    if !(limit > 0.0 && limit < LARGEST_ANGLE) {
        return Err(format!(
            "{path}.limit: given {limit} rad; expected more than 0, below {LARGEST_ANGLE}"
        ));
    }
    if coefficients[1] <= 0.0 {
        return Err(format!(
            "{path}.coefficients[1]: given {} N/m, the slope of F_norm at g = 0; expected a value above 0: \
             without it the energy is not convex at rest and the flat ply has no stable state",
            coefficients[1]
        ));
    }
    let law = Polynomial::new(coefficients, limit);
    let at = |i: usize| limit * i as f64 / SAMPLES as f64;
    if let Some(i) = (1..=SAMPLES).find(|i| law.scalar(at(*i)).0 <= 0.0) {
        return Err(format!(
            "{path}.coefficients: F_norm is {} N/m at {}; expected values above 0 up to the limit of {} \
             (check the units: coefficients belong to powers of the angle in rad, not in deg)",
            law.scalar(at(i)).0,
            angle(at(i)),
            angle(limit)
        ));
    }
    match falling_range(&law, limit) {
        Some((from, to, slope)) if !softening => Err(format!(
            "{path}.coefficients: F_norm falls from {} to {} (slope down to {slope:.4} N/m per rad); \
             expected a curve that rises up to the limit of {}: {}",
            angle(from),
            angle(to),
            angle(limit),
            softening_advice(path)
        )),
        _ => Ok(law),
    }
}

/// First range of angles in which the polynomial falls, and its least slope there.
fn falling_range(law: &Polynomial, limit: f64) -> Option<(f64, f64, f64)> {
    let at = |i: usize| limit * i as f64 / SAMPLES as f64;
    let slope = |g: f64| law.scalar(g).1;
    let first = (0..=SAMPLES).find(|i| slope(at(*i)) < 0.0)?;
    let after = (first..=SAMPLES).find(|i| slope(at(*i)) >= 0.0);
    // The zero of the slope between two samples.
    let zero = |mut a: f64, mut b: f64| {
        let negative = slope(a) < 0.0;
        for _ in 0..60 {
            let c = 0.5 * (a + b);
            if (slope(c) < 0.0) == negative {
                a = c;
            } else {
                b = c;
            }
        }
        0.5 * (a + b)
    };
    let from = zero(at(first.saturating_sub(1)), at(first));
    let to = after.map_or(limit, |i| zero(at(i - 1), at(i)));
    let least = (first..after.unwrap_or(SAMPLES + 1))
        .map(|i| slope(at(i)))
        .fold(f64::INFINITY, f64::min);
    Some((from, to, least))
}

/// Points of the stitch curve: |g| (rad) and forces (N/m), up to the yarns' limit (rad).
pub(super) fn stitch(x: &[f64], y: &[f64], limit: f64) -> Result<(), String> {
    columns("stitch", &SHEAR, 3..=super::stitch::MAX_POINTS, x, y)?;
    let (n, last) = (x.len(), x.len() - 1);
    if x[0] < 0.0 {
        return Err(format!(
            "stitch.angles[0]: given {}; expected at least 0: angles are sizes, and 'direction: \
             negative' makes the stitch act for g < 0",
            angle(x[0])
        ));
    }
    if x[last] > limit {
        return Err(format!(
            "stitch.angles[{last}]: given {}; expected at most the limit of the yarns' law, {}: raise \
             the limit, or let the stitch fail earlier",
            angle(x[last]),
            angle(limit)
        ));
    }
    for i in [0, last] {
        if y[i] != 0.0 {
            return Err(format!(
                "stitch.forces[{i}]: given {} N/m; expected 0 N/m: the stitch carries nothing before \
                 its first angle and after its last",
                y[i]
            ));
        }
    }
    if y[1] <= 0.0 {
        return Err(format!(
            "stitch.forces[1]: given {} N/m; expected the peak of the stitch, above 0 N/m",
            y[1]
        ));
    }
    if let Some(i) = (2..n).find(|i| y[*i] > y[*i - 1]) {
        return Err(format!(
            "stitch.forces[{i}]: given {} N/m after {} N/m; expected forces that do not rise after the peak, \
             which is the second point (a broken stitch does not heal); a rise in several pieces belongs \
             into the yarns' law",
            y[i],
            y[i - 1]
        ));
    }
    Ok(())
}
