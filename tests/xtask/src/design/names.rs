//! What the pictures name is in the code, and what is in the code is in the pictures.

use super::{PAGE, page};
use crate::workspace;
use std::path::Path;

/// All source text below a folder.
fn source(folder: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &source(&path);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            text += &std::fs::read_to_string(path).unwrap();
        }
    }
    text
}

/// The classes of the page's class diagrams, each with the crate that it stands in.
fn classes(page: &str) -> Vec<(String, String)> {
    let diagrams = page.split("classDiagram\n").skip(1);
    let lines = diagrams.flat_map(|diagram| diagram.split("```").next().unwrap_or_default().lines());
    let (mut crate_name, mut classes) = (String::new(), Vec::new());
    for line in lines.map(str::trim) {
        if let Some(name) = line.strip_prefix("namespace ") {
            crate_name = name.trim_end_matches('{').trim().to_owned();
        } else if let Some(name) = line.strip_prefix("class ") {
            let name = name.split([' ', '{', '[', '~']).next().unwrap();
            classes.push((crate_name.clone(), name.to_owned()));
        }
    }
    classes
}

#[test]
fn every_class_of_the_picture_is_a_type_of_its_crate() {
    let classes = classes(&page());
    assert!(classes.len() > 25, "only {} classes were found", classes.len());
    for (crate_name, class) in classes {
        let folder = if crate_name == "board" { "board/src".to_owned() } else { format!("firmware/{crate_name}/src") };
        let source = source(&workspace::root().join(folder));
        let is_there = ["struct", "enum", "trait"].iter().any(|kind| {
            source.match_indices(&format!("{kind} {class}")).any(|(offset, found)| {
                !source[offset + found.len()..].starts_with(|next: char| next.is_ascii_alphanumeric() || next == '_')
            })
        });
        assert!(is_there, "{PAGE}: {crate_name} has no type {class}");
    }
}

/// Names of the tasks that the application binds.
fn tasks() -> Vec<String> {
    let source = std::fs::read_to_string(workspace::root().join("firmware/app/src/main.rs")).unwrap();
    let bound = source.split("#[task(").skip(1);
    let name = |rest: &str| rest.split_once("\n    fn ").unwrap().1.split('(').next().unwrap().to_owned();
    bound.map(name).collect()
}

#[test]
fn every_task_is_in_the_picture_of_the_architecture() {
    let picture = std::fs::read_to_string(workspace::root().join("docs/architecture.svg")).unwrap();
    let tasks = tasks();
    assert_eq!(tasks.len(), 10, "{tasks:?}");
    for task in tasks {
        // One word for the two lines of the chip.
        let shown = if task.starts_with("chip_interrupt") { "chip interrupt" } else { &task };
        assert!(picture.contains(shown), "docs/architecture.svg lacks {task}");
    }
}
