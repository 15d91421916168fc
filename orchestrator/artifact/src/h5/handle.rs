//! The library's lock, its errors and its handles.
//!
//! **What makes calls sound.** The library asks for one call at a time, started before, and looks at every identifier itself: one that it
//! does not know, or of another class, is an error that it returns. So a call in [`locked`] needs no more than pointers that are right for
//! its length: names end with a zero ([`CString`]), and arrays have the length that the call takes from elsewhere.

use crate::error::{ArtifactError, ErrorKind, Result};
use hdf5_sys::h5::{H5dont_atexit, H5open, hsize_t};
use hdf5_sys::h5a::H5Aclose;
use hdf5_sys::h5d::H5Dclose;
use hdf5_sys::h5e::{H5E_DEFAULT, H5E_direction_t, H5E_error2_t, H5Eset_auto2, H5Ewalk2};
use hdf5_sys::h5f::H5Fclose;
use hdf5_sys::h5g::H5Gclose;
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{H5Pclose, H5Pcreate};
use hdf5_sys::h5s::{H5S_class_t, H5Sclose, H5Screate, H5Screate_simple};
use hdf5_sys::h5t::{
    H5T_C_S1, H5T_cset_t, H5T_str_t, H5Tclose, H5Tcopy, H5Tset_cset, H5Tset_size, H5Tset_strpad,
};
use std::ffi::{CStr, CString, c_uint, c_void};
use std::sync::{Mutex, Once, PoisonError};

pub(super) const DEFAULT: hid_t = 0;

/// The number behind one of the library's names. The library writes them when it starts, but the bindings
/// call them immutable: a plain read may be moved by the compiler to before the start, and is in release
/// builds.
pub(super) fn id(name: &'static hid_t) -> hid_t {
    // SAFETY: a static of the library that is there as long as the process, aligned, and written by `H5open` alone: under the lock and before
    // `locked` lets anybody go on. Before that it is 0, or a number that the library does not know.
    unsafe { std::ptr::read_volatile(name) }
}

static INIT: Once = Once::new();

/// Runs `f` alone in the library, which is started on first use.
pub(super) fn locked<T>(f: impl FnOnce() -> T) -> T {
    let _guard = hdf5_sys::LOCK.lock();
    // SAFETY: the lock is held. Plain calls; no function is given to be called on errors.
    INIT.call_once(|| unsafe {
        // Handles may outlive `main`; the library must not close them behind our back.
        H5dont_atexit();
        H5open();
        H5Eset_auto2(H5E_DEFAULT, None, std::ptr::null_mut());
    });
    f()
}

/// The innermost description on the library's error stack.
pub(super) fn last_error() -> String {
    /// # Safety
    /// Called by `H5Ewalk2`, which was given a `String` for `out` and gives an error of its stack.
    unsafe extern "C" fn visit(_: c_uint, e: *const H5E_error2_t, out: *mut c_void) -> i32 {
        // SAFETY: what `H5Ewalk2` was given below, which nobody else has during the walk.
        let out = unsafe { &mut *out.cast::<String>() };
        // SAFETY: the library's description of an error, there for this call.
        let text = unsafe { (*e).desc };
        if out.is_empty() && !text.is_null() {
            // SAFETY: not NULL, so a text of the library's that ends with a zero, there for this call.
            *out = unsafe { CStr::from_ptr(text) }
                .to_string_lossy()
                .into_owned();
        }
        0
    }
    let mut text = String::new();
    // SAFETY: `visit` gets `text`, whose type it knows, and keeps nothing of it; it does not panic. An error's place is the thread's own.
    unsafe {
        H5Ewalk2(
            H5E_DEFAULT,
            H5E_direction_t::H5E_WALK_UPWARD,
            Some(visit),
            (&raw mut text).cast(),
        );
    }
    text
}

pub(super) fn checked(code: impl Into<i64>, what: impl FnOnce() -> String) -> Result<i64> {
    let code = code.into();
    if code >= 0 {
        return Ok(code);
    }
    let message = format!("{} (HDF5: {})", what(), last_error());
    Err(ArtifactError::new(ErrorKind::Io, message))
}

pub(super) fn c_name(name: &str) -> Result<CString> {
    CString::new(name).map_err(|_| {
        ArtifactError::new(
            ErrorKind::BadValue,
            format!("the name {name:?} holds a zero byte"),
        )
    })
}

/// Closes a handle of one class when dropped.
#[derive(Debug)]
pub(super) struct Handle(pub(super) hid_t, pub(super) unsafe fn(hid_t) -> i32);

impl Drop for Handle {
    fn drop(&mut self) {
        locked(|| {
            // SAFETY: a function that closes identifiers, in the lock; the identifier is this handle's, and closed once.
            if unsafe { (self.1)(self.0) } < 0 {
                let why = last_error();
                let mut failed = CLOSE_FAILED.lock().unwrap_or_else(PoisonError::into_inner);
                failed.get_or_insert(why);
            }
        });
    }
}

/// Why closing a handle has failed, if it has. The library keeps small parts back until then, and lets them go even when the disk does not take
/// them; the file could be closed afterwards as if nothing had happened.
pub(super) static CLOSE_FAILED: Mutex<Option<String>> = Mutex::new(None);

macro_rules! closer {
    ($name:ident, $f:ident) => {
        /// # Safety
        /// Called in [`locked`].
        pub(super) unsafe fn $name(id: hid_t) -> i32 {
            // SAFETY: in the lock (the caller's promise); an identifier of another kind is an error that is returned.
            unsafe { $f(id) }
        }
    };
}
closer!(close_file, H5Fclose);
closer!(close_group, H5Gclose);
closer!(close_dataset, H5Dclose);
closer!(close_space, H5Sclose);
closer!(close_type, H5Tclose);
closer!(close_attribute, H5Aclose);
closer!(close_plist, H5Pclose);

pub(super) fn plist(class: &'static hid_t) -> Result<Handle> {
    // The class has its number only once the library has started.
    // SAFETY: in the lock.
    let id = locked(|| unsafe { H5Pcreate(id(class)) });
    checked(id, || "making a property list".into())?;
    Ok(Handle(id, close_plist))
}

pub(super) fn space(shape: &[u64], growing: bool) -> Result<Handle> {
    // SAFETY: in the lock; arrays of as many sizes as the rank that stands beside them, or NULL for "as they are".
    let id = locked(|| unsafe {
        if shape.is_empty() {
            H5Screate(H5S_class_t::H5S_SCALAR)
        } else if growing {
            let mut most = shape.to_vec();
            most[0] = hsize_t::MAX; // H5S_UNLIMITED
            H5Screate_simple(shape.len() as i32, shape.as_ptr(), most.as_ptr())
        } else {
            H5Screate_simple(shape.len() as i32, shape.as_ptr(), std::ptr::null())
        }
    });
    checked(id, || format!("making a space of shape {shape:?}"))?;
    Ok(Handle(id, close_space))
}

pub(super) fn text_type(bytes: usize, ascii: bool) -> Result<Handle> {
    // SAFETY: in the lock; identifiers and numbers alone.
    locked(|| unsafe {
        let id = checked(H5Tcopy(id(H5T_C_S1)), || "making a text type".into())?;
        let t = Handle(id, close_type);
        let set = if ascii {
            H5T_cset_t::H5T_CSET_ASCII
        } else {
            H5T_cset_t::H5T_CSET_UTF8
        };
        // HDF5 has no text of no bytes; one padding byte stands for it.
        checked(H5Tset_size(t.0, bytes.max(1)), || {
            format!("a text of {bytes} bytes")
        })?;
        checked(H5Tset_strpad(t.0, H5T_str_t::H5T_STR_NULLPAD), || {
            "text padding".into()
        })?;
        checked(H5Tset_cset(t.0, set), || "text encoding".into())?;
        Ok(t)
    })
}
