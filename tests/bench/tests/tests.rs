//! The bench. One program, and none beside it: the library would be compiled a second time for unit tests of its own.

mod elf;
mod measure;
mod traced;

use bench::Elves;

/// What `cargo xtask test` has built.
fn elves() -> Elves {
    let path =
        |name: &str| std::env::var_os(name).unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`"));
    Elves::new(path("PRODUCT_ELF"), path("BUS_PLUGIN"))
}
