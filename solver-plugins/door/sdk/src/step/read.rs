//! What a step reads: its inputs, their attributes, arrays, meshes and frames.

use super::{BodyInfo, Host, Input, Meshes, On};
use crate::error::StepError;
use plyflow_abi::*;
use serde::de::DeserializeOwned;

impl Host {
    /// All inputs in the order of the workflow.
    ///
    /// # Errors
    /// When the host's list cannot be read.
    pub fn inputs(&self) -> Result<Vec<Input>, StepError> {
        self.json(call!(self.inputs()), "inputs")
    }

    /// The inputs wired to one port.
    ///
    /// # Errors
    /// As [`Host::inputs`].
    pub fn inputs_of(&self, port: &str) -> Result<Vec<Input>, StepError> {
        Ok(self
            .inputs()?
            .into_iter()
            .filter(|i| i.port == port)
            .collect())
    }

    /// The single input of a port.
    ///
    /// # Errors
    /// When there is none or more than one.
    pub fn input(&self, port: &str) -> Result<Input, StepError> {
        let mut found = self.inputs_of(port)?;
        match found.len() {
            1 => Ok(found.remove(0)),
            n => Err(StepError::Failed(format!(
                "port '{port}' needs one input, has {n}"
            ))),
        }
    }

    /// This step's own fan-out index path; empty if it is not fanned out.
    ///
    /// # Errors
    /// When the host's text cannot be read.
    pub fn item(&self) -> Result<Vec<u64>, StepError> {
        self.json(call!(self.item()), "item")
    }

    /// The attributes that the input's plugin wrote.
    ///
    /// # Errors
    /// When they do not fit the type.
    pub fn attributes<T: DeserializeOwned>(&self, input: &Input) -> Result<T, StepError> {
        let what = format!("attributes of '{}'", input.step);
        self.json(call!(self.attributes(input.handle)), &what)
    }

    /// Type and shape of an array, or `None` if the artifact has none of that path.
    pub fn array_info(&self, input: &Input, path: &str) -> Option<pf_array_info> {
        let mut info = pf_array_info::default();
        let code = call!(self.array_info(input.handle, pf_str::new(path), &raw mut info));
        (code == PF_OK).then_some(info)
    }

    fn read_array<T: Copy + Default>(
        &self,
        input: &Input,
        path: &str,
        dtype: u32,
    ) -> Result<(Vec<T>, Vec<usize>), StepError> {
        let missing = || StepError::Failed(format!("'{}' has no array '{path}'", input.step));
        let info = self.array_info(input, path).ok_or_else(missing)?;
        let shape: Vec<usize> = info.shape[..info.rank as usize]
            .iter()
            .map(|n| *n as usize)
            .collect();
        let mut data = vec![T::default(); shape.iter().product()];
        let bytes = size_of_val(data.as_slice()) as u64;
        let buffer = data.as_mut_ptr().cast();
        self.check(
            call!(self.array_read(input.handle, pf_str::new(path), dtype, buffer, bytes)),
            || format!("reading '{path}' of '{}'", input.step),
        )?;
        Ok((data, shape))
    }

    /// An array as f64 (converted if stored otherwise) with its shape.
    ///
    /// # Errors
    /// When there is none.
    pub fn array_f64(
        &self,
        input: &Input,
        path: &str,
    ) -> Result<(Vec<f64>, Vec<usize>), StepError> {
        self.read_array(input, path, PF_F64)
    }

    /// An array as u32 with its shape.
    ///
    /// # Errors
    /// When there is none.
    pub fn array_u32(
        &self,
        input: &Input,
        path: &str,
    ) -> Result<(Vec<u32>, Vec<usize>), StepError> {
        self.read_array(input, path, PF_U32)
    }

    /// Bodies, fields and frame times of an input.
    ///
    /// # Errors
    /// When the artifact has no meshes.
    pub fn meshes(&self, input: &Input) -> Result<Meshes, StepError> {
        let what = format!("meshes of '{}'", input.step);
        self.json(call!(self.meshes(input.handle)), &what)
    }

    /// The services that read meshes take no sizes: a description of another artifact's body would make
    /// the host write beyond the buffer.
    fn check_body(&self, input: &Input, body: &BodyInfo) -> Result<(), StepError> {
        let meshes = self.meshes(input)?;
        let own = meshes.body(&body.name)?;
        let sizes = |b: &BodyInfo| (b.points, b.cells, b.nodes_per_cell);
        if sizes(own) == sizes(body) {
            return Ok(());
        }
        Err(StepError::Failed(format!(
            "body '{}' of '{}' has {} points and {} cells; the description given is of another \
             artifact's body with {} and {}",
            body.name, input.step, own.points, own.cells, body.points, body.cells
        )))
    }

    /// Reference points `[n]` (m) and cells `[m * nodes_per_cell]` of a body.
    ///
    /// # Errors
    /// When there is no such body.
    pub fn mesh(
        &self,
        input: &Input,
        body: &BodyInfo,
    ) -> Result<(Vec<[f64; 3]>, Vec<u32>), StepError> {
        self.check_body(input, body)?;
        let mut points = vec![[0.0; 3]; body.points];
        let mut cells = vec![0u32; body.cells * body.nodes_per_cell];
        let (p, c) = (points.as_mut_ptr().cast(), cells.as_mut_ptr());
        self.check(
            call!(self.mesh_read(input.handle, pf_str::new(&body.name), p, c)),
            || format!("body '{}' of '{}'", body.name, input.step),
        )?;
        Ok((points, cells))
    }

    /// Points (m) of a body in a frame.
    ///
    /// # Errors
    /// When there is no such body or frame.
    pub fn frame_points(
        &self,
        input: &Input,
        body: &BodyInfo,
        frame: usize,
    ) -> Result<Vec<[f64; 3]>, StepError> {
        self.check_body(input, body)?;
        let mut points = vec![[0.0; 3]; body.points];
        let p = points.as_mut_ptr().cast();
        let name = pf_str::new(&body.name);
        self.check(
            call!(self.frame_points_read(input.handle, name, frame as u64, p)),
            || format!("frame {frame} of body '{}' of '{}'", body.name, input.step),
        )?;
        Ok(points)
    }

    /// Values `[rows * components]` of a field in a frame.
    ///
    /// # Errors
    /// When there is no such body, frame or field.
    pub fn frame_field(
        &self,
        input: &Input,
        body: &BodyInfo,
        frame: usize,
        name: &str,
    ) -> Result<Vec<f64>, StepError> {
        let Some(field) = body.fields.iter().find(|f| f.name == name) else {
            let names: Vec<&str> = body.fields.iter().map(|f| f.name.as_str()).collect();
            return Err(StepError::Failed(format!(
                "body '{}' of '{}' has no field '{name}'; there are: {}",
                body.name,
                input.step,
                names.join(", ")
            )));
        };
        let (rows, on) = match field.on {
            On::Points => (body.points, PF_ON_POINTS),
            On::Cells => (body.cells, PF_ON_CELLS),
        };
        let mut values = vec![0.0; rows * field.components as usize];
        let (p, n) = (values.as_mut_ptr(), values.len() as u64);
        let (b, f) = (pf_str::new(&body.name), pf_str::new(name));
        self.check(
            call!(self.frame_field_read(input.handle, b, frame as u64, on, f, p, n)),
            || format!("field '{name}' of body '{}' of '{}'", body.name, input.step),
        )?;
        Ok(values)
    }
}
