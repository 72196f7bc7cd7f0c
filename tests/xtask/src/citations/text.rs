//! A file as its reader sees it: comments without their marks, lines run together.

use super::place::Place;
use std::path::Path;

/// A file's text.
pub(super) struct Text {
    /// From the root of the repository, with `/`.
    pub(super) path: String,
    /// Its lines, joined by blanks; in Rust files without the marks of comments.
    pub(super) content: String,
    /// Where in `content` each line begins.
    lines: Vec<usize>,
}

impl Text {
    /// Rust and Markdown files; `None` for all others.
    pub(super) fn read(root: &Path, path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        if !["rs", "md"].contains(&extension) {
            return None;
        }
        // The file with the examples of what is wrong.
        if path.ends_with("xtask/src/citations.rs") || path.ends_with("xtask/src/citations/text.rs") {
            return None;
        }
        let name = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
        Some(Self::new(&name, &std::fs::read_to_string(path).unwrap()))
    }

    pub(super) fn new(path: &str, raw: &str) -> Self {
        let (mut content, mut lines) = (String::new(), Vec::new());
        for line in raw.lines() {
            lines.push(content.len());
            let mut line = line.trim();
            if path.ends_with(".rs") {
                for mark in ["//!", "///", "//"] {
                    line = line.strip_prefix(mark).unwrap_or(line);
                }
            }
            content += line.trim();
            content.push(' ');
        }
        Self { path: path.into(), content, lines }
    }

    /// The number of the line that a place of `content` is in, from 1.
    pub(super) fn line(&self, offset: usize) -> usize {
        self.lines.partition_point(|begin| *begin <= offset)
    }

    /// The file's name without its folders.
    pub(super) fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or(&self.path)
    }

    /// Names of Markdown files, with the folders that stand before them.
    pub(super) fn documents(&self) -> Vec<(usize, &str)> {
        let part = |character: char| character.is_ascii_alphanumeric() || "_-./".contains(character);
        let mut found = Vec::new();
        for (end, _) in self.content.match_indices(".md") {
            let end = end + ".md".len();
            let begin = self.content[..end].rfind(|character| !part(character)).map_or(0, |before| before + 1);
            let name = self.content[begin..end].trim_start_matches(['.', '/']);
            let ends = !self.content[end..].starts_with(|next: char| next.is_ascii_alphanumeric() || next == '_');
            // `".md"` alone is an ending, not a name.
            if ends && name.len() > "md".len() && !self.content[..begin].ends_with(['{', '}', '<']) {
                found.push((begin, name));
            }
        }
        found
    }

    /// Targets of Markdown links within the repository.
    pub(super) fn links(&self) -> Vec<(usize, &str)> {
        if !self.path.ends_with(".md") {
            return Vec::new();
        }
        let found = self.content.match_indices("](").filter_map(|(offset, opening)| {
            let target = &self.content[offset + opening.len()..];
            let target = &target[..target.find(')')?];
            let outside = target.contains("://") || target.contains(char::is_whitespace) || target.is_empty();
            (!outside).then_some((offset, target))
        });
        found.collect()
    }

    /// Paths of this repository that stand in backquotes.
    pub(super) fn quoted_paths(&self) -> Vec<(usize, &str)> {
        if !self.path.ends_with(".md") || self.path.ends_with("CHANGELOG.md") || self.path.contains("reference/") {
            return Vec::new();
        }
        let found = ["`firmware/", "`board/", "`tests/", "`docs/", "`fuzz/", "`.ci/"].iter().flat_map(|begin| {
            self.content.match_indices(begin).filter_map(|(offset, _)| {
                let path = &self.content[offset + 1..];
                let path = &path[..path.find('`')?];
                let is_path = !path.contains([' ', '*', '<', '$', '{']);
                is_path.then_some((offset, path))
            })
        });
        found.collect()
    }

    /// Sections of its own that one of the two references cites.
    pub(super) fn own_sections(&self) -> Vec<(usize, Place)> {
        if !["sercos2.md", "sercon816.md"].contains(&self.name()) {
            return Vec::new();
        }
        let found = ["§", "section ", "(s.", " s."].iter().flat_map(|mark| {
            self.content.match_indices(mark).filter_map(|(offset, _)| {
                let behind = &self.content[offset + mark.len()..];
                let length = behind.find(|next: char| !next.is_ascii_digit() && next != '.').unwrap_or(behind.len());
                let number = behind[..length].trim_end_matches('.');
                (!number.is_empty()).then(|| (offset, Place::Section(number.into())))
            })
        });
        found.collect()
    }
}
