//! Writes what a GPU computes as source: each element with each material that it is used with, into one file a function.
//!
//! `cargo run --release -p plyflow-kernels --example device_sources -- FOLDER`; `scripts/check-device` compiles them.

use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::isotropic::Isotropic;
use plyflow_kernels::m4::M4;
use plyflow_kernels::m4f::M4f;
use plyflow_kernels::marlow::Marlow;
use plyflow_kernels::record;
use plyflow_kernels::rf4::{PATCH_NODES, Rf4};
use plyflow_kernels::s4::S4;
use plyflow_sdk::{Element, LocalMaterial, Material};
use plyflow_tape::{PRELUDE, Tape};
use std::path::Path;

const NCF: &str = r#"{"form":"fibre-energy","fibre_modulus":3e9,"thickness":4e-4,"areal_mass":0.44,
    "shear":{"coefficients":[0,112.19,94.73,137.06,-65.56,29.56],"limit":1.0471975511965976},
    "stitch":{"angles":[0.06,0.5,0.75],"forces":[0,880,0]},
    "bending":{"positive":{"linear":1.9457e-4,"asymptote":0.03139,"scale":4.0},
        "negative":{"linear":1.0279e-4,"asymptote":0.03619,"scale":6.5},"positive_face":"up","families":"opposite"}}"#;
const FILM: &str = r#"{"uniaxial":{"amplitude":6.364e6,"growth":0.4451,"decay":7.545},"limit":5.0,"thickness":8e-5,"areal_mass":0.08}"#;
const PLATE: &str =
    r#"{"youngs_modulus":2e9,"poisson_ratio":0.3,"thickness":1e-3,"areal_mass":1.2}"#;

type Problem = Box<dyn std::error::Error>;

/// A material with its tapes.
struct Under<M> {
    material: LocalMaterial<M>,
    membrane: Tape,
    bending: Option<Tape>,
}

impl<M: Material> Under<M> {
    fn new(json: &str) -> Result<Self, Problem> {
        let material = M::create(json)?;
        let membrane = record::membrane(&material, false)?;
        let bends = material.sizes().has_bending;
        Ok(Self {
            bending: bends.then(|| record::bending(&material)).transpose()?,
            material: LocalMaterial::new(material)?,
            membrane,
        })
    }

    fn inlined(&self, tape: &Tape) -> Result<Tape, Problem> {
        Ok(tape.with_calls(|name| match name {
            "membrane" => Some(&self.membrane),
            _ => self.bending.as_ref(),
        })?)
    }

    fn element<E: Element>(&self, parameters: &str) -> Result<Tape, Problem> {
        let seen = self.material.seen();
        let element = E::create(parameters, seen)?;
        self.inlined(&record::forces(&element, seen.sizes())?)
    }

    fn patch(&self, nodes: usize) -> Result<Tape, Problem> {
        let seen = self.material.seen();
        let element = Rf4::create("{}", seen)?;
        self.inlined(&record::patch_forces(&element, seen.sizes(), nodes)?)
    }
}

fn main() -> Result<(), Problem> {
    let folder = std::env::args().nth(1).ok_or("which folder?")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let write = |name: &str, tape: Tape| -> Result<(), Problem> {
        std::fs::write(
            folder.join(format!("{name}.cu")),
            format!("{PRELUDE}{}", tape.source(name)),
        )?;
        let counts: Vec<String> = tape
            .counts()
            .iter()
            .map(|(what, n)| format!("{n} {what}"))
            .collect();
        println!("{name}: {}", counts.join(", "));
        Ok(())
    };
    let (ncf, film, plate) = (
        Under::<Fabric>::new(NCF)?,
        Under::<Marlow>::new(FILM)?,
        Under::<Isotropic>::new(PLATE)?,
    );
    write("m4_ncf", ncf.element::<M4>("{}")?)?;
    write("m4_film", film.element::<M4>("{}")?)?;
    write(
        "m4f_ncf",
        ncf.element::<M4f>(r#"{"fibres_along_sides": true}"#)?,
    )?;
    write("s4_ncf", ncf.element::<S4>("{}")?)?;
    write("s4_plate", plate.element::<S4>(r#"{"twist": "material"}"#)?)?;
    for nodes in [5, 9, PATCH_NODES] {
        write(&format!("rf4_ncf_{nodes}"), ncf.patch(nodes)?)?;
    }
    write("rf4_plate_9", plate.patch(9)?)
}
