//! What a step writes: attributes, arrays, meshes, frames, results and collections.

use super::{Host, On};
use crate::error::StepError;
use plyflow_abi::*;

/// As JSON. By way of a value, whose keys are sorted: the text hangs on what is told, not on the order of a type's fields.
fn json_text(value: &impl serde::Serialize) -> Result<String, StepError> {
    let value = serde_json::to_value(value).map_err(|e| StepError::Failed(e.to_string()))?;
    Ok(value.to_string())
}

impl Host {
    /// Writes the artifact's attributes (once; a JSON object).
    ///
    /// # Errors
    /// When the host refuses.
    pub fn write_attributes(&self, value: &impl serde::Serialize) -> Result<(), StepError> {
        let text = json_text(value)?;
        self.check(call!(self.attributes_write(pf_str::new(&text))), || {
            "writing attributes".into()
        })
    }

    fn write_array<T>(
        &self,
        path: &str,
        dtype: u32,
        shape: &[usize],
        unit: &str,
        data: &[T],
    ) -> Result<(), StepError> {
        let what = || format!("writing array '{path}'");
        if shape.len() > PF_MAX_RANK || shape.iter().product::<usize>() != data.len() {
            return Err(StepError::Failed(format!(
                "{}: shape {shape:?} does not hold {} values",
                what(),
                data.len()
            )));
        }
        let mut info = pf_array_info {
            dtype,
            rank: shape.len() as u32,
            ..Default::default()
        };
        for (to, from) in info.shape.iter_mut().zip(shape) {
            *to = *from as u64;
        }
        let (p, u) = (pf_str::new(path), pf_str::new(unit));
        self.check(
            call!(self.array_write(p, &raw const info, u, data.as_ptr().cast())),
            what,
        )
    }

    /// Writes an f64 array (row-major) at `path`, e.g. `history/kinetic_energy`.
    ///
    /// # Errors
    /// When the shape does not fit, a value is not finite, or the path exists.
    pub fn write_f64(
        &self,
        path: &str,
        shape: &[usize],
        unit: &str,
        data: &[f64],
    ) -> Result<(), StepError> {
        self.write_array(path, PF_F64, shape, unit, data)
    }

    /// Writes a u32 array (row-major) at `path`.
    ///
    /// # Errors
    /// As [`Host::write_f64`].
    pub fn write_u32(&self, path: &str, shape: &[usize], data: &[u32]) -> Result<(), StepError> {
        self.write_array(path, PF_U32, shape, "1", data)
    }

    /// Defines a body: reference `points` (m) and `cells` with `k` = 3 or 4 nodes each.
    ///
    /// # Errors
    /// When the host refuses (name taken, index out of range, after the first frame).
    pub fn define_mesh(
        &self,
        body: &str,
        points: &[[f64; 3]],
        k: usize,
        cells: &[u32],
        attributes: &impl serde::Serialize,
    ) -> Result<(), StepError> {
        if !matches!(k, 3 | 4) || !cells.len().is_multiple_of(k) {
            return Err(StepError::Failed(format!(
                "body '{body}': {} node numbers do not make cells of {k} nodes; a cell has 3 or 4",
                cells.len()
            )));
        }
        let json = json_text(attributes)?;
        let (n, m) = (points.len() as u64, (cells.len() / k) as u64);
        let (p, c) = (points.as_ptr().cast(), cells.as_ptr());
        let (b, j) = (pf_str::new(body), pf_str::new(&json));
        self.check(call!(self.mesh_define(b, n, p, m, k as u32, c, j)), || {
            format!("body '{body}'")
        })
    }

    /// Starts a frame at `time` (s).
    ///
    /// # Errors
    /// When a frame is open or the time does not grow.
    pub fn begin_frame(&self, time: f64) -> Result<(), StepError> {
        self.check(call!(self.frame_begin(time)), || {
            format!("frame at {time} s")
        })
    }

    /// Points (m) of a body in the open frame.
    ///
    /// # Errors
    /// When the size differs from the body's or a value is not finite.
    pub fn write_points(&self, body: &str, points: &[[f64; 3]]) -> Result<(), StepError> {
        let (b, p, n) = (
            pf_str::new(body),
            points.as_ptr().cast(),
            points.len() as u64,
        );
        self.check(call!(self.frame_points(b, p, n)), || {
            format!("points of body '{body}'")
        })
    }

    /// A field `[rows * components]` of a body in the open frame.
    ///
    /// # Errors
    /// As [`Host::write_points`].
    pub fn write_field(
        &self,
        body: &str,
        on: On,
        name: &str,
        components: u32,
        unit: &str,
        values: &[f64],
    ) -> Result<(), StepError> {
        let on = if on == On::Points {
            PF_ON_POINTS
        } else {
            PF_ON_CELLS
        };
        let (b, f, u) = (pf_str::new(body), pf_str::new(name), pf_str::new(unit));
        let (p, n) = (values.as_ptr(), values.len() as u64);
        self.check(
            call!(self.frame_field(b, on, f, components, u, p, n)),
            || format!("field '{name}' of body '{body}'"),
        )
    }

    /// Ends the open frame.
    ///
    /// # Errors
    /// When a body lacks a field that it had in the first frame.
    pub fn end_frame(&self) -> Result<(), StepError> {
        self.check(call!(self.frame_end()), || "ending a frame".into())
    }

    /// A named number for `plyflow results`.
    ///
    /// # Errors
    /// When the value is not finite or the name is taken.
    pub fn result(&self, name: &str, value: f64, unit: &str) -> Result<(), StepError> {
        let (n, u) = (pf_str::new(name), pf_str::new(unit));
        self.check(call!(self.result(n, value, u, 0)), || {
            format!("result '{name}' = {value}")
        })
    }

    /// A named number that depends on the machine (seconds, bytes); kept beside the artifact.
    ///
    /// # Errors
    /// As [`Host::result`].
    pub fn measured(&self, name: &str, value: f64, unit: &str) -> Result<(), StepError> {
        let (n, u) = (pf_str::new(name), pf_str::new(unit));
        self.check(call!(self.result(n, value, u, PF_RESULT_MEASURED)), || {
            format!("result '{name}' = {value}")
        })
    }

    /// Declares the output a collection of the named items, for later fan-out.
    ///
    /// # Errors
    /// When the plugin's manifest does not declare a collection.
    pub fn collection(&self, names: &[String]) -> Result<(), StepError> {
        let json = serde_json::to_string(names).map_err(|e| StepError::Failed(e.to_string()))?;
        self.check(
            call!(self.collection(names.len() as u64, pf_str::new(&json))),
            || "declaring the collection".into(),
        )
    }
}
