//! Cost of the distance grid of a scene's tool:
//! `cargo run --release -p plyflow-tooling --example distance-cost -- scene.yaml`.

use plyflow_model::scene::Scene;
use plyflow_tooling::SignedDistanceGrid;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: distance-cost <scene.yaml>")?;
    let scene = Scene::from_json(serde_saphyr::from_str(&std::fs::read_to_string(&path)?)?)?;
    let started = Instant::now();
    let mesh = plyflow_tooling::build_from(
        &scene.tool,
        Path::new(&path).parent().unwrap_or(Path::new("")),
    )?;
    println!(
        "mesh: {} facets in {:.3} s",
        mesh.triangles.len(),
        started.elapsed().as_secs_f64()
    );
    for spacing in [4e-3, 3e-3, 2e-3] {
        let started = Instant::now();
        let grid = SignedDistanceGrid::build(&mesh, spacing, 6e-3);
        let build = started.elapsed().as_secs_f64();
        // Points on the surface, in the order of the mesh, as the nodes of a draped sheet would come.
        let near: Vec<[f64; 3]> = mesh
            .points
            .iter()
            .map(|p| [p[0], p[1], p[2] + 4e-4])
            .collect();
        let far: Vec<[f64; 3]> = mesh
            .points
            .iter()
            .map(|p| [p[0], 2.0 * p[1], 0.5 * p[2] + 0.08])
            .collect();
        print!(
            "h {:.0} mm: build {build:.3} s, {:.1} MB",
            spacing * 1e3,
            grid.memory() as f64 / 1e6
        );
        for (name, points) in [("near", &near), ("mixed", &far)] {
            let (mut d, mut g) = (vec![0.0; points.len()], vec![[0.0; 3]; points.len()]);
            let rounds = 20;
            let started = Instant::now();
            for _ in 0..rounds {
                grid.within_many(std::hint::black_box(points), 4e-3, &mut d, &mut g);
            }
            let found = d.iter().filter(|d| d.is_finite()).count();
            let each = started.elapsed().as_secs_f64() * 1e9 / (rounds * points.len()) as f64;
            print!(
                ", {name} {each:.1} ns a query ({found} of {} found)",
                points.len()
            );
        }
        println!();
    }
    Ok(())
}
