//! What of a ply is a result: a net that does not reach everywhere leaves cells that only hang on.

use crate::Topology;
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::{BodyInfo, Host, Input, Log, StepError};

/// Field of cells: 1 where a net reaches all of the cell. Runs without it are formed everywhere.
pub const DRAPED: &str = "draped";

/// Field of cells that are not draped: why the net stopped there ([`LOCKED`], ..).
pub const STOPPED: &str = "drape_stop";

/// Value of [`STOPPED`] where cells of the net would have sheared beyond the locking angle.
pub const LOCKED: f64 = 1.0;

/// The part of a ply's mesh that is draped, with numbers of its own for nodes and cells.
#[derive(Debug, Clone, PartialEq)]
pub struct DrapedPart {
    /// `[cells]` of the whole: whether it belongs to the part.
    pub draped: Vec<bool>,
    /// `[cells]` of the whole: whether the fabric locks there.
    pub locked: Vec<bool>,
    /// Numbers in the whole, by node of the part.
    nodes: Vec<u32>,
    /// Of the part, in its own numbers.
    connectivity: Vec<u32>,
    nodes_per_cell: usize,
}

impl DrapedPart {
    /// Of a mesh of `nodes` nodes with these cells, of which `draped` are.
    pub fn new(
        nodes: usize,
        nodes_per_cell: usize,
        cells: &[u32],
        draped: Vec<bool>,
        locked: Vec<bool>,
    ) -> Self {
        let mut used = vec![false; nodes];
        let of_part = || (cells.chunks_exact(nodes_per_cell).zip(&draped)).filter(|(_, d)| **d);
        for n in of_part().flat_map(|(c, _)| c) {
            used[*n as usize] = true;
        }
        let mut number = vec![u32::MAX; nodes];
        let kept: Vec<u32> = (0..nodes as u32).filter(|n| used[*n as usize]).collect();
        for (k, n) in kept.iter().enumerate() {
            number[*n as usize] = k as u32;
        }
        let connectivity = (of_part().flat_map(|(c, _)| c))
            .map(|n| number[*n as usize])
            .collect();
        Self {
            nodes: kept,
            connectivity,
            nodes_per_cell,
            draped,
            locked,
        }
    }

    /// The draped part of a body of a run in a frame; `None` where all is draped. Tells the user of what is not, by its share of the flat
    /// ply's area.
    ///
    /// # Errors
    /// When the run cannot be read, or nothing of the body is draped.
    pub fn read(
        host: &Host,
        input: &Input,
        body: &BodyInfo,
        frame: usize,
    ) -> Result<Option<Self>, StepError> {
        let has = |name: &str| body.fields.iter().any(|f| f.name == name);
        if !has(DRAPED) {
            return Ok(None);
        }
        let draped: Vec<bool> = (host.frame_field(input, body, frame, DRAPED)?.iter())
            .map(|d| *d > 0.5)
            .collect();
        if draped.iter().all(|d| *d) {
            return Ok(None);
        }
        let locked = if has(STOPPED) {
            let why = host.frame_field(input, body, frame, STOPPED)?;
            why.iter().map(|w| *w == LOCKED).collect()
        } else {
            vec![false; draped.len()]
        };
        let (flat, cells) = host.mesh(input, body)?;
        let part = Self::new(flat.len(), body.nodes_per_cell, &cells, draped, locked);
        let (ply, step) = (&body.name, &input.step);
        if part.nodes.is_empty() {
            return Err(format!(
                "ply '{ply}' of '{step}' is draped nowhere: there is nothing to judge"
            )
            .into());
        }
        let areas = Topology::new(flat.len(), body.nodes_per_cell, &cells).cell_areas(&flat);
        let share = |of: &[bool]| {
            let chosen = areas.iter().zip(of).filter(|(_, o)| **o).map(|(a, _)| a);
            chosen.sum::<f64>() / areas.iter().sum::<f64>()
        };
        let locked = match share(&part.locked) {
            locked if locked > 0.0 => format!(
                ". Of it {} lies where or behind where the fabric locks: it cannot shear as far as the tool asks, and wrinkles or bridges there",
                percent(locked)
            ),
            _ => String::new(),
        };
        host.log(
            Log::Warn,
            &format!(
                "ply '{ply}' of '{step}' is draped on {} of its area (field `{DRAPED}`); the rest has no shape and counts in no number \
                 here{locked}",
                percent(share(&part.draped))
            ),
        );
        Ok(Some(part))
    }

    /// Its mesh.
    pub fn topology(&self) -> Topology {
        Topology::new(self.nodes.len(), self.nodes_per_cell, &self.connectivity)
    }

    /// Its cells in its own numbers of nodes.
    pub fn connectivity(&self) -> &[u32] {
        &self.connectivity
    }

    /// Values at its nodes, of values at all nodes.
    pub fn at_nodes<T: Copy>(&self, all: &[T]) -> Vec<T> {
        self.nodes.iter().map(|n| all[*n as usize]).collect()
    }

    /// Values of its cells, of values of all cells.
    pub fn of_cells<T: Copy>(&self, all: &[T]) -> Vec<T> {
        let kept = all.iter().zip(&self.draped).filter(|(_, d)| **d);
        kept.map(|(v, _)| *v).collect()
    }

    /// Values at all `nodes`, of values at its own; `else_` at the others.
    pub fn to_nodes<T: Copy>(&self, nodes: usize, own: &[T], else_: T) -> Vec<T> {
        let mut all = vec![else_; nodes];
        for (n, v) in self.nodes.iter().zip(own) {
            all[*n as usize] = *v;
        }
        all
    }

    /// Values of all cells, of values of its own; `else_` of the others.
    pub fn to_cells<T: Copy>(&self, own: &[T], else_: T) -> Vec<T> {
        let mut own = own.iter();
        let of = |d: &bool| if *d { own.next().copied() } else { None };
        self.draped
            .iter()
            .map(of)
            .map(|v| v.unwrap_or(else_))
            .collect()
    }
}

/// What a run holds of a body in a frame, as far as it is draped.
pub struct Formed {
    /// In the flat ply (m).
    pub flat: Vec<Vec3>,
    /// (m).
    pub points: Vec<Vec3>,
    /// Corners of cells.
    pub cells: Vec<u32>,
    /// What of the body this is; `None`: all.
    pub part: Option<DrapedPart>,
}

impl Formed {
    /// Reads a body.
    ///
    /// # Errors
    /// As [`DrapedPart::read`].
    pub fn read(
        host: &Host,
        input: &Input,
        body: &BodyInfo,
        frame: usize,
    ) -> Result<Self, StepError> {
        let (flat, cells) = host.mesh(input, body)?;
        let points = host.frame_points(input, body, frame)?;
        let part = DrapedPart::read(host, input, body, frame)?;
        Ok(match part {
            None => Self {
                flat,
                points,
                cells,
                part,
            },
            Some(part) => Self {
                flat: part.at_nodes(&flat),
                points: part.at_nodes(&points),
                cells: part.connectivity().to_vec(),
                part: Some(part),
            },
        })
    }

    /// What of a field of cells belongs to it.
    pub fn of_cells(&self, all: Vec<f64>) -> Vec<f64> {
        match &self.part {
            Some(part) => part.of_cells(&all),
            None => all,
        }
    }

    /// What of a field of nodes belongs to it.
    pub fn at_nodes(&self, all: Vec<f64>) -> Vec<f64> {
        match &self.part {
            Some(part) => part.at_nodes(&all),
            None => all,
        }
    }
}

fn percent(share: f64) -> String {
    // Never 100 % of what is not all, nor 0 % of what is not none.
    format!("{:.1} %", (100.0 * share).clamp(0.1, 99.9))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_has_its_own_numbers_and_gives_back_those_of_the_whole() {
        // Three quads in a row; the middle one hangs on.
        let cells = [0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6];
        let draped = vec![true, false, true];
        let part = DrapedPart::new(8, 4, &cells, draped.clone(), vec![false; 3]);
        assert_eq!(part.topology().cells(), 2);
        assert_eq!(part.of_cells(&[1.0, 2.0, 3.0]), [1.0, 3.0]);
        assert_eq!(part.to_cells(&[1.0, 3.0], 0.0), [1.0, 0.0, 3.0]);
        let only_last = DrapedPart::new(8, 4, &cells, vec![false, false, true], vec![false; 3]);
        assert_eq!(only_last.at_nodes(&[0, 1, 2, 3, 4, 5, 6, 7]), [2, 3, 6, 7]);
        assert_eq!(only_last.connectivity(), [0, 1, 3, 2]);
        assert_eq!(
            only_last.to_nodes(8, &[2, 3, 6, 7], -1),
            [-1, -1, 2, 3, -1, -1, 6, 7]
        );
    }
}
