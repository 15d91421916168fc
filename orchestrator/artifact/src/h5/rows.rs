//! Rows of a dataset: appended whole, read whole or in part.

use super::handle::{DEFAULT, checked, locked, space};
use super::{DType, Dataset, Location};
use crate::error::Result;
use hdf5_sys::h5d::{H5Dread, H5Dset_extent, H5Dwrite};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5s::{H5S_seloper_t, H5Sselect_hyperslab};

impl Dataset {
    /// Appends whole rows.
    pub(crate) fn append(&mut self, data: &[u8]) -> Result<()> {
        let row: u64 = self.shape[1..].iter().product::<u64>() * self.dtype.size() as u64;
        if data.is_empty() || row == 0 {
            return Ok(());
        }
        let (first, rows) = (self.shape[0], data.len() as u64 / row);
        self.shape[0] += rows;
        locked(|| unsafe {
            checked(H5Dset_extent(self.id(), self.shape.as_ptr()), || {
                "growing a dataset".into()
            })
        })?;
        self.slab(first, rows, |d, t, memory, file| unsafe {
            H5Dwrite(d, t, memory, file, DEFAULT, data.as_ptr().cast())
        })
    }

    /// Reads rows `first .. first + rows` as `dtype` into `buffer` (of the right length).
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
        let wanted = rows * self.shape[1..].iter().product::<u64>() * dtype.size() as u64;
        debug_assert_eq!(buffer.len() as u64, wanted);
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

    /// Reads everything as `dtype` into `buffer` (of the right length).
    pub(crate) fn read_all(&self, dtype: DType, buffer: &mut [u8]) -> Result<()> {
        if buffer.is_empty() {
            return Ok(());
        }
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
