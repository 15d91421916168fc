//! Long series, thinned to what a screen shows.

use std::collections::BTreeSet;

/// A place on the page (px); `None` where the series has a gap.
pub(super) type Place = Option<[f64; 2]>;

/// A series is drawn with about this many places at most.
const MOST: usize = 2400;
/// Markers are drawn at this many places at most.
const MOST_MARKERS: usize = 1500;
/// Of markers whose centres share a square of this side (px) one is drawn.
const CELL: f64 = 2.0;

/// The stretches of a line between its gaps. Of neighbours in one column of pixels the first, the lowest, the highest
/// and the last are kept: on a screen that is the same line (the "M4" aggregation of Jugel et al., VLDB 2014, which
/// holds for lines that turn back as well when columns are taken along the line).
pub(super) fn line(places: &[Place]) -> Vec<Vec<[f64; 2]>> {
    let mut runs: Vec<Vec<[f64; 2]>> = Vec::new();
    for stretch in places.split(Option::is_none) {
        let all: Vec<[f64; 2]> = stretch.iter().flatten().copied().collect();
        if all.is_empty() {
            continue;
        }
        let kept = simplified(&by_columns(&all));
        runs.push(if kept.len() > MOST {
            by_stretches(&kept, MOST / 6)
        } else {
            kept
        });
    }
    if runs.iter().map(Vec::len).sum::<usize>() > 4 * MOST {
        // So many gaps that none can be seen.
        let all: Vec<[f64; 2]> = places.iter().flatten().copied().collect();
        runs = vec![by_stretches(&all, MOST / 6)];
    }
    runs
}

/// Places of markers: one of those that cover each other, and always those that lie farthest out.
pub(super) fn markers(places: &[Place]) -> Vec<[f64; 2]> {
    let all: Vec<[f64; 2]> = places.iter().flatten().copied().collect();
    let outermost = extremes(&all);
    let mut taken = BTreeSet::new();
    let mut kept = Vec::new();
    for (i, p) in all.iter().enumerate() {
        let cell = p.map(|v| (v / CELL).floor() as i64);
        if taken.insert(cell) || outermost.contains(&i) {
            kept.push(*p);
        }
    }
    if kept.len() > MOST_MARKERS {
        kept = by_stretches(&kept, MOST_MARKERS / 6);
    }
    kept
}

fn by_columns(all: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let column = |p: &[f64; 2]| p[0].floor();
    let mut kept = Vec::new();
    for group in all.chunk_by(|a, b| column(a) == column(b)) {
        let by = |i: &usize, j: &usize| group[*i][1].total_cmp(&group[*j][1]);
        let low = (0..group.len()).min_by(by).unwrap_or(0);
        let high = (0..group.len()).max_by(by).unwrap_or(0);
        let ends = BTreeSet::from([0, low, high, group.len() - 1]);
        kept.extend(ends.into_iter().map(|i| group[i]));
    }
    kept
}

/// Farthest that a line may lie from one of its places that is left out (px).
const UNSEEN: f64 = 0.15;

/// A line without the places that lie on the chords between others (Ramer 1972; Douglas and Peucker 1973).
fn simplified(all: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept = vec![false; all.len()];
    let Some(last) = all.len().checked_sub(1) else {
        return Vec::new();
    };
    (kept[0], kept[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((a, b)) = open.pop() {
        let between = (a + 1..b).map(|i| (i, apart(all[i], all[a], all[b])));
        let farthest = between.reduce(|x, y| if y.1 > x.1 { y } else { x });
        if let Some((i, _)) = farthest.filter(|f| f.1 > UNSEEN) {
            kept[i] = true;
            open.extend([(a, i), (i, b)]);
        }
    }
    let places = all.iter().zip(kept).filter(|(_, kept)| *kept);
    places.map(|(p, _)| *p).collect()
}

/// Distance of a place from the stretch between two others.
fn apart(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (u, v) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = u[0] * u[0] + u[1] * u[1];
    let along = if square > 0.0 {
        ((u[0] * v[0] + u[1] * v[1]) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (v[0] - along * u[0]).hypot(v[1] - along * u[1])
}

/// Of each of `count` stretches both ends and what lies farthest out.
fn by_stretches(all: &[[f64; 2]], count: usize) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for group in all.chunks(all.len().div_ceil(count.max(1)).max(1)) {
        let mut ends = extremes(group);
        ends.extend([0, group.len() - 1]);
        kept.extend(ends.into_iter().map(|i| group[i]));
    }
    kept
}

/// The places farthest left, right, up and down.
fn extremes(all: &[[f64; 2]]) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    for d in 0..2 {
        let by = |i: &usize, j: &usize| all[*i][d].total_cmp(&all[*j][d]);
        found.extend((0..all.len()).min_by(by));
        // The first of equals, as above.
        found.extend((0..all.len()).rev().max_by(by));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn has(runs: &[Vec<[f64; 2]>], p: [f64; 2]) -> bool {
        runs.iter().flatten().any(|q| *q == p)
    }

    #[test]
    fn thinning_keeps_peaks_and_ends_of_long_lines() {
        let n = 100_000;
        let x = |i: usize| 500.0 * i as f64 / (n - 1) as f64;
        let mut all: Vec<Place> = (0..n)
            .map(|i| Some([x(i), 100.0 + 50.0 * (i as f64 * 0.01).sin()]))
            .collect();
        all[43_210] = Some([x(43_210), 3.0]);
        all[87_650] = Some([x(87_650), 220.0]);
        let runs = line(&all);
        assert_eq!(runs.len(), 1);
        assert!(runs[0].len() <= MOST, "{}", runs[0].len());
        for i in [0, 43_210, 87_650, n - 1] {
            assert!(has(&runs, all[i].unwrap()), "{i}");
        }
        assert!(runs[0].windows(2).all(|w| w[0][0] <= w[1][0]));
    }

    #[test]
    fn a_line_that_turns_back_again_and_again_keeps_its_outermost_places() {
        let n = 100_000;
        let mut all: Vec<Place> = (0..n)
            .map(|i| {
                let a = i as f64 * 1.7;
                Some([250.0 + 200.0 * a.sin(), 100.0 + 80.0 * (1.3 * a).cos()])
            })
            .collect();
        let out = [[5.0, 100.0], [495.0, 101.0], [250.0, 1.0], [251.0, 199.0]];
        for (k, p) in out.into_iter().enumerate() {
            all[20_000 * (k + 1)] = Some(p);
        }
        let runs = line(&all);
        assert!(runs.iter().map(Vec::len).sum::<usize>() <= MOST);
        assert!(out.into_iter().all(|p| has(&runs, p)));
    }

    #[test]
    fn a_gap_splits_a_line_and_short_lines_are_kept_whole() {
        let all = [Some([0.0, 1.0]), Some([5.0, 2.0]), None, Some([9.0, 3.0])];
        let runs = line(&all);
        assert_eq!(runs, [vec![[0.0, 1.0], [5.0, 2.0]], vec![[9.0, 3.0]]]);
        let broken: Vec<Place> = (0..100_000)
            .map(|i| (i % 2 == 0).then_some([i as f64 * 5e-3, (i % 7) as f64]))
            .collect();
        assert!(line(&broken).iter().map(Vec::len).sum::<usize>() <= MOST);
    }

    #[test]
    fn places_on_a_chord_are_left_out_and_the_line_stays_within_a_seventh_of_a_pixel() {
        let all: Vec<[f64; 2]> = (0..=4000)
            .map(|i| {
                let x = 0.125 * f64::from(i);
                [
                    x,
                    if x < 250.0 {
                        100.0
                    } else {
                        100.0 + 60.0 * (0.05 * (x - 250.0)).sin()
                    },
                ]
            })
            .collect();
        let places: Vec<Place> = all.iter().copied().map(Some).collect();
        let runs = line(&places);
        let kept = &runs[0];
        assert!(
            kept.len() < 120 && (kept[0], kept[kept.len() - 1]) == (all[0], all[4000]),
            "{}",
            kept.len()
        );
        for p in &all {
            let near = kept
                .windows(2)
                .map(|w| apart(*p, w[0], w[1]))
                .fold(f64::INFINITY, f64::min);
            // Columns drop places between their lowest and highest.
            assert!(near < 0.5, "{p:?}: {near} px");
        }
        let simple = simplified(&all);
        let worst = all.iter().map(|p| {
            simple
                .windows(2)
                .map(|w| apart(*p, w[0], w[1]))
                .fold(f64::INFINITY, f64::min)
        });
        assert!(worst.fold(0.0, f64::max) <= UNSEEN);
    }

    #[test]
    fn markers_that_cover_each_other_are_drawn_once_and_the_outermost_always() {
        let mut all: Vec<Place> = (0..100_000)
            .map(|i| Some([100.0 + (i % 300) as f64, 100.0 + (i % 97) as f64]))
            .collect();
        all[777] = Some([400.5, 100.2]);
        let kept = markers(&all);
        assert!(kept.len() <= MOST_MARKERS, "{}", kept.len());
        assert!(kept.contains(&[400.5, 100.2]));
        let same = vec![Some([10.1, 10.1]); 5000];
        assert_eq!(markers(&same).len(), 1);
        assert!(markers(&[None, None]).is_empty());
    }
}
