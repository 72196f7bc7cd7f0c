//! Defects made by hand: the patches of tests/defects, each with what must see it.
//!
//! A patch begins with lines of `# `: `# test: NAME`, once for each test that must turn red, or `# compiler: TEXT`, part of the error with which it
//! must not build; and `# why: SENTENCE`, what it would do to a machine. Then comes what `git diff` makes.

use crate::workspace;
use anyhow::{Context, Result, bail, ensure};
use std::path::PathBuf;

/// Where the patches are.
pub(super) const FOLDER: &str = "tests/defects";

/// One defect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Defect {
    /// Of its file, without the extension.
    pub(super) name: String,
    pub(super) expected: Expected,
    /// What it would do to a machine.
    pub(super) why: String,
    pub(super) patch: PathBuf,
}

/// What sees a defect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Expected {
    /// Each of these tests turns red.
    Tests(Vec<String>),
    /// It does not compile, and this is part of the reason.
    Compiler(String),
}

impl std::fmt::Display for Expected {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tests(names) => formatter.write_str(&names.join(", ")),
            Self::Compiler(text) => write!(formatter, "the compiler: {text}"),
        }
    }
}

/// All defects of the repository, by name.
pub(super) fn all() -> Result<Vec<Defect>> {
    let folder = workspace::root().join(FOLDER);
    let mut defects = Vec::new();
    for entry in std::fs::read_dir(&folder).with_context(|| format!("cannot read {FOLDER}"))? {
        let patch = entry.with_context(|| format!("cannot read {FOLDER}"))?.path();
        let text = std::fs::read_to_string(&patch).with_context(|| format!("cannot read {}", patch.display()))?;
        let name = patch.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let Some(name) = name.strip_suffix(".patch") else { bail!("{FOLDER}/{name} is no patch; remove it") };
        defects.push(parse(name, &text, patch.clone()).with_context(|| format!("{FOLDER}/{name}.patch"))?);
    }
    defects.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(defects)
}

fn parse(name: &str, text: &str, patch: PathBuf) -> Result<Defect> {
    let (mut tests, mut compiler, mut why) = (Vec::new(), None, None);
    for line in text.lines().map_while(|line| line.strip_prefix("# ")) {
        let (key, value) = line.split_once(": ").context("a line of the head is no `# key: value`")?;
        let value = value.trim().to_owned();
        ensure!(!value.is_empty(), "`{key}` says nothing");
        match key {
            "test" => tests.push(value),
            "compiler" => ensure!(compiler.replace(value).is_none(), "`compiler` stands there twice"),
            "why" => ensure!(why.replace(value).is_none(), "`why` stands there twice"),
            _ => bail!("`{key}` is none of `test`, `compiler` and `why`"),
        }
    }
    let why = why.context("`# why: ` is missing: what would it do to a machine?")?;
    let expected = match (tests.is_empty(), compiler) {
        (false, None) => Expected::Tests(tests),
        (true, Some(text)) => Expected::Compiler(text),
        _ => bail!("either `# test: NAME` or `# compiler: TEXT` must say what sees it"),
    };
    ensure!(text.contains("\ndiff --git "), "there is no diff in it");
    Ok(Defect { name: name.to_owned(), expected, why, patch })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    const DIFF: &str = "diff --git a/board/src/lib.rs b/board/src/lib.rs\n";

    fn read(head: &str) -> Result<Defect> {
        parse("name", &format!("{head}{DIFF}"), PathBuf::new())
    }

    #[test]
    fn a_head_says_what_sees_the_defect_and_what_it_would_do() {
        let two = read("# test: qemu::one\n# test: qemu::two\n# why: It falls.\n").unwrap();
        assert_eq!(two.expected, Expected::Tests(vec!["qemu::one".into(), "qemu::two".into()]));
        assert_eq!(two.why, "It falls.");
        let compiler = read("# compiler: evaluation panicked: a: b\n# why: It burns.\n").unwrap();
        assert_eq!(compiler.expected, Expected::Compiler("evaluation panicked: a: b".into()));
    }

    #[test]
    fn a_head_that_leaves_something_open_is_refused_with_the_reason() {
        for (head, reason) in [
            ("# why: It falls.\n", "must say what sees it"),
            ("# test: one\n", "`# why: ` is missing"),
            ("# test: one\n# compiler: two\n# why: It falls.\n", "must say what sees it"),
            ("# test: one\n# why: a\n# why: b\n", "twice"),
            ("# tset: one\n# why: It falls.\n", "`tset` is none"),
            ("# free words\n", "no `# key: value`"),
            ("# test:  \n# why: It falls.\n", "`test` says nothing"),
        ] {
            let error = format!("{:#}", read(head).unwrap_err());
            assert!(error.contains(reason), "{head:?}: {error}");
        }
        assert!(parse("name", "# test: one\n# why: It falls.\n", PathBuf::new()).is_err(), "no diff");
    }

    #[test]
    fn every_patch_says_what_sees_it_and_applies() {
        let defects = all().unwrap();
        assert!(defects.len() >= 60, "only {} defects", defects.len());
        for defect in &defects {
            let mut git = Command::new("git");
            git.args(["apply", "--check"]).arg(&defect.patch).current_dir(workspace::root());
            let output = git.output().unwrap();
            assert!(output.status.success(), "{}: {}", defect.name, String::from_utf8_lossy(&output.stderr));
        }
    }
}
