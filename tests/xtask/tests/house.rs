//! Who may know whom: read from the code of the firmware, through re-exports.
//!
//! * No two files of a crate name each other, directly or around.
//! * Inside a crate nothing is imported through the root, and each `use` says where a thing is defined.
//! * The four crates at the bottom name no other crate of the workspace.
//!
//! What does not hold yet is listed, and has to leave the list when it does.

#[path = "house/names.rs"]
mod names;
#[path = "house/source.rs"]
mod source;

use std::collections::BTreeSet;
use std::path::Path;

use names::{circles, ties};
use source::Crate;

/// A crate of the firmware.
struct Wing {
    name: &'static str,
    /// Below the root of the repository.
    folder: &'static str,
    root: &'static str,
    /// Files that still need each other; each circle in the order of the names.
    circles: &'static [&'static [&'static str]],
    /// Something is still imported by way of a module that has it from another one.
    by_detours: bool,
}

const WINGS: [Wing; 7] = [
    Wing { name: "sercos", folder: "firmware/sercos/src", root: "lib.rs", circles: &[], by_detours: false },
    Wing { name: "sercon816", folder: "firmware/sercon816/src", root: "lib.rs", circles: &[], by_detours: false },
    Wing { name: "servo", folder: "firmware/servo/src", root: "lib.rs", circles: &[], by_detours: false },
    Wing { name: "memory", folder: "firmware/memory/src", root: "lib.rs", circles: &[], by_detours: false },
    Wing { name: "drive", folder: "firmware/drive/src", root: "lib.rs", circles: &[], by_detours: true },
    Wing { name: "board", folder: "board/src", root: "lib.rs", circles: &[], by_detours: false },
    Wing { name: "app", folder: "firmware/app/src", root: "main.rs", circles: &[], by_detours: false },
];

/// They can be used without the rest.
const ALONE: [&str; 4] = ["sercos", "sercon816", "servo", "memory"];

impl Wing {
    fn read(&self) -> Crate {
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
        Crate::read(self.root, &|file| std::fs::read_to_string(repository.join(self.folder).join(file)).ok())
    }
}

#[test]
fn no_two_files_of_a_crate_need_each_other_but_those_on_the_list() {
    let mut faults = Vec::new();
    for wing in &WINGS {
        let needs = wing.read().needs();
        assert!(!needs.is_empty(), "{} has no files", wing.name);
        let found = circles(&needs);
        let listed: BTreeSet<Vec<String>> =
            wing.circles.iter().map(|circle| circle.iter().map(|&file| file.into()).collect()).collect();
        for circle in found.difference(&listed) {
            let ties = ties(&needs, circle).join("\n    ");
            faults.push(format!("{}: these files need each other: {circle:?}\n    {ties}", wing.name));
        }
        for circle in listed.difference(&found) {
            faults.push(format!("{}: this circle is no more, take it off the list: {circle:?}", wing.name));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// What the tasks of the loops and the interrupt lines need, through whatever lies between.
#[test]
fn the_hot_half_of_the_drive_knows_neither_dictionary_nor_service_channel_nor_texts() {
    let drive = WINGS.iter().find(|wing| wing.name == "drive").unwrap();
    let needs = drive.read().needs();
    let is_hot = |file: &&String| file.starts_with("motion") || *file == "interrupts.rs";
    let mut reached: BTreeSet<&String> = needs.keys().filter(is_hot).collect();
    loop {
        let below: BTreeSet<&String> =
            reached.iter().filter_map(|file| needs.get(*file)).flat_map(|of| of.keys()).collect();
        if below.is_subset(&reached) {
            break;
        }
        reached.extend(below);
    }
    assert!(reached.len() > 30 && reached.iter().any(|file| *file == "settings.rs"), "{reached:?}");
    let cold = ["dictionary", "service", "diagnosis/table", "diagnosis/news", "communication"];
    let known: Vec<_> = reached.iter().filter(|file| cold.iter().any(|part| file.starts_with(part))).collect();
    assert!(known.is_empty(), "the hot half needs {known:?}");
}

#[test]
fn inside_a_crate_nothing_is_imported_through_its_root() {
    for wing in &WINGS {
        assert_eq!(wing.read().detours(true), BTreeSet::new(), "{}", wing.name);
    }
}

#[test]
fn each_use_says_where_a_thing_is_defined() {
    for wing in &WINGS {
        let detours = wing.read().detours(false);
        if wing.by_detours {
            assert!(!detours.is_empty(), "{} has no detours any more, take it off the list", wing.name);
        } else {
            assert_eq!(detours, BTreeSet::new(), "{}", wing.name);
        }
    }
}

#[test]
fn protocol_chip_and_motion_know_no_other_crate_of_the_workspace() {
    for wing in &WINGS {
        let others: Vec<&str> = WINGS.iter().map(|other| other.name).filter(|name| *name != wing.name).collect();
        let named = wing.read().names_of(&others);
        assert_eq!(named.is_empty(), ALONE.contains(&wing.name), "{} names {named:?}", wing.name);
    }
}

/// A crate of these files; the first is its root.
fn made_up(files: &[(&str, &str)]) -> Crate {
    let read = |name: &str| files.iter().find(|(file, _)| *file == name).map(|(_, text)| (*text).to_owned());
    Crate::read(files[0].0, &read)
}

fn circles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    circles(&made_up(files).needs()).into_iter().collect()
}

#[test]
fn a_circle_is_found_however_it_is_tied() {
    let b = "pub struct B(crate::a::A);";
    for a in [
        "use crate::b::B; pub struct A;",
        "pub struct A; impl A { fn f() -> crate::b::B { loop {} } }",
        "pub struct A; use super::b; fn f(_: &b::B) {}",
        "pub struct A; use crate::b::*; fn f(_: Option<B>) {}",
        "pub struct A; use crate::C; fn f(_: Option<C>) {}",
        "pub struct A; fn f() { assert!(1 == crate::b::B::SIZE); }",
        "pub struct A; fn f(x: u8) -> bool { matches!(x, crate::b::LOW) }",
        "pub struct A; mod inner { fn f(_: crate::b::B) {} }",
        "pub struct A; fn f() { use crate::d::E; }",
    ] {
        let d = "pub use crate::b::B as E;";
        let root = "mod a; mod b; mod d; pub use b::B as C;";
        assert_eq!(circles_of(&[("lib.rs", root), ("a.rs", a), ("b.rs", b), ("d.rs", d)]), [["a.rs", "b.rs"]], "{a}");
    }
    let around = [
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use crate::b::B; pub struct A;"),
        ("b.rs", "bitflags! { pub struct B: u8 { const X = 1; } } use crate::c::C;"),
        ("c.rs", "mod d; pub use d::C;"),
        ("c/d.rs", "pub struct C(super::super::a::A);"),
    ];
    assert_eq!(circles_of(&around), [["a.rs", "b.rs", "c/d.rs"]]);
}

#[test]
fn what_only_looks_like_a_circle_is_none() {
    for a in [
        "pub struct A; #[cfg(test)] mod tests { use crate::b::B; }",
        "pub struct A; #[cfg(test)] mod tests; ",
        "pub struct A; pub use crate::b::B;",
        "pub struct A; impl A { #[cfg(test)] fn f(_: crate::b::B) {} }",
        "pub struct A; fn f(b: u8) -> u8 { b }",
        "pub struct A; /// As in [`crate::b::B`].\n fn f() {}",
    ] {
        let files = [
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", a),
            ("b.rs", "pub struct B(crate::a::A);"),
            ("a/tests.rs", "use crate::b::B;"),
        ];
        assert_eq!(circles_of(&files), Vec::<Vec<String>>::new(), "{a}");
    }
}

#[test]
fn a_detour_is_found_and_one_through_the_root_by_itself() {
    let files = [
        ("lib.rs", "mod a; mod b; pub use b::c::C; pub struct Own;"),
        (
            "a.rs",
            "use crate::C; use crate::b::C as D; use crate::b::c::C as E; use crate::Own; fn f(_: super::C, _: D) {}",
        ),
        ("b.rs", "pub mod c; pub use c::C; #[cfg(test)] mod tests { use super::C; }"),
        ("b/c.rs", "pub struct C;"),
    ];
    let of = |only: bool| made_up(&files).detours(only).into_iter().collect::<Vec<_>>();
    assert_eq!(of(true), ["a.rs: crate::C", "a.rs: super::C"]);
    assert_eq!(of(false), ["a.rs: crate::C", "a.rs: crate::b::C", "a.rs: super::C"]);
}

#[test]
fn another_crate_is_found_by_its_name() {
    let files = [
        ("lib.rs", "mod a; use drive::X; mod board { pub fn f() {} } fn g() { board::f(); }"),
        ("a.rs", "fn f(_: servo::Y) {}"),
    ];
    let named = made_up(&files).names_of(&["drive", "servo", "board", "sercos"]);
    assert_eq!(named.into_iter().collect::<Vec<_>>(), ["drive", "servo"]);
}

/// Boards that stand in for the real one where the firmware runs on a PC.
const STAND_INS: [&str; 5] = [
    "firmware/servo/src/motor/example.rs",
    "firmware/servo/tests/machine_bench/stage.rs",
    "firmware/drive/src/service/rig.rs",
    "tests/bench/src/motor_side.rs",
    "tests/garbage/src/configuration.rs",
];

#[test]
fn the_boards_of_the_tests_measure_temperatures_as_the_board_does() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let inputs = |file: &str| -> Vec<String> {
        let text = std::fs::read_to_string(repository.join(file)).unwrap();
        let lines = text.lines().map(|line| line.trim().trim_start_matches("pub(crate) ").to_owned());
        let mut inputs: Vec<String> =
            lines.filter(|line| line.starts_with("const DIVIDER:") || line.starts_with("thermometers: &")).collect();
        inputs.sort_unstable();
        inputs
    };
    let board = inputs("board/src/facts.rs");
    assert_eq!(board.len(), 2, "{board:?}");
    for file in STAND_INS {
        assert_eq!(inputs(file), board, "{file} has another divider or sensor than board/src/facts.rs");
    }
}

#[test]
fn the_amplifiers_of_the_tests_are_that_of_the_board() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let ratings = |file: &str| -> Vec<String> {
        let text = std::fs::read_to_string(repository.join(file)).unwrap();
        let from = text.find("Amplifier {\n    peak_current: ").unwrap_or_else(|| panic!("{file} has no amplifier"));
        text[from..].lines().skip(1).take_while(|line| *line != "};").map(ToOwned::to_owned).collect()
    };
    let board = ratings("board/src/facts.rs");
    assert_eq!(board.len(), 13, "{board:?}");
    for file in &STAND_INS[2..] {
        assert_eq!(ratings(file), board, "{file} has another amplifier than board/src/facts.rs");
    }
}
