//! A law as the SDK's trait has it: the row of parameters, and calls of the compiled code.

use crate::code::Code;
use crate::parameters;
use crate::payload::Payload;
use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MembraneBatch};
use std::ffi::c_void;
use std::sync::OnceLock;

/// The most history values of a point. The code gets a copy of a point's history to try strains with, which lies on the stack.
const MOST_HISTORY: usize = 256;

/// What a function of the law is to compiled code, by numba's calling convention: the first two are places for what it returns and for an
/// exception, of which there is none; the answer is 0.
///
/// Then: the row of parameters and its length, lanes, dt, metric, curvature (NULL for membranes), history, stress or moment, energy,
/// stiffness or tangent with 1 where it is wanted (else NULL and 0), and room for one history.
type Batch = unsafe extern "C" fn(
    *mut i64,
    *mut *mut c_void,
    *const f64,
    i64,
    i64,
    f64,
    *const f64,
    *const f64,
    *mut f64,
    *mut f64,
    *mut f64,
    *mut f64,
    i64,
    *mut f64,
) -> i32;

/// What the payload holds, made ready.
pub struct Loaded {
    /// JSON, see `schemas/manifest.md`.
    pub manifest: String,
    payload: Payload,
    membrane: Function,
    bending: Option<Function>,
}

struct Function {
    batch: Batch,
    // The code, which must outlive the pointer to it.
    _code: Code,
}

/// The law of this library; the text says what is wrong with it.
pub fn loaded() -> Result<&'static Loaded, &'static str> {
    static LOADED: OnceLock<Result<Loaded, String>> = OnceLock::new();
    let inside = loaded as fn() -> Result<&'static Loaded, &'static str> as usize;
    let loaded = LOADED.get_or_init(|| Loaded::of(Payload::of_library(inside)?));
    loaded.as_ref().map_err(String::as_str)
}

/// The levels that this processor has, the best first.
fn levels() -> &'static [&'static str] {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("f16c")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("movbe")
    {
        return &["x86-64-v3", "x86-64"];
    }
    &["x86-64"]
}

impl Loaded {
    fn of(payload: Payload) -> Result<Self, String> {
        let most = payload.header.membrane_history;
        let most = most.max(payload.header.bending_history);
        if most > MOST_HISTORY {
            return Err(format!(
                "{most} history values; at most {MOST_HISTORY} are possible"
            ));
        }
        Ok(Self {
            manifest: payload.header.manifest.clone(),
            membrane: Function::of(&payload, "membrane")?
                .ok_or("there is no code of `membrane` for this processor")?,
            bending: Function::of(&payload, "bending")?,
            payload,
        })
    }
}

impl Function {
    fn of(payload: &Payload, name: &str) -> Result<Option<Self>, String> {
        let pieces = &payload.header.code;
        let best = levels().iter().find_map(|level| {
            pieces
                .iter()
                .find(|p| p.function == name && p.level == *level)
        });
        let Some(piece) = best else {
            // All or none: whether a sheet bends must not hang on the processor.
            return match pieces.iter().any(|p| p.function == name) {
                true => Err(format!("there is no code of `{name}` for this processor")),
                false => Ok(None),
            };
        };
        let code = Code::load(payload.code(piece)?, &format!("plyflow_{name}"))?;
        // SAFETY: `plyflow.laws` compiles both functions with this signature, which is part of the payload's layout. The host has consent
        // to run the library's code, of which the payload is a part.
        let batch = unsafe { std::mem::transmute::<*const u8, Batch>(code.entry()) };
        Ok(Some(Self { batch, _code: code }))
    }

    /// # Safety
    /// The pointers are those of a batch of `plyflow.h` with so many lanes, for the law's sizes.
    unsafe fn call(&self, row: &[f64], lanes: usize, dt: f64, batch: &Pointers) -> i32 {
        let mut scratch = [0.0; MOST_HISTORY];
        let (mut answer, mut exception) = (0i64, std::ptr::null_mut());
        // SAFETY: the caller's promise for the batch; the row is as long as is said, and the scratch has room for any history.
        unsafe {
            (self.batch)(
                &raw mut answer,
                &raw mut exception,
                row.as_ptr(),
                row.len() as i64,
                lanes as i64,
                dt,
                batch.metric,
                batch.curvature,
                batch.history,
                batch.stress,
                batch.energy,
                batch.tangent.unwrap_or(std::ptr::null_mut()),
                i64::from(batch.tangent.is_some()),
                scratch.as_mut_ptr(),
            )
        }
    }
}

struct Pointers {
    metric: *const f64,
    curvature: *const f64,
    history: *mut f64,
    stress: *mut f64,
    energy: *mut f64,
    tangent: Option<*mut f64>,
}

/// One sheet of the law.
pub struct Law {
    law: &'static Loaded,
    row: Vec<f64>,
    thickness: f64,
    areal_mass: f64,
}

impl Material for Law {
    // The manifest is that of the payload.
    const MANIFEST: &'static str = "";

    fn create(parameters: &str) -> Result<Self, String> {
        let law = loaded()?;
        let given: serde_json::Value =
            serde_json::from_str(parameters).map_err(|e| format!("parameters: {e}"))?;
        let of_sheet = |name: &str, unit: &str| match given[name].as_f64() {
            Some(value) if value > 0.0 => Ok(value),
            _ => Err(format!(
                "{name}: given {} {unit}; expected a number above 0",
                given[name]
            )),
        };
        Ok(Self {
            law,
            row: parameters::row(&law.payload.header.values, &given)?,
            thickness: of_sheet("thickness", "m")?,
            areal_mass: of_sheet("areal_mass", "kg/m2")?,
        })
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            membrane_history: self.law.payload.header.membrane_history,
            bending_history: self.law.payload.header.bending_history,
            has_bending: self.law.bending.is_some(),
            thickness: self.thickness,
            areal_mass: self.areal_mass,
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        let pointers = Pointers {
            metric: b.metric.as_ptr(),
            curvature: std::ptr::null(),
            history: b.history.as_mut_ptr(),
            stress: b.stress.as_mut_ptr(),
            energy: b.energy.as_mut_ptr(),
            tangent: b.stiffness.as_deref_mut().map(<[f64]>::as_mut_ptr),
        };
        // SAFETY: slices of a batch as the SDK gives it, with the lengths of plyflow.h for these lanes and the sizes above.
        let status = unsafe { (self.law.membrane).call(&self.row, b.lanes, b.dt, &pointers) };
        if status != 0 {
            b.energy.fill(f64::NAN);
        }
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        let Some(bending) = &self.law.bending else {
            return;
        };
        let pointers = Pointers {
            metric: b.metric.as_ptr(),
            curvature: b.curvature.as_ptr(),
            history: b.history.as_mut_ptr(),
            stress: b.moment.as_mut_ptr(),
            energy: b.energy.as_mut_ptr(),
            tangent: b.tangent.as_deref_mut().map(<[f64]>::as_mut_ptr),
        };
        // SAFETY: as in `membrane`.
        let status = unsafe { bending.call(&self.row, b.lanes, b.dt, &pointers) };
        if status != 0 {
            b.energy.fill(f64::NAN);
        }
    }
}
