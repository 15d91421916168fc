//! The least that a worker process can do: load a library and find its symbol.

use std::ffi::CString;

fn main() {
    let library = std::env::args().nth(1).and_then(|a| CString::new(a).ok());
    let library = library.expect("usage: bare-worker LIBRARY");
    // SAFETY: a path that ends with a zero. The library's initialisers are those of a plugin that this process is there for.
    let handle = unsafe { libc::dlopen(library.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
    assert!(!handle.is_null(), "the library does not load");
    // SAFETY: a library that is loaded, and a name that ends with a zero.
    let symbol = unsafe { libc::dlsym(handle, c"plyflow_plugin".as_ptr()) };
    assert!(!symbol.is_null(), "the library is no plugin");
}
