//! Rigid surfaces: distances of the open plate, and surfaces that move.

use plyflow_geometry::vec3::{Vec3, add, dot, norm, scale, sub};
use plyflow_mechanics::contact::{
    ContactSettings, OpenPlate, Pace, Plane, RigidContact, RigidItem, RigidMotion, RigidSurface,
};
use plyflow_mechanics::history::constant_speed_way;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const PLATE: OpenPlate = OpenPlate {
    height: 0.01,
    side: 1.0,
    opening: 0.05,
    edge: 0.006,
};

#[test]
fn distance_to_an_open_plate_is_that_of_its_parts() {
    let at = |x: Vec3| PLATE.distance(x).0;
    // Below the face, at the wall of the opening, at the rounding's middle.
    assert!((at([0.07, 0.02, 0.004]) - 0.006).abs() < 1e-15);
    assert!((at([0.0, 0.03, 0.03]) - 0.02).abs() < 1e-15);
    let diagonal = 0.056 - 0.006 * 0.5f64.sqrt();
    let on_edge = [diagonal, 0.0, 0.016 - 0.006 * 0.5f64.sqrt()];
    assert!(at(on_edge).abs() < 1e-15);
    // A plate whose solid lies below is the mirror image.
    let mirrored = OpenPlate {
        side: -1.0,
        height: -0.01,
        ..PLATE
    };
    for x in [[0.052, 0.003, 0.012], [0.04, -0.02, 0.03], [0.08, 0.0, 0.0]] {
        let ((d, g), (m, h)) = (PLATE.distance(x), mirrored.distance([x[0], x[1], -x[2]]));
        assert_eq!((d, g), (m, [h[0], h[1], -h[2]]));
    }
}

#[test]
fn gradient_of_the_distance_is_its_derivative_and_has_length_one() {
    for i in 0..40 {
        for j in 0..40 {
            let r = 0.03 + 0.04 * f64::from(i) / 40.0 + 1e-5;
            let z = -0.005 + 0.03 * f64::from(j) / 40.0 + 1e-5;
            let x = [0.6 * r, 0.8 * r, z];
            let (d, g) = PLATE.distance(x);
            // Inside the plate nothing but the skin matters.
            if d < -0.002 {
                continue;
            }
            assert!((norm(g) - 1.0).abs() < 1e-12);
            for c in 0..3 {
                let h = 1e-7;
                let moved = |s: f64| {
                    let mut y = x;
                    y[c] += s * h;
                    PLATE.distance(y).0
                };
                let slope = (moved(1.0) - moved(-1.0)) / (2.0 * h);
                assert!((slope - g[c]).abs() < 1e-6, "{x:?} {c}: {slope} {}", g[c]);
            }
        }
    }
}

#[test]
fn a_rising_floor_lifts_a_weight_and_does_its_work() {
    let (mass, dt, gravity) = (0.01, 1e-5, 9.81);
    let mut item = RigidItem::new(0);
    (item.stiffness, item.damping) = (1e5, 10.0);
    let settings = ContactSettings {
        augmentation: 0.0,
        ..ContactSettings::default()
    };
    let floor = Arc::new(Plane { height: 0.0 });
    let mut contact = RigidContact::new("floor".into(), floor, 0.0, 0.3, &settings, vec![item]);
    contact.moves = true;
    // The floor also drifts sideways: friction takes the weight along. It stops more gently than a weight falls, so
    // that the weight stays on it.
    let way = |t: f64| {
        let up = constant_speed_way(t, 0.005, 0.1, 0.02);
        [0.1 * up, 0.0, up]
    };
    let (mut x, mut v) = (vec![[0.0, 0.0, -mass * gravity / 1e5]], vec![[0.0; 3]]);
    let start = x[0];
    let pace = Pace {
        dt,
        speed: 100.0,
        acceleration: 1e6,
        growth: 1.0,
    };
    let (mut external, mut lost, mut stored) = (0.0, 0.0, None);
    for i in 0..10_000 {
        let t = f64::from(i) * dt;
        let before = if i == 0 { way(0.0) } else { way(t - dt) };
        contact.motion = RigidMotion {
            shift: way(t),
            velocity: scale(add(way(t), scale(before, -1.0)), 1.0 / dt),
        };
        let energy = contact.compute(&x, &v, pace);
        stored.get_or_insert(energy.stored);
        lost += energy.friction + energy.damping;
        external += dot(contact.items[0].force, contact.motion.velocity) * dt;
        if i == 9_999 {
            let gained = 0.5 * mass * dot(v[0], v[0]) + mass * gravity * (x[0][2] - start[2]);
            let kept = energy.stored - stored.unwrap();
            assert!((x[0][2] - start[2] - 0.005).abs() < 1e-5, "{:?}", x[0]);
            assert!((x[0][0] - 0.0005).abs() < 1e-5, "{:?}", x[0]);
            let open = (external - gained - kept - lost).abs();
            assert!(open < 2e-3 * external, "{external} {gained} {kept} {lost}");
        }
        let f = add(contact.items[0].force, [0.0, 0.0, -mass * gravity]);
        v[0] = add(v[0], scale(f, dt / mass));
        x[0] = add(x[0], scale(v[0], dt));
    }
}

/// A ball about the origin that counts how often it is asked.
struct Ball {
    radius: f64,
    costly: bool,
    asked: AtomicUsize,
}

impl RigidSurface for Ball {
    fn distance(&self, p: Vec3) -> (f64, Vec3) {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let r = norm(p);
        (r - self.radius, scale(p, 1.0 / r))
    }

    fn is_costly(&self) -> bool {
        self.costly
    }
}

/// A weight slides off the top of a ball of 10 mm: where it leaves (m), after how many steps, how often the ball was asked.
fn slide(costly: bool) -> (Vec3, usize, usize) {
    let (mass, dt, gravity, radius, start) = (0.01, 1e-5, 9.81, 0.01, 0.2f64);
    let mut item = RigidItem::new(0);
    (item.stiffness, item.damping) = (1e5, 10.0);
    let settings = ContactSettings {
        augmentation: 0.0,
        ..ContactSettings::default()
    };
    let asked = AtomicUsize::new(0);
    let ball = Arc::new(Ball {
        radius,
        costly,
        asked,
    });
    let mut contact =
        RigidContact::new("ball".into(), ball.clone(), 0.0, 0.0, &settings, vec![item]);
    let r = radius - mass * gravity * start.cos() / 1e5;
    let mut x = vec![[r * start.sin(), 0.0, r * start.cos()]];
    let mut v = vec![[0.0; 3]];
    let pace = Pace {
        dt,
        speed: 10.0,
        acceleration: 4.0 * gravity,
        growth: 1.0,
    };
    let mut last = (x[0], 0, 0);
    for step in 0.. {
        contact.compute(&x, &v, pace);
        if contact.items[0].normal_force > 0.0 {
            last = (x[0], step, ball.asked.load(Ordering::Relaxed));
        } else if step > last.1 + 300 {
            return last;
        }
        let f = add(contact.items[0].force, [0.0, 0.0, -mass * gravity]);
        v[0] = add(v[0], scale(f, dt / mass));
        x[0] = add(x[0], scale(v[0], dt));
    }
    unreachable!("it leaves")
}

/// A weight without friction leaves a ball where the cosine from the top is two thirds of that at which it started.
#[test]
fn a_weight_leaves_a_ball_where_it_must_whether_it_keeps_its_tangent_plane_or_not() {
    let (x, steps, asked) = slide(false);
    assert_eq!(asked, steps + 1, "a cheap surface is asked every time");
    let leaves = |x: Vec3| (x[2] / norm(x)).acos().to_degrees();
    let must = (2.0 / 3.0 * 0.2f64.cos()).acos().to_degrees();
    assert!((leaves(x) - must).abs() < 0.2, "{} {must}", leaves(x));
    // On its plane it departs by k (8 v dt)^2 / 2R, two percent of its weight at the end: so much earlier it leaves.
    let (y, later, seldom) = slide(true);
    assert!((leaves(y) - must).abs() < 1.0, "{} {must}", leaves(y));
    assert!(seldom < later / 6, "{seldom} of {later}");
}

/// A weight that falls is found before it is deep, however long it has slept.
#[test]
fn a_falling_weight_is_never_found_late() {
    let (mass, dt, gravity) = (0.01, 1e-5, 9.81);
    for height in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
        for push in [0.0, 0.1, 1.0] {
            let mut item = RigidItem::new(0);
            (item.stiffness, item.damping) = (1e5, 10.0);
            let asked = AtomicUsize::new(0);
            let ball = Arc::new(Ball {
                radius: 0.01,
                costly: true,
                asked,
            });
            let settings = ContactSettings::default();
            let mut contact =
                RigidContact::new("ball".into(), ball.clone(), 0.0, 0.0, &settings, vec![item]);
            let (mut x, mut v) = (vec![[0.0, 0.0, 0.01 + height]], vec![[0.0, 0.0, -push]]);
            let pace = Pace {
                dt,
                speed: 10.0,
                acceleration: gravity,
                growth: 1.0,
            };
            let mut steps = 0;
            while contact.items[0].normal_force == 0.0 {
                contact.compute(&x, &v, pace);
                v[0][2] += (contact.items[0].force[2] / mass - gravity) * dt;
                x[0][2] += v[0][2] * dt;
                steps += 1;
            }
            let deep = f64::from(contact.items[0].penetration);
            assert!(
                deep <= 1.1 * v[0][2].abs().max(push + 0.5) * dt,
                "{height} {push}: {deep}"
            );
            // From a centimetre it sleeps most of the way.
            let asked = ball.asked.load(Ordering::Relaxed);
            assert!(height < 1e-2 || asked < steps / 4, "{asked} of {steps}");
        }
    }
}

/// A sheet that another one keeps away: nothing holds it before the slack is used up, then the penalty counts from there.
#[test]
fn slack_comes_before_the_force() {
    let settings = ContactSettings {
        augmentation: 0.0,
        ..ContactSettings::default()
    };
    let pace = Pace {
        dt: 1e-6,
        speed: 100.0,
        acceleration: 1e6,
        growth: 1.0,
    };
    let force = |height: f64| {
        let mut item = RigidItem::new(0);
        item.stiffness = 1e5;
        let floor = Arc::new(Plane { height: 0.0 });
        let contact = RigidContact::new("floor".into(), floor, 4e-4, 0.3, &settings, vec![item]);
        let mut contact = contact.with_slack(2e-5);
        assert_eq!(contact.slack, 2e-5);
        contact.compute(&[[0.0, 0.0, height]], &[[0.0; 3]], pace);
        contact.items[0].normal_force
    };
    assert_eq!(force(3.81e-4), 0.0);
    assert!((force(3.7e-4) - 1.0).abs() < 1e-9, "{}", force(3.7e-4));
}

struct Incline {
    normal: Vec3,
}

impl RigidSurface for Incline {
    fn distance(&self, p: Vec3) -> (f64, Vec3) {
        (dot(p, self.normal), self.normal)
    }
}

/// Slides a point mass for 0.1 s down a plane of the given angle; distance (m) along it.
fn slide_down(angle: f64, friction: f64) -> f64 {
    let normal = [angle.sin(), 0.0, angle.cos()];
    let down = [angle.cos(), 0.0, -angle.sin()];
    let (mass, dt, g) = (0.01, 1e-5, 9.81);
    let mut item = RigidItem::new(0);
    item.stiffness = 1e5;
    item.damping = 10.0;
    // At rest on the slip spring, as far as friction holds.
    let held = (mass * g * angle.sin()).min(friction * mass * g * angle.cos());
    item.slip = scale(down, -held);
    let surface = Arc::new(Incline { normal });
    let settings = ContactSettings::default();
    let mut c = RigidContact::new(
        "incline".into(),
        surface,
        0.0,
        friction,
        &settings,
        vec![item],
    );
    // At rest on the penalty spring.
    let start = scale(normal, -mass * g * angle.cos() / 1e5);
    let (mut x, mut v) = (vec![start], vec![[0.0; 3]]);
    for _ in 0..10_000 {
        c.compute(
            &x,
            &v,
            Pace {
                dt,
                speed: 100.0,
                acceleration: 1e6,
                growth: 1.0,
            },
        );
        let f = add(c.items[0].force, [0.0, 0.0, -mass * g]);
        v[0] = add(v[0], scale(f, dt / mass));
        x[0] = add(x[0], scale(v[0], dt));
    }
    dot(sub(x[0], start), down)
}

#[test]
fn block_on_an_incline_sticks_below_the_angle_of_friction() {
    let mu: f64 = 0.4;
    assert!(slide_down(mu.atan() * 0.98, mu).abs() < 2e-6);
}

#[test]
fn block_on_an_incline_slides_by_coulombs_law_above_it() {
    let mu: f64 = 0.4;
    let angle = mu.atan() * 1.3;
    let expected = 0.5 * 9.81 * (angle.sin() - mu * angle.cos()) * 0.1f64.powi(2);
    let got = slide_down(angle, mu);
    assert!(
        (got / expected - 1.0).abs() < 0.01,
        "{got} against {expected}"
    );
}

/// Sleep and planes are kept by item: what is taken out later leaves others with what was its own. Seen by `make checked` alone.
#[cfg(debug_assertions)]
#[test]
#[should_panic(expected = "other items than when it looked last")]
fn a_contact_whose_items_change_after_it_has_looked_is_told() {
    let floor = Arc::new(Plane { height: 0.0 });
    let items = (0..2).map(RigidItem::new).collect();
    let settings = ContactSettings::default();
    let mut contact = RigidContact::new("floor".into(), floor, 0.0, 0.3, &settings, items);
    let pace = Pace {
        dt: 1e-6,
        speed: 10.0,
        acceleration: f64::INFINITY,
        growth: 1.0,
    };
    let (x, v) = ([[0.0, 0.0, 1.0]; 2], [[0.0; 3]; 2]);
    contact.compute(&x, &v, pace);
    contact.items.remove(0);
    contact.compute(&x, &v, pace);
}
