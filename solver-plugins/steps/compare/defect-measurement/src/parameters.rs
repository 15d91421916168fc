//! What the manifest asks for beside [`Settings`](plyflow_defects::Settings) and [`Limits`](plyflow_defects::Limits).

use crate::region::Asked;
use plyflow_model::artifact::SectionOn;
use plyflow_sdk::StepError;
use serde::Deserialize;

#[derive(Deserialize)]
pub struct Parameters {
    pub compressed_below: f64,
    pub sections: Vec<Section>,
    pub shear_regions: Vec<Asked>,
    pub scan: Option<String>,
    pub scan_unit: Option<f64>,
    pub scan_offset: Option<f64>,
    pub scan_align: Align,
    pub scan_kept: f64,
    pub scan_ply: Option<String>,
}

#[derive(Deserialize)]
pub struct Section {
    pub label: String,
    /// `[x, y]` (m).
    from: Option<Vec<f64>>,
    /// `[x, y]` (m).
    to: Option<Vec<f64>>,
    /// `[x, y]` (m) each, instead of both ends.
    path: Option<Vec<Vec<f64>>>,
    #[serde(default)]
    pub on: SectionOn,
}

impl Section {
    /// The corners of its path (m).
    pub fn corners(&self) -> Result<Vec<[f64; 2]>, StepError> {
        let given = match (&self.path, &self.from, &self.to) {
            (Some(path), None, None) => path.clone(),
            (None, Some(from), Some(to)) => vec![from.clone(), to.clone()],
            _ => {
                let what = "either both ends, `from` and `to`, or a `path`";
                return Err(format!("sections: '{}': expected {what}", self.label).into());
            }
        };
        let place = |p: &Vec<f64>| <[f64; 2]>::try_from(&p[..]).ok();
        let corners: Option<Vec<[f64; 2]>> = given.iter().map(place).collect();
        let moves = |c: &Vec<[f64; 2]>| c.windows(2).any(|w| w[0] != w[1]);
        corners.filter(moves).ok_or_else(|| {
            format!(
                "sections: '{}' goes along {given:?} m; expected two or more different places [x, y]",
                self.label
            )
            .into()
        })
    }
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub enum Align {
    ClosestPoints,
    None,
}
