//! Where the recordings of masters are. Tests that play them take this file in as a module.
//!
//! One was made by the scripted master of `tests/ring` and lies beside this file. That of a real master belongs to others and is not in the
//! repository: where it is not found, the test plays the first alone, says so, and is counted by `cargo xtask test`.

use std::io::Write;
use std::path::{Path, PathBuf};

/// A recording, and what is known of it. Each brings four drives, addresses 1 to 4, into CP4.
#[derive(Clone, Debug)]
#[allow(dead_code, reason = "not every program asks for everything")]
pub(crate) struct Known {
    pub(crate) path: PathBuf,
    /// Cycles in it, and how many of them have an MDT.
    pub(crate) cycles: (usize, usize),
    /// S-0-0006 of each drive.
    pub(crate) t1: [u16; 4],
    /// S-0-0007.
    pub(crate) t4: u16,
    /// Data blocks that the master wrote to each drive, procedure commands included.
    pub(crate) written: u64,
}

/// The root of the repository.
pub(crate) fn repository() -> &'static Path {
    let inside = Path::new(env!("CARGO_MANIFEST_DIR"));
    inside.ancestors().find(|folder| folder.join("Cargo.lock").is_file()).expect("a crate of the workspace")
}

/// That of the scripted master.
pub(crate) fn ours() -> Known {
    Known {
        path: repository().join("tests/recordings/scripted-master.tsv"),
        cycles: (1_195, 1_183),
        t1: [20, 102, 184, 266],
        t4: 1_918,
        written: 14,
    }
}

/// All that are here.
pub(crate) fn recordings() -> Vec<Known> {
    let folder =
        std::env::var_os("SERCOS_CAPTURES").map_or_else(|| repository().join("../shared/captures"), PathBuf::from);
    // A Beckhoff FC7502 with four drives.
    let path = folder.join("fc7502-four-drives.tsv");
    let real = Known { path, cycles: (4_277, 4_152), t1: [92, 336, 580, 824], t4: 1_698, written: 14 };
    if real.path.exists() {
        return vec![ours(), real];
    }
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    eprintln!("SKIPPED: no recording of a real master at {}; set SERCOS_CAPTURES to its folder", real.path.display());
    if let Some(list) = std::env::var_os("SKIPPED_RECORDINGS") {
        let mut list = std::fs::OpenOptions::new().append(true).create(true).open(list).expect("the list of xtask");
        // One write, so that tests side by side leave whole lines.
        list.write_all(format!("{test}\n").as_bytes()).expect("the list of xtask");
    }
    vec![ours()]
}
