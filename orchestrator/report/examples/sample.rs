//! Writes the reports of made-up runs: `cargo run -p plyflow-report --example sample -- FOLDER`.

#[path = "../tests/common/mod.rs"]
mod common;

use camino::Utf8PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Utf8PathBuf::from(std::env::args().nth(1).ok_or("usage: sample FOLDER")?);
    std::fs::create_dir_all(&folder)?;
    let mut study = common::whole_study(&folder);
    study.measurement();
    let mut limited = common::whole(&folder);
    limited.limits = Some(serde_json::from_value(serde_json::json!({
        "wrinkle_length": "60 mm", "wrinkle_height": "2 mm", "bridging_gap": "3 mm", "shear_positive": "20 deg", "shear_negative": "-50 deg",
    }))?);
    limited.judged = plyflow_report::judge(&limited);
    let mut coupons = common::Study::new(&folder);
    coupons.coupon();
    for (input, name) in [
        (study.input(), "report.html"),
        (limited, "limits.html"),
        (coupons.input(), "coupon.html"),
        (common::family::friction_map(&folder), "study-map.html"),
        (common::family::sweep(&folder, 5), "study-sweep.html"),
        (common::family::sweep(&folder, 45), "study-small.html"),
        (common::family::sample(&folder, 200), "study-sample.html"),
        (common::family::alone(&folder), "study-alone.html"),
        (common::family::texts(&folder), "study-texts.html"),
    ] {
        let out = folder.join(name);
        let size = plyflow_report::write_report(&input, &out)?;
        print!("{}", plyflow_report::summary(&input, Some(&out)));
        println!("{size} bytes");
    }
    let (first, second) = (folder.join("first"), folder.join("second"));
    for sub in [&first, &second] {
        std::fs::create_dir_all(sub)?;
    }
    let (a, mut b) = (common::whole(&first), common::Study::new(&second));
    b.scene["friction"]["fabric_fabric"] = serde_json::json!(0.2);
    b.forming("coarse", None, 0.004);
    b.defects(false);
    plyflow_report::write_beside([&a, &b.input()], &folder.join("beside.html"))?;
    Ok(())
}
