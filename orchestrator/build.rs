//! How the program is linked: workers start by the thousand, so what the dynamic loader does counts.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_ENV").as_deref() == Ok("gnu") {
        // Symbols are looked up when first called; a worker calls few of them.
        println!("cargo:rustc-link-arg-bins=-Wl,-z,lazy");
        // No load address to relocate for: some thousand pointers stay as they are in the file.
        println!("cargo:rustc-link-arg-bins=-no-pie");
        println!("cargo:rustc-link-arg-bins=-static-libgcc");
    }
}
