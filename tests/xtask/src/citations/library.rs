//! What there is to be cited.

use super::place::Place;
use super::text::Text;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The works' places, and the repository.
pub(super) struct Library {
    root: PathBuf,
    places: HashSet<(&'static str, Place)>,
    chip: String,
    documents: Vec<String>,
}

impl Library {
    pub(super) fn open(root: &Path, texts: &[Text]) -> Self {
        let read = |name: &str| std::fs::read_to_string(root.join("docs/reference").join(name)).unwrap();
        let (protocol, chip, papers) = (read("sercos2.md"), read("sercon816.md"), read("papers.md"));
        let mut places = HashSet::new();
        places.extend(headings(&protocol).into_iter().map(|place| ("sercos2.md", place)));
        places.extend(headings(&chip).into_iter().map(|place| ("sercon816.md", place)));
        let rows = chip.lines().filter_map(|line| line.strip_prefix("| G")?.split(' ').next()?.parse().ok());
        places.extend(rows.map(|number| ("sercon816.md", Place::Open(number))));
        for work in ["IGS", "Gao", "RM0090"] {
            let rows = papers.lines().filter_map(|line| line.strip_prefix("| ")?.strip_prefix(work));
            places.extend(rows.flat_map(listed).map(|place| (work, place)));
        }
        let documents = texts.iter().map(|text| text.path.clone()).filter(|path| path.ends_with(".md")).collect();
        Self { root: root.into(), places, chip, documents }
    }

    /// Whether the work has this place.
    pub(super) fn has(&self, work: &str, place: &Place) -> bool {
        match place {
            // Registers are described throughout the chip's reference.
            Place::Register(name) => work == "sercon816.md" && self.chip.contains(name.as_str()),
            place => self.places.iter().any(|(of, there)| *of == work && there == place),
        }
    }

    /// Whether there is a Markdown file of this name, whatever its folder.
    pub(super) fn has_document(&self, name: &str) -> bool {
        self.documents
            .iter()
            .any(|path| path.strip_suffix(name).is_some_and(|folder| folder.is_empty() || folder.ends_with('/')))
            || self.root.join(name).is_file()
    }

    /// Whether the repository has this file or folder.
    pub(super) fn has_path(&self, path: &str) -> bool {
        self.root.join(path).exists()
    }

    /// Follows a link out of a document.
    ///
    /// # Errors
    /// What is not there: the file, or the heading in it.
    pub(super) fn follow(&self, from: &str, target: &str) -> Result<(), String> {
        let (file, heading) = target.split_once('#').map_or((target, None), |(file, heading)| (file, Some(heading)));
        let from = self.root.join(from);
        let path = if file.is_empty() { from } else { from.parent().unwrap_or(&self.root).join(file) };
        if !path.exists() {
            return Err(format!("{file} is not in the repository"));
        }
        let Some(heading) = heading else { return Ok(()) };
        let document = std::fs::read_to_string(&path).map_err(|error| format!("{file}: {error}"))?;
        let there = document.lines().filter(|line| line.starts_with('#')).any(|line| anchor(line) == heading);
        if there { Ok(()) } else { Err(format!("{file} has no heading #{heading}")) }
    }
}

/// Numbers of the headings (`## 4. Title`, `### 4.1 Title`, `## Appendix A`), of paragraphs (`10.2 FCS`), and of a section's list (`3. Walk`).
fn headings(document: &str) -> HashSet<Place> {
    let mut places = HashSet::new();
    let mut section = String::new();
    for line in document.lines() {
        let title = line.trim_start_matches('#').trim_start();
        let is_heading = line.starts_with("##");
        if let Some(letter) = title.strip_prefix("Appendix ").filter(|_| is_heading) {
            places.extend(letter.chars().next().map(Place::Appendix));
        }
        let (number, _) = title.split_once(' ').unwrap_or((title, ""));
        let digits = number.trim_end_matches('.');
        if digits.is_empty() || !digits.split('.').all(|part| part.parse::<u16>().is_ok()) {
            continue;
        }
        if is_heading {
            places.insert(Place::Section(digits.into()));
            section = digits.into();
        } else if number.ends_with('.') && !digits.contains('.') {
            places.insert(Place::Section(format!("{section}.{digits}")));
        } else if digits.split_once('.').is_some_and(|(major, _)| major == section) {
            places.insert(Place::Section(digits.into()));
        }
    }
    places
}

/// The places that a row of the page of papers lists: ` 4.2.2.1 | a to f | ...`, ` table 1 | ...`.
fn listed(row: &str) -> Vec<Place> {
    let mut cells = row.split('|').map(str::trim);
    let place = cells.next().unwrap_or_default();
    for kind in ["table", "figure"] {
        if let Some(number) = place.strip_prefix(kind) {
            return vec![Place::Numbered(kind, number.trim().into())];
        }
    }
    let mut places = vec![Place::Section(place.into())];
    if let Some((first, last)) = cells.next().and_then(|items| items.split_once(" to "))
        && let (Some(first), Some(last)) = (first.chars().next(), last.chars().next())
        && last.len_utf8() == 1
    {
        places.extend((first..=last).map(|letter| Place::Item(place.into(), letter)));
    }
    places
}

/// A heading's anchor, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let title = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = title.chars().filter(|character| character.is_alphanumeric() || " -_".contains(*character));
    kept.map(|character| if character == ' ' { '-' } else { character }).collect()
}
