//! Writes the synthetic raw data of `workflows/characterisation`: what testing machines would record of the
//! laws of the thesis, with a stated noise. The same bytes every time.
//!
//! `cargo run --release -p plyflow-characterisation --example reference_data`

use plyflow_characterisation::synthetic::{
    BENDING, Noise, frame_force, ncf_shear, overhang_at, sled_coefficient, woven_shear,
};
use std::fmt::Write;
use std::path::{Path, PathBuf};

const SIDE: f64 = 0.145;
const SPECIMEN: f64 = 0.145;

fn main() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../workflows/characterisation");
    profiles(&root.join("revised-cantilever/reference"))?;
    overhangs(&root.join("standard-cantilever/reference"))?;
    frames(&root.join("picture-frame/reference"))?;
    pulls(&root.join("friction-sled/reference"))
}

fn write(folder: &Path, name: &str, about: &str, header: &str, rows: &str) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let path: PathBuf = folder.join(name);
    let head = "# SYNTHETIC DATA, not measured; written by the example `reference_data` of plyflow-characterisation.";
    std::fs::write(path, format!("{head}\n# {about}\n{header}\n{rows}"))
}

fn profiles(folder: &Path) -> std::io::Result<()> {
    for (i, law) in BENDING.iter().enumerate() {
        for specimen in 1..=2u64 {
            let [x, z] = law.scan(0.5e-3, 0.02e-3, 100 * i as u64 + specimen);
            // The scanner's origin is the edge of the clamp.
            let rows: String = x
                .iter()
                .zip(&z)
                .map(|(x, z)| format!("{:.4},{:.4}\n", 1e3 * x, 1e3 * z))
                .collect();
            let about = format!(
                "Elastica of a strip under its own weight, bending law '{}' of thesis table 3.2, overhang {} mm, {} g/m2;\n\
                 # a point every 0.5 mm of the arc, normal noise of 0.02 mm in x and in z.",
                law.name,
                1e3 * law.overhang,
                1e3 * law.areal_mass
            );
            write(
                folder,
                &format!("{}-{specimen}.csv", law.name),
                &about,
                "x [mm],z [mm]",
                &rows,
            )?;
        }
    }
    Ok(())
}

fn overhangs(folder: &Path) -> std::io::Result<()> {
    for (i, law) in BENDING.iter().enumerate() {
        for (j, degrees) in [41.5f64, 7.1].into_iter().enumerate() {
            let exact = overhang_at(&|k| law.law(k), law.weight(), degrees.to_radians());
            let mut random = Noise::new(7 + 10 * i as u64 + j as u64);
            let mut rows = String::new();
            for _ in 0..6 {
                let _ = writeln!(
                    rows,
                    "{:.2},{degrees}",
                    1e3 * exact * (1.0 + 0.01 * random.normal())
                );
            }
            let about = format!(
                "Overhang at which an elastica with bending law '{}' of thesis table 3.2 hangs at {degrees} deg ({:.2} mm),\n\
                 # six specimens, normal noise of 1 % of the overhang.",
                law.name,
                1e3 * exact
            );
            write(
                folder,
                &format!("{}-{degrees}-deg.csv", law.name),
                &about,
                "overhang [mm],angle [deg]",
                &rows,
            )?;
        }
    }
    Ok(())
}

fn frames(folder: &Path) -> std::io::Result<()> {
    type Law = fn(f64) -> f64;
    let cases: [(&str, Law, f64, f64); 4] = [
        ("woven-1", woven_shear, 1.0, 60.0),
        ("woven-2", woven_shear, 1.0, 60.0),
        ("ncf-positive", ncf_shear, 1.0, 55.0),
        ("ncf-negative", ncf_shear, -1.0, 55.0),
    ];
    for (i, (name, law, sign, degrees)) in cases.into_iter().enumerate() {
        let mut random = Noise::new(40 + i as u64);
        let half = 0.5 * (90f64 - degrees).to_radians();
        let last = 2.0 * SIDE * (half.cos() - 0.5f64.sqrt());
        let forces: Vec<f64> = (0..=500)
            .map(|n| frame_force(&law, SIDE, SPECIMEN, last * f64::from(n) / 500.0, sign))
            .collect();
        let noise = 0.002 * forces.iter().fold(0.0f64, |m, f| m.max(*f));
        let mut rows = String::new();
        for (n, force) in forces.iter().enumerate() {
            let _ = writeln!(
                rows,
                "{:.4},{:.5}",
                1e3 * last * n as f64 / 500.0,
                force + noise * random.normal()
            );
        }
        let about = format!(
            "Cross-head of a picture frame with sides of {} mm filled by the specimen, law of thesis table 3.1, {} shear\n\
             # to {degrees} deg; normal noise of 0.2 % of the largest force ({noise:.4} N).",
            1e3 * SIDE,
            if sign > 0.0 { "positive" } else { "negative" }
        );
        write(
            folder,
            &format!("{name}.csv"),
            &about,
            "displacement [mm],force [N]",
            &rows,
        )?;
    }
    Ok(())
}

fn pulls(folder: &Path) -> std::io::Result<()> {
    let normal = 5.0;
    for pull in 1..=5u64 {
        let mut random = Noise::new(70 + pull);
        let dynamic = 0.36 + 0.01 * random.normal();
        let mut rows = String::new();
        for i in 0..=1000 {
            let s = 0.25e-3 * f64::from(i);
            let force = normal
                * (sled_coefficient(dynamic + 0.06, dynamic, 0.008, s) + 0.003 * random.normal());
            let _ = writeln!(rows, "{:.2},{force:.4}", 1e3 * s);
        }
        let about = format!(
            "Sled of {normal} N: dynamic coefficient 0.36 (thesis, fabric on fabric; 0.01 from pull to pull, here {dynamic:.4}),\n\
             # static peak 0.06 above it, stick-slip of 0.008, normal noise of 0.003, all over the normal force."
        );
        write(
            folder,
            &format!("pull-{pull}.csv"),
            &about,
            "displacement [mm],force [N]",
            &rows,
        )?;
    }
    Ok(())
}
