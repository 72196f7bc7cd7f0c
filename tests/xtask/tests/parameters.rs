//! `cargo xtask parameters` as a user meets it: a drive that remembers in a file, exit codes, one clear line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), contents).unwrap();
    }

    /// Names of what lies in it, in order.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn parameters(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
        command.current_dir(self.0.path()).arg("parameters").args(arguments).output().unwrap()
    }

    /// What it prints, where it succeeds.
    #[track_caller]
    fn done(&self, arguments: &[&str]) -> String {
        let output = self.parameters(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// What it prints, and its last line on stderr, where it ends with this exit code.
    #[track_caller]
    fn ends_with(&self, code: i32, arguments: &[&str]) -> (String, String) {
        let output = self.parameters(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        let told = stderr.lines().last().unwrap_or_default().to_owned();
        (String::from_utf8(output.stdout).unwrap(), told)
    }
}

fn replaced(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

#[test]
fn a_drive_is_saved_changed_compared_loaded_and_compared_again() {
    let folder = Folder::new();
    let saved = folder.done(&["save", "press.toml", "--flash", "drive"]);
    assert!(saved.starts_with("saved: ") && saved.ends_with(", in press.toml\n"), "{saved}");
    assert_eq!(folder.names(), ["drive", "press.toml"]);
    assert_eq!(folder.done(&["compare", "press.toml", "--flash", "drive"]).split(' ').next(), Some("no"));

    // A drive that nobody has told anything is told all of it.
    folder.done(&["load", "press.toml", "--flash", "drive"]);
    let changed = replaced(&folder.text("press.toml"), "value = \"100.0000\"", "value = \"250.5\"");
    folder.write("changed.toml", &changed);
    let table =
        "IDN       name             changed.toml  drive\nS-0-0041  Homing velocity  250.5 rpm     100.0000 rpm\n";
    assert_eq!(folder.ends_with(1, &["compare", "changed.toml", "--flash", "drive"]).0, table);
    let loaded = folder.done(&["load", "changed.toml", "--flash", "drive"]);
    let [written, last] = loaded.lines().collect::<Vec<_>>()[..] else { panic!("{loaded}") };
    assert_eq!(written, "written: S-0-0041 Homing velocity = 250.5 rpm");
    assert!(last.contains(" 1 written, ") && last.ends_with("saved with S-0-0264"), "{last}");
    folder.done(&["compare", "changed.toml", "--flash", "drive"]);
    let row = "S-0-0041  Homing velocity  250.5000  rpm";
    assert!(folder.done(&["print", "S-0-0041", "--flash", "drive"]).ends_with(&format!("{row}\n")));
    assert!(folder.done(&["print", "--flash", "drive"]).lines().count() > 100);

    folder.done(&["save", "again.toml", "--flash", "drive"]);
    folder.done(&["save", "once more.toml", "--flash", "drive"]);
    assert_eq!(folder.text("again.toml"), folder.text("once more.toml"), "nothing in it tells when it was written");
    let table =
        "IDN       name             press.toml    again.toml\nS-0-0041  Homing velocity  100.0000 rpm  250.5000 rpm\n";
    assert_eq!(folder.ends_with(1, &["compare", "press.toml", "again.toml"]).0, table);
    folder.done(&["compare", "changed.toml", "again.toml"]);
}

#[test]
fn a_refused_load_fails_with_one_line_and_the_drive_keeps_what_it_had() {
    let folder = Folder::new();
    folder.done(&["save", "good.toml"]);
    folder.done(&["load", "good.toml", "--flash", "drive"]);
    let good = folder.text("good.toml");
    let language = "name = \"Language selection\"\nvalue = \"1\"";
    let bad = replaced(&good, "value = \"100.0000\"", "value = \"250.5\"");
    folder.write("bad.toml", replaced(&bad, language, &language.replace('1', "7")));
    let (printed, told) = folder.ends_with(1, &["load", "bad.toml", "--flash", "drive"]);
    assert_eq!(printed, "");
    assert!(told.starts_with("failed: S-0-0265 \"Language selection\" = 7: the drive refuses with 7007H"), "{told}");
    assert!(told.ends_with("S-0-0263 has brought back what was saved"), "{told}");
    folder.done(&["compare", "good.toml", "--flash", "drive"]);

    let more = format!("{good}\n[parameters.P-0-4000]\nname = \"Warp factor\"\nvalue = \"9\"\n");
    folder.write("more.toml", more);
    let (_, told) = folder.ends_with(1, &["load", "more.toml"]);
    assert!(told.contains("does not keep P-0-4000 \"Warp factor\""), "{told}");
    let loaded = folder.done(&["load", "more.toml", "--skip-unknown"]);
    assert!(loaded.starts_with("left out: P-0-4000 Warp factor"), "{loaded}");
}

#[test]
fn what_cannot_be_done_is_refused_in_one_line_before_a_drive_is_started() {
    let folder = Folder::new();
    folder.write("empty.toml", "");
    folder.write("short", [0xFF; 100]);
    folder.write("broken.toml", "form = 1\n[saved_from]\nmanufacturer_version = \"\n");
    for (arguments, cause) in [
        (&["load", "none.toml"][..], "cannot read none.toml"),
        (&["load", "empty.toml"], "empty.toml is no parameter file: no `form`"),
        (&["compare", "broken.toml"], "broken.toml is no parameter file: line 3: "),
        (&["compare", "empty.toml", "broken.toml"], "empty.toml is no parameter file"),
        (&["save", "x.toml", "--flash", "short"], "short has 100 bytes, the flash of a drive 262144"),
        (&["print", "S0041"], "'S0041' is no IDN; one reads S-0-0051"),
        (&["compare", "empty.toml", "empty.toml", "--flash", "drive"], "cannot be used with"),
        (&["save"], "<FILE>"),
        (&[], "see `cargo xtask --help`"),
    ] {
        let output = folder.parameters(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
        assert!(stderr.contains(cause), "{cause:?} expected in {stderr}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(folder.names(), ["broken.toml", "empty.toml", "short"], "nothing is left behind");
}

#[test]
fn a_file_that_cannot_be_written_is_told_and_leaves_nothing() {
    let folder = Folder::new();
    std::fs::create_dir_all(folder.path("place/inside")).unwrap();
    let (_, told) = folder.ends_with(2, &["save", "place"]);
    assert!(told.starts_with("error: cannot write ./place"), "{told}");
    assert_eq!(folder.names(), ["place"]);
    assert!(Path::new(&folder.path("place/inside")).is_dir());
}
