//! Where everything of a bag lies before it is meshed.

use crate::error::{FormingError, Result};
use crate::request::Parameters;
use crate::stack::{StackSheet, sheet};
use plyflow_blank::Blank;
use plyflow_geometry::rectangle::{Rectangle, grown, holds_inside, hull, intersection};
use plyflow_mechanics::mesh::{QuadMesh, graded_axis};
use plyflow_mechanics::mirror::Planes;
use plyflow_model::budget::{self, Wanted};
use plyflow_tooling::ToolMesh;

/// What clamps films, and how far they are fine.
pub struct Frame {
    /// The word of the process.
    pub process: &'static str,
    /// Length and width of its opening (m).
    pub opening: [f64; 2],
    /// Height (m) of the lowest sheet over the tool's highest point at the start.
    pub clearance: f64,
    /// Distance (m) around the plies beyond which two films count as one, of a process that has two.
    pub joint: Option<f64>,
    /// Whether it comes down around the tool. Otherwise it may end on the tool.
    pub around_tool: bool,
}

/// Places of everything before meshing.
pub struct Layout {
    /// Height of the lowest sheet's mid-plane (m).
    pub bottom_z: f64,
    /// Of the plies, from the tool upwards: the parts of their blanks between mirror planes.
    pub plies: Vec<Blank>,
    all_plies: Rectangle,
    /// Beyond this box the films are joined.
    joint: Rectangle,
    /// Where elements of the films are even: the plies with free film around them, and the tool.
    fine: Rectangle,
    /// The lower film, flat; the upper one has a part of its cells.
    pub film: QuadMesh,
    film_size: f64,
    /// Beside which a part is computed.
    pub planes: Planes,
}

impl Layout {
    /// Of a stack over a tool.
    ///
    /// # Errors
    /// When the frame is too small, the films' elements are finer than the plies' or too many, or a blank has no shape.
    pub fn new(
        stack: &[StackSheet],
        frame: &Frame,
        p: &Parameters,
        tool: &ToolMesh,
        planes: Planes,
    ) -> Result<Self> {
        let [lo, hi] = tool.bounds();
        let plies: Vec<Blank> = stack
            .iter()
            .filter(|sheet| sheet.is_ply())
            .map(|sheet| sheet::blank_part(sheet, planes))
            .collect::<Result<_>>()?;
        // There is one: `sheet::stack` refuses a stack of films alone.
        let all_plies = plies[1..]
            .iter()
            .map(Blank::bounds)
            .fold(plies[0].bounds(), hull);
        let film_size = p.film_size();
        if film_size < 0.999 * p.element_size {
            return Err(FormingError::Scene(format!(
                "diaphragm_element_size ({film_size} m) is below element_size ({} m): the plies' nodes \
                 carry the films, so the films' elements must not be finer",
                p.element_size
            )));
        }
        // At least three cells of free film around the plies, so that the step at their edge has room.
        let margin = frame.joint.unwrap_or(0.0).max(3.0 * film_size);
        let joint = grown(all_plies, margin);
        let half = frame.opening.map(|full| 0.5 * full);
        let mut around = grown([lo[0], lo[1], hi[0], hi[1]], 0.03);
        if !frame.around_tool {
            around = intersection(around, [-half[0], -half[1], half[0], half[1]]);
        }
        let fine = hull(grown(joint, film_size), around);
        check_frame(half, fine, margin, film_size, frame)?;
        let fine_part = [0, 1].map(|k| fine[k + 2] - if planes.0[k] { 0.0 } else { fine[k] });
        allow_film(fine_part[0] * fine_part[1], p)?;
        // A grid line lies on every mirror plane.
        let axis = |k: usize| {
            let (low, fine_low) = if planes.0[k] {
                (0.0, 0.0)
            } else {
                (-half[k], fine[k])
            };
            let (high, growth) = (fine[k + 2], p.diaphragm_growth);
            graded_axis(low, half[k], fine_low, high, film_size, growth)
        };
        Ok(Self {
            bottom_z: hi[2] + frame.clearance + stack[0].offset,
            plies,
            all_plies,
            joint,
            fine,
            film: QuadMesh::grid(&axis(0), &axis(1)),
            film_size,
            planes,
        })
    }

    fn is_inside(&self, b: Rectangle, cell: &[u32; 4]) -> bool {
        let p = cell.map(|n| self.film.points[n as usize]);
        let c = [0, 1].map(|k| 0.25 * (p[0][k] + p[1][k] + p[2][k] + p[3][k]));
        holds_inside(b, c[0], c[1])
    }

    /// Whether a cell of the film lies where its elements are even.
    pub fn is_fine(&self, cell: &[u32; 4]) -> bool {
        self.is_inside(self.fine, cell)
    }

    /// Whether a cell of the film stands for both films.
    pub fn is_joined(&self, cell: &[u32; 4]) -> bool {
        !self.is_inside(self.joint, cell)
    }

    /// Whether a place lies over a ply, or within a film element beside one.
    pub fn over_ply(&self, [x, y]: [f64; 2]) -> bool {
        let beside = 1.01 * self.film_size;
        let in_box = holds_inside(grown(self.all_plies, beside), x, y);
        // Rectangles of one stack cover nearly the same: the box around all of them has no steps between them.
        let rectangles = self.plies.iter().all(|b| matches!(b, Blank::Rectangle(_)));
        in_box && (rectangles || self.plies.iter().any(|b| b.distance([x, y]) < beside))
    }
}

/// Whether the frame, of these half sizes (m), holds what is to be fine; `margin`: free film around the plies (m).
fn check_frame(
    half: [f64; 2],
    fine: Rectangle,
    margin: f64,
    film_size: f64,
    frame: &Frame,
) -> Result<()> {
    if (0..2).all(|k| fine[k] >= -half[k] && fine[k + 2] <= half[k]) {
        return Ok(());
    }
    let at_least = match frame.joint {
        Some(_) => "`film_joint_margin`, at least three elements",
        None => "three elements",
    };
    let tool = match frame.around_tool {
        true => ", and the tool with 30 mm",
        false => "",
    };
    Err(FormingError::Scene(format!(
        "process.{}: the frame ({} x {} m) is too small; expected at least {:.3} x {:.3} m: the plies with {:.0} mm of free \
         film around them ({at_least} of {:.1} mm, `diaphragm_element_size` or `element_size`) and one \
         more element{tool}. Enlarge `frame_length` and `frame_width`, or take less of these",
        frame.process,
        2.0 * half[0],
        2.0 * half[1],
        2.0 * fine[2].max(-fine[0]),
        2.0 * fine[3].max(-fine[1]),
        1e3 * margin,
        1e3 * film_size
    )))
}

/// Whether the films' elements are not too many to be made; `fine`: the area of the even ones (m2), which are most.
fn allow_film(fine: f64, p: &Parameters) -> Result<()> {
    let size = p.film_size();
    budget::allow(Wanted {
        what: "the mesh of a diaphragm",
        of: "elements",
        count: fine / (size * size),
        most: budget::MOST_ELEMENTS,
        bytes: budget::ELEMENT_BYTES,
        parameter: match p.diaphragm_element_size {
            Some(_) => "diaphragm_element_size",
            None => "element_size",
        },
        size,
    })
    .map_err(FormingError::Scene)
}
