//! Sections: where tool, plies and scan are cut along a path.

use plyflow_defects::Ply;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{self, Axis, Plot, SectionOn, Series};
use plyflow_sdk::{Host, StepError};
use plyflow_surface::{SectionPoint, Surface, Topology, path_section, stations, triangles};

/// A surface that a section may cut.
pub struct Sheet<'a> {
    /// In the plot.
    pub label: String,
    /// In the names of its arrays.
    pub name: String,
    /// Where its nodes are in the flat ply (m); `None` of a scan, which knows none.
    pub flat: Option<&'a [Vec3]>,
    /// Where they are formed (m).
    pub formed: &'a [Vec3],
    /// Its cells.
    pub topology: &'a Topology,
}

impl<'a> Sheet<'a> {
    /// A ply or a scan that is measured.
    pub fn measured(ply: &'a Ply, simulated: bool) -> Self {
        Self {
            label: ply.name.clone(),
            name: ply.name.clone(),
            flat: simulated.then_some(&ply.undeformed[..]),
            formed: &ply.formed,
            topology: &ply.topology,
        }
    }

    /// The longest line in which a path cuts it, its places told by `stations`.
    fn cut(&self, plan: &[Vec3], path: &[[f64; 2]], stations: &[f64]) -> Option<Vec<SectionPoint>> {
        let (corners, cells) = self.topology.connectivity();
        let facets = triangles(corners, cells);
        let lines = path_section(plan, self.formed, &facets, path, stations);
        lines.into_iter().next()
    }
}

/// A section that is asked for.
pub struct Section<'a> {
    /// Its name.
    pub label: &'a str,
    /// Its corners (x, y in m).
    pub path: &'a [[f64; 2]],
    /// What these are told in.
    pub on: SectionOn,
    /// Its place among all.
    pub number: usize,
}

/// Label, name and points of a line in which something is cut; none where it is not.
type Cut<'a> = (&'a str, &'a str, Option<Vec<SectionPoint>>);

impl Section<'_> {
    /// The path as seen from above, and what its corners are told by.
    fn seen_from_above(&self, sheets: &[Sheet<'_>], along: &[f64]) -> (Vec<[f64; 2]>, Vec<f64>) {
        let path = self.path;
        let mut above = (path.to_vec(), along.to_vec());
        if self.on == SectionOn::FlatPly {
            let lowest = sheets.iter().find_map(|s| Some((s, s.flat?)));
            let line = lowest.and_then(|(s, flat)| s.cut(flat, path, along));
            let line = line.unwrap_or_default();
            above = (
                line.iter().map(|p| [p.place[0], p.place[1]]).collect(),
                line.iter().map(|p| p.station).collect(),
            );
        }
        above
    }

    /// Writes the lines that there are; the series that show them.
    fn arrays(&self, host: &Host, lines: &[Cut<'_>]) -> Result<Vec<Series>, StepError> {
        let number = self.number;
        let mut series = Vec::new();
        for (label, name, line) in lines {
            let Some(line) = line else { continue };
            let [x, y] =
                ["station", "height"].map(|n| format!("sections/section_{number}/{name}/{n}"));
            let stations: Vec<f64> = line.iter().map(|p| p.station).collect();
            let heights: Vec<f64> = line.iter().map(|p| p.place[2]).collect();
            host.write_f64(&x, &[line.len()], "m", &stations)?;
            host.write_f64(&y, &[line.len()], "m", &heights)?;
            series.push(Series::new(*label, x, y));
        }
        Ok(series)
    }

    /// Writes the lines in which it cuts the tool and the sheets: as they are seen from above, or the plies along a line of their
    /// material, and tool and scan below or above where that went on the first ply, the lowest. Of each the longest line counts. Gives what the
    /// attributes tell of it, and its plot.
    pub fn write(
        &self,
        host: &Host,
        tool: &Surface,
        sheets: &[Sheet<'_>],
    ) -> Result<(artifact::Section, Plot), StepError> {
        let (label, path, number) = (self.label, self.path, self.number);
        let along = stations(path);
        let above = self.seen_from_above(sheets, &along);
        let (points, facets) = (tool.points(), tool.triangles());
        let of_tool = path_section(points, points, facets, &above.0, &above.1);
        let mut lines: Vec<Cut<'_>> = vec![("tool", "tool", of_tool.into_iter().next())];
        for sheet in sheets {
            let line = match sheet.flat.filter(|_| self.on == SectionOn::FlatPly) {
                Some(flat) => sheet.cut(flat, path, &along),
                None => sheet.cut(sheet.formed, &above.0, &above.1),
            };
            lines.push((&sheet.label, &sheet.name, line));
        }
        if lines.iter().skip(1).all(|(_, _, line)| line.is_none()) {
            return Err(format!(
                "sections: '{label}' along {path:?} m meets no ply; take places above the plies (with `on: flat-ply`: in the flat ply)"
            )
            .into());
        }
        let series = self.arrays(host, &lines)?;
        let axis = match self.on {
            SectionOn::FromAbove => "along the section",
            SectionOn::FlatPly => "along the section in the flat ply",
        };
        let plot = Plot {
            name: format!("section_{number}"),
            title: Some(format!("Section {label}")),
            note: None,
            x: Axis::new(axis, "mm"),
            y: Axis::new("height", "mm"),
            series: series.clone(),
        };
        let told = artifact::Section {
            label: label.to_owned(),
            from: path[0],
            to: path[path.len() - 1],
            path: path.to_vec(),
            on: self.on,
            lines: series,
        };
        Ok((told, plot))
    }
}
