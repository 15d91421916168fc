//! What presses on sheets from the tool, and whether plies have touched themselves.

use crate::forming::Forming;
use crate::stack::{Body, RigidBody};
use plyflow_geometry::vec3::{Vec3, dot, norm};
use plyflow_mechanics::contact::RigidContact;
use plyflow_model::scene::Scene;

impl Forming {
    /// Pressure (Pa) on the face of each of a body's points that looks to the tool.
    pub fn contact_pressure(&self, body: &Body) -> Vec<f64> {
        let m = &self.model;
        let mut force = vec![0.0; m.x().len()];
        // A part above, such as the die of a press, lies on the other face, and a mirror plane beside the sheet.
        let above: Vec<&RigidBody> = self.rigid.iter().filter(|body| body.above).collect();
        let facing = |c: &&RigidContact| {
            !above.iter().any(|body| body.name.is_of(&c.name)) && !c.name.starts_with("symmetry_")
        };
        for c in m.rigid_contacts().iter().filter(facing) {
            for i in &c.items {
                force[i.node as usize] += f64::from(i.normal_force);
            }
        }
        for c in m.sheet_contacts() {
            for i in c.items.iter().filter(|i| i.active) {
                if c.side > 0.0 {
                    force[i.node as usize] += i.normal_force;
                } else {
                    for (w, n) in i.weights().iter().zip(m.cells()[i.cell as usize]) {
                        force[n as usize] += w * i.normal_force;
                    }
                }
            }
        }
        for i in m.self_contacts().iter().flat_map(|c| &c.items) {
            let slave = &i.slave;
            if !slave.active {
                continue;
            }
            // The slave's face that looks to the tool is pressed from there, and so is the master's, or neither.
            if dot(slave.force, m.normals()[slave.node as usize]) > 0.0 {
                force[slave.node as usize] += slave.normal_force;
            }
            if i.side < 0.0 {
                for (w, n) in slave.weights().iter().zip(m.cells()[slave.cell as usize]) {
                    force[n as usize] += w * slave.normal_force;
                }
            }
        }
        let (nodes, areas) = (body.sheet.nodes(m), m.node_areas(body.sheet.0));
        let pressure = |(n, area): (&u32, &Vec3)| force[*n as usize] / norm(*area).max(1e-12);
        let part: Vec<f64> = nodes.iter().zip(&areas).map(pressure).collect();
        match &body.mirrored {
            Some(b) => b.whole.at_nodes(|n, _| part[n]),
            None => part,
        }
    }

    /// What to say when plies have touched themselves and the scene does not tell how they rub.
    pub fn frictionless_folds(&self, scene: &Scene) -> Option<String> {
        let contacts = self.model.self_contacts().iter().filter(|c| c.touched);
        let touched: Vec<&str> = contacts.map(|c| c.name.as_str()).collect();
        (scene.friction.fabric_fabric.is_none() && !touched.is_empty()).then(|| {
            format!(
                "friction.fabric_fabric: not given, but plies touched themselves ({}) and slid without friction; expected \
                 the coefficient of fabric on fabric",
                touched.join(", ")
            )
        })
    }
}
