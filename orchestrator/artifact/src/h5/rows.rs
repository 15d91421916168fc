//! Rows of a dataset: appended whole, read whole or in part.

use super::handle::{DEFAULT, checked, locked, space};
use super::shape::{check_buffer, elements};
use super::{DType, Dataset, Location};
use crate::error::Result;
use hdf5_sys::h5d::{H5Dread, H5Dset_extent, H5Dwrite};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5s::{H5S_seloper_t, H5Sselect_hyperslab};

impl Dataset {
    /// Appends whole rows.
    pub(crate) fn append(&mut self, data: &[u8]) -> Result<()> {
        let row = elements(&self.shape[1..])?.saturating_mul(self.dtype.size() as u64);
        if data.is_empty() || row == 0 {
            return Ok(());
        }
        let (first, rows) = (self.shape[0], data.len() as u64 / row);
        self.shape[0] += rows;
        // SAFETY: in the lock (`super::handle`); the dataset's own rank.
        locked(|| unsafe {
            checked(H5Dset_extent(self.id(), self.shape.as_ptr()), || {
                "growing a dataset".into()
            })
        })?;
        // SAFETY: in the lock, which `slab` takes; `data` has at least the bytes of `rows` rows of the dataset's type.
        self.slab(first, rows, |d, t, memory, file| unsafe {
            H5Dwrite(d, t, memory, file, DEFAULT, data.as_ptr().cast())
        })
    }

    /// Reads rows `first .. first + rows` as `dtype` into `buffer`.
    ///
    /// # Errors
    /// When the buffer has another length, or the dataset fewer rows.
    pub(crate) fn read_rows(
        &self,
        first: u64,
        rows: u64,
        dtype: DType,
        buffer: &mut [u8],
    ) -> Result<()> {
        if buffer.is_empty() {
            return Ok(());
        }
        let mut part = self.shape.clone();
        part[0] = rows;
        check_buffer(buffer.len(), elements(&part)?, dtype.size())?;
        // SAFETY: in the lock, which `slab` takes; the buffer has the bytes of `rows` rows of this type, as was just found.
        self.slab(first, rows, |d, _, memory, file| unsafe {
            H5Dread(
                d,
                dtype.memory(),
                memory,
                file,
                DEFAULT,
                buffer.as_mut_ptr().cast(),
            )
        })
    }

    /// Reads everything as `dtype` into `buffer`.
    ///
    /// # Errors
    /// When the buffer has another length.
    pub(crate) fn read_all(&self, dtype: DType, buffer: &mut [u8]) -> Result<()> {
        if buffer.is_empty() {
            return Ok(());
        }
        check_buffer(buffer.len(), elements(&self.shape)?, dtype.size())?;
        // SAFETY: in the lock; the dataset has this shape (made or opened with it), and the buffer its bytes, as was just found.
        locked(|| unsafe {
            let to = buffer.as_mut_ptr().cast();
            let code = H5Dread(self.id(), dtype.memory(), DEFAULT, DEFAULT, DEFAULT, to);
            checked(code, || "reading a dataset".into())
        })?;
        Ok(())
    }

    fn slab(
        &self,
        first: u64,
        rows: u64,
        f: impl FnOnce(hid_t, hid_t, hid_t, hid_t) -> i32,
    ) -> Result<()> {
        let mut start = vec![0; self.shape.len()];
        let mut count = self.shape.clone();
        (start[0], count[0]) = (first, rows);
        let (memory, file) = (space(&count, false)?, space(&self.shape, false)?);
        // SAFETY: in the lock; arrays of the dataset's own rank, which that of `file` is, and NULL for single steps and blocks.
        locked(|| unsafe {
            let null = std::ptr::null();
            let code = H5Sselect_hyperslab(
                file.0,
                H5S_seloper_t::H5S_SELECT_SET,
                start.as_ptr(),
                null,
                count.as_ptr(),
                null,
            );
            checked(code, || {
                format!("selecting rows {first} to {}", first + rows)
            })?;
            checked(f(self.id(), self.dtype.memory(), memory.0, file.0), || {
                format!("rows {first} to {} of a dataset", first + rows)
            })
        })?;
        Ok(())
    }
}
