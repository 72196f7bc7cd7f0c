//! Every example of the repository, run: what they print is for their readers, what they assert holds.

#![allow(missing_docs, reason = "they are documents themselves")]

#[path = "../../../firmware/servo/examples/position_loop.rs"]
mod position_loop;
#[path = "../../ring/examples/run_up.rs"]
mod run_up;
#[path = "../../../firmware/sercos/examples/service_request.rs"]
mod service_request;
#[path = "../../../firmware/sercon816/examples/slave_on_a_bus.rs"]
mod slave_on_a_bus;

#[test]
fn a_step_of_the_service_channel_is_answered() {
    service_request::main();
}

#[test]
fn a_slave_is_set_up_on_a_bus() {
    slave_on_a_bus::main();
}

#[test]
fn an_axis_follows_a_master() {
    position_loop::main();
}

#[test]
fn a_ring_of_two_drives_runs_up() {
    run_up::main();
}

/// A file that is no module here would never be run.
#[test]
fn every_example_is_run_here() {
    let root = crate::workspace::root();
    let here = std::fs::read_to_string(root.join("tests/xtask/src/examples.rs")).unwrap();
    let mut found = 0;
    for folder in ["firmware", "tests"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let examples = entry.unwrap().path().join("examples");
            for example in std::fs::read_dir(&examples).into_iter().flatten() {
                let path = example.unwrap().path();
                if path.is_dir() {
                    continue;
                }
                // A tool that asks what to do is no example to be read.
                if std::fs::read_to_string(&path).unwrap().contains("env::args") {
                    continue;
                }
                let name = path.file_stem().unwrap().to_str().unwrap();
                let line = format!("mod {name};");
                assert!(here.lines().any(|found| found == line), "{}: {line} is missing", examples.display());
                found += 1;
            }
        }
    }
    assert!(found >= 4, "{found} examples were found");
}
