//! The plane of two variables: triangles between computed points, and lines of equal response on them.
//!
//! Nothing is put between points that do not lie on the plane, where one of them has no value, or outside of them.

use crate::family::Levels;
use crate::units::plural;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::HashMap;

/// A map of fewer points, or of fewer values of a variable, shows what is put between the points and not what was computed.
pub(crate) const LEAST: usize = 9;
pub(crate) const LEAST_VALUES: usize = 3;

/// A corner: place on the picture and value.
pub(crate) type Corner = [f64; 3];

/// Points of a study that differ in two variables alone.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plane {
    /// Positions of the points.
    pub(crate) points: Vec<usize>,
    /// Values of both variables (positions among the levels) by point.
    at: Vec<[usize; 2]>,
}

impl Plane {
    /// The planes of two variables in a study: one for each combination of what the others are.
    pub(crate) fn all(levels: &[Levels], [a, b]: [usize; 2]) -> Vec<Self> {
        let mut known: HashMap<Vec<usize>, usize> = HashMap::new();
        let mut planes: Vec<Self> = Vec::new();
        let n = levels.first().map_or(0, |l| l.of.len());
        for p in 0..n {
            let others = (levels.iter())
                .enumerate()
                .filter(|(v, _)| *v != a && *v != b);
            let others: Vec<usize> = others.map(|(_, l)| l.of[p]).collect();
            let i = *known.entry(others).or_insert_with(|| {
                planes.push(Self {
                    points: Vec::new(),
                    at: Vec::new(),
                });
                planes.len() - 1
            });
            planes[i].points.push(p);
            planes[i].at.push([levels[a].of[p], levels[b].of[p]]);
        }
        planes
    }

    /// Whether a map of the points with a value would be honest; otherwise why not.
    pub(crate) fn is_mapped(&self, values: &[Option<f64>]) -> Result<(), String> {
        let with = self.points.iter().zip(&self.at);
        let with = with.filter(|(p, _)| values[**p].is_some());
        let with: Vec<&[usize; 2]> = with.map(|(_, at)| at).collect();
        if with.len() < LEAST {
            return Err(format!(
                "{} with a value lie on the plane; a map needs {LEAST}",
                plural(with.len(), "point", "points")
            ));
        }
        for d in 0..2 {
            let mut all: Vec<usize> = with.iter().map(|at| at[d]).collect();
            all.sort_unstable();
            all.dedup();
            if all.len() < LEAST_VALUES {
                return Err(format!(
                    "points with a value have {} of a variable; a map needs {LEAST_VALUES}",
                    plural(all.len(), "value", "values")
                ));
            }
        }
        Ok(())
    }

    /// Triangles between neighbours that all have a value. `place`: of the values of both variables on the picture.
    pub(crate) fn triangles(
        &self,
        values: &[Option<f64>],
        place: &[Vec<f64>; 2],
    ) -> Vec<[Corner; 3]> {
        let corner = |k: usize| {
            let [i, j] = self.at[k];
            Some([place[0][i], place[1][j], values[self.points[k]]?])
        };
        let rows = |d: usize| {
            let mut all: Vec<usize> = self.at.iter().map(|a| a[d]).collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        let rows = [rows(0), rows(1)];
        // A grid, perhaps with a corner cut off by a condition.
        if rows[0].len() * rows[1].len() <= 2 * self.points.len() {
            self.of_grid(&rows, &corner)
        } else {
            self.scattered(place, &corner)
        }
    }

    fn of_grid(
        &self,
        rows: &[Vec<usize>; 2],
        corner: &dyn Fn(usize) -> Option<Corner>,
    ) -> Vec<[Corner; 3]> {
        let known: HashMap<[usize; 2], usize> =
            self.at.iter().enumerate().map(|(k, a)| (*a, k)).collect();
        let mut all = Vec::new();
        for i in rows[0].windows(2) {
            for j in rows[1].windows(2) {
                let around = [[i[0], j[0]], [i[1], j[0]], [i[1], j[1]], [i[0], j[1]]];
                let there = around.iter().filter_map(|a| known.get(a).copied());
                let corners: Option<Vec<Corner>> = there.map(corner).collect();
                match corners.as_deref() {
                    // About the middle, so that no diagonal shows.
                    Some(&[a, b, c, d]) => {
                        let m = [0, 1, 2].map(|x| 0.25 * (a[x] + b[x] + c[x] + d[x]));
                        all.extend([[a, b, m], [b, c, m], [c, d, m], [d, a, m]]);
                    }
                    Some(&[a, b, c]) => all.push([a, b, c]),
                    // A corner failed or has not run, or the study has not enough of them.
                    _ => {}
                }
            }
        }
        all
    }

    fn scattered(
        &self,
        place: &[Vec<f64>; 2],
        corner: &dyn Fn(usize) -> Option<Corner>,
    ) -> Vec<[Corner; 3]> {
        struct Site(usize, Point2<f64>);
        impl HasPosition for Site {
            type Scalar = f64;
            fn position(&self) -> Point2<f64> {
                self.1
            }
        }
        let site =
            |(k, a): (usize, &[usize; 2])| Site(k, Point2::new(place[0][a[0]], place[1][a[1]]));
        let sites: Vec<Site> = self.at.iter().enumerate().map(site).collect();
        // Also those without a value: what was put over them would hide that they have none.
        let Ok(mesh) = DelaunayTriangulation::<Site>::bulk_load_stable(sites) else {
            return Vec::new();
        };
        let cells = mesh.inner_faces();
        let mut cells: Vec<[usize; 3]> = cells.map(|f| f.vertices().map(|v| v.data().0)).collect();
        cells.sort_unstable();
        let corners = |[a, b, c]: &[usize; 3]| Some([corner(*a)?, corner(*b)?, corner(*c)?]);
        cells.iter().filter_map(corners).collect()
    }
}

/// The lines along which the value is `level`: pieces, one for each triangle that they cross.
pub(crate) fn contour(triangles: &[[Corner; 3]], level: f64) -> Vec<[[f64; 2]; 2]> {
    let mut pieces = Vec::new();
    for t in triangles {
        let mut ends: Vec<[f64; 2]> = Vec::with_capacity(2);
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            // Half open, so that a corner on the level belongs to one side.
            if (a[2] < level) != (b[2] < level) {
                let w = (level - a[2]) / (b[2] - a[2]);
                ends.push([0, 1].map(|d| a[d] + w * (b[d] - a[d])));
            }
        }
        if let [a, b] = ends[..] {
            pieces.push([a, b]);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::Value;

    fn levels(of: &[usize]) -> Levels {
        let n = of.iter().max().unwrap() + 1;
        Levels {
            values: (0..n).map(|i| Value::Number(i as f64)).collect(),
            of: of.to_vec(),
        }
    }

    /// A grid of `n` by `n` values and of two of a third variable.
    fn grid(n: usize) -> Vec<Levels> {
        let all: Vec<[usize; 3]> = (0..n * n * 2)
            .map(|i| [i / 2 / n, i / 2 % n, i % 2])
            .collect();
        let of = |d: usize| levels(&all.iter().map(|a| a[d]).collect::<Vec<_>>());
        vec![of(0), of(1), of(2)]
    }

    fn area(triangles: &[[Corner; 3]]) -> f64 {
        let of =
            |[a, b, c]: &[Corner; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        triangles.iter().map(|t| 0.5 * of(t).abs()).sum()
    }

    fn places(n: usize) -> [Vec<f64>; 2] {
        let one: Vec<f64> = (0..n).map(|i| i as f64).collect();
        [one.clone(), one]
    }

    #[test]
    fn a_plane_has_the_points_that_differ_in_its_two_variables_alone() {
        let all = Plane::all(&grid(3), [0, 1]);
        assert_eq!(all.len(), 2);
        assert!(all.iter().all(|p| p.points.len() == 9));
        assert_eq!(all[1].points[..3], [1, 3, 5]);
        assert_eq!(Plane::all(&grid(3), [0, 2]).len(), 3);
    }

    #[test]
    fn no_map_is_drawn_of_few_points_or_few_values() {
        let levels = grid(3);
        let plane = &Plane::all(&levels, [0, 1])[0];
        let mut values = vec![Some(1.0); 18];
        assert_eq!(plane.is_mapped(&values), Ok(()));
        values[0] = None;
        assert!(plane.is_mapped(&values).unwrap_err().contains("8 points"));
        let narrow = &Plane::all(&grid(9), [0, 2])[0];
        assert!(
            narrow
                .is_mapped(&[Some(1.0); 162])
                .unwrap_err()
                .contains("2 values")
        );
    }

    #[test]
    fn nothing_is_put_around_a_point_without_a_value() {
        let levels = grid(5);
        let plane = &Plane::all(&levels, [0, 1])[0];
        let mut values = vec![Some(1.0); 50];
        let whole = plane.triangles(&values, &places(5));
        assert!((area(&whole) - 16.0).abs() < 1e-12);
        // The middle one: the four cells around it are gone.
        values[2 * (2 * 5 + 2)] = None;
        let holed = plane.triangles(&values, &places(5));
        assert!((area(&holed) - 12.0).abs() < 1e-12);
        assert!(holed.iter().flatten().all(|c| c[2] == 1.0), "never zero");
    }

    #[test]
    fn scattered_points_are_joined_and_what_failed_leaves_a_hole() {
        // On a circle around one in the middle: a fan.
        let n = 12;
        let turn = |i: usize| (i as f64 * std::f64::consts::TAU / n as f64 + 0.1).sin_cos();
        let x: Vec<f64> = (0..=n)
            .map(|i| if i < n { turn(i).0 } else { 0.0 })
            .collect();
        let y: Vec<f64> = (0..=n)
            .map(|i| if i < n { turn(i).1 } else { 0.0 })
            .collect();
        let of: Vec<usize> = (0..=n).collect();
        let plane = &Plane::all(&[levels(&of), levels(&of)], [0, 1])[0];
        let mut values = vec![Some(2.0); n + 1];
        let fan = plane.triangles(&values, &[x.clone(), y.clone()]);
        let polygon = 0.5 * n as f64 * (std::f64::consts::TAU / n as f64).sin();
        assert!((area(&fan) - polygon).abs() < 1e-9, "{}", area(&fan));
        values[n] = None;
        assert!(plane.triangles(&values, &[x, y]).is_empty());
    }

    #[test]
    fn lines_of_equal_value_of_a_slope_are_straight() {
        let levels = grid(4);
        let plane = &Plane::all(&levels, [0, 1])[0];
        let values: Vec<Option<f64>> = (0..32).map(|p| Some(levels[0].of[p] as f64)).collect();
        let pieces = contour(&plane.triangles(&values, &places(4)), 1.25);
        assert!(pieces.iter().flatten().all(|p| (p[0] - 1.25).abs() < 1e-12));
        let length: f64 = pieces.iter().map(|[a, b]| (b[1] - a[1]).abs()).sum();
        assert!((length - 3.0).abs() < 1e-12);
    }
}
