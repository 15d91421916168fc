//! The law of what slides on one of several surfaces.

use crate::stack::regions::nodes_of;
use plyflow_mechanics::contact::{
    FrictionLaw, NodeLaws, Partner, RegionalFriction, VaryingFriction, Whose,
};
use plyflow_mechanics::model::Model;
use std::sync::Arc;

/// Coefficient under 1 bar, along the fibres or wherever its factor is 1.
pub fn at_one_bar(law: &FrictionLaw) -> f64 {
    match law {
        // Outside of the regions.
        FrictionLaw::Regional(r) => r.laws.first().map_or(0.0, at_one_bar),
        FrictionLaw::Constant(c) => *c,
        FrictionLaw::Varying(v) => v.pressure.coefficient(1e5),
    }
}

/// A node on a rigid part has no cell of a master, whose fibres it could ask for.
pub fn without_fibres_of_others(law: FrictionLaw) -> FrictionLaw {
    match law {
        FrictionLaw::Regional(r) => {
            let laws = r.laws.iter().cloned().map(without_fibres_of_others);
            FrictionLaw::Regional(Arc::new(RegionalFriction {
                laws: laws.collect(),
                ..(*r).clone()
            }))
        }
        FrictionLaw::Varying(v) if v.angle.as_ref().is_some_and(|a| a.whose == Whose::Master) => {
            FrictionLaw::Varying(Arc::new(VaryingFriction {
                angle: None,
                ..(*v).clone()
            }))
        }
        law => law,
    }
}

/// Of the laws of surfaces that could slide under a node of `sheet`, that with the least coefficient under 1 bar, node by node.
pub fn least(model: &Model, sheet: &str, laws: &[FrictionLaw]) -> FrictionLaw {
    let single = |law: &FrictionLaw, node: Option<u32>| -> Vec<FrictionLaw> {
        match law {
            FrictionLaw::Regional(r) => {
                let numbers = node.map_or([0; 2], |n| r.at_node(n));
                let inside: Vec<u16> = numbers.into_iter().filter(|k| *k > 0).collect();
                let numbers = if inside.is_empty() { vec![0] } else { inside };
                numbers
                    .iter()
                    .map(|k| r.laws[usize::from(*k)].clone())
                    .collect()
            }
            law => vec![law.clone()],
        }
    };
    let pick = |node: Option<u32>| {
        let all = laws.iter().flat_map(|l| single(l, node));
        all.reduce(|a, b| {
            if at_one_bar(&b) < at_one_bar(&a) {
                b
            } else {
                a
            }
        })
    };
    let same = |a: &FrictionLaw, b: &FrictionLaw| match (a, b) {
        (FrictionLaw::Constant(a), FrictionLaw::Constant(b)) => a.to_bits() == b.to_bits(),
        (FrictionLaw::Varying(a), FrictionLaw::Varying(b)) => Arc::ptr_eq(a, b),
        _ => false,
    };
    let mut list: Vec<FrictionLaw> = pick(None).into_iter().collect();
    let nodes = nodes_of(model, sheet);
    let mut numbers = std::collections::BTreeMap::new();
    for n in nodes {
        let Some(law) = pick(Some(*n)) else { continue };
        let known = list.iter().position(|l| same(l, &law));
        let k = known.unwrap_or_else(|| {
            list.push(law);
            list.len() - 1
        });
        numbers.insert(*n, k as u16);
    }
    FrictionLaw::Regional(Arc::new(RegionalFriction {
        laws: list,
        slave: NodeLaws::new(nodes, |n| numbers.get(&n).copied().unwrap_or(0)),
        partner: Partner::Bare,
    }))
}
