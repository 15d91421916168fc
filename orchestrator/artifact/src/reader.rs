//! Reading an artifact.

use crate::contents::{ArrayInfo, BodyInfo, Contents, DATA_MODEL, FieldInfo, NamedValue, On};
use crate::error::{ArtifactError, ErrorKind, Result, bad_shape, not_found};
use crate::h5::{DType, File, Group, Location, Plain, bytes_mut};
use crate::mesh::group;
use crate::small;
use std::path::{Path, PathBuf};

/// An artifact open for reading. Its description is read when it is opened, arrays when they are asked
/// for.
#[derive(Debug)]
pub struct Artifact {
    path: PathBuf,
    /// Absent when the artifact has attributes alone.
    file: Option<File>,
    kind: String,
    attributes: String,
    results: Vec<NamedValue>,
    collection: Option<Vec<String>>,
    contents: Contents,
    provenance: String,
    times: Vec<f64>,
}

/// Where the attributes of `/plyflow` come from.
enum Source {
    Small(Vec<(String, small::Value)>),
    Library(Group),
}

impl Source {
    fn text(&self, name: &str) -> Result<Option<String>> {
        match self {
            Self::Library(group) => group.read_text(name),
            Self::Small(all) => Ok(all.iter().find_map(|(n, v)| match v {
                small::Value::Text(t) if n == name => Some(t.clone()),
                _ => None,
            })),
        }
    }

    fn integer(&self, name: &str) -> Result<Option<i64>> {
        match self {
            Self::Library(group) => group.read_integer(name),
            Self::Small(all) => Ok(all.iter().find_map(|(n, v)| match v {
                small::Value::Integer(i) if n == name => Some(*i),
                _ => None,
            })),
        }
    }
}

/// Attributes of a file that needs no library; `None` for every other file.
fn read_small(path: &Path) -> Option<Vec<(String, small::Value)>> {
    /// Larger ones hold arrays or texts that only the library reads.
    const LARGEST: u64 = 1 << 20;
    if std::fs::metadata(path).ok()?.len() > LARGEST {
        return None;
    }
    small::read(&std::fs::read(path).ok()?)
}

/// Times of the frames (s).
fn read_times(file: Option<&File>, frames: u64) -> Result<Vec<f64>> {
    let mut times = vec![0.0; frames as usize];
    if let (Some(file), true) = (file, frames > 0) {
        let d = file.open_dataset("/plyflow/times", DType::F64, &[frames])?;
        d.read_rows(0, frames, DType::F64, bytes_mut(&mut times))?;
    }
    Ok(times)
}

impl Artifact {
    /// Opens an artifact.
    ///
    /// # Errors
    /// When the file cannot be opened or is not an artifact of this data model.
    pub fn open(path: &Path) -> Result<Self> {
        if !path.exists() {
            return not_found(format!("there is no artifact {}", path.display()));
        }
        let broken = |what: String| {
            let text = format!("{} is not a Plyflow artifact: {what}", path.display());
            ArtifactError::new(ErrorKind::NotAnArtifact, text)
        };
        let (file, source) = match read_small(path) {
            Some(attributes) => (None, Source::Small(attributes)),
            None => {
                let file = File::open(path).map_err(|e| broken(e.message))?;
                let group = file.open_group("/plyflow").map_err(|e| broken(e.message))?;
                (Some(file), Source::Library(group))
            }
        };
        match source.integer("data_model")? {
            Some(DATA_MODEL) => {}
            Some(other) => {
                return Err(broken(format!(
                    "its data model is version {other}, this program reads version {DATA_MODEL}"
                )));
            }
            None => return Err(broken("it has no data model version".into())),
        }
        let text = |name: &str| {
            source
                .text(name)?
                .ok_or_else(|| broken(format!("it has no '{name}'")))
        };
        let parse = |name: &str, e: serde_json::Error| broken(format!("'{name}': {e}"));
        let contents: Contents =
            serde_json::from_str(&text("contents")?).map_err(|e| parse("contents", e))?;
        let length = std::fs::metadata(path).map_or(0, |m| m.len());
        if let Some(what) = contents.beyond(length) {
            return Err(broken(format!(
                "{what}, more than a file of {length} bytes holds"
            )));
        }
        let results = serde_json::from_str(&text("results")?).map_err(|e| parse("results", e))?;
        let collection = match source.text("collection")? {
            Some(t) => Some(serde_json::from_str(&t).map_err(|e| parse("collection", e))?),
            None => None,
        };
        let times = read_times(file.as_ref(), contents.frames)?;
        let (kind, attributes, provenance) =
            (text("kind")?, text("attributes")?, text("provenance")?);
        drop(source);
        Ok(Self {
            path: path.to_owned(),
            file,
            kind,
            attributes,
            results,
            collection,
            contents,
            provenance,
            times,
        })
    }

    fn file(&self) -> Result<&File> {
        // An artifact without a file lists no body and no array, so nobody comes here.
        self.file.as_ref().ok_or_else(|| {
            ArtifactError::new(
                ErrorKind::NotFound,
                "the artifact holds no arrays and no bodies",
            )
        })
    }

    /// Artifact kind, e.g. `forming`.
    #[must_use]
    pub fn kind(&self) -> &str {
        &self.kind
    }

    /// The attributes that the plugin wrote: text of a JSON object.
    #[must_use]
    pub fn attributes(&self) -> &str {
        &self.attributes
    }

    /// Named numbers in the order reported; measured ones are not in the artifact but in its record.
    #[must_use]
    pub fn results(&self) -> &[NamedValue] {
        &self.results
    }

    /// Labels of the items, if the artifact is a collection.
    #[must_use]
    pub fn collection(&self) -> Option<&[String]> {
        self.collection.as_deref()
    }

    /// Text of the provenance (JSON).
    #[must_use]
    pub fn provenance(&self) -> &str {
        &self.provenance
    }

    /// Bodies, fields and arrays.
    #[must_use]
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Time of each frame (s).
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The body of that name.
    ///
    /// # Errors
    /// Lists the names there are.
    pub fn body(&self, name: &str) -> Result<&BodyInfo> {
        let Some(body) = self.contents.body(name) else {
            let names: Vec<&str> = self
                .contents
                .bodies
                .iter()
                .map(|b| b.name.as_str())
                .collect();
            return not_found(format!(
                "{} has no body '{name}'; there are: {}",
                self.path.display(),
                names.join(", ")
            ));
        };
        Ok(body)
    }

    /// Type, shape and unit of the array at `path` (below `/data`).
    ///
    /// # Errors
    /// Lists the arrays there are.
    pub fn array_info(&self, path: &str) -> Result<&ArrayInfo> {
        let Some(info) = self.contents.array(path) else {
            let names: Vec<&str> = self
                .contents
                .arrays
                .iter()
                .map(|a| a.path.as_str())
                .collect();
            return not_found(format!(
                "{} has no array '{path}'; there are: {}",
                self.path.display(),
                names.join(", ")
            ));
        };
        Ok(info)
    }

    /// Reads an array as `dtype` (converted if stored otherwise) into `buffer`.
    ///
    /// # Errors
    /// Unknown path, or a buffer of another size.
    pub fn read_array(&self, path: &str, dtype: DType, buffer: &mut [u8]) -> Result<()> {
        let info = self.array_info(path)?;
        let count: u64 = info.shape.iter().product();
        if buffer.len() as u64 != count * dtype.size() as u64 {
            return bad_shape(format!(
                "the array '{path}' of shape {:?} needs a buffer of {} bytes, not {}",
                info.shape,
                count * dtype.size() as u64,
                buffer.len()
            ));
        }
        let d = self
            .file()?
            .open_dataset(&format!("/data/{path}"), info.dtype, &info.shape)?;
        d.read_all(dtype, buffer)
    }

    fn array<T: Plain + Default>(&self, path: &str, dtype: DType) -> Result<(Vec<T>, Vec<usize>)> {
        let shape: Vec<usize> = self
            .array_info(path)?
            .shape
            .iter()
            .map(|n| *n as usize)
            .collect();
        let mut data = vec![T::default(); shape.iter().product()];
        self.read_array(path, dtype, bytes_mut(&mut data))?;
        Ok((data, shape))
    }

    /// An array as doubles, with its shape.
    ///
    /// # Errors
    /// Unknown path.
    pub fn array_f64(&self, path: &str) -> Result<(Vec<f64>, Vec<usize>)> {
        self.array(path, DType::F64)
    }

    /// An array as unsigned integers, with its shape.
    ///
    /// # Errors
    /// Unknown path.
    pub fn array_u32(&self, path: &str) -> Result<(Vec<u32>, Vec<usize>)> {
        self.array(path, DType::U32)
    }

    /// Reads reference points `[n][3]` (m) and cells `[m][k]` of a body into buffers of that size.
    ///
    /// # Errors
    /// Unknown body, or buffers of another size.
    pub fn read_mesh(&self, body: &str, points: &mut [f64], cells: &mut [u32]) -> Result<()> {
        let b = self.body(body)?;
        let (n, ids) = (b.points, b.cells * u64::from(b.nodes_per_cell));
        if points.len() as u64 != 3 * n || cells.len() as u64 != ids {
            return bad_shape(format!("body '{body}' has {n} points and {ids} cell nodes"));
        }
        let path = if b.moving {
            format!("/plyflow/reference/{body}")
        } else {
            format!("/VTKHDF/{body}/Points")
        };
        let d = self.file()?.open_dataset(&path, DType::F64, &[n, 3])?;
        d.read_all(DType::F64, bytes_mut(points))?;
        let path = format!("/VTKHDF/{body}/Connectivity");
        let d = self.file()?.open_dataset(&path, DType::I64, &[ids])?;
        d.read_all(DType::U32, bytes_mut(cells))?;
        // Whoever reads a mesh goes from its cells to its points.
        match cells.iter().find(|i| u64::from(**i) >= n) {
            None => Ok(()),
            Some(i) => Err(ArtifactError::new(
                ErrorKind::NotAnArtifact,
                format!("body '{body}' has {n} points, and a cell with the corner {i} (from 0)"),
            )),
        }
    }

    /// Reference points `[n]` (m) and cells `[m * k]` of a body.
    ///
    /// # Errors
    /// Unknown body.
    pub fn mesh(&self, body: &str) -> Result<(Vec<[f64; 3]>, Vec<u32>)> {
        let b = self.body(body)?;
        let mut points = vec![[0.0; 3]; b.points as usize];
        let mut cells = vec![0; (b.cells * u64::from(b.nodes_per_cell)) as usize];
        self.read_mesh(body, points.as_flattened_mut(), &mut cells)?;
        Ok((points, cells))
    }

    fn check_frame(&self, frame: u64) -> Result<()> {
        if frame < self.contents.frames {
            return Ok(());
        }
        not_found(format!(
            "{} has {} frames; there is no frame {frame} (the first is 0)",
            self.path.display(),
            self.contents.frames
        ))
    }

    /// Reads the points `[n][3]` (m) of a body in a frame.
    ///
    /// # Errors
    /// Unknown body or frame, or a buffer of another size.
    pub fn read_frame_points(&self, body: &str, frame: u64, points: &mut [f64]) -> Result<()> {
        let b = self.body(body)?;
        self.check_frame(frame)?;
        let n = b.points;
        if points.len() as u64 != 3 * n {
            return bad_shape(format!("body '{body}' has {n} points"));
        }
        let (rows, first) = if b.moving {
            (n * self.contents.frames, n * frame)
        } else {
            (n, 0)
        };
        let path = format!("/VTKHDF/{body}/Points");
        let d = self.file()?.open_dataset(&path, DType::F64, &[rows, 3])?;
        d.read_rows(first, n, DType::F64, bytes_mut(points))
    }

    /// Points `[n]` (m) of a body in a frame.
    ///
    /// # Errors
    /// Unknown body or frame.
    pub fn frame_points(&self, body: &str, frame: u64) -> Result<Vec<[f64; 3]>> {
        let mut points = vec![[0.0; 3]; self.body(body)?.points as usize];
        self.read_frame_points(body, frame, points.as_flattened_mut())?;
        Ok(points)
    }

    /// The field of a body.
    ///
    /// # Errors
    /// Unknown body, or lists the fields there are.
    pub fn field(&self, body: &str, on: On, name: &str) -> Result<&FieldInfo> {
        let b = self.body(body)?;
        let Some(field) = b.fields.iter().find(|f| f.name == name && f.on == on) else {
            let names: Vec<&str> = b.fields.iter().map(|f| f.name.as_str()).collect();
            return not_found(format!(
                "body '{body}' has no field '{name}' there; its fields are: {}",
                names.join(", ")
            ));
        };
        Ok(field)
    }

    /// Reads the values `[rows][components]` of a field of a body in a frame.
    ///
    /// # Errors
    /// Unknown body, frame or field, or a buffer of another size.
    pub fn read_frame_field(
        &self,
        body: &str,
        frame: u64,
        on: On,
        name: &str,
        values: &mut [f64],
    ) -> Result<()> {
        let components = u64::from(self.field(body, on, name)?.components);
        self.check_frame(frame)?;
        let b = self.body(body)?;
        let rows = if on == On::Points { b.points } else { b.cells };
        if values.len() as u64 != rows * components {
            return bad_shape(format!(
                "field '{name}' of body '{body}' has {rows} rows of {components} components"
            ));
        }
        let mut shape = vec![rows * self.contents.frames];
        if components > 1 {
            shape.push(components);
        }
        let path = format!("/VTKHDF/{body}/{}/{name}", group(on));
        let d = self.file()?.open_dataset(&path, DType::F32, &shape)?;
        d.read_rows(rows * frame, rows, DType::F64, bytes_mut(values))
    }

    /// Values `[rows * components]` of a field of a body in a frame.
    ///
    /// # Errors
    /// Unknown body, frame or field.
    pub fn frame_field(&self, body: &str, frame: u64, on: On, name: &str) -> Result<Vec<f64>> {
        let components = self.field(body, on, name)?.components as usize;
        let b = self.body(body)?;
        let rows = if on == On::Points { b.points } else { b.cells };
        let mut values = vec![0.0; rows as usize * components];
        self.read_frame_field(body, frame, on, name, &mut values)?;
        Ok(values)
    }
}
