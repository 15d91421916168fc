//! Writing an artifact.

use crate::contents::{ArrayInfo, BodyInfo, Contents, DATA_MODEL, FieldInfo, NamedValue};
use crate::error::{ArtifactError, ErrorKind, Result, bad_order, bad_shape, bad_value};
use crate::h5::{DType, Dataset, File, Location, bytes, bytes_mut};
use crate::mesh::BodyWriter;
use crate::small;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Most dimensions of an array.
pub const MAX_RANK: usize = 4;

/// Writes one artifact.
///
/// Everything of an array or a frame goes to the file at once, so memory does not grow with the number
/// of frames. Nothing depends on the clock, the machine or the path: the same calls make the same bytes.
/// The file has to be made under a temporary name and renamed after [`ArtifactWriter::finish`].
#[derive(Debug)]
pub struct ArtifactWriter {
    path: PathBuf,
    kind: String,
    /// Made when the first mesh or array arrives: many steps have neither.
    file: Option<File>,
    attributes: Option<String>,
    results: Vec<NamedValue>,
    collection: Option<Vec<String>>,
    arrays: Vec<ArrayInfo>,
    groups: BTreeSet<String>,
    bodies: Vec<BodyWriter>,
    times: Option<Dataset>,
    frames: u64,
    last_time: f64,
    frame_open: bool,
}

impl ArtifactWriter {
    /// Starts an artifact of a kind at `path`, replacing a file that is there.
    ///
    /// # Errors
    /// When the kind is not a name.
    pub fn create(path: &Path, kind: &str) -> Result<Self> {
        check_name("artifact kind", kind)?;
        Ok(Self {
            path: path.to_owned(),
            kind: kind.to_owned(),
            file: None,
            attributes: None,
            results: Vec::new(),
            collection: None,
            arrays: Vec::new(),
            groups: BTreeSet::new(),
            bodies: Vec::new(),
            times: None,
            frames: 0,
            last_time: f64::NEG_INFINITY,
            frame_open: false,
        })
    }

    fn file(&mut self) -> Result<&File> {
        if self.file.is_none() {
            self.file = Some(File::create(&self.path)?);
        }
        Ok(self.file.as_ref().expect("made above"))
    }

    /// The plugin's attributes: a JSON object, once.
    ///
    /// # Errors
    /// When the text is not a JSON object or attributes were written before.
    pub fn attributes(&mut self, json: &str) -> Result<()> {
        if self.attributes.is_some() {
            return bad_order("the attributes were written before; write them once, all together");
        }
        json_object("attributes", json)?;
        // Kept as given: what a JSON library makes of it may change with its version.
        self.attributes = Some(json.to_owned());
        Ok(())
    }

    /// A free array at `/data/<path>`. `data` holds the product of `shape` native elements of `dtype`,
    /// row-major; an empty shape is one value.
    ///
    /// # Errors
    /// NaN or infinite values, a path that is taken or not made of names, sizes that do not match.
    pub fn array(
        &mut self,
        path: &str,
        dtype: DType,
        shape: &[u64],
        unit: &str,
        data: &[u8],
    ) -> Result<()> {
        for part in path.split('/') {
            check_name("part of an array path", part)?;
        }
        if self.arrays.iter().any(|a| a.path == path) || self.groups.contains(path) {
            return bad_order(format!("the array '{path}' was written before"));
        }
        if shape.len() > MAX_RANK {
            return bad_shape(format!(
                "the array '{path}' has {} dimensions; at most {MAX_RANK} are allowed",
                shape.len()
            ));
        }
        let size = shape
            .iter()
            .try_fold(dtype.size() as u64, |a, n| a.checked_mul(*n));
        if size != Some(data.len() as u64) {
            return bad_shape(format!(
                "the array '{path}' of shape {shape:?} was given {} bytes",
                data.len()
            ));
        }
        check_array(path, dtype, data)?;
        self.make_groups(path)?;
        let file = self.file()?;
        file.write(&format!("/data/{path}"), dtype, shape, data)?
            .write_text("unit", unit, false)?;
        let (path, unit, shape) = (path.to_owned(), unit.to_owned(), shape.to_vec());
        self.arrays.push(ArrayInfo {
            path,
            dtype,
            shape,
            unit,
        });
        Ok(())
    }

    fn make_groups(&mut self, path: &str) -> Result<()> {
        let mut ends: Vec<usize> = path.match_indices('/').map(|(i, _)| i).collect();
        ends.insert(0, 0);
        for end in ends {
            let group = &path[..end];
            if self.groups.contains(group) {
                continue;
            }
            if self.arrays.iter().any(|a| a.path == group) {
                return bad_order(format!(
                    "'{group}' is an array; '{path}' cannot lie under it"
                ));
            }
            let full = if end == 0 {
                "/data".to_owned()
            } else {
                format!("/data/{group}")
            };
            self.file()?.create_group(&full)?;
            self.groups.insert(group.to_owned());
        }
        Ok(())
    }

    /// Defines a body: reference `points` `[n][3]` (m), `cells` `[m][k]` with `k` 3 or 4, and the
    /// plugin's attributes of it (a JSON object or nothing).
    ///
    /// # Errors
    /// A name that is taken or not a name, a cell that names no point, NaN, or a call after the first
    /// frame began.
    pub fn define_mesh(
        &mut self,
        name: &str,
        points: &[f64],
        k: u32,
        cells: &[u32],
        attributes_json: &str,
    ) -> Result<()> {
        check_name("body name", name)?;
        if matches!(name, "Assembly" | "Steps") {
            return bad_value(format!(
                "a body cannot be named '{name}': VTK uses that name itself"
            ));
        }
        if self.frame_open || self.frames > 0 {
            return bad_order(format!(
                "the body '{name}' is defined after the first frame began; define all bodies first"
            ));
        }
        if self.bodies.iter().any(|b| b.info.name == name) {
            return bad_order(format!("the body '{name}' was defined before"));
        }
        let text = if attributes_json.trim().is_empty() {
            "{}"
        } else {
            attributes_json
        };
        let attributes = json_object("body attributes", text)?;
        check_mesh(name, points, k, cells)?;
        let info = BodyInfo {
            name: name.to_owned(),
            points: points.len() as u64 / 3,
            cells: cells.len() as u64 / u64::from(k),
            nodes_per_cell: k,
            moving: false,
            attributes,
            fields: Vec::new(),
        };
        let index = self.bodies.len();
        if index == 0 {
            let root = self.file()?.create_group("/VTKHDF")?;
            root.write_i64("Version", &[2], &[2, 2])?;
            root.write_text("Type", "MultiBlockDataSet", true)?;
            self.file()?.create_group("/VTKHDF/Assembly")?;
        }
        let body = BodyWriter::define(self.file()?, index, info, points, cells)?;
        self.bodies.push(body);
        Ok(())
    }

    /// Starts a frame at `time` (s); times grow strictly.
    ///
    /// # Errors
    /// Without a body, with a frame open, or when the time does not grow.
    pub fn begin_frame(&mut self, time: f64) -> Result<()> {
        if self.frame_open {
            return bad_order(format!("frame {} is still open; end it first", self.frames));
        }
        if self.bodies.is_empty() {
            return bad_order("a frame needs bodies; define them first");
        }
        if !time.is_finite() {
            return bad_value(format!("frame {}: the time is {time}", self.frames));
        }
        if time <= self.last_time {
            return bad_value(format!(
                "frame {}: the time {time} s is not after that of the frame before, {} s",
                self.frames, self.last_time
            ));
        }
        self.last_time = time;
        self.frame_open = true;
        Ok(())
    }

    fn open_body(&mut self, name: &str) -> Result<(&File, &mut BodyWriter)> {
        if !self.frame_open {
            return bad_order(format!("body '{name}': no frame is open; begin one first"));
        }
        let names = || {
            let names: Vec<&str> = self.bodies.iter().map(|b| b.info.name.as_str()).collect();
            format!(
                "there is no body '{name}'; defined are: {}",
                names.join(", ")
            )
        };
        let Some(i) = self.bodies.iter().position(|b| b.info.name == name) else {
            return Err(ArtifactError::new(ErrorKind::NotFound, names()));
        };
        Ok((
            self.file.as_ref().expect("a body has a file"),
            &mut self.bodies[i],
        ))
    }

    /// Points `[n][3]` (m) of a body in the open frame.
    ///
    /// # Errors
    /// No open frame, unknown body, wrong size, NaN, given twice, or not given in the first frame.
    pub fn frame_points(&mut self, body: &str, points: &[f64]) -> Result<()> {
        let frame = self.frames;
        let (file, body) = self.open_body(body)?;
        body.points(file, frame, points)
    }

    /// Values `[rows][components]` of a field of a body in the open frame. Stored in single precision.
    ///
    /// # Errors
    /// No open frame, unknown body, wrong size, NaN or out of single range, given twice, or not a field
    /// of the first frame.
    pub fn frame_field(&mut self, body: &str, field: FieldInfo, values: &[f64]) -> Result<()> {
        check_name("field name", &field.name)?;
        let frame = self.frames;
        let (file, body) = self.open_body(body)?;
        body.field(file, frame, field, values)
    }

    /// Ends the open frame.
    ///
    /// # Errors
    /// No open frame, or points or a field of the first frame are missing.
    pub fn end_frame(&mut self) -> Result<()> {
        if !self.frame_open {
            return bad_order("no frame is open");
        }
        let file = self.file.as_ref().expect("a body has a file");
        for body in &mut self.bodies {
            body.end_frame(file, self.frames)?;
        }
        if self.times.is_none() {
            file.ensure_group("/plyflow")?;
            self.times = Some(file.growing("/plyflow/times", DType::F64, &[], 64)?);
        }
        self.times
            .as_mut()
            .expect("made above")
            .append(bytes(&[self.last_time]))?;
        self.frames += 1;
        self.frame_open = false;
        Ok(())
    }

    /// A named number that does not depend on the machine.
    ///
    /// # Errors
    /// When the value is not finite or the name is taken.
    pub fn result(&mut self, name: &str, value: f64, unit: &str) -> Result<()> {
        check_result(name, value)?;
        if self.results.iter().any(|r| r.name == name) {
            return bad_order(format!("the result '{name}' was reported before"));
        }
        self.results.push(NamedValue {
            name: name.to_owned(),
            value,
            unit: unit.to_owned(),
        });
        Ok(())
    }

    /// Declares the artifact a collection with one label per item.
    ///
    /// # Errors
    /// When declared before or a label is used twice.
    pub fn collection(&mut self, labels: Vec<String>) -> Result<()> {
        if self.collection.is_some() {
            return bad_order("the collection was declared before");
        }
        let mut seen = BTreeSet::new();
        if let Some(twice) = labels.iter().find(|l| !seen.insert(l.as_str())) {
            return bad_value(format!(
                "two items of the collection have the label '{twice}'"
            ));
        }
        self.collection = Some(labels);
        Ok(())
    }

    /// Labels of the collection, if one was declared.
    #[must_use]
    pub fn labels(&self) -> Option<&[String]> {
        self.collection.as_deref()
    }

    /// Writes what is left, closes the file and returns its size (bytes). `provenance` is stored as it
    /// is and must not depend on the machine or the moment.
    ///
    /// # Errors
    /// When a frame is open, or the file system refuses.
    pub fn finish(mut self, provenance: &Value) -> Result<u64> {
        if self.frame_open {
            return bad_order(format!(
                "frame {} (time {} s) was begun but not ended",
                self.frames, self.last_time
            ));
        }
        let times = self.read_times()?;
        let bodies = std::mem::take(&mut self.bodies);
        let mut contents = Contents {
            bodies: Vec::new(),
            frames: self.frames,
            arrays: std::mem::take(&mut self.arrays),
        };
        if let Some(file) = &self.file {
            if let (Some(first), false) = (bodies.first(), times.is_empty()) {
                link_steps(file, &first.info.name, &times)?;
            }
            for body in bodies {
                contents.bodies.push(body.finish(file, &times)?);
            }
        }
        let attributes = self.description(&contents, provenance)?;
        if self.file.is_none()
            && let Some(bytes) = small::write(&attributes)
        {
            std::fs::write(&self.path, &bytes).map_err(|e| {
                let text = format!("writing the artifact {}: {e}", self.path.display());
                ArtifactError::new(ErrorKind::Io, text)
            })?;
            return Ok(bytes.len() as u64);
        }
        let group = self.file()?.ensure_group("/plyflow")?;
        for (name, value) in attributes {
            match value {
                small::Value::Text(text) => group.write_text(name, &text, false)?,
                small::Value::Integer(i) => group.write_i64(name, &[], &[i])?,
            }
        }
        drop(group);
        self.file.take().expect("made above").close()?;
        let size = std::fs::metadata(&self.path).map_err(|e| {
            ArtifactError::new(ErrorKind::Io, format!("{}: {e}", self.path.display()))
        })?;
        Ok(size.len())
    }

    /// The attributes of `/plyflow`.
    fn description(
        &mut self,
        contents: &Contents,
        provenance: &Value,
    ) -> Result<Vec<(&'static str, small::Value)>> {
        let text = |t: String| small::Value::Text(t);
        let attributes = self.attributes.take().unwrap_or_else(|| "{}".to_owned());
        let mut all = vec![
            ("data_model", small::Value::Integer(DATA_MODEL)),
            ("kind", text(self.kind.clone())),
            ("attributes", text(attributes)),
            ("results", text(json(&self.results)?)),
        ];
        if let Some(labels) = &self.collection {
            all.push(("collection", text(json(labels)?)));
        }
        all.push(("contents", text(json(contents)?)));
        all.push(("provenance", text(provenance.to_string())));
        Ok(all)
    }

    fn read_times(&mut self) -> Result<Vec<f64>> {
        let Some(d) = self.times.take() else {
            return Ok(Vec::new());
        };
        let mut times = vec![0.0; self.frames as usize];
        d.read_all(DType::F64, bytes_mut(&mut times))?;
        Ok(times)
    }
}

/// VTK 9.7 forgets the number of steps of the blocks of a composite file when it reads again, and takes it
/// from `/VTKHDF/Steps`. That link leads to the first body, which carries the number and the times besides
/// its own `Steps`: as a child of the root it must be a valid block, and the assembly does not list it.
fn link_steps(file: &File, first: &str, times: &[f64]) -> Result<()> {
    let path = format!("/VTKHDF/{first}");
    file.open_group(&path)?
        .write_i64("NSteps", &[], &[times.len() as i64])?;
    file.write(
        &format!("{path}/Values"),
        DType::F64,
        &[times.len() as u64],
        bytes(times),
    )?;
    file.soft_link(&path, "/VTKHDF/Steps")
}

fn json(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|e| ArtifactError::new(ErrorKind::BadValue, e.to_string()))
}

fn json_object(what: &str, text: &str) -> Result<Value> {
    match serde_json::from_str(text) {
        Ok(value @ Value::Object(_)) => Ok(value),
        Ok(other) => bad_value(format!("{what}: expected a JSON object, got {other}")),
        Err(e) => bad_value(format!("{what}: not JSON: {e}")),
    }
}

/// Refuses what is no finite value of a result.
///
/// # Errors
/// When the name is empty or the value not finite.
pub fn check_result(name: &str, value: f64) -> Result<()> {
    if name.is_empty() {
        return bad_value("a result needs a name");
    }
    if !value.is_finite() {
        return bad_value(format!(
            "the result '{name}' is {value}; results are finite numbers"
        ));
    }
    Ok(())
}

/// Names go into HDF5 paths and VTK assemblies: a letter or `_`, then letters, digits and `_ - .`
pub(crate) fn check_name(what: &str, name: &str) -> Result<()> {
    let first = name
        .chars()
        .next()
        .is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    let rest = name
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
    if first && rest {
        return Ok(());
    }
    bad_value(format!(
        "'{name}' cannot be a {what}: it must begin with a letter or '_' and hold only letters, digits, '_', '-' and '.'"
    ))
}

fn check_mesh(name: &str, points: &[f64], k: u32, cells: &[u32]) -> Result<()> {
    if !matches!(k, 3 | 4) {
        return bad_shape(format!(
            "body '{name}': {k} nodes per cell; 3 or 4 are allowed"
        ));
    }
    if !points.len().is_multiple_of(3) || !cells.len().is_multiple_of(k as usize) {
        return bad_shape(format!(
            "body '{name}': points are [n][3] and cells [m][{k}]"
        ));
    }
    if let Some(i) = points.iter().position(|x| !x.is_finite()) {
        return bad_value(format!(
            "body '{name}': coordinate {} of point {} is {}",
            i % 3,
            i / 3,
            points[i]
        ));
    }
    let n = points.len() / 3;
    if let Some(i) = cells.iter().position(|c| *c as usize >= n) {
        return bad_value(format!(
            "body '{name}': cell {} names point {}, but there are {n} points",
            i / k as usize,
            cells[i]
        ));
    }
    Ok(())
}

fn check_array(path: &str, dtype: DType, data: &[u8]) -> Result<()> {
    let bad = match dtype {
        DType::F64 => data
            .chunks_exact(8)
            .map(|b| f64::from_ne_bytes(b.try_into().expect("8 bytes")))
            .enumerate()
            .find(|(_, x)| !x.is_finite()),
        DType::F32 => data
            .chunks_exact(4)
            .map(|b| f64::from(f32::from_ne_bytes(b.try_into().expect("4 bytes"))))
            .enumerate()
            .find(|(_, x)| !x.is_finite()),
        DType::I64 | DType::U32 | DType::U8 => None,
    };
    match bad {
        Some((i, x)) => bad_value(format!("the array '{path}' is {x} at flat index {i}")),
        None => Ok(()),
    }
}
