//! Hands the shim's own linker script to the linker; nothing of the product's memory map is used.

fn main() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/shim.ld");
    println!("cargo:rerun-if-changed={script}");
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-T{script}");
}
