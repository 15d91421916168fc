//! Writes a small artifact of the kind `forming` whose fibres, thickness and areal mass are closed forms: for tests and for readers that are not ours.
//!
//!     cargo run -p plyflow-export --example sheared-square -- FILE [what is left out: fibres | thickness | mass | drape]..
//!
//! Ply `lower`: a square of 100 mm in 4 x 4 cells with the fibres at 0 and 90 degrees, in two frames. In the last one it is sheared by
//! 0.4 rad, stretched by 1.1 along x and turned about x by 30 degrees. Ply `upper-2`: the same over it, fibres at 45 and 135 degrees. A film, and a
//! tool of two triangles. With `drape` the first cell of `lower` has no shape.

use plyflow_artifact::{ArtifactError, ArtifactWriter, FieldInfo, On};
use serde_json::{Value, json};

/// Cells along a side.
pub const SIDE: usize = 4;
/// Side of the flat square (m).
pub const LENGTH: f64 = 0.1;
/// Shear angle at the end (rad).
pub const SHEAR: f64 = 0.4;
/// Stretch along x at the end.
pub const STRETCH: f64 = 1.1;
/// Without `straight`: by how much fibres turn along x (rad).
pub const STEERED: f64 = 0.5;
/// Turn about x at the end (rad).
pub const TURN: f64 = std::f64::consts::FRAC_PI_6;

/// Points of the square at a height; formed or not.
fn points(z: f64, formed: bool) -> Vec<f64> {
    let step = LENGTH / SIDE as f64;
    let at = |i: usize| {
        let x = (i % (SIDE + 1)) as f64 * step - 0.5 * LENGTH;
        let y = (i / (SIDE + 1)) as f64 * step - 0.5 * LENGTH;
        let (sin, cos) = TURN.sin_cos();
        match formed {
            false => [x, y, z],
            true => [
                STRETCH * (x + SHEAR.tan() * y),
                cos * y - sin * z,
                sin * y + cos * z,
            ],
        }
    };
    (0..(SIDE + 1) * (SIDE + 1)).flat_map(at).collect()
}

fn cells() -> Vec<u32> {
    let corners = |c: usize| {
        let a = c / SIDE * (SIDE + 1) + c % SIDE;
        [a, a + 1, a + SIDE + 2, a + SIDE + 1].map(|n| n as u32)
    };
    (0..SIDE * SIDE).flat_map(corners).collect()
}

/// Names and materials of the plies; with the word `names` such as come too near to each other where small letters and umlauts do not count.
fn names(words: &[String]) -> [[&'static str; 2]; 2] {
    match words.iter().any(|w| w == "names") {
        true => [["a", "Gewebe \u{e4}"], ["A-Draped", "Gewebe \u{f6}"]],
        false => [["lower", "NCF, 440 g/m2"], ["upper-2", "NCF, 440 g/m2"]],
    }
}

fn sheets(without: &[String]) -> Value {
    let has = |what: &str| !without.iter().any(|w| w == what);
    let ply = |[name, material]: [&str; 2], fibre_1: f64, z: f64| {
        let mut sheet = json!({"name": name, "kind": "ply", "material": material, "thickness": 0.0, "offset": z});
        if has("thickness") {
            sheet["thickness"] = json!(0.0005);
        }
        if has("mass") {
            sheet["areal_mass"] = json!(0.44);
        }
        if has("fibres") {
            let first = fibre_1.to_radians();
            if has("straight") {
                sheet["fibre_1"] = json!(first);
                sheet["fibre_2"] = json!((fibre_1 + 90.0).to_radians());
            } else {
                let half = 0.5 * LENGTH;
                sheet["steering"] = json!([[-half, 0.0, first], [half, 0.0, first + STEERED]]);
            }
        }
        sheet
    };
    let [lower, upper] = names(without);
    json!([
        ply(lower, 0.0, 0.0),
        {"name": "film", "kind": "diaphragm", "thickness": 0.0001, "offset": 0.001},
        ply(upper, 45.0, 0.002)
    ])
}

/// Writes it.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &str, without: &[String]) -> Result<(), ArtifactError> {
    let mut w = ArtifactWriter::create(path.as_ref(), "forming")?;
    let [[lower, _], [upper, _]] = names(without);
    let bodies = [(lower, 0.0), ("film", 0.001), (upper, 0.002)];
    for (name, z) in bodies {
        w.define_mesh(name, &points(z, false), 4, &cells(), "")?;
    }
    let tool = [
        0.0, 0.0, -0.01, 0.1, 0.0, -0.01, 0.1, 0.1, -0.01, 0.0, 0.1, -0.01,
    ];
    w.define_mesh("tool", &tool, 3, &[0, 1, 2, 0, 2, 3], "")?;
    for (time, formed) in [(0.0, false), (0.25, true)] {
        w.begin_frame(time)?;
        for (name, z) in bodies {
            w.frame_points(name, &points(z, formed))?;
            let count = (SIDE + 1) * (SIDE + 1);
            let pressure: Vec<f64> = (0..count).map(|i| i as f64 * 100.0 + time).collect();
            w.frame_field(
                name,
                FieldInfo::new(On::Points, "contact_pressure", 1, "Pa"),
                &pressure,
            )?;
            if name == "film" {
                continue;
            }
            let shear = vec![if formed { SHEAR } else { 0.0 }; SIDE * SIDE];
            w.frame_field(
                name,
                FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
                &shear,
            )?;
            if without.iter().any(|w| w == "drape") && name == lower {
                let mut reached = vec![1.0; SIDE * SIDE];
                reached[0] = 0.0;
                w.frame_field(name, FieldInfo::new(On::Cells, "draped", 1, "1"), &reached)?;
            }
        }
        w.end_frame()?;
    }
    w.attributes(&json!({"sheets": sheets(without)}).to_string())?;
    let key = "0".repeat(64);
    w.finish(&json!({"step": "square", "item": [], "key": key, "plugin": {"name": "sheared-square", "version": "1.0.0"}}))?;
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let path = words
        .next()
        .ok_or("usage: sheared-square FILE [fibres|straight|thickness|mass|drape|names]..")?;
    Ok(write(&path, &words.collect::<Vec<_>>())?)
}
