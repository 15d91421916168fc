//! What an artifact with a few attributes costs: the first one starts the library.
//! `cargo run --release -p plyflow-artifact --example cost -- FOLDER`

use plyflow_artifact::{Artifact, ArtifactWriter};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: cost FOLDER")?;
    for i in 0..5 {
        let path = std::path::Path::new(&folder).join(format!("{i}.h5"));
        let clock = Instant::now();
        let mut w = ArtifactWriter::create(&path, "test")?;
        w.attributes("{\"value\": 1}")?;
        w.result("value", 1.0, "1")?;
        w.finish(&serde_json::json!({"step": "x"}))?;
        let written = clock.elapsed();
        let clock = Instant::now();
        let a = Artifact::open(&path)?;
        let opened = clock.elapsed();
        println!("{}: written in {written:?}, opened in {opened:?}", a.kind());
    }
    Ok(())
}
