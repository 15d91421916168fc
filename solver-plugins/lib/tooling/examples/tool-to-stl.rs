//! Writes the tool of a scene as a binary STL file in millimetres:
//! `cargo run -p plyflow-tooling --example tool-to-stl -- scene.yaml tool.stl`.

use plyflow_model::scene::Scene;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let usage = "usage: tool-to-stl <scene.yaml> <tool.stl>";
    let mut arguments = std::env::args().skip(1);
    let scene_path = arguments.next().ok_or(usage)?;
    let stl_path = arguments.next().ok_or(usage)?;
    let scene = Scene::from_json(serde_saphyr::from_str(&std::fs::read_to_string(
        &scene_path,
    )?)?)?;
    let folder = Path::new(&scene_path).parent().unwrap_or(Path::new(""));
    let mesh = plyflow_tooling::build_from(&scene.tool, folder)?;
    let facets: Vec<[[f64; 3]; 3]> = (0..mesh.triangles.len())
        .map(|t| mesh.corners(t).map(|p| p.map(|c| c * 1e3)))
        .collect();
    std::fs::write(&stl_path, plyflow_files::stl::write(&facets))?;
    let [low, high] = mesh.bounds().map(|p| p.map(|c| c * 1e3));
    println!(
        "{stl_path}: {} points, {} facets",
        mesh.points.len(),
        facets.len()
    );
    println!(
        "box (mm): {low:.2?} to {high:.2?}; volume {:.1} cm3",
        mesh.volume() * 1e6
    );
    Ok(())
}
