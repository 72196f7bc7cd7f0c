//! Places within a cited work, as they are written behind its name.

use std::fmt;

/// One place.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Place {
    /// `4.2.1`.
    Section(String),
    /// The letter of an item in the section before it.
    Item(String, char),
    /// `Appendix A`.
    Appendix(char),
    /// A G-number of sercon816.md 14.
    Open(u32),
    /// A register of the chip, `0DH`.
    Register(String),
    /// `table 1` or `figure 3`.
    Numbered(&'static str, String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Section(number) => f.write_str(number),
            Self::Item(section, letter) => write!(f, "{section} {letter}"),
            Self::Appendix(letter) => write!(f, "Appendix {letter}"),
            Self::Open(number) => write!(f, "G{number}"),
            Self::Register(name) => f.write_str(name),
            Self::Numbered(kind, number) => write!(f, "{kind} {number}"),
        }
    }
}

/// Where a work is named, and which of its places stand behind the name.
pub(super) fn places_after(content: &str, work: &str) -> Vec<(usize, Vec<Place>)> {
    let named = content.match_indices(work).filter(|(offset, _)| is_word(content, *offset, work.len()));
    named.map(|(offset, _)| (offset, places(&content[offset + work.len()..]))).collect()
}

/// Each `G` with a number behind it that is a word of its own.
pub(super) fn g_numbers(content: &str) -> Vec<(usize, u32)> {
    let found = content.match_indices('G').filter_map(|(offset, _)| {
        let digits = content[offset + 1..].bytes().take_while(u8::is_ascii_digit).count();
        let number = content[offset + 1..offset + 1 + digits].parse().ok()?;
        is_word(content, offset, 1 + digits).then_some((offset, number))
    });
    found.collect()
}

fn is_word(content: &str, offset: usize, length: usize) -> bool {
    let part = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    let before = offset.checked_sub(1).is_some_and(|before| part(content.as_bytes()[before]));
    let after = content.as_bytes().get(offset + length).copied().is_some_and(part);
    !before && !after
}

/// The places at the beginning of a text.
fn places(behind: &str) -> Vec<Place> {
    let mut places = Vec::new();
    let mut rest = behind.trim_start_matches(['`', ',']);
    let mut kind = None;
    while let Some(next) = rest.strip_prefix(' ') {
        rest = next.trim_start();
        for (word, meaning) in [
            ("sections ", None),
            ("section ", None),
            ("register maps of ", None),
            ("Appendix ", Some("Appendix")),
            ("appendix ", Some("Appendix")),
            ("table ", Some("table")),
            ("figure ", Some("figure")),
            ("figures ", Some("figure")),
        ] {
            if let Some(next) = rest.strip_prefix(word) {
                (rest, kind) = (next, meaning);
            }
        }
        let length = rest.find(|character: char| !character.is_ascii_alphanumeric() && character != '.');
        let (token, next) = rest.split_at(length.unwrap_or(rest.len()));
        let Some(place) = place(token.trim_end_matches('.'), kind, places.last()) else { break };
        places.push(place);
        if token.ends_with('.') {
            break;
        }
        rest = [", ", " and ", " to "].iter().find(|joint| next.starts_with(**joint)).map_or(next, |joint| {
            // The blank is left: what follows is looked at in the same way.
            &next[joint.len() - 1..]
        });
    }
    places
}

fn place(token: &str, kind: Option<&'static str>, before: Option<&Place>) -> Option<Place> {
    let letter = || token.chars().next().filter(|_| token.len() == 1);
    let is_number = !token.is_empty() && token.split('.').all(|part| part.parse::<u16>().is_ok());
    if let Some(numbered @ ("table" | "figure")) = kind
        && is_number
    {
        return Some(Place::Numbered(numbered, token.into()));
    }
    if is_number {
        return Some(Place::Section(token.into()));
    }
    if let Some(number) = token.strip_prefix('G').and_then(|number| number.parse().ok()) {
        return Some(Place::Open(number));
    }
    if token.len() == 3 && token.ends_with('H') && u8::from_str_radix(&token[..2], 16).is_ok() {
        return Some(Place::Register(token.into()));
    }
    match (letter()?, before) {
        ('A' | 'B' | 'C', _) => Some(Place::Appendix(letter()?)),
        ('b'..='h', Some(Place::Section(section) | Place::Item(section, _))) => {
            Some(Place::Item(section.clone(), letter()?))
        }
        // A lone `a` is an article, except where items go on behind it.
        ('a', Some(Place::Section(section))) if section.split('.').count() > 3 => {
            Some(Place::Item(section.clone(), 'a'))
        }
        _ => None,
    }
}
