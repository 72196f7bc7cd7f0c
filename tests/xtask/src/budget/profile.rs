//! Where the instructions of one task go: a tree of functions, those that the compiler has inlined among them.

use addr2line::Loader;
use anyhow::{Result, anyhow};
use emulator::Profile;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;
use std::path::Path;

/// A function below those that lead to it.
#[derive(Debug, Default)]
struct Node {
    /// Instructions of its own, and with all that is below it.
    own: u64,
    all: u64,
    below: BTreeMap<String, Self>,
}

/// Functions of this workspace and its libraries that take fewer instructions than this an activation are not shown by themselves.
const SHOWN_FROM: f64 = 2.0;

/// The tree as text: instructions of an activation on average with all below, alone, and the function.
pub(crate) fn tree(elf: &Path, profile: &Profile, activations: u64) -> Result<String> {
    let mut frames = Frames { loader: loader(elf)?, known: HashMap::new() };
    let mut root = Node::default();
    for (returns, places) in profile {
        let mut calls = Vec::new();
        for &address in returns {
            // The call itself ends just before the address to which it returns.
            calls.extend_from_slice(frames.at(address.saturating_sub(1))?);
        }
        for (&address, &times) in places {
            let path = calls.iter().chain(frames.at(address)?);
            root.add(path, times);
        }
    }
    let mut text = String::from("   with all    alone\n");
    root.write(&mut text, activations.max(1), 0);
    Ok(text)
}

fn loader(elf: &Path) -> Result<Loader> {
    Loader::new(elf).map_err(|error| anyhow!("the program's line numbers cannot be read: {error}"))
}

/// The functions around an address, the outermost first.
struct Frames {
    loader: Loader,
    known: HashMap<u32, Vec<String>>,
}

impl Frames {
    fn at(&mut self, address: u32) -> Result<&[String]> {
        if !self.known.contains_key(&address) {
            let names = self.names(address)?;
            self.known.insert(address, names);
        }
        Ok(self.known.get(&address).map_or(&[], Vec::as_slice))
    }

    fn names(&self, address: u32) -> Result<Vec<String>> {
        let unreadable = |error: &dyn std::fmt::Display| anyhow!("the line of {address:#x} cannot be read: {error}");
        let mut frames = self.loader.find_frames(u64::from(address)).map_err(|error| unreadable(&error))?;
        let mut names = Vec::new();
        while let Some(frame) = frames.next().map_err(|error| unreadable(&error))? {
            let file = frame.location.as_ref().and_then(|location| location.file).unwrap_or_default();
            let name = frame.function.as_ref().and_then(|function| function.raw_name().ok());
            // What the language itself brings along belongs to whoever uses it.
            if let Some(name) = name.filter(|_| !file.contains("/library/core/")) {
                names.push(format!("{:#}", rustc_demangle::demangle(&name)));
            }
        }
        names.reverse();
        Ok(names)
    }
}

impl Node {
    fn add<'a>(&mut self, mut path: impl Iterator<Item = &'a String>, times: u64) {
        self.all += times;
        match path.next() {
            None => self.own += times,
            Some(name) => self.below.entry(name.clone()).or_default().add(path, times),
        }
    }

    fn write(&self, text: &mut String, activations: u64, depth: usize) {
        let mut below: Vec<(&String, &Self)> = self.below.iter().collect();
        below.sort_by_key(|(name, node)| (std::cmp::Reverse(node.all), *name));
        for (name, node) in below {
            let [all, own] = [node.all, node.own].map(|count| count as f64 / activations as f64);
            if all >= SHOWN_FROM {
                _ = writeln!(text, "{all:11.1} {own:8.1}  {:indent$}{name}", "", indent = 2 * depth);
                node.write(text, activations, depth + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_adds_up_what_is_below_and_shows_the_dearest_first() {
        let mut root = Node::default();
        let path = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<String>>();
        for (names, times) in [(&["a", "b"][..], 10), (&["a"], 3), (&["a", "c"], 30), (&["d"], 3), (&["a", "b"], 2)] {
            root.add(path(names).iter(), times);
        }
        let mut text = String::new();
        root.write(&mut text, 2, 0);
        let expected = "       22.5      1.5  a\n       15.0     15.0    c\n        6.0      6.0    b\n";
        assert_eq!(text, expected, "d takes 1.5: too little");
    }
}
