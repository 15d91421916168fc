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

fn refuse<T>(message: String) -> Result<T> {
    Err(ArtifactError::new(ErrorKind::NotAnArtifact, message))
}

/// Whether a dataset has this shape. Call under the library's lock.
pub(super) unsafe fn check_shape(dataset: hid_t, path: &str, expected: &[u64]) -> Result<()> {
    let what = || format!("the shape of the dataset {path}");
    let space = Handle(
        checked(unsafe { H5Dget_space(dataset) }, what)?,
        close_space,
    );
    let rank = checked(unsafe { H5Sget_simple_extent_ndims(space.0) }, what)?;
    let mut shape = vec![0; usize::try_from(rank).unwrap_or(0)];
    let null = std::ptr::null_mut();
    checked(
        unsafe { H5Sget_simple_extent_dims(space.0, shape.as_mut_ptr(), null) },
        what,
    )?;
    if shape == expected {
        return Ok(());
    }
    refuse(format!(
        "the dataset {path} has the shape {shape:?}; its artifact says {expected:?}"
    ))
}

/// Whether an attribute is one value. Call under the library's lock.
pub(super) unsafe fn check_single(attribute: hid_t, name: &str) -> Result<()> {
    let what = || format!("the shape of the attribute '{name}'");
    let space = Handle(
        checked(unsafe { H5Aget_space(attribute) }, what)?,
        close_space,
    );
    match unsafe { H5Sget_simple_extent_npoints(space.0) } {
        1 => Ok(()),
        n => refuse(format!(
            "the attribute '{name}' has {n} values; expected one"
        )),
    }
}

/// Whether a type is a text of fixed length. Call under the library's lock.
pub(super) unsafe fn check_text(kind: hid_t, name: &str) -> Result<()> {
    let text = unsafe { H5Tget_class(kind) == H5T_class_t::H5T_STRING };
    if text && unsafe { H5Tis_variable_str(kind) } == 0 {
        return Ok(());
    }
    refuse(format!("the attribute '{name}' is no text of fixed length"))
}

#[cfg(test)]
mod tests {
    use crate::h5::{DType, File, Location, bytes};

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
