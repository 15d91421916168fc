//! The safe Rust face of the Plyflow plugin ABI (`plyflow.h`).
//!
//! A step plugin implements [`Step`] and calls [`export_step!`]; an element formulation implements
//! [`Element`] and calls [`export_element!`]; a material implements [`Material`] and calls
//! [`export_material!`]. The macros export the one symbol, stop every panic inside the plugin and
//! turn it into an error code with its text.
//!
//! All quantities are SI. Array layouts are those of `plyflow.h`: batched arrays are structure of
//! arrays with the lane running fastest.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod aligned;
mod component;
mod error;
mod step;

pub use aligned::Aligned;

pub use component::{
    BendingBatch, Constants, Element, ElementBatch, ElementSizes, ElementTape, Material,
    MaterialRef, MaterialSizes, MaterialTape, MembraneBatch, PatchBatch,
    table::{LocalMaterial, element_table, material_table},
};
pub use error::StepError;
pub use plyflow_abi as abi;
pub use step::{BodyInfo, Cost, FieldInfo, Host, Input, Log, Meshes, On, Progress, Step, run_step};

/// Exports a [`Step`] as the plugin of this shared library.
#[macro_export]
macro_rules! export_step {
    ($step:ty) => {
        #[doc = "The plugin's entry point."]
        #[unsafe(no_mangle)]
        pub extern "C" fn plyflow_plugin() -> *const $crate::abi::pf_plugin {
            unsafe extern "C" fn run(services: *const $crate::abi::pf_services) -> i32 {
                // SAFETY: the host gives `run` a table that is valid until it returns (plyflow.h).
                unsafe { $crate::run_step::<$step>(services) }
            }
            static FUNCTIONS: $crate::abi::pf_step_functions = $crate::abi::pf_step_functions {
                size: size_of::<$crate::abi::pf_step_functions>() as u64,
                run,
            };
            static PLUGIN: $crate::abi::pf_plugin = $crate::abi::pf_plugin {
                magic: $crate::abi::PF_MAGIC,
                abi_major: $crate::abi::PF_ABI_MAJOR,
                abi_minor: $crate::abi::PF_ABI_MINOR,
                size: size_of::<$crate::abi::pf_plugin>() as u64,
                kind: $crate::abi::PF_KIND_STEP,
                reserved: 0,
                manifest: $crate::abi::pf_str::new(<$step as $crate::Step>::MANIFEST),
                functions: (&raw const FUNCTIONS).cast(),
            };
            &raw const PLUGIN
        }
    };
}

/// Exports an [`Element`] as the plugin of this shared library.
#[macro_export]
macro_rules! export_element {
    ($element:ty) => {
        #[doc = "The plugin's entry point."]
        #[unsafe(no_mangle)]
        pub extern "C" fn plyflow_plugin() -> *const $crate::abi::pf_plugin {
            static FUNCTIONS: $crate::abi::pf_element_functions =
                $crate::element_table::<$element>();
            static PLUGIN: $crate::abi::pf_plugin = $crate::abi::pf_plugin {
                magic: $crate::abi::PF_MAGIC,
                abi_major: $crate::abi::PF_ABI_MAJOR,
                abi_minor: $crate::abi::PF_ABI_MINOR,
                size: size_of::<$crate::abi::pf_plugin>() as u64,
                kind: $crate::abi::PF_KIND_ELEMENT,
                reserved: 0,
                manifest: $crate::abi::pf_str::new(<$element as $crate::Element>::MANIFEST),
                functions: (&raw const FUNCTIONS).cast(),
            };
            &raw const PLUGIN
        }
    };
}

/// Exports a [`Material`] as the plugin of this shared library.
#[macro_export]
macro_rules! export_material {
    ($material:ty) => {
        #[doc = "The plugin's entry point."]
        #[unsafe(no_mangle)]
        pub extern "C" fn plyflow_plugin() -> *const $crate::abi::pf_plugin {
            static FUNCTIONS: $crate::abi::pf_material_functions =
                $crate::material_table::<$material>();
            static PLUGIN: $crate::abi::pf_plugin = $crate::abi::pf_plugin {
                magic: $crate::abi::PF_MAGIC,
                abi_major: $crate::abi::PF_ABI_MAJOR,
                abi_minor: $crate::abi::PF_ABI_MINOR,
                size: size_of::<$crate::abi::pf_plugin>() as u64,
                kind: $crate::abi::PF_KIND_MATERIAL,
                reserved: 0,
                manifest: $crate::abi::pf_str::new(<$material as $crate::Material>::MANIFEST),
                functions: (&raw const FUNCTIONS).cast(),
            };
            &raw const PLUGIN
        }
    };
}
