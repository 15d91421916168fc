//! A sheet of a coarse run, and a fine one placed in it.

use crate::cut::Placed;
use crate::grid::Grid;
use crate::late::{self, Start};
use crate::pull::{FORCES, Pull};
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_model::artifact::Sheet;
use plyflow_sdk::{BodyInfo, Host, Input, Meshes, StepError};
use plyflow_surface::of_run::check_quads;

/// A sheet of a coarse run.
pub(crate) struct Whole<'a> {
    input: &'a Input,
    meshes: &'a Meshes,
    body: &'a BodyInfo,
    sheet: &'a Sheet,
    /// `[n]` undeformed (m).
    pub(crate) points: Vec<Vec3>,
    /// `[m * 4]`.
    cells: Vec<u32>,
}

impl<'a> Whole<'a> {
    /// Its undeformed mesh.
    pub(crate) fn read(
        host: &Host,
        input: &'a Input,
        meshes: &'a Meshes,
        sheet: &'a Sheet,
    ) -> Result<Self, StepError> {
        let body = meshes.body(&sheet.name)?;
        check_quads(&format!("sheet '{}'", sheet.name), body)?;
        let (points, cells) = host.mesh(input, body)?;
        Ok(Self {
            input,
            meshes,
            body,
            sheet,
            points,
            cells,
        })
    }

    /// With a fine mesh placed in it.
    pub(crate) fn placed(self, grid: Grid) -> Result<Coarse<'a>, StepError> {
        let (name, step) = (&self.sheet.name, &self.input.step);
        let fine = Placed::new(grid, &self.points, &self.cells)
            .map_err(|e| format!("sheet '{name}' of '{step}': {e}"))?;
        Ok(Coarse { whole: self, fine })
    }
}

/// A fine sheet placed in that of a coarse run.
pub(crate) struct Coarse<'a> {
    whole: Whole<'a>,
    pub(crate) fine: Placed,
}

/// Where the coarse run leads a fine sheet's driven nodes.
#[derive(Default)]
pub(crate) struct Motion {
    pub(crate) position: Vec<f64>,
    pub(crate) normal: Option<Vec<f64>>,
    /// Largest interpolation error (m).
    pub(crate) error: f64,
    /// Largest distance of the first frame from the undeformed mesh (m).
    pub(crate) start: f64,
}

/// What the surroundings do at a cut that gives way.
pub(crate) struct Pulls {
    /// `[f][k][3]` (N).
    pub(crate) force: Vec<f64>,
    /// `[k]` (N/m).
    pub(crate) stiffness: Vec<f64>,
}

impl Coarse<'_> {
    pub(crate) fn is_ply(&self) -> bool {
        self.whole.sheet.is_ply()
    }

    /// Follows it through the coarse run's frames; a ply, which may turn, also in its normals.
    pub(crate) fn follow(&self, host: &Host) -> Result<Motion, StepError> {
        let (fine, of) = (&self.fine, &self.whole);
        let mut motion = Motion {
            normal: self.is_ply().then(Vec::new),
            ..Motion::default()
        };
        for frame in 0..of.meshes.times.len() {
            let coarse = fine.surface(host.frame_points(of.input, of.body, frame)?);
            let driven = fine.positions(&coarse);
            motion.error = motion.error.max(fine.error(&driven, &coarse));
            if frame == 0 {
                let moved = |(&n, &d): (&u32, &Vec3)| distance(fine.points[n as usize], d);
                let nodes = fine.driven_nodes.iter().zip(&driven);
                motion.start = nodes.map(moved).fold(0.0, f64::max);
            }
            motion.position.extend(driven.into_iter().flatten());
            if let Some(normal) = &mut motion.normal {
                normal.extend(fine.normals(&coarse).into_iter().flatten());
            }
        }
        Ok(motion)
    }

    /// Where all nodes are when the fine run begins at the frame `first` and is `slower`.
    pub(crate) fn start(
        &self,
        host: &Host,
        first: usize,
        slower: f64,
    ) -> Result<Option<Start>, StepError> {
        let of = &self.whole;
        late::start(
            host, of.input, of.meshes, of.body, &self.fine, first, slower,
        )
    }

    /// What the surroundings pull at the cut with, through the frames of the coarse run. `stiffness`: theirs, of the cut's length (N/m2).
    pub(crate) fn pulls(&self, host: &Host, stiffness: f64) -> Result<Pulls, StepError> {
        let of = &self.whole;
        let (ply, step) = (&of.sheet.name, &of.input.step);
        let laid = of.sheet.laid().ok_or_else(|| {
            format!(
                "`cut_stiffness` is given, and ply '{ply}' of '{step}' does not tell where its fibres lie (`fibre_1`, `fibre_2`). Leave out `cut_stiffness`, or run that step again"
            )
        })?;
        let has = |name: &str| of.body.fields.iter().any(|f| f.name == name);
        if let Some(missing) = FORCES.iter().find(|name| !has(name)) {
            return Err(format!(
                "`cut_stiffness` is given, and ply '{ply}' of '{step}' has no field {missing}: its run must tell its membrane forces. Leave out `cut_stiffness`, or run that step again"
            )
            .into());
        }
        let cut = Pull::new(
            &self.fine.grid,
            &self.fine.driven_nodes,
            &of.points,
            &of.cells,
            laid,
        );
        let mut force = Vec::new();
        for frame in 0..of.meshes.times.len() {
            let points = host.frame_points(of.input, of.body, frame)?;
            let mut fields = [const { Vec::new() }; 3];
            for (field, name) in fields.iter_mut().zip(FORCES) {
                *field = host.frame_field(of.input, of.body, frame, name)?;
            }
            force.extend(cut.forces(&points, &fields).into_iter().flatten());
        }
        let stiffness = cut.lengths().iter().map(|l| stiffness * l).collect();
        Ok(Pulls { force, stiffness })
    }
}
