use super::*;
use std::f64::consts::TAU;

fn field(points: &[[f64; 3]]) -> SteeredField {
    SteeredField::new(points.to_vec()).unwrap_or_else(|e| panic!("{e}"))
}

/// Fibres on circles about (0, 0).
fn on_circles(x: f64, y: f64) -> f64 {
    y.atan2(x) + FRAC_PI_2
}

/// Points of a grid of this distance over a quarter of a ring with the inner radius 0.1 m and a little beyond it.
fn ring(distance: f64) -> Vec<[f64; 3]> {
    let n = (0.3 / distance).round() as i32;
    let all = (-2..=n).flat_map(|i| (-2..=n).map(move |j| [i, j]));
    let places = all.map(|[i, j]| [f64::from(i) * distance, f64::from(j) * distance]);
    places
        .filter(|[x, y]| x.hypot(*y) > 0.08)
        .map(|[x, y]| [x, y, on_circles(x, y)])
        .collect()
}

/// Places within the quarter ring from 0.1 to 0.3 m.
fn places() -> impl Iterator<Item = Point> {
    (0..40).flat_map(|i| {
        (0..40).map(move |j| {
            let (r, turn) = (0.101 + 0.0049 * f64::from(i), 0.0391 * f64::from(j) + 0.01);
            [r * turn.cos(), r * turn.sin()]
        })
    })
}

/// The error of a linear interpolation in a triangle is at most half the square of the radius of its circle times the largest second derivative.
/// Of a unit vector at twice the angle of the tangents of circles, that is at most 4.5 / r2 (the derivative along any line: 4 / r2 and 2 / r2 at a right
/// angle). The triangles of a square grid of the distance h have the radius h / sqrt 2. So the vector is off by 1.125 h2 / r2 at
/// most, and the direction by half the angle of that sine.
#[test]
fn directions_on_circles_lie_within_the_bound_of_a_linear_interpolation() {
    for distance in [0.02, 0.01, 0.005] {
        let field = field(&ring(distance));
        let mut largest = 0.0f64;
        for [x, y] in places() {
            let r = x.hypot(y);
            // The triangle may reach nearer to the centre than the place.
            let bound = 0.5 * (1.125 * (distance / (r - distance)).powi(2)).asin();
            let off = directions_apart(field.angle_at([x, y]), on_circles(x, y));
            assert!(off <= bound, "{off} beyond {bound} at {r}, grid {distance}");
            largest = largest.max(off / bound);
        }
        // A bound that is never come near says nothing.
        assert!(largest > 0.1, "{largest}");
    }
}

#[test]
fn equal_directions_give_that_direction_to_the_bit_inside_and_outside() {
    for angle in [0.0, 0.3, -FRAC_PI_2, 1.1 * PI, 45f64.to_radians()] {
        let points: Vec<[f64; 3]> = ring(0.02).iter().map(|p| [p[0], p[1], angle]).collect();
        let field = field(&points);
        for place in places().chain([[5.0, -3.0], [0.0, 0.0], [-0.5, 0.3]]) {
            assert_eq!(field.angle_at(place).to_bits(), angle.to_bits());
        }
    }
}

#[test]
fn a_direction_and_its_opposite_are_one_between_points_too() {
    let field = field(&[
        [0.0, 0.0, 170f64.to_radians()],
        [1.0, 0.0, 10f64.to_radians()],
        [0.0, 1.0, -10f64.to_radians()],
        [1.0, 1.0, 190f64.to_radians()],
    ]);
    // Half way from 170 to 10 lies 180, not 90.
    for (place, want) in [([0.5, 0.0], 0.0), ([0.0, 0.5], 170.0), ([1.0, 0.5], 10.0)] {
        let off = directions_apart(field.angle_at(place), f64::to_radians(want));
        assert!(off < 1e-12, "{place:?}: {off}");
    }
}

#[test]
fn beyond_the_points_the_nearest_place_counts_and_points_on_a_line_are_joined() {
    let degrees = f64::to_radians;
    let line = field(&[
        [0.1, 0.0, degrees(20.0)],
        [0.0, 0.0, degrees(0.0)],
        [0.3, 0.0, degrees(60.0)],
    ]);
    for (place, want) in [
        ([0.1, 0.7], 20.0),
        ([-4.0, 1.0], 0.0),
        ([9.0, -1.0], 60.0),
        ([0.05, -0.2], 10.0),
        ([0.2, 0.0], 40.0),
    ] {
        // In the middle the direction is the middle, however the doubled angles are mixed.
        let off = directions_apart(line.angle_at(place), degrees(want));
        assert!(off < 1e-12, "{place:?}: {off}");
    }
    let one = field(&[[0.1, 0.2, 0.7]]);
    assert_eq!(one.angle_at([3.0, -1.0]), 0.7);
    let square = field(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.2],
        [1.0, 1.0, 0.4],
        [0.0, 1.0, 0.2],
    ]);
    let off = square.angle_at([2.0, 0.5]) - 0.3;
    assert!(off.abs() < 1e-12, "{off}");
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    let points = ring(0.02);
    let mut other = points.clone();
    other.reverse();
    other.swap(3, 40);
    let (a, b) = (field(&points), field(&other));
    for place in places().chain([[5.0, -3.0]]) {
        let off = directions_apart(a.angle_at(place), b.angle_at(place));
        assert!(off < 1e-14, "{place:?}: {off}");
    }
}

#[test]
fn points_that_tell_no_direction_are_refused() {
    let refused = |points: &[[f64; 3]]| SteeredField::new(points.to_vec()).unwrap_err();
    assert_eq!(refused(&[]), SteeringError::Count(0));
    assert_eq!(
        refused(&vec![[0.0; 3]; MOST_POINTS + 1]),
        SteeringError::Count(MOST_POINTS + 1)
    );
    assert_eq!(
        refused(&[[0.0; 3], [f64::NAN, 0.0, 0.0]]),
        SteeringError::NoNumber(1)
    );
    let twice = [[0.1, 0.2, 0.0], [0.0, 0.0, 0.0], [0.1, 0.2, 1.0]];
    let SteeringError::Same {
        first: 0,
        second: 2,
        ..
    } = refused(&twice)
    else {
        panic!("{:?}", refused(&twice));
    };
    // The smallest numbers are places, too.
    assert_eq!(
        field(&[[1e-300, 0.0, 0.1], [1.0, 0.0, 0.1]]).angle_at([0.5, 0.0]),
        0.1
    );
}

#[test]
fn a_sharp_turn_is_told_where_the_ply_lies_and_not_in_its_hole() {
    // All around a ring of points there is no direction in the middle.
    let points: Vec<[f64; 3]> = (0..48)
        .map(|k| {
            let (r, turn) = (if k < 24 { 0.1 } else { 0.2 }, TAU * f64::from(k) / 24.0);
            let (x, y) = (r * turn.cos(), r * turn.sin());
            [x, y, on_circles(x, y)]
        })
        .collect();
    let field = field(&points);
    let circle = |r: f64| -> Vec<Point> {
        let turn = |k: i32| TAU * f64::from(k) / 60.0;
        (0..60)
            .map(|k| [r * turn(k).cos(), r * turn(k).sin()])
            .collect()
    };
    let ring = Region::new(circle(0.19), vec![circle(0.102)]).unwrap();
    assert_eq!(field.sharp_turn(Some(&ring)), None);
    let disc = Region::new(circle(0.19), Vec::new()).unwrap();
    let turn = field.sharp_turn(Some(&disc)).unwrap();
    assert!(turn.apart >= MOST_TURN - 1e-9 && turn.first < turn.second && turn.second < 24);
    assert!(field.sharp_turn(None).is_some());
    // Of two points the join counts, wherever the ply lies.
    let two = super::tests::field(&[[0.0, 0.0, 0.0], [0.1, 0.0, FRAC_PI_2]]);
    let apart = two.sharp_turn(Some(&disc)).map(|t| t.apart);
    assert!((apart.unwrap() - FRAC_PI_2).abs() < 1e-12);
}

#[test]
fn a_straight_ply_keeps_its_directions_and_a_steered_one_lies_square() {
    let straight = Laid::Straight([0.3, 0.9]);
    assert_eq!(
        (straight.at([1.0, 2.0]), straight.axis_at([1.0, 2.0])),
        ([0.3, 0.9], 0.3)
    );
    let steered = Laid::steered(vec![[0.0, 0.0, 0.1], [1.0, 0.0, 0.3]]).unwrap();
    let corners = [
        [0.0, 0.0, 9.0],
        [1.0, 0.0, 9.0],
        [1.0, 1.0, 9.0],
        [0.0, 1.0, 9.0],
    ];
    let [first, second] = steered.in_cell(&corners);
    assert!((first - 0.2).abs() < 1e-12 && second == first + FRAC_PI_2);
    assert_eq!(steered.axis_in_cell(&corners), first);
    assert_eq!(
        (straight.straight(), steered.straight()),
        (Some([0.3, 0.9]), None)
    );
}
