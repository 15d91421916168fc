//! Writes a forming-like artifact: a tool that stands still and three sheets with fields of their own.
//! `cargo run -p plyflow-artifact --example vtk-sample -- FILE [FRAMES [SIDE]]`; the Python check in
//! `tests/vtk` opens it.

use plyflow_artifact::{ArtifactWriter, FieldInfo, On};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .ok_or("usage: sample FILE [FRAMES [SIDE]]")?;
    let frames: usize = arguments.next().map_or(Ok(5), |t| t.parse())?;
    let side: usize = arguments.next().map_or(Ok(12), |t| t.parse())?;
    let mut w = ArtifactWriter::create(path.as_ref(), "forming")?;
    let tool: Vec<f64> = (0..30).map(|i| f64::from(i) / 7.0).collect();
    let triangles: Vec<u32> = (0..8).flat_map(|i| [i, i + 1, i + 2]).collect();
    w.define_mesh("tool", &tool, 3, &triangles, "")?;
    let names = ["ply_1", "ply_2", "film"];
    let sides = [side, side + 1, side / 2];
    for (b, name) in names.iter().enumerate() {
        let n = sides[b];
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let cells: Vec<u32> = (0..n * n)
            .flat_map(|c| {
                let (i, j) = (c / n, c % n);
                [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
            })
            .collect();
        w.define_mesh(name, &points(n, b, 0.0), 4, &cells, "")?;
    }
    for f in 0..frames {
        let t = f as f64 * 0.01;
        w.begin_frame(t)?;
        for (b, name) in names.iter().enumerate() {
            let n = sides[b];
            w.frame_points(name, &points(n, b, t))?;
            let on_points: Vec<f64> = (0..(n + 1) * (n + 1))
                .map(|i| (i as f64 * 0.1 + t * 50.0).sin())
                .collect();
            w.frame_field(
                name,
                FieldInfo::new(On::Points, "contact_pressure", 1, "Pa"),
                &on_points,
            )?;
            let on_cells: Vec<f64> = (0..n * n).map(|i| (i as f64 * 0.3 - t).cos()).collect();
            if *name == "film" {
                w.frame_field(
                    name,
                    FieldInfo::new(On::Cells, "principal_stretch", 1, "1"),
                    &on_cells,
                )?;
            } else {
                w.frame_field(
                    name,
                    FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
                    &on_cells,
                )?;
            }
        }
        w.end_frame()?;
    }
    w.attributes("{}")?;
    w.finish(&serde_json::json!({}))?;
    Ok(())
}

fn points(n: usize, body: usize, t: f64) -> Vec<f64> {
    (0..(n + 1) * (n + 1))
        .flat_map(|p| {
            let (x, y) = ((p / (n + 1)) as f64 / 3.0, (p % (n + 1)) as f64 / 7.0);
            [x, y, body as f64 * 0.01 + t * (x * y).sin()]
        })
        .collect()
}
