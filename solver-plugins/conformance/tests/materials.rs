//! A sound material has no findings; each fault is found by the check that is meant for it.

use plyflow_conformance::check_material;
use plyflow_sdk::{Material, MaterialSizes, MembraneBatch, material_table};

/// W = k/8 ((C11 - 1)^2 + (C22 - 1)^2) + g C12^2 / 2, with a fault on demand.
struct Law(Fault);

#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    WrongDerivative,
    NeighbourLane,
    NotFinite,
    Prestress,
}

impl Material for Law {
    const MANIFEST: &'static str = "{}";

    fn create(parameters: &str) -> Result<Self, String> {
        Ok(Self(match parameters {
            "none" => Fault::None,
            "derivative" => Fault::WrongDerivative,
            "neighbour" => Fault::NeighbourLane,
            "nan" => Fault::NotFinite,
            "prestress" => Fault::Prestress,
            other => return Err(format!("no fault '{other}'")),
        }))
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            thickness: 1e-3,
            areal_mass: 0.4,
            ..MaterialSizes::default()
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        let (k, g, n) = (1e5, 1e3, b.lanes);
        for i in 0..n {
            let (x, y, z) = (
                b.metric[i] - 1.0,
                b.metric[n + i] - 1.0,
                b.metric[2 * n + i],
            );
            let factor = if self.0 == Fault::WrongDerivative {
                1.01
            } else {
                1.0
            };
            b.stress[i] = k / 2.0 * x * factor;
            b.stress[n + i] = k / 2.0 * y;
            b.stress[2 * n + i] = g * z;
            b.energy[i] = k / 8.0 * (x * x + y * y) + g * z * z / 2.0;
            match self.0 {
                Fault::NeighbourLane => b.stress[i] += 1e-9 * b.metric[(i + 1) % n],
                Fault::NotFinite => b.energy[i] = f64::NAN,
                Fault::Prestress => b.stress[i] += 1.0,
                Fault::None | Fault::WrongDerivative => {}
            }
        }
    }
}

fn findings(parameters: &str) -> Vec<&'static str> {
    let table = material_table::<Law>();
    let found = unsafe { check_material(&raw const table, parameters) };
    found.into_iter().map(|f| f.check).collect()
}

#[test]
fn nothing_is_found_in_a_sound_material() {
    assert_eq!(findings("none"), Vec::<&str>::new());
}

#[test]
fn each_fault_is_found_by_its_check() {
    assert!(findings("derivative").contains(&"derivative"));
    assert!(findings("neighbour").contains(&"batch-independence"));
    assert_eq!(findings("nan"), ["finite"]);
    assert!(findings("prestress").contains(&"rest"));
    assert_eq!(findings("unknown"), ["create"]);
}
