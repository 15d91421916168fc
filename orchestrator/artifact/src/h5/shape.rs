//! What a file really holds, before buffers of the size that it should have are filled: files may be damaged, or written by others.

use super::handle::{Handle, checked, close_space};
use crate::error::{ArtifactError, ErrorKind, Result};
use hdf5_sys::h5a::H5Aget_space;
use hdf5_sys::h5d::H5Dget_space;
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5s::{
    H5Sget_simple_extent_dims, H5Sget_simple_extent_ndims, H5Sget_simple_extent_npoints,
};
use hdf5_sys::h5t::{H5T_class_t, H5Tget_class, H5Tis_variable_str};

/// Number of elements of a shape.
///
/// # Errors
/// When it is more than a number holds.
pub(super) fn elements(shape: &[u64]) -> Result<u64> {
    let all = shape.iter().try_fold(1u64, |all, n| all.checked_mul(*n));
    all.ok_or_else(|| {
        let text = format!("the shape {shape:?} has more elements than can be counted");
        ArtifactError::new(ErrorKind::BadShape, text)
    })
}

/// Whether a buffer has the bytes of that many elements of `size` bytes: the library takes its length from the shape.
///
/// # Errors
/// When it has others.
pub(super) fn check_buffer(bytes: usize, elements: u64, size: usize) -> Result<()> {
    if elements.checked_mul(size as u64) == Some(bytes as u64) {
        return Ok(());
    }
    let text = format!("a buffer of {bytes} bytes for {elements} elements of {size} bytes");
    Err(ArtifactError::new(ErrorKind::BadShape, text))
}

fn refuse<T>(message: String) -> Result<T> {
    Err(ArtifactError::new(ErrorKind::NotAnArtifact, message))
}

/// Whether a dataset has this shape.
///
/// # Safety
/// Called in [`super::handle::locked`].
pub(super) unsafe fn check_shape(dataset: hid_t, path: &str, expected: &[u64]) -> Result<()> {
    let what = || format!("the shape of the dataset {path}");
    // SAFETY: in the lock (the caller's promise).
    let space = unsafe { H5Dget_space(dataset) };
    let space = Handle(checked(space, what)?, close_space);
    // SAFETY: as above.
    let rank = checked(unsafe { H5Sget_simple_extent_ndims(space.0) }, what)?;
    let mut shape = vec![0; usize::try_from(rank).unwrap_or(0)];
    let null = std::ptr::null_mut();
    // SAFETY: as above; room for as many sizes as the space has, and NULL for those that are not wanted.
    let code = unsafe { H5Sget_simple_extent_dims(space.0, shape.as_mut_ptr(), null) };
    checked(code, what)?;
    if shape == expected {
        return Ok(());
    }
    refuse(format!(
        "the dataset {path} has the shape {shape:?}; its artifact says {expected:?}"
    ))
}

/// Whether an attribute is one value.
///
/// # Safety
/// Called in [`super::handle::locked`].
pub(super) unsafe fn check_single(attribute: hid_t, name: &str) -> Result<()> {
    let what = || format!("the shape of the attribute '{name}'");
    // SAFETY: in the lock (the caller's promise).
    let space = unsafe { H5Aget_space(attribute) };
    let space = Handle(checked(space, what)?, close_space);
    // SAFETY: as above.
    match unsafe { H5Sget_simple_extent_npoints(space.0) } {
        1 => Ok(()),
        n => refuse(format!(
            "the attribute '{name}' has {n} values; expected one"
        )),
    }
}

/// Whether a type is a text of fixed length.
///
/// # Safety
/// Called in [`super::handle::locked`].
pub(super) unsafe fn check_text(kind: hid_t, name: &str) -> Result<()> {
    // SAFETY: in the lock (the caller's promise).
    let text = unsafe { H5Tget_class(kind) == H5T_class_t::H5T_STRING };
    // SAFETY: as above.
    if text && unsafe { H5Tis_variable_str(kind) } == 0 {
        return Ok(());
    }
    refuse(format!("the attribute '{name}' is no text of fixed length"))
}

#[cfg(test)]
mod tests {
    use crate::error::ErrorKind;
    use crate::h5::{DType, File, Location, bytes, bytes_mut};

    #[test]
    fn a_buffer_of_another_length_than_the_shape_has_is_refused_before_the_library_touches_it() {
        let dir = tempfile::tempdir().unwrap();
        let file = File::create(&dir.path().join("a.h5")).unwrap();
        let group = file.create_group("/g").unwrap();
        for values in [5, 7] {
            let e = file.write("/short", DType::F64, &[2, 3], bytes(&vec![0.0; values]));
            assert_eq!(e.unwrap_err().kind, ErrorKind::BadShape);
            assert!(group.write_i64("short", &[6], &vec![0; values]).is_err());
        }
        // 2^64 elements, and 1 more: as many as there are values, for who does not look at the overflow.
        let many: [u64; 2] = [0xAAAA_AAAA_AAAA_AAAB, 3];
        assert_eq!(many[0].wrapping_mul(many[1]), 1);
        assert!(file.write("/many", DType::U8, &many, &[0]).is_err());
        let rows = file
            .write("/x", DType::F64, &[2, 3], bytes(&[1.0; 6]))
            .unwrap();
        for values in [2, 5, 7] {
            let mut buffer = vec![0.0; values];
            assert!(rows.read_all(DType::F64, bytes_mut(&mut buffer)).is_err());
            assert!(
                rows.read_rows(0, 1, DType::F64, bytes_mut(&mut buffer))
                    .is_err()
            );
            assert!(buffer.iter().all(|v| *v == 0.0));
        }
        let mut buffer = [0.0; 3];
        assert!(
            rows.read_rows(2, 1, DType::F64, bytes_mut(&mut buffer))
                .is_err()
        );
        rows.read_rows(1, 1, DType::F64, bytes_mut(&mut buffer))
            .unwrap();
        assert_eq!(buffer, [1.0; 3]);
    }

    #[test]
    fn what_is_of_another_shape_or_type_than_it_should_be_is_refused_and_not_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.h5");
        let file = File::create(&path).unwrap();
        file.write("/x", DType::F64, &[2, 3], bytes(&[0.0; 6]))
            .unwrap();
        let group = file.create_group("/g").unwrap();
        group.write_i64("many", &[4], &[1, 2, 3, 4]).unwrap();
        group.write_i64("one", &[], &[7]).unwrap();
        group.write_text("text", "seven", false).unwrap();
        for shape in [&[2, 4][..], &[6], &[2, 3, 1], &[]] {
            let e = file.open_dataset("/x", DType::F64, shape).err().unwrap();
            assert!(e.message.contains("/x has the shape [2, 3]"), "{e:?}");
        }
        assert!(file.open_dataset("/x", DType::F64, &[2, 3]).is_ok());
        assert_eq!(group.read_integer("one").unwrap(), Some(7));
        let e = group.read_integer("many").unwrap_err();
        assert!(e.message.contains("'many' has 4 values"), "{e:?}");
        assert_eq!(group.read_text("text").unwrap().unwrap(), "seven");
        let e = group.read_text("one").unwrap_err();
        assert!(e.message.contains("'one' is no text"), "{e:?}");
        assert!(group.read_text("many").is_err());
    }
}
