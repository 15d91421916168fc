//! A tool that is put in its place: from the coordinates of its file to those of the scene, and back.

use crate::artifact::ToolPlacement;
use crate::tool::place::Place;

/// Placed coordinates are decimals of a millimetre with whole multiples of this part of it (1 pm), as a file in mm has them that lies in its place: what is
/// left in their last digits by the place that they had reaches no result.
const GRAIN: f64 = 1e9;

/// From what was given to the scene: `turn (unit (p - from)) + to`.
///
/// The middle of the tool is taken off first, so that no digits are lost to the distance from the origin that it has in its file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// By rows.
    turn: [[f64; 3]; 3],
    /// A point of what was given, in its units.
    from: [f64; 3],
    /// Where that point comes to (m).
    to: [f64; 3],
    /// Length of one unit (m).
    unit: f64,
    /// Whether it is only scaled and moved.
    plain: bool,
}

impl Placed {
    /// What a place comes to for a tool whose points these are (in units of `unit` m). `None` where it has no point, or one that is not finite.
    pub fn of<'a>(
        place: &Place,
        unit: f64,
        points: impl Iterator<Item = &'a [f64; 3]>,
    ) -> Option<Self> {
        if place.only_moves() {
            return Some(Self::moved(unit, place.translate));
        }
        let points: Vec<&[f64; 3]> = points.collect();
        let (low, high) = bounds(points.iter().map(|p| **p))?;
        let from: [f64; 3] = std::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]);
        let mut placed = Self {
            turn: place.turn(),
            from,
            to: [0.0; 3],
            unit,
            plain: false,
        };
        let origin = std::array::from_fn(|k| from[k] * unit + place.translate[k]);
        placed.to = placed.turned(origin);
        if place.centre.is_none() && place.foot.is_none() {
            return Some(placed);
        }
        let (low, high) = bounds(points.iter().map(|p| placed.about_from(**p)))?;
        if let Some(centre) = place.centre {
            let at = centre.at();
            for k in 0..2 {
                placed.to[k] = at[k] - (0.5 * low[k] + 0.5 * high[k]);
            }
        }
        if let Some(foot) = place.foot {
            placed.to[2] = foot.at() - low[2];
        }
        Some(placed)
    }

    /// Scaled and then moved by `translate` (m), and nothing else.
    pub fn moved(unit: f64, translate: [f64; 3]) -> Self {
        Self {
            turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            from: [0.0; 3],
            to: translate,
            unit,
            plain: true,
        }
    }

    fn turned(&self, p: [f64; 3]) -> [f64; 3] {
        self.turn
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
    }

    fn about_from(&self, p: [f64; 3]) -> [f64; 3] {
        self.turned(std::array::from_fn(|k| (p[k] - self.from[k]) * self.unit))
    }

    /// A point of what was given, in the scene (m).
    pub fn put(&self, p: [f64; 3]) -> [f64; 3] {
        if self.plain {
            return std::array::from_fn(|k| p[k] * self.unit + self.to[k]);
        }
        let about = self.about_from(p);
        // The decimal first and then its unit, as of a file's coordinates. Adding zero turns -0 into 0.
        let decimal = |x: f64| (x * 1e3 * GRAIN).round() / GRAIN;
        std::array::from_fn(|k| decimal(about[k] + self.to[k]) * 1e-3 + 0.0)
    }

    /// A point of the scene (m) in what was given, in its units.
    pub fn back(&self, p: [f64; 3]) -> [f64; 3] {
        if self.plain {
            return std::array::from_fn(|k| (p[k] - self.to[k]) / self.unit);
        }
        let q: [f64; 3] = std::array::from_fn(|k| p[k] - self.to[k]);
        let turn = &self.turn;
        std::array::from_fn(|k| {
            let back = turn[0][k] * q[0] + turn[1][k] * q[1] + turn[2][k] * q[2];
            back / self.unit + self.from[k]
        })
    }

    /// As artifacts tell it; `None` of a tool that is only scaled and moved.
    pub fn told(&self) -> Option<ToolPlacement> {
        if self.plain {
            return None;
        }
        let moved = self.turned(self.from.map(|c| c * self.unit));
        let row = |k: usize| {
            let [a, b, c] = self.turn[k];
            [a, b, c, self.to[k] - moved[k]].map(|v| v + 0.0)
        };
        Some(ToolPlacement {
            matrix: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
            unit: self.unit,
        })
    }
}

/// The box around points; `None` without any, or where one is not finite.
fn bounds(points: impl Iterator<Item = [f64; 3]>) -> Option<([f64; 3], [f64; 3])> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let finite = |v: &[f64; 3]| v.iter().all(|c| c.is_finite());
    (finite(&low) && finite(&high)).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn place(words: Value) -> Place {
        let mut tool = json!({"file": "hat.stl", "unit": "1 mm"});
        let (all, given) = (tool.as_object_mut().unwrap(), words.as_object().unwrap());
        all.extend(given.clone());
        let tool: crate::tool::StlTool =
            serde_json::from_value(tool).unwrap_or_else(|e| panic!("{words}: {e}"));
        tool.place()
    }

    fn corners() -> Vec<[f64; 3]> {
        (0..8)
            .map(|k| {
                [
                    1e3 + f64::from(k & 1),
                    2e3 + 2.0 * f64::from(k >> 1 & 1),
                    3e3 + 3.0 * f64::from(k >> 2),
                ]
            })
            .collect()
    }

    #[test]
    fn up_brings_each_axis_to_z_by_the_smallest_turn_and_rotate_follows_it() {
        let turned = |words: Value, p: [f64; 3]| {
            let turn = place(words).turn();
            turn.map(|row| (0..3).map(|k| row[k] * p[k]).sum::<f64>())
        };
        for (up, x, y, z) in [
            ("+z", [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ("-z", [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]),
            ("+y", [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]),
            ("-y", [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]),
            ("+x", [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]),
            ("-x", [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]),
        ] {
            let of = |p| turned(json!({"up": up}), p);
            let found = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(of);
            assert_eq!(found, [x, y, z], "{up}");
        }
        let askew = turned(json!({"up": [1, 2, 2]}), [1.0, 2.0, 2.0]);
        assert!(
            askew[0].abs() < 1e-15 && askew[1].abs() < 1e-15,
            "{askew:?}"
        );
        assert!((askew[2] - 3.0).abs() < 1e-15);

        let about = |words, p| turned(words, p);
        let quarter = about(json!({"rotate": "90 deg"}), [1.0, 0.0, 0.0]);
        assert_eq!(quarter, [0.0, 1.0, 0.0], "counter-clockwise from above");
        let after = about(json!({"up": "+y", "rotate": "90 deg"}), [0.0, 0.0, 1.0]);
        assert_eq!(after, [1.0, 0.0, 0.0], "about the z that `up` has made");
        let listed =
            json!([{"axis": "+x", "angle": "90 deg"}, {"axis": [0, 0, 2], "angle": "90 deg"}]);
        let listed = about(json!({ "rotate": listed }), [0.0, 0.0, 1.0]);
        assert_eq!(listed, [1.0, 0.0, 0.0], "one after the other");
        let sixth = about(json!({"rotate": "30 deg"}), [1.0, 0.0, 0.0]);
        assert!((sixth[1] - 0.5).abs() < 1e-15, "{sixth:?}");
    }

    #[test]
    fn each_word_moves_what_it_says_and_nothing_else() {
        let corners = corners();
        let low_high = |words: Value| {
            let placed = Placed::of(&place(words), 1e-3, corners.iter()).unwrap();
            bounds(corners.iter().map(|p| placed.put(*p))).unwrap()
        };
        let moved = low_high(json!({"translate": ["-1 m", "0 mm", "0 mm"]}));
        assert_eq!(moved.0.map(|c| (c * 1e3).round()), [0.0, 2e3, 3e3]);
        let upright = low_high(json!({"up": "+y", "translate": ["-1 m", "-2 m", "-3 m"]}));
        assert_eq!(upright, ([0.0, -0.003, 0.0], [0.001, 0.0, 0.002]));
        let centred = low_high(json!({"up": "+y", "centre": "auto", "foot": "auto"}));
        assert_eq!(centred, ([-0.0005, -0.0015, 0.0], [0.0005, 0.0015, 0.002]));
        let put = low_high(json!({"centre": ["10 mm", "-20 mm"], "foot": "5 mm"}));
        assert_eq!(put, ([0.0095, -0.021, 0.005], [0.0105, -0.019, 0.008]));
        let centred = low_high(json!({"centre": "auto"}));
        assert_eq!(
            [centred.0[2], centred.1[2]],
            [3.0, 3.003],
            "its height is left"
        );
        let stood = low_high(json!({"foot": "auto"}));
        assert_eq!([stood.0[0], stood.1[2]], [1.0, 0.003], "its place is left");
    }

    #[test]
    fn what_is_told_takes_the_file_to_the_scene_and_the_way_back_gives_the_file() {
        let corners = corners();
        let words = json!({"up": [1, 2, -2], "rotate": "17 deg", "centre": "auto", "foot": "auto"});
        let placed = Placed::of(&place(words), 1e-3, corners.iter()).unwrap();
        let ToolPlacement { matrix, unit } = placed.told().unwrap();
        for p in &corners {
            let put = placed.put(*p);
            let by_matrix: [f64; 3] = std::array::from_fn(|k| {
                let [a, b, c, d] = matrix[k];
                a * p[0] * unit + b * p[1] * unit + c * p[2] * unit + d
            });
            let back = placed.back(put);
            for k in 0..3 {
                assert!(
                    (put[k] - by_matrix[k]).abs() < 1e-12,
                    "{put:?} {by_matrix:?}"
                );
                assert!((back[k] - p[k]).abs() < 1e-8, "{back:?} {p:?}");
            }
        }
        assert_eq!(
            Placed::of(&place(json!({})), 1.0, corners.iter())
                .unwrap()
                .told(),
            None
        );
    }

    #[test]
    fn a_place_20_m_off_leaves_the_same_bits_as_one_at_the_origin() {
        // Features of 0.1 mm, in inches, turned about by quarters.
        let here: Vec<[f64; 3]> = (0..1000)
            .map(|k| {
                let k = f64::from(k);
                [k % 7.0, k % 11.0, k % 13.0].map(|c| (c * 100.0 + 30.0).round() / 1e3)
            })
            .collect();
        let words = json!({"up": "+y", "rotate": "90 deg", "centre": "auto", "foot": "auto"});
        let near = Placed::of(
            &place(json!({"centre": "auto", "foot": "auto"})),
            1e-3,
            here.iter(),
        )
        .unwrap();
        // The way round that `words` undo.
        let there: Vec<[f64; 3]> = (here.iter())
            .map(|[x, y, z]| [-12_345.678 + y, 20_000.0 + z, 17_654.321 + x].map(|c| c / 25.4))
            .collect();
        let far = Placed::of(&place(words), 0.0254, there.iter()).unwrap();
        // The same without any words, where the box is of that place.
        let at = json!({"up": "+y", "rotate": "90 deg", "centre": ["0.33 mm", "0.53 mm"], "foot": "0.03 mm"});
        let plain = Placed::moved(1e-3, [0.0; 3]);
        let there_too = Placed::of(&place(at), 0.0254, there.iter()).unwrap();
        let mut different = 0;
        for (p, q) in here.iter().zip(&there) {
            for (a, b) in [
                (near.put(*p), far.put(*q)),
                (plain.put(*p), there_too.put(*q)),
            ] {
                different += usize::from(a.map(f64::to_bits) != b.map(f64::to_bits));
            }
        }
        assert_eq!(different, 0);
    }
}
