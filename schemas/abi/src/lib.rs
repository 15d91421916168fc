//! The Rust twin of `plyflow.h` (ABI 1.2): same structs, same order, no dependencies.
//!
//! The header is the reference text; what a field means, its shape, unit and index order are
//! written there. A test compiles the header with the machine's C compiler and compares every
//! size and offset with this file.
#![allow(non_camel_case_types, missing_docs)]
// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use core::ffi::{c_char, c_void};

pub const PF_ABI_MAJOR: u32 = 1;
pub const PF_ABI_MINOR: u32 = 2;
/// The bytes `PLYFLOW1` in memory on a little-endian machine.
pub const PF_MAGIC: u64 = 0x3157_4F4C_4659_4C50;
pub const PF_SYMBOL: &[u8] = b"plyflow_plugin\0";

pub const PF_KIND_STEP: u32 = 1;
pub const PF_KIND_ELEMENT: u32 = 2;
pub const PF_KIND_MATERIAL: u32 = 3;

pub const PF_OK: i32 = 0;
pub const PF_ERROR: i32 = 1;
pub const PF_CANCELLED: i32 = 2;
pub const PF_PANIC: i32 = 3;
pub const PF_NOT_FOUND: i32 = 4;
pub const PF_BAD_SHAPE: i32 = 5;
pub const PF_BAD_VALUE: i32 = 6;

pub const PF_F64: u32 = 1;
pub const PF_F32: u32 = 2;
pub const PF_I64: u32 = 3;
pub const PF_U32: u32 = 4;
pub const PF_U8: u32 = 5;
pub const PF_MAX_RANK: usize = 4;

pub const PF_ON_POINTS: u32 = 0;
pub const PF_ON_CELLS: u32 = 1;

pub const PF_LOG_ERROR: u32 = 1;
pub const PF_LOG_WARN: u32 = 2;
pub const PF_LOG_INFO: u32 = 3;
pub const PF_LOG_DEBUG: u32 = 4;

pub const PF_RESULT_MEASURED: u32 = 1;

pub const PF_ERROR_TEXT: usize = 512;

pub const PF_ENERGY_MEMBRANE: usize = 0;
pub const PF_ENERGY_BENDING: usize = 1;
pub const PF_ENERGY_HOURGLASS: usize = 2;
pub const PF_ENERGIES: usize = 3;

/// UTF-8 text by pointer and length; owned by whoever handed it over.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pf_str {
    pub data: *const c_char,
    pub len: u64,
}

// SAFETY: a pointer and a length. Safe code cannot follow the pointer: `as_str` is unsafe, and who calls it sees to it that the text is there.
unsafe impl Sync for pf_str {}
// SAFETY: as for `Sync`.
unsafe impl Send for pf_str {}

impl pf_str {
    /// A view of `text`, valid as long as `text` lives.
    pub const fn new(text: &str) -> Self {
        Self {
            data: text.as_ptr().cast(),
            len: text.len() as u64,
        }
    }

    /// The text behind the view.
    ///
    /// # Errors
    /// When the bytes are not UTF-8.
    ///
    /// # Safety
    /// `data` must point to `len` readable bytes that live for `'a`, or be null with `len` 0.
    pub unsafe fn as_str<'a>(&self) -> Result<&'a str, core::str::Utf8Error> {
        if self.data.is_null() || self.len == 0 {
            return Ok("");
        }
        // SAFETY: not null, so there are `len` readable bytes for `'a` (the caller's promise).
        let bytes =
            unsafe { core::slice::from_raw_parts(self.data.cast::<u8>(), self.len as usize) };
        core::str::from_utf8(bytes)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pf_plugin {
    pub magic: u64,
    pub abi_major: u32,
    pub abi_minor: u32,
    pub size: u64,
    pub kind: u32,
    pub reserved: u32,
    pub manifest: pf_str,
    pub functions: *const c_void,
}
// SAFETY: plain values and pointers that safe code cannot follow. What they point to is static and read-only (plyflow.h), so that whoever
// follows them may do so in any thread.
unsafe impl Sync for pf_plugin {}
// SAFETY: as for `Sync`.
unsafe impl Send for pf_plugin {}

pub type pf_entry = unsafe extern "C" fn() -> *const pf_plugin;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct pf_array_info {
    pub dtype: u32,
    pub rank: u32,
    pub shape: [u64; PF_MAX_RANK],
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pf_progress {
    pub size: u64,
    pub fraction: f64,
    pub simulated_time: f64,
    pub rate: f64,
    pub energy_ratio: f64,
    pub phase: pf_str,
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pf_component {
    pub kind: u32,
    pub reserved: u32,
    pub functions: *const c_void,
    pub manifest: pf_str,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_services {
    pub size: u64,
    pub host: *mut c_void,
    pub log: unsafe extern "C" fn(*mut c_void, u32, pf_str),
    pub progress: unsafe extern "C" fn(*mut c_void, *const pf_progress),
    pub cancelled: unsafe extern "C" fn(*mut c_void) -> i32,
    pub fail: unsafe extern "C" fn(*mut c_void, pf_str),
    pub threads: unsafe extern "C" fn(*mut c_void) -> u32,
    pub parameters: unsafe extern "C" fn(*mut c_void) -> pf_str,
    pub scratch: unsafe extern "C" fn(*mut c_void) -> pf_str,
    pub inputs: unsafe extern "C" fn(*mut c_void) -> pf_str,
    pub item: unsafe extern "C" fn(*mut c_void) -> pf_str,
    pub attributes: unsafe extern "C" fn(*mut c_void, u32) -> pf_str,
    pub array_info: unsafe extern "C" fn(*mut c_void, u32, pf_str, *mut pf_array_info) -> i32,
    pub array_read: unsafe extern "C" fn(*mut c_void, u32, pf_str, u32, *mut c_void, u64) -> i32,
    pub meshes: unsafe extern "C" fn(*mut c_void, u32) -> pf_str,
    pub mesh_read: unsafe extern "C" fn(*mut c_void, u32, pf_str, *mut f64, *mut u32) -> i32,
    pub frame_points_read: unsafe extern "C" fn(*mut c_void, u32, pf_str, u64, *mut f64) -> i32,
    pub frame_field_read:
        unsafe extern "C" fn(*mut c_void, u32, pf_str, u64, u32, pf_str, *mut f64, u64) -> i32,
    pub attributes_write: unsafe extern "C" fn(*mut c_void, pf_str) -> i32,
    pub array_write: unsafe extern "C" fn(
        *mut c_void,
        pf_str,
        *const pf_array_info,
        pf_str,
        *const c_void,
    ) -> i32,
    pub mesh_define: unsafe extern "C" fn(
        *mut c_void,
        pf_str,
        u64,
        *const f64,
        u64,
        u32,
        *const u32,
        pf_str,
    ) -> i32,
    pub frame_begin: unsafe extern "C" fn(*mut c_void, f64) -> i32,
    pub frame_points: unsafe extern "C" fn(*mut c_void, pf_str, *const f64, u64) -> i32,
    pub frame_field:
        unsafe extern "C" fn(*mut c_void, pf_str, u32, pf_str, u32, pf_str, *const f64, u64) -> i32,
    pub frame_end: unsafe extern "C" fn(*mut c_void) -> i32,
    pub result: unsafe extern "C" fn(*mut c_void, pf_str, f64, pf_str, u32) -> i32,
    pub collection: unsafe extern "C" fn(*mut c_void, u64, pf_str) -> i32,
    pub find_component: unsafe extern "C" fn(*mut c_void, u32, pf_str, *mut pf_component) -> i32,
    pub checkpoint: unsafe extern "C" fn(*mut c_void) -> pf_str,
    pub checkpoint_due: unsafe extern "C" fn(*mut c_void) -> i32,
    pub checkpoint_saved: unsafe extern "C" fn(*mut c_void),
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_step_functions {
    pub size: u64,
    pub run: unsafe extern "C" fn(*const pf_services) -> i32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_error {
    pub text: [c_char; PF_ERROR_TEXT],
}

impl Default for pf_error {
    fn default() -> Self {
        Self {
            text: [0; PF_ERROR_TEXT],
        }
    }
}

impl pf_error {
    /// Writes `text`, cut at a character boundary to fit with its terminating NUL.
    pub fn set(&mut self, text: &str) {
        let mut end = text.len().min(PF_ERROR_TEXT - 1);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        for (slot, byte) in self
            .text
            .iter_mut()
            .zip(text.as_bytes()[..end].iter().chain([&0u8]))
        {
            *slot = *byte as c_char;
        }
    }

    /// The text up to its NUL.
    pub fn get(&self) -> String {
        let bytes: Vec<u8> = self
            .text
            .iter()
            .take_while(|c| **c != 0)
            .map(|c| *c as u8)
            .collect();
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pf_material_sizes {
    pub size: u64,
    pub membrane_history: u32,
    pub bending_history: u32,
    pub has_bending: u32,
    pub reserved: u32,
    pub thickness: f64,
    pub areal_mass: f64,
}

/// As a caller hands it over: `size` is set, and all else is 0.
impl Default for pf_material_sizes {
    fn default() -> Self {
        Self {
            size: size_of::<Self>() as u64,
            membrane_history: 0,
            bending_history: 0,
            has_bending: 0,
            reserved: 0,
            thickness: 0.0,
            areal_mass: 0.0,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_membrane_batch {
    pub size: u64,
    pub lanes: u32,
    pub reserved: u32,
    pub dt: f64,
    pub metric: *const f64,
    pub history: *mut f64,
    pub stress: *mut f64,
    pub energy: *mut f64,
    pub stiffness: *mut f64,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_bending_batch {
    pub size: u64,
    pub lanes: u32,
    pub reserved: u32,
    pub dt: f64,
    pub metric: *const f64,
    pub curvature: *const f64,
    pub history: *mut f64,
    pub moment: *mut f64,
    pub energy: *mut f64,
    pub tangent: *mut f64,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_material_functions {
    pub size: u64,
    pub create: unsafe extern "C" fn(pf_str, *mut *mut c_void, *mut pf_error) -> i32,
    pub destroy: unsafe extern "C" fn(*mut c_void),
    pub sizes: unsafe extern "C" fn(*const c_void, *mut pf_material_sizes) -> i32,
    pub membrane: unsafe extern "C" fn(*const c_void, *const pf_membrane_batch) -> i32,
    pub bending: Option<unsafe extern "C" fn(*const c_void, *const pf_bending_batch) -> i32>,
    pub tape: Option<pf_material_tape>,
}

pub type pf_material_tape =
    unsafe extern "C" fn(*const c_void, u32, *const pf_writer, *mut pf_error) -> i32;

impl pf_material_functions {
    /// Its bytes in ABI 1.0 and 1.1.
    pub const LEAST: usize = core::mem::offset_of!(pf_material_functions, tape);
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_writer {
    pub host: *mut c_void,
    pub write: unsafe extern "C" fn(*mut c_void, pf_str),
}

pub const PF_TAPE_MEMBRANE: u32 = 1;
pub const PF_TAPE_BENDING: u32 = 2;
pub const PF_TAPE_FORCES: u32 = 3;
pub const PF_TAPE_PATCH_FORCES: u32 = 4;

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_material {
    pub functions: *const pf_material_functions,
    pub instance: *const c_void,
}
// SAFETY: two pointers that safe code cannot follow. The functions are static, and an instance does not change after `create` and is called by
// several threads at once (plyflow.h), so that whoever follows them may do so in any thread.
unsafe impl Sync for pf_material {}
// SAFETY: as for `Sync`.
unsafe impl Send for pf_material {}

#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct pf_element_sizes {
    pub size: u64,
    pub nodes: u32,
    pub dofs_per_node: u32,
    pub constants: u32,
    pub history: u32,
    pub material_points: u32,
    pub fields: u32,
    pub patch_nodes: u32,
    pub patch_constants: u32,
    pub patch_history: u32,
    pub patch_fields: u32,
    pub ignores_velocity: u32,
    pub reserved: u32,
}

/// As a caller hands it over: `size` is set, and all else is 0.
impl Default for pf_element_sizes {
    fn default() -> Self {
        Self {
            size: size_of::<Self>() as u64,
            nodes: 0,
            dofs_per_node: 0,
            constants: 0,
            history: 0,
            material_points: 0,
            fields: 0,
            patch_nodes: 0,
            patch_constants: 0,
            patch_history: 0,
            patch_fields: 0,
            ignores_velocity: 0,
            reserved: 0,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_element_batch {
    pub size: u64,
    pub lanes: u32,
    pub reserved: u32,
    pub dt: f64,
    pub position: *const f64,
    pub velocity: *const f64,
    pub spin: *const f64,
    pub axis: *const f64,
    pub constants: *mut f64,
    pub history: *mut f64,
    pub material_history: *mut f64,
    pub force: *mut f64,
    pub moment: *mut f64,
    pub energy: *mut f64,
    pub fields: *mut f64,
    pub mass: *mut f64,
    pub inertia: *mut f64,
    pub critical_step: *mut f64,
    pub material: *const pf_material,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_patch_batch {
    pub size: u64,
    pub lanes: u32,
    pub reserved: u32,
    pub dt: f64,
    pub position: *const f64,
    pub count: *const f64,
    pub area: *const f64,
    pub axis: *const f64,
    pub constants: *mut f64,
    pub history: *mut f64,
    pub force: *mut f64,
    pub energy: *mut f64,
    pub fields: *mut f64,
    pub stiffness: *mut f64,
    pub material: *const pf_material,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct pf_element_functions {
    pub size: u64,
    pub create:
        unsafe extern "C" fn(pf_str, *const pf_material, *mut *mut c_void, *mut pf_error) -> i32,
    pub destroy: unsafe extern "C" fn(*mut c_void),
    pub sizes: unsafe extern "C" fn(*const c_void, *mut pf_element_sizes) -> i32,
    pub initialise: unsafe extern "C" fn(*const c_void, *const pf_element_batch) -> i32,
    pub forces: unsafe extern "C" fn(*const c_void, *const pf_element_batch) -> i32,
    pub patch_initialise: Option<unsafe extern "C" fn(*const c_void, *const pf_patch_batch) -> i32>,
    pub patch_forces: Option<unsafe extern "C" fn(*const c_void, *const pf_patch_batch) -> i32>,
    pub tape: Option<pf_element_tape>,
}

pub type pf_element_tape =
    unsafe extern "C" fn(*const c_void, u32, u32, *const pf_writer, *mut pf_error) -> i32;

impl pf_element_functions {
    /// Its bytes in ABI 1.0 and 1.1.
    pub const LEAST: usize = core::mem::offset_of!(pf_element_functions, tape);
}
