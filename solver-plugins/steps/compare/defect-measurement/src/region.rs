//! Shear in a place of the flat plies, outside of their wrinkles.

use crate::measured::{Measured, check_names, columns};
use plyflow_defects::Kind;
use plyflow_model::artifact::{Cell, Table};
use plyflow_sdk::{Host, StepError};
use plyflow_surface::weighted_quantiles;
use serde::Deserialize;

/// Columns of the table: label, SI unit.
const COLUMNS: [(&str, &str); 5] = [
    ("place", ""),
    ("ply", ""),
    ("largest shear", "rad"),
    ("99 % are below", "rad"),
    ("share in wrinkles", ""),
];

/// A rectangle on the flat plies, as the manifest has it.
#[derive(Deserialize)]
pub struct Asked {
    name: String,
    /// Its middle (m).
    at: Vec<f64>,
    /// Along x (m).
    length: f64,
    /// Along y (m).
    width: f64,
}

/// Checks what is asked for.
///
/// # Errors
/// When a name cannot be a part of a result's name, or stands twice.
pub fn check(asked: &[Asked]) -> Result<(), StepError> {
    check_names("shear_regions", asked.iter().map(|r| r.name.as_str()))
}

/// What a ply has in a region.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shear {
    /// Largest size of the shear angle outside of wrinkles (rad); `None` where all of the region is in wrinkles.
    largest: Option<f64>,
    /// 99 % of the area outside of wrinkles have less (rad).
    q99: f64,
    /// Share of the region's area that is in wrinkles.
    wrinkled: f64,
}

/// Regions, with what the plies that reach there have.
pub struct Regions {
    found: Vec<(String, Vec<(String, Shear)>)>,
}

impl Regions {
    /// Of the plies of a run whose shear is known. An element is in the region when its middle is, and in a wrinkle when one of its nodes is in one of
    /// its own ply.
    ///
    /// # Errors
    /// When no ply has an element in a region.
    pub fn of(measured: &[Measured], asked: &[Asked]) -> Result<Self, StepError> {
        let mut found = Vec::new();
        for region in asked {
            let known = |m: &&Measured| m.simulated && !m.ply.shear_angle.is_empty();
            let plies: Vec<(String, Shear)> = measured
                .iter()
                .filter(known)
                .filter_map(|m| Some((m.ply.name.clone(), shear(m, region)?)))
                .collect();
            if plies.is_empty() {
                return Err(format!(
                    "shear_regions: '{}': no ply whose shear is known has an element there; expected a place on the flat plies, in which the tool's middle is [0, 0]",
                    region.name
                )
                .into());
            }
            found.push((region.name.clone(), plies));
        }
        Ok(Self { found })
    }

    /// Reports the results: of all plies together, and of each.
    ///
    /// # Errors
    /// When the host does not take them.
    pub fn report(&self, host: &Host) -> Result<(), StepError> {
        for (name, plies) in &self.found {
            let largest = |get: fn(&Shear) -> Option<f64>| {
                plies.iter().filter_map(|(_, s)| get(s)).reduce(f64::max)
            };
            if let Some(value) = largest(|s| s.largest) {
                host.result(&format!("region_shear_max.{name}"), value, "rad")?;
            }
            if let Some(value) = largest(|s| s.largest.map(|_| s.q99)) {
                host.result(&format!("region_shear_q99.{name}"), value, "rad")?;
            }
            for (ply, s) in plies {
                if let Some(value) = s.largest {
                    host.result(&format!("region_shear_max.{name}.{ply}"), value, "rad")?;
                    host.result(&format!("region_shear_q99.{name}.{ply}"), s.q99, "rad")?;
                }
                host.result(
                    &format!("region_wrinkled_share.{name}.{ply}"),
                    s.wrinkled,
                    "1",
                )?;
            }
        }
        Ok(())
    }

    /// The table of the report; `None` when no region was asked for.
    pub fn table(&self) -> Option<Table> {
        let row = |name: &String, ply: &String, s: &Shear| -> Vec<Cell> {
            let q99 = s.largest.map(|_| s.q99);
            vec![
                name.into(),
                ply.into(),
                s.largest.into(),
                q99.into(),
                s.wrinkled.into(),
            ]
        };
        let found = self.found.iter();
        let rows: Vec<Vec<Cell>> = found
            .flat_map(|(name, plies)| plies.iter().map(move |(ply, s)| row(name, ply, s)))
            .collect();
        (!rows.is_empty()).then(|| Table {
            name: "region_shear".into(),
            title: Some("Shear outside of wrinkles".into()),
            columns: columns(&COLUMNS),
            rows,
        })
    }
}

/// `None`: the ply has no element there.
fn shear(m: &Measured, region: &Asked) -> Option<Shear> {
    let (ply, &[x, y]) = (&m.ply, &region.at[..]) else {
        return None;
    };
    let mut wrinkled = vec![false; ply.undeformed.len()];
    let wrinkles = m.defects.iter().filter(|d| d.kind == Kind::Wrinkle);
    for node in wrinkles.flat_map(|d| &d.nodes) {
        wrinkled[*node as usize] = true;
    }
    let (corners, cells) = ply.topology.connectivity();
    let areas = ply.topology.cell_areas(&ply.undeformed);
    let (mut sizes, mut weights, mut whole) = (Vec::new(), Vec::new(), 0.0);
    for (k, cell) in cells.chunks_exact(corners).enumerate() {
        let middle = [0, 1].map(|a| {
            let sum: f64 = cell.iter().map(|&n| ply.undeformed[n as usize][a]).sum();
            sum / corners as f64
        });
        let inside = (middle[0] - x).abs() <= 0.5 * region.length
            && (middle[1] - y).abs() <= 0.5 * region.width;
        if !inside {
            continue;
        }
        whole += areas[k];
        if !cell.iter().any(|&n| wrinkled[n as usize]) {
            sizes.push(ply.shear_angle[k].abs());
            weights.push(areas[k]);
        }
    }
    let outside: f64 = weights.iter().sum();
    (whole > 0.0).then(|| Shear {
        largest: sizes.iter().copied().reduce(f64::max),
        q99: weighted_quantiles(&sizes, &weights, &[0.99])[0],
        wrinkled: 1.0 - outside / whole,
    })
}
