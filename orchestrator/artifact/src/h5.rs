//! A thin safe layer over the HDF5 C library: only what an artifact needs.
//!
//! HDF5 is not thread-safe here: every call takes the library's one lock. Handles close themselves.
//! No object times are tracked and every group keeps the order of creation (VTK iterates in it), so the
//! bytes of a file depend only on the calls that made it.

mod handle;
mod rows;
mod shape;

use crate::error::{ArtifactError, ErrorKind, Result};
use handle::{
    CLOSE_FAILED, DEFAULT, Handle, c_name, checked, close_attribute, close_dataset, close_file,
    close_group, close_type, id, locked, plist, space, text_type,
};
use hdf5_sys::h5a::{H5Acreate2, H5Aget_type, H5Aopen, H5Aread, H5Awrite};
use hdf5_sys::h5d::{H5D_fill_time_t, H5Dcreate2, H5Dopen2, H5Dwrite};
use hdf5_sys::h5f::{H5F_ACC_RDONLY, H5F_ACC_TRUNC, H5F_libver_t, H5Fclose, H5Fcreate, H5Fopen};
use hdf5_sys::h5g::{H5Gcreate2, H5Gopen2};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5l::{H5Lcreate_soft, H5Lexists};
use hdf5_sys::h5p::*;
use hdf5_sys::h5t::{
    H5T_IEEE_F32LE, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, H5T_NATIVE_FLOAT, H5T_NATIVE_INT64,
    H5T_NATIVE_UINT8, H5T_NATIVE_UINT32, H5T_STD_I64LE, H5T_STD_U8LE, H5T_STD_U32LE, H5Tget_size,
};
use std::ffi::{CString, c_void};
use std::path::Path;
use std::sync::PoisonError;

/// Type of an element, in the file (little-endian) and in memory (native).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DType {
    /// Double.
    F64,
    /// Single.
    F32,
    /// Signed 64-bit.
    I64,
    /// Unsigned 32-bit.
    U32,
    /// Unsigned byte.
    U8,
}

impl DType {
    /// Bytes of one element.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::F32 | Self::U32 => 4,
            Self::U8 => 1,
        }
    }

    fn memory(self) -> hid_t {
        match self {
            Self::F64 => id(H5T_NATIVE_DOUBLE),
            Self::F32 => id(H5T_NATIVE_FLOAT),
            Self::I64 => id(H5T_NATIVE_INT64),
            Self::U32 => id(H5T_NATIVE_UINT32),
            Self::U8 => id(H5T_NATIVE_UINT8),
        }
    }

    fn file(self) -> hid_t {
        match self {
            Self::F64 => id(H5T_IEEE_F64LE),
            Self::F32 => id(H5T_IEEE_F32LE),
            Self::I64 => id(H5T_STD_I64LE),
            Self::U32 => id(H5T_STD_U32LE),
            Self::U8 => id(H5T_STD_U8LE),
        }
    }
}

/// An open file.
#[derive(Debug)]
pub(crate) struct File(Handle);

/// An open group.
#[derive(Debug)]
pub(crate) struct Group(Handle);

/// An open dataset and its rank and row size.
#[derive(Debug)]
pub(crate) struct Dataset {
    handle: Handle,
    shape: Vec<u64>,
    dtype: DType,
}

/// What attributes can be written to.
pub(crate) trait Location {
    fn id(&self) -> hid_t;

    /// Writes a text of fixed length.
    fn write_text(&self, name: &str, text: &str, ascii: bool) -> Result<()> {
        let t = text_type(text.len(), ascii)?;
        // The buffer is what the type says, also for the empty text.
        let padded;
        let bytes = if text.is_empty() {
            padded = [0u8];
            &padded[..]
        } else {
            text.as_bytes()
        };
        // SAFETY: one value of as many bytes as the type has.
        unsafe { self.write_raw(name, t.0, t.0, &[], bytes.as_ptr().cast()) }
    }

    /// Writes integers; an empty shape makes one value.
    ///
    /// # Errors
    /// When they are not as many as the shape has.
    fn write_i64(&self, name: &str, shape: &[u64], values: &[i64]) -> Result<()> {
        let t = DType::I64;
        shape::check_buffer(size_of_val(values), shape::elements(shape)?, t.size())?;
        // SAFETY: as many values of the type as the shape has, as was just found.
        unsafe { self.write_raw(name, t.file(), t.memory(), shape, values.as_ptr().cast()) }
    }

    /// Writes an attribute of a type of the file from one in memory.
    ///
    /// # Safety
    /// `data` points to as many values of the type `memory` as the shape has.
    #[doc(hidden)]
    unsafe fn write_raw(
        &self,
        name: &str,
        file: hid_t,
        memory: hid_t,
        shape: &[u64],
        data: *const c_void,
    ) -> Result<()> {
        let c = c_name(name)?;
        let s = space(shape, false)?;
        // SAFETY: in the lock (`handle`); a name, and the values that the attribute is made for (the caller's promise).
        locked(|| unsafe {
            let id = H5Acreate2(self.id(), c.as_ptr(), file, s.0, DEFAULT, DEFAULT);
            checked(id, || format!("making the attribute '{name}'"))?;
            let a = Handle(id, close_attribute);
            checked(H5Awrite(a.0, memory, data), || {
                format!("writing the attribute '{name}'")
            })?;
            Ok(())
        })
    }

    /// A text attribute, or `None` if there is none of that name.
    fn read_text(&self, name: &str) -> Result<Option<String>> {
        let c = c_name(name)?;
        // SAFETY: in the lock (`handle`); a name, and a buffer of the bytes that the type has: the attribute is one value of it, and a text of
        // fixed length, as is looked at before it is read.
        locked(|| unsafe {
            let id = H5Aopen(self.id(), c.as_ptr(), DEFAULT);
            if id < 0 {
                return Ok(None);
            }
            let a = Handle(id, close_attribute);
            let what = || format!("reading the attribute '{name}'");
            let t = Handle(checked(H5Aget_type(a.0), what)?, close_type);
            shape::check_single(a.0, name)?;
            shape::check_text(t.0, name)?;
            let mut bytes = vec![0u8; H5Tget_size(t.0)];
            checked(H5Aread(a.0, t.0, bytes.as_mut_ptr().cast()), what)?;
            let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
            bytes.truncate(end);
            String::from_utf8(bytes).map(Some).map_err(|_| {
                ArtifactError::new(
                    ErrorKind::NotAnArtifact,
                    format!("the attribute '{name}' is not UTF-8"),
                )
            })
        })
    }

    /// An integer attribute, or `None` if there is none of that name.
    fn read_integer(&self, name: &str) -> Result<Option<i64>> {
        let c = c_name(name)?;
        // SAFETY: in the lock (`handle`); a name, and room for the one value that the attribute has, as is looked at before it is read.
        locked(|| unsafe {
            let id = H5Aopen(self.id(), c.as_ptr(), DEFAULT);
            if id < 0 {
                return Ok(None);
            }
            let a = Handle(id, close_attribute);
            shape::check_single(a.0, name)?;
            let mut value = 0i64;
            checked(
                H5Aread(a.0, DType::I64.memory(), (&raw mut value).cast()),
                || format!("reading the attribute '{name}'"),
            )?;
            Ok(Some(value))
        })
    }
}

impl Location for File {
    fn id(&self) -> hid_t {
        self.0.0
    }
}

impl Location for Group {
    fn id(&self) -> hid_t {
        self.0.0
    }
}

impl Location for Dataset {
    fn id(&self) -> hid_t {
        self.handle.0
    }
}

impl File {
    /// Makes a new file, replacing one that is there. Format of HDF5 1.10: what VTK 9.4 reads.
    pub(crate) fn create(path: &Path) -> Result<Self> {
        let access = plist(H5P_CLS_FILE_ACCESS)?;
        let creation = plist(H5P_CLS_FILE_CREATE)?;
        let c = c_path(path)?;
        // SAFETY: in the lock (`handle`); a path, identifiers and numbers.
        locked(|| unsafe {
            let v110 = H5F_libver_t::H5F_LIBVER_V110;
            H5Pset_libver_bounds(access.0, v110, v110);
            // Nobody else opens a temporary name; some cluster file systems have no locks.
            H5Pset_file_locking(access.0, 0, 1);
            H5Pset_link_creation_order(creation.0, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
            H5Pset_obj_track_times(creation.0, 0);
            let id = H5Fcreate(c.as_ptr(), H5F_ACC_TRUNC, creation.0, access.0);
            checked(id, || format!("making the artifact {}", path.display()))?;
            Ok(Self(Handle(id, close_file)))
        })
    }

    /// Opens a file for reading.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let access = plist(H5P_CLS_FILE_ACCESS)?;
        let c = c_path(path)?;
        // SAFETY: as in `create`.
        locked(|| unsafe {
            H5Pset_file_locking(access.0, 0, 1);
            let id = H5Fopen(c.as_ptr(), H5F_ACC_RDONLY, access.0);
            checked(id, || format!("opening the artifact {}", path.display()))?;
            Ok(Self(Handle(id, close_file)))
        })
    }

    /// Closes the file; every other handle of it must be gone. An error also when one of them could not be closed.
    pub(crate) fn close(self) -> Result<()> {
        let id = self.0.0;
        std::mem::forget(self);
        // SAFETY: in the lock; `self`, which would close it a second time, is forgotten.
        locked(|| checked(unsafe { H5Fclose(id) }, || "closing the artifact".into()))?;
        let mut failed = CLOSE_FAILED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(why) = failed.take() {
            let text = format!("a part of the artifact could not be written (HDF5: {why})");
            return Err(ArtifactError::new(ErrorKind::Io, text));
        }
        Ok(())
    }

    /// Makes a group; groups on the way must exist.
    pub(crate) fn create_group(&self, path: &str) -> Result<Group> {
        let creation = plist(H5P_CLS_GROUP_CREATE)?;
        let c = c_name(path)?;
        // SAFETY: in the lock (`handle`); a path, identifiers and numbers.
        locked(|| unsafe {
            H5Pset_link_creation_order(creation.0, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
            H5Pset_obj_track_times(creation.0, 0);
            let id = H5Gcreate2(self.id(), c.as_ptr(), DEFAULT, creation.0, DEFAULT);
            checked(id, || format!("making the group {path}"))?;
            Ok(Group(Handle(id, close_group)))
        })
    }

    /// Makes a group unless it is there.
    pub(crate) fn ensure_group(&self, path: &str) -> Result<Group> {
        if self.exists(path) {
            self.open_group(path)
        } else {
            self.create_group(path)
        }
    }

    /// Opens a group.
    pub(crate) fn open_group(&self, path: &str) -> Result<Group> {
        let c = c_name(path)?;
        // SAFETY: in the lock (`handle`); a path and identifiers.
        locked(|| unsafe {
            let id = H5Gopen2(self.id(), c.as_ptr(), DEFAULT);
            checked(id, || format!("opening the group {path}"))?;
            Ok(Group(Handle(id, close_group)))
        })
    }

    /// Whether a link of that path exists; links on the way must exist.
    pub(crate) fn exists(&self, path: &str) -> bool {
        let Ok(c) = c_name(path) else { return false };
        // SAFETY: as in `open_group`.
        locked(|| unsafe { H5Lexists(self.id(), c.as_ptr(), DEFAULT) > 0 })
    }

    /// A link from `path` to `target` (a path in this file).
    pub(crate) fn soft_link(&self, target: &str, path: &str) -> Result<()> {
        let (t, p) = (c_name(target)?, c_name(path)?);
        // SAFETY: in the lock (`handle`); two paths and identifiers.
        locked(|| unsafe {
            let code = H5Lcreate_soft(t.as_ptr(), self.id(), p.as_ptr(), DEFAULT, DEFAULT);
            checked(code, || format!("linking {path} to {target}"))?;
            Ok(())
        })
    }

    /// Makes a dataset of fixed shape (contiguous) and writes it.
    ///
    /// # Errors
    /// When `data` does not hold the elements of `shape`.
    pub(crate) fn write(
        &self,
        path: &str,
        dtype: DType,
        shape: &[u64],
        data: &[u8],
    ) -> Result<Dataset> {
        shape::check_buffer(data.len(), shape::elements(shape)?, dtype.size())?;
        let d = self.create_dataset(path, dtype, shape, None)?;
        if !data.is_empty() {
            // SAFETY: in the lock (`handle`); the dataset was made with this shape, whose bytes `data` has, as was just found.
            locked(|| unsafe {
                let code = H5Dwrite(
                    d.id(),
                    dtype.memory(),
                    DEFAULT,
                    DEFAULT,
                    DEFAULT,
                    data.as_ptr().cast(),
                );
                checked(code, || format!("writing {path}"))
            })?;
        }
        Ok(d)
    }

    /// Makes a dataset that starts with no rows, grows along its first axis and is stored in chunks of
    /// `chunk` rows. `row` is the shape of one row.
    pub(crate) fn growing(
        &self,
        path: &str,
        dtype: DType,
        row: &[u64],
        chunk: u64,
    ) -> Result<Dataset> {
        let mut shape = vec![0];
        shape.extend_from_slice(row);
        self.create_dataset(path, dtype, &shape, Some(chunk.max(1)))
    }

    fn create_dataset(
        &self,
        path: &str,
        dtype: DType,
        shape: &[u64],
        chunk: Option<u64>,
    ) -> Result<Dataset> {
        let (c, s) = (c_name(path)?, space(shape, chunk.is_some())?);
        let creation = plist(H5P_CLS_DATASET_CREATE)?;
        let access = plist(H5P_CLS_DATASET_ACCESS)?;
        // SAFETY: in the lock (`handle`); a path, identifiers, and as many sizes of a chunk as the rank that stands beside them.
        locked(|| unsafe {
            H5Pset_obj_track_times(creation.0, 0);
            H5Pset_fill_time(creation.0, H5D_fill_time_t::H5D_FILL_TIME_NEVER);
            if let Some(rows) = chunk {
                let mut dims = shape.to_vec();
                dims[0] = rows;
                H5Pset_chunk(creation.0, dims.len() as i32, dims.as_ptr());
                // Whole chunks are written at once, so a cache would only hold memory.
                H5Pset_chunk_cache(access.0, 1, 0, 1.0);
            }
            let id = H5Dcreate2(
                self.id(),
                c.as_ptr(),
                dtype.file(),
                s.0,
                DEFAULT,
                creation.0,
                access.0,
            );
            checked(id, || format!("making the dataset {path}"))?;
            let handle = Handle(id, close_dataset);
            Ok(Dataset {
                handle,
                shape: shape.to_vec(),
                dtype,
            })
        })
    }

    /// Opens a dataset of a shape that it must have.
    ///
    /// # Errors
    /// When there is none, or it has another: buffers are made by the shape.
    pub(crate) fn open_dataset(&self, path: &str, dtype: DType, shape: &[u64]) -> Result<Dataset> {
        let c = c_name(path)?;
        // SAFETY: in the lock (`handle`), where `check_shape` is, too; a path and identifiers.
        locked(|| unsafe {
            let id = H5Dopen2(self.id(), c.as_ptr(), DEFAULT);
            checked(id, || format!("opening the dataset {path}"))?;
            let handle = Handle(id, close_dataset);
            shape::check_shape(handle.0, path, shape)?;
            Ok(Dataset {
                handle,
                shape: shape.to_vec(),
                dtype,
            })
        })
    }
}

fn c_path(path: &Path) -> Result<CString> {
    let text = path.to_str().ok_or_else(|| {
        ArtifactError::new(
            ErrorKind::Io,
            format!("the path {} is not UTF-8", path.display()),
        )
    })?;
    c_name(text)
}

/// The bytes of a slice of plain numbers.
pub(crate) fn bytes<T: Plain>(values: &[T]) -> &[u8] {
    // SAFETY: the slice's own bytes, borrowed as it is; plain types have no padding.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// The bytes of a slice of plain numbers, to read into.
pub(crate) fn bytes_mut<T: Plain>(values: &mut [T]) -> &mut [u8] {
    // SAFETY: the slice's own bytes, borrowed alone as it is; any bytes that are written there make plain numbers.
    unsafe { std::slice::from_raw_parts_mut(values.as_mut_ptr().cast(), size_of_val(values)) }
}

/// Numbers that are just bytes.
pub(crate) trait Plain: Copy {}

impl Plain for f64 {}

impl Plain for f32 {}

impl Plain for i64 {}

impl Plain for u32 {}

impl Plain for u8 {}
