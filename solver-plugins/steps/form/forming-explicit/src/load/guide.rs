//! What presses a rigid part in a zone: its share of the force, about the way that the part had in the run of the whole.

use plyflow_mechanics::history::MonotoneCubic;

/// How a part that is pressed goes in a zone.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// Its way in the run of the whole (m).
    pub way: MonotoneCubic,
    /// Share of the plies under it that the zone has, of those that are free to push back.
    pub share: f64,
    /// How far off that way the part may be pushed until its whole force holds it (m).
    pub slack: f64,
}

impl Guide {
    /// What presses the part (N) when its whole force is `whole` and it has been pushed back by `back` (m) from where it was in the run of the whole: its
    /// share, more as it is pushed back and less as it goes on, never less than nothing nor more than the whole.
    pub fn force(&self, whole: f64, back: f64) -> f64 {
        let whole = whole.max(0.0);
        (self.share * whole + whole * back / self.slack).clamp(0.0, whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_has_its_share_on_its_way_and_its_whole_force_where_it_is_pushed_off() {
        let guide = Guide {
            way: MonotoneCubic::new(vec![0.0, 1.0], vec![0.0; 2]),
            share: 0.4,
            slack: 1e-4,
        };
        // A micrometre, of which nothing hangs, is a hundredth of the force.
        for (back, expected) in [
            (0.0, 40.0),
            (1e-6, 41.0),
            (-1e-6, 39.0),
            (6e-5, 100.0),
            (1e-3, 100.0),
            (-1e-3, 0.0),
        ] {
            assert!(
                (guide.force(100.0, back) - expected).abs() < 1e-9,
                "{back} m"
            );
        }
        assert_eq!(guide.force(-5.0, 0.0), 0.0);
    }
}
