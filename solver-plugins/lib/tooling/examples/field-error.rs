//! How far the distance field of a scene's tool is from its triangles:
//! `cargo run --release -p plyflow-tooling --example field-error -- scene.yaml [offset in mm] [spacing in mm ...]`.

use plyflow_model::scene::Scene;
use plyflow_tooling::SignedDistanceGrid;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .ok_or("usage: field-error <scene.yaml> [offset] [spacing ...]")?;
    let numbers: Vec<f64> = arguments.map(|a| a.parse()).collect::<Result<_, _>>()?;
    let offset = 1e-3 * numbers.first().copied().unwrap_or(1.0);
    let scene = Scene::from_json(serde_saphyr::from_str(&std::fs::read_to_string(&path)?)?)?;
    let folder = Path::new(&path).parent().unwrap_or(Path::new(""));
    let mesh = plyflow_tooling::build_from(&scene.tool, folder)?;
    println!("{} facets", mesh.triangles.len());
    let given: &[f64] = numbers
        .get(1..)
        .filter(|g| !g.is_empty())
        .unwrap_or(&[4.0, 3.0, 2.0]);
    for spacing in given {
        for tolerance in [3e-5, 4e-5] {
            let started = Instant::now();
            let space = [1e-3 * spacing, 1e-2];
            let (grid, e) =
                SignedDistanceGrid::build_within(&mesh, space, [tolerance, offset], &|_| true);
            println!(
                "spacing {spacing} mm, within {:.3} mm: built in {:.2} s, {:.1} MB; largest error {:.4} mm at {:?}",
                1e3 * tolerance,
                started.elapsed().as_secs_f64(),
                grid.memory() as f64 / 1e6,
                1e3 * e.largest,
                e.at.map(|c| (c * 1e5).round() / 1e2),
            );
            let again = grid.error_against(&mesh, offset, |_| true);
            println!("  looked at again: {:.4} mm", 1e3 * again.largest);
        }
        let started = Instant::now();
        let grid = SignedDistanceGrid::build(&mesh, 1e-3 * spacing, 1e-2);
        let built = started.elapsed().as_secs_f64();
        for (what, offset) in [("on it", 0.0), ("and out of it", offset)] {
            let started = Instant::now();
            let e = grid.error_against(&mesh, offset, |_| true);
            println!(
                "spacing {spacing} mm: built in {built:.2} s, {:.1} MB; {what}: largest error {:.4} mm at {:?}, found in {:.2} s",
                grid.memory() as f64 / 1e6,
                1e3 * e.largest,
                e.at.map(|c| (c * 1e5).round() / 1e2),
                started.elapsed().as_secs_f64()
            );
        }
    }
    Ok(())
}
