//! Coefficients of friction: constant, or by pressure and by the angle between sliding and fibres.

use super::penalty::{Tangential, friction_force};
use crate::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_fixed::FixedBits;

/// No law gives more, whatever the pressure: the largest coefficient that a scene may state.
pub const LARGEST_COEFFICIENT: f64 = 2.0;

/// Coefficient by pressure.
#[derive(Debug, Clone, PartialEq)]
pub enum PressureDependence {
    /// The same at all pressures.
    Constant(f64),
    /// `coefficient (p / reference)^exponent`, at most [`LARGEST_COEFFICIENT`].
    Power {
        /// Coefficient at the reference.
        coefficient: f64,
        /// Reference (Pa).
        reference: f64,
        /// Exponent, above -1 so that friction still grows with pressure.
        exponent: f64,
    },
    /// `[n]` pressures (Pa, growing) and coefficients: linear between, constant beyond.
    Table(Vec<[f64; 2]>),
}

impl PressureDependence {
    /// Coefficient at a pressure (Pa, not negative).
    pub fn coefficient(&self, pressure: f64) -> f64 {
        match self {
            Self::Constant(c) => *c,
            Self::Power {
                coefficient,
                reference,
                exponent,
            } => {
                let of = coefficient * (pressure / reference).fixed_powf(*exponent);
                of.min(LARGEST_COEFFICIENT)
            }
            Self::Table(rows) => interpolate(rows, pressure),
        }
    }
}

/// Linear between rows of growing first entries, constant beyond.
fn interpolate(rows: &[[f64; 2]], x: f64) -> f64 {
    let after = rows.partition_point(|r| r[0] <= x);
    if after == 0 {
        return rows[0][1];
    }
    let [x0, y0] = rows[after - 1];
    match rows.get(after) {
        Some([x1, y1]) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        None => y0,
    }
}

/// Whose fibres count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whose {
    /// Those of the sheet whose nodes touch.
    Slave,
    /// Those of the sheet that they touch.
    Master,
}

/// Factor on the coefficient by the angle between sliding and fibres.
#[derive(Debug, Clone)]
pub struct AngleDependence {
    /// `[n]` angles (rad, growing, 0 to pi / 2) and factors: linear between, constant beyond.
    pub factors: Vec<[f64; 2]>,
    /// Whose fibres.
    pub whose: Whose,
    /// The fibres.
    pub fibres: FibreField,
}

/// A coefficient by pressure, and by the angle to fibres.
///
/// Coulomb's limit becomes mu(p, angle) N with the nodal pressure p = N / area of the slave node, and the angle between the
/// fibres and the way in which the contact slides or is about to (that of the trial force): the force stays opposite to
/// it, so sliding always loses energy. It depends on the present positions alone: there is no state.
#[derive(Debug, Clone)]
pub struct VaryingFriction {
    /// By pressure.
    pub pressure: PressureDependence,
    /// By direction.
    pub angle: Option<AngleDependence>,
    /// The slaves' sheet, for the nodes' areas.
    pub slave: SheetCells,
}

/// The cells of a sheet, by node.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetCells {
    /// `[cells][4]` model nodes.
    cells: Vec<[u32; 4]>,
    /// Lowest model node.
    base: u32,
    /// By node from `base`: where its cells begin in `around`; one more at the end.
    first: Vec<u32>,
    /// Cells around the nodes, one node after the other.
    around: Vec<u32>,
}

impl SheetCells {
    /// Of the cells (model nodes) of one sheet.
    pub fn new(cells: &[[u32; 4]]) -> Self {
        let nodes = || cells.iter().flatten().copied();
        let (base, end) = (
            nodes().min().unwrap_or(0),
            nodes().max().map_or(0, |n| n + 1),
        );
        let mut first = vec![0u32; (end - base) as usize + 1];
        for n in nodes() {
            first[(n - base) as usize + 1] += 1;
        }
        for k in 1..first.len() {
            first[k] += first[k - 1];
        }
        let mut place = first.clone();
        let mut around = vec![0; 4 * cells.len()];
        for (c, cell) in cells.iter().enumerate() {
            for n in cell {
                let at = &mut place[(n - base) as usize];
                around[*at as usize] = c as u32;
                *at += 1;
            }
        }
        Self {
            cells: cells.to_vec(),
            base,
            first,
            around,
        }
    }

    fn around(&self, node: u32) -> &[u32] {
        let k = (node - self.base) as usize;
        &self.around[self.first[k] as usize..self.first[k + 1] as usize]
    }

    /// A quarter of the areas (m2) of the cells around a node.
    fn area(&self, node: u32, x: &[Vec3]) -> f64 {
        let area = |c: &u32| {
            let p = self.cells[*c as usize].map(|n| x[n as usize]);
            0.5 * norm(cross(sub(p[2], p[0]), sub(p[3], p[1])))
        };
        0.25 * self.around(node).iter().map(area).sum::<f64>()
    }
}

/// Direction of fibres in a sheet, carried along by its cells.
#[derive(Debug, Clone)]
pub struct FibreField {
    sheet: SheetCells,
    /// Model number of the sheet's first cell.
    first_cell: u32,
    /// `[cells]` components along the lines that join the middles of opposite sides.
    components: Vec<[f64; 2]>,
}

/// Lines through the middle of a cell along its two coordinates (m).
fn middle_lines(p: [Vec3; 4]) -> [Vec3; 2] {
    let along =
        |a: usize, b: usize, c: usize, d: usize| scale(sub(add(p[a], p[b]), add(p[c], p[d])), 0.5);
    [along(1, 2, 0, 3), along(2, 3, 0, 1)]
}

impl FibreField {
    /// Fibres along `direction` (in the sheet's plane) at the positions `x` (m) of the model's nodes. `cells`: those of the
    /// sheet, of which the first has the number `first_cell` in the model.
    pub fn new(cells: &[[u32; 4]], first_cell: usize, x: &[Vec3], direction: Vec3) -> Self {
        Self::steered(cells, first_cell, x, |_| direction)
    }

    /// The same with a direction for each cell, by its number among `cells`.
    pub fn steered(
        cells: &[[u32; 4]],
        first_cell: usize,
        x: &[Vec3],
        direction: impl Fn(usize) -> Vec3,
    ) -> Self {
        let components = cells.iter().enumerate().map(|(k, cell)| {
            let direction = direction(k);
            let [a, b] = middle_lines(cell.map(|n| x[n as usize]));
            let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
            let (da, db) = (dot(direction, a), dot(direction, b));
            let det = aa * bb - ab * ab;
            [(da * bb - db * ab) / det, (db * aa - da * ab) / det]
        });
        Self {
            sheet: SheetCells::new(cells),
            first_cell: first_cell as u32,
            components: components.collect(),
        }
    }

    fn of_own_cell(&self, cell: usize, x: &[Vec3]) -> Vec3 {
        let [a, b] = middle_lines(self.sheet.cells[cell].map(|n| x[n as usize]));
        let [ca, cb] = self.components[cell];
        unit(add(scale(a, ca), scale(b, cb)))
    }

    /// Direction in a cell (model number).
    fn in_cell(&self, cell: u32, x: &[Vec3]) -> Vec3 {
        self.of_own_cell((cell - self.first_cell) as usize, x)
    }

    /// Mean direction of the cells around a node, not of unit length. A fibre has no sense: each counts in that of those before it.
    fn at_node(&self, node: u32, x: &[Vec3]) -> Vec3 {
        let cells = self.sheet.around(node).iter();
        cells.fold([0.0; 3], |sum, c| {
            let own = self.of_own_cell(*c as usize, x);
            match dot(sum, own) < 0.0 {
                true => sub(sum, own),
                false => add(sum, own),
            }
        })
    }
}

/// A contact that may slide.
pub(crate) struct Sliding<'a> {
    /// Slave node.
    pub node: u32,
    /// Master cell, or [`crate::mesh::NONE`] on a rigid surface.
    pub cell: u32,
    /// `[nodes]` positions (m).
    pub x: &'a [Vec3],
    /// Unit normal of the contact.
    pub normal: Vec3,
    /// Normal force (N).
    pub force: f64,
    /// Force held by the slip spring (N), sliding velocity (m/s), and step times stiffness (N s/m): what the trial force
    /// is made of.
    pub held: Vec3,
    pub vt: Vec3,
    pub spring: f64,
}

impl Sliding<'_> {
    /// Friction under a law, by a slip spring of stiffness `k` (N/m) and a damper `c` (N s/m), in a step `dt` (s).
    #[inline(always)]
    pub(super) fn friction(&self, law: &impl Coulomb, dt: f64, k: f64, c: f64) -> Tangential {
        friction_force(self.held, self.vt, dt, k, c, law.limit(self))
    }
}

/// What gives Coulomb's limit. The contacts are compiled once for each law: the constant one costs one product.
pub(crate) trait Coulomb: Sync {
    /// Whether it is no friction at all.
    fn is_smooth(&self) -> bool;
    /// Largest friction force (N).
    fn limit(&self, s: &Sliding<'_>) -> f64;
}

/// The constant coefficient.
pub(crate) struct Constant(pub f64);

impl Coulomb for Constant {
    #[inline(always)]
    fn is_smooth(&self) -> bool {
        self.0 <= 0.0
    }

    #[inline(always)]
    fn limit(&self, s: &Sliding<'_>) -> f64 {
        self.0 * s.force
    }
}

impl Coulomb for VaryingFriction {
    fn is_smooth(&self) -> bool {
        false
    }

    fn limit(&self, s: &Sliding<'_>) -> f64 {
        let area = self.slave.area(s.node, s.x);
        if s.force <= 0.0 || area <= 0.0 {
            return 0.0;
        }
        let mut coefficient = self.pressure.coefficient(s.force / area);
        if let Some(angle) = &self.angle {
            let fibre = match angle.whose {
                Whose::Slave => angle.fibres.at_node(s.node, s.x),
                Whose::Master => angle.fibres.in_cell(s.cell, s.x),
            };
            let flat = sub(fibre, scale(s.normal, dot(fibre, s.normal)));
            let way = sub(s.held, scale(s.vt, s.spring));
            // A fibre has no sense: 0 to pi / 2.
            let between = norm(cross(flat, way)).fixed_atan2(dot(flat, way).abs());
            coefficient *= interpolate(&angle.factors, between);
        }
        coefficient.min(LARGEST_COEFFICIENT) * s.force
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{NONE, QuadMesh};

    #[test]
    fn tables_are_linear_between_rows_and_constant_beyond() {
        let rows = [[1.0, 0.4], [2.0, 0.2], [4.0, 0.3]];
        for (x, y) in [
            (0.0, 0.4),
            (1.0, 0.4),
            (1.5, 0.3),
            (2.0, 0.2),
            (3.0, 0.25),
            (4.0, 0.3),
            (9.0, 0.3),
        ] {
            assert!((interpolate(&rows, x) - y).abs() < 1e-15, "{x}");
        }
    }

    #[test]
    fn a_power_law_stays_finite_down_to_no_pressure() {
        let law = PressureDependence::Power {
            coefficient: 0.3,
            reference: 1e5,
            exponent: -0.3,
        };
        assert!((law.coefficient(1e5) - 0.3).abs() < 1e-15);
        assert!((law.coefficient(2e5) / 0.3 - 2f64.powf(-0.3)).abs() < 1e-15);
        assert_eq!(law.coefficient(0.0), LARGEST_COEFFICIENT);
    }

    #[test]
    fn a_fibre_has_no_sense_where_the_cells_about_a_node_name_opposite_ones() {
        let mesh = QuadMesh::grid(&[0.0, 0.01, 0.02], &[0.0, 0.01, 0.02]);
        let along = |angle: f64| [angle.cos(), angle.sin(), 0.0];
        // By cell about the node in the middle: steered fibres near 90 degrees are told as 85 or as -85.
        let angles = [85.0, -85.0, 88.0, -88.0f64].map(f64::to_radians);
        let of = |turn: f64| {
            let each = |c: usize| along(angles[c] + if c % 2 == 1 { turn } else { 0.0 });
            let field = FibreField::steered(&mesh.cells, 0, &mesh.points, each);
            unit(field.at_node(4, &mesh.points))
        };
        let [a, b] = [of(0.0), of(std::f64::consts::PI)];
        assert!(norm(sub(a, [0.0, 1.0, 0.0])) < 0.01, "{a:?}");
        assert!(norm(sub(a, b)) < 1e-12, "{a:?} {b:?}");
    }

    #[test]
    fn fibres_and_areas_follow_a_sheet_that_is_sheared_and_turned_out_of_its_plane() {
        let mesh = QuadMesh::grid(&[0.0, 0.01, 0.025], &[0.0, 0.02, 0.03]);
        let start = [0.6f64.cos(), 0.6f64.sin(), 0.0];
        let field = FibreField::new(&mesh.cells, 0, &mesh.points, start);
        // F has the columns f1 and f2.
        let (f1, f2): (Vec3, Vec3) = ([0.9, 0.1, 0.3], [0.4, 0.8, -0.2]);
        let x: Vec<Vec3> = mesh
            .points
            .iter()
            .map(|p| add(scale(f1, p[0]), scale(f2, p[1])))
            .collect();
        let expected = unit(add(scale(f1, start[0]), scale(f2, start[1])));
        for n in 0..9 {
            assert!(norm(sub(unit(field.at_node(n, &x)), expected)) < 1e-12);
        }
        assert!(norm(sub(field.in_cell(3, &x), expected)) < 1e-12);
        // A quarter of each of the four cells.
        let area = field.sheet.area(4, &x);
        let whole = 0.25 * 0.025 * 0.03 * norm(cross(f1, f2));
        assert!((area / whole - 1.0).abs() < 1e-12, "{area} {whole}");
    }

    #[test]
    fn the_limit_follows_the_way_of_sliding_whatever_its_sense() {
        let mesh = QuadMesh::grid(&[0.0, 0.01], &[0.0, 0.01]);
        let x = &mesh.points;
        let law = VaryingFriction {
            pressure: PressureDependence::Constant(0.4),
            angle: Some(AngleDependence {
                factors: vec![[0.0, 1.0], [std::f64::consts::FRAC_PI_2, 0.5]],
                whose: Whose::Slave,
                fibres: FibreField::new(&mesh.cells, 0, x, [1.0, 0.0, 0.0]),
            }),
            slave: SheetCells::new(&mesh.cells),
        };
        let limit = |angle: f64| {
            law.limit(&Sliding {
                node: 0,
                cell: NONE,
                x,
                normal: [0.0, 0.0, 1.0],
                force: 10.0,
                held: [0.0; 3],
                vt: [angle.cos(), angle.sin(), 0.0],
                spring: 1.0,
            })
        };
        for (degrees, expected) in [
            (0.0, 4.0),
            (180.0, 4.0),
            (90.0, 2.0),
            (-90.0, 2.0),
            (45.0, 3.0),
            (-135.0, 3.0),
        ] {
            let got = limit(f64::to_radians(degrees));
            assert!(
                (got - expected).abs() < 1e-12,
                "{degrees}: {got} N instead of {expected} N"
            );
        }
    }
}
