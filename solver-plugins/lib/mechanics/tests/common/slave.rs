//! One slave on a sheet, and what it must be held by: the gradient of its own energy.

use plyflow_geometry::vec3::{Vec3, norm};
use plyflow_mechanics::contact::{
    ContactSettings, Pace, SheetContact, SlaveItem, Surface, ledge, rim_height,
};
use plyflow_mechanics::mesh::QuadMesh;

/// Distance (m) at which it touches.
pub const OFFSET: f64 = 4e-4;

/// Of nodes that never sleep for long.
pub fn pace(dt: f64) -> Pace {
    Pace {
        dt,
        speed: 100.0,
        acceleration: 1e6,
        growth: 1.0,
    }
}

/// Two by two cells of 8 mm, folded along x = 0 by `fold` (rad, positive: a valley) and warped a little; one
/// slave above at `place` and `height` over the middle line of the fold.
pub fn scene(fold: f64, place: [f64; 2], height: f64) -> (QuadMesh, Vec<Vec3>) {
    scene_of(0.008, fold, place, height)
}

/// The same of cells of the length `cell` (m).
pub fn scene_of(cell: f64, fold: f64, place: [f64; 2], height: f64) -> (QuadMesh, Vec<Vec3>) {
    let axis = [-cell, 0.0, cell];
    let mut mesh = QuadMesh::grid(&axis, &axis);
    for (i, p) in mesh.points.iter_mut().enumerate() {
        p[2] = p[0].abs() * (0.5 * fold).tan() + 1e-5 * ((i * 7) % 5) as f64;
    }
    let mut x = mesh.points.clone();
    let ground = place[0].abs() * (0.5 * fold).tan();
    x.push([place[0], place[1], ground + height]);
    (mesh, x)
}

pub fn contact(slave: u32, cell: u32) -> SheetContact {
    let mut item = SlaveItem::new(slave, cell, [0.0; 2]);
    item.stiffness = 1e5;
    let settings = ContactSettings {
        stiffness_factor: 0.0,
        slip_factor: 0.5,
        damping_ratio: 0.0,
        augmentation: 0.0,
    };
    SheetContact::new("test".into(), 1.0, OFFSET, 0.0, &settings, vec![item])
}

/// Energy (J) and forces (N) of a fresh contact.
pub fn evaluate(mesh: &QuadMesh, x: &[Vec3], cell: u32) -> (f64, Vec<Vec3>) {
    let normals = vec![[0.0, 0.0, 1.0]; x.len()];
    let neighbours = mesh.neighbours();
    let surface = Surface {
        cells: &mesh.cells,
        neighbours: &neighbours,
        x,
        normals: &normals,
    };
    let mut c = contact(x.len() as u32 - 1, cell);
    let height = rim_height(&mesh.cells, &neighbours, x).expect("a rim");
    c.ledge = ledge(OFFSET, height);
    let v = vec![[0.0; 3]; x.len()];
    let mut energy = 0.0;
    // The first search starts afar; the second is at the place.
    for _ in 0..2 {
        energy = c.compute(&surface, &v, pace(1e-6)).stored;
    }
    let mut f = vec![[0.0; 3]; x.len()];
    c.scatter(&mesh.cells, &mut f);
    (energy, f)
}

pub fn gradient_error(fold: f64, place: [f64; 2], height: f64) -> f64 {
    gradient_error_of(scene(fold, place, height))
}

/// By how much forces differ from the gradient of the energy, over the force on the slave.
pub fn gradient_error_of(scene: (QuadMesh, Vec<Vec3>)) -> f64 {
    let [slave, master] = gradient_errors(scene);
    slave.max(master)
}

/// The same of the slave, and of the master's nodes.
pub fn gradient_errors((mesh, x): (QuadMesh, Vec<Vec3>)) -> [f64; 2] {
    let place = x[x.len() - 1];
    let (energy, f) = evaluate(&mesh, &x, 0);
    assert!(energy > 0.0, "not in touch at {place:?}");
    let size = norm(*f.last().unwrap());
    let h = 1e-8;
    let mut worst = [0.0f64; 2];
    for n in 0..x.len() {
        for c in 0..3 {
            let at = |d: f64| {
                let mut y = x.clone();
                y[n][c] += d;
                evaluate(&mesh, &y, 0).0
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let of = usize::from(n + 1 < x.len());
            worst[of] = worst[of].max((f[n][c] + slope).abs() / size);
        }
    }
    worst
}
