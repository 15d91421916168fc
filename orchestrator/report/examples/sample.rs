//! Writes the report of a made-up study: `cargo run -p plyflow-report --example sample -- FOLDER`.

#[path = "../tests/common/mod.rs"]
mod common;

use camino::Utf8PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Utf8PathBuf::from(std::env::args().nth(1).ok_or("usage: sample FOLDER")?);
    std::fs::create_dir_all(&folder)?;
    let input = common::whole(&folder);
    let out = folder.join("report.html");
    let size = plyflow_report::write_report(&input, &out)?;
    print!("{}", plyflow_report::summary(&input, Some(&out)));
    println!("{size} bytes");
    Ok(())
}
