//! Writes the reports of made-up runs: `cargo run -p plyflow-report --example sample -- FOLDER`.

#[path = "../tests/common/mod.rs"]
mod common;

use camino::Utf8PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Utf8PathBuf::from(std::env::args().nth(1).ok_or("usage: sample FOLDER")?);
    std::fs::create_dir_all(&folder)?;
    let mut study = common::whole_study(&folder);
    study.measurement();
    let mut coupons = common::Study::new(&folder);
    coupons.coupon();
    for (input, name) in [
        (study.input(), "report.html"),
        (coupons.input(), "coupon.html"),
    ] {
        let out = folder.join(name);
        let size = plyflow_report::write_report(&input, &out)?;
        print!("{}", plyflow_report::summary(&input, Some(&out)));
        println!("{size} bytes");
    }
    Ok(())
}
