//! The command line as a user meets it: exit codes, one clear line, nothing half done.
//!
//! PATH is set to an empty folder where a tool shall be missing, so that nothing can be installed either.

use std::path::Path;
use std::process::{Command, Output};

fn xtask() -> Command {
    Command::new(env!("CARGO_BIN_EXE_xtask"))
}

/// The program on a machine that has no tools at all; Cargo is known to it, as always under `cargo xtask`.
fn xtask_without_tools(empty: &Path) -> Command {
    let mut command = xtask();
    command.env("PATH", empty).env("CARGO", env!("CARGO")).env_remove("QEMU");
    command
}

/// Exit code 2 and one line on stderr, nothing on stdout; gives the line.
#[track_caller]
fn refusal(output: &Output) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "one line expected: {stderr}");
    assert!(stderr.starts_with("error: "), "{stderr}");
    assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
    stderr
}

#[test]
fn the_help_is_as_written_down() {
    let mut text = String::new();
    for arguments in [
        &["--help"][..],
        &["build", "--help"],
        &["budget", "--help"],
        &["test", "--help"],
        &["fuzz", "--help"],
        &["demo", "--help"],
        &["replay", "--help"],
        &["slave-report", "--help"],
        &["manual", "--help"],
        &["faults", "--help"],
        &["explore", "--help"],
        &["mutants", "--help"],
        &["scope", "--help"],
        &["parameters", "--help"],
        &["parameters", "save", "--help"],
        &["parameters", "load", "--help"],
        &["parameters", "compare", "--help"],
        &["parameters", "print", "--help"],
        &["ring", "--help"],
        &["identity", "--help"],
        &["flash", "--help"],
    ] {
        let output = xtask().args(arguments).env("COLUMNS", "100").output().unwrap();
        assert!(output.status.success());
        text += &format!("$ cargo xtask {}\n{}\n", arguments.join(" "), String::from_utf8(output.stdout).unwrap());
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/help.txt");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let golden = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text, golden, "set UPDATE_GOLDEN=1 to accept the new text");
}

#[test]
fn bad_arguments_are_refused_in_one_line() {
    for (arguments, cause) in [
        (&["fly"][..], "unrecognized subcommand 'fly'"),
        (&["replay"], "<FILE>"),
        (&["replay", "x.tsv", "--on", "moon"], "invalid value 'moon'"),
        (&["slave-report", "--section", "colour"], "invalid value 'colour'"),
        (&["ring", "--drives", "1,0", "--chip-socket", "s"], "0 is not in 1..=254"),
        (&["ring", "--drives", "1,255", "--chip-socket", "s"], "255 is not in 1..=254"),
        (&["scope", "--signal", "F007"], "neither a data block of the drive"),
        (&["scope", "--pre-trigger", "2048"], "2048 is not in 0..=2047"),
        (&["scope", "--trigger-channel", "0"], "0 is not in 1..=4"),
        (&["explore", "--for", "1d"], "'1d' is no span of time"),
        (&["explore", "--lives", "0"], "0 is not in 1.."),
        (&["explore", "--life", "0xZ"], "'0xZ' is no seed"),
        (&["explore", "--for", "1s", "--lives", "5"], "cannot be used with"),
        (&["explore", "--shrink"], "--life"),
        (&["test", "--host", "--qemu"], "cannot be used with"),
        (&["fuzz", "--target", "moon"], "invalid value 'moon'"),
        (&["fuzz", "--runs", "0"], "0 is not in 1.."),
        (&["identity"], "<FILE>"),
        (&["identity", "x.toml", "--output", "x.bin", "--replace"], "cannot be used with"),
    ] {
        let line = refusal(&xtask().args(arguments).output().unwrap());
        assert!(line.contains(cause), "{cause:?} expected in {line}");
        assert!(line.contains("cargo xtask --help"), "{line}");
    }
}

#[test]
fn an_oscilloscope_order_that_no_drive_could_carry_out_is_refused_before_anything_runs() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, cause) in [
        (&["--signal", "F003", "--trigger-channel", "2"][..], "--trigger-channel 2, but there are 1 signals"),
        (
            &["--signal", "F003", "--signal", "F003", "--signal", "F003", "--signal", "F003", "--signal", "F003"],
            "5 signals",
        ),
        (&["--rpm", "10001"], "--rpm 10001, expected -10000 to 10000"),
        (&["--level", "nan"], "--level NaN is no number"),
    ] {
        let output = folder.path().join("plot");
        let line = refusal(&xtask().arg("scope").args(arguments).arg("--output").arg(&output).output().unwrap());
        assert!(line.contains(cause), "{cause:?} expected in {line}");
        assert!(!output.exists());
    }
}

#[test]
fn no_command_at_all_is_a_refusal() {
    let output = xtask().output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    refusal(&output);
}

#[test]
fn a_missing_qemu_is_named_with_the_command_that_installs_it() {
    let empty = tempfile::tempdir().unwrap();
    let output_folder = empty.path().join("report");
    let output = xtask_without_tools(empty.path()).arg("demo").arg("--output").arg(&output_folder).output().unwrap();
    let line = refusal(&output);
    assert!(line.contains("QEMU (qemu-system-arm) is not installed"), "{line}");
    assert!(line.contains("apt-get install -y qemu-system-arm"), "{line}");
    assert!(!output_folder.exists(), "nothing may be left half done");
}

#[test]
fn a_missing_target_is_named_with_the_command_that_installs_it() {
    let empty = tempfile::tempdir().unwrap();
    let line = refusal(&xtask_without_tools(empty.path()).arg("build").output().unwrap());
    assert!(line.contains("target thumbv7em-none-eabihf is not installed"), "{line}");
    assert!(line.contains("`rustup target add thumbv7em-none-eabihf`"), "{line}");
}

/// A board at a probe, as far as `probe-rs` tells of it: a program that keeps the sector in a file beside it.
struct Board {
    folder: tempfile::TempDir,
}

impl Board {
    fn new() -> Self {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("probe-rs");
        // read --chip C --format binary --output FILE b8 ADDRESS BYTES; download --chip C --binary-format bin --base-address A FILE; reset --chip C.
        let script = "#!/bin/sh\nhere=${0%/*}\necho \"$@\" >> $here/called\ncase $1 in\n  read) cp $here/sector $7 ;;\n  \
                      download) cp $8 $here/sector ;;\nesac\n";
        std::fs::write(&program, script).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        std::fs::write(folder.path().join("sector"), [0xFF; 80]).unwrap();
        Self { folder }
    }

    fn sector(&self) -> Vec<u8> {
        std::fs::read(self.folder.path().join("sector")).unwrap()
    }

    fn called(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("called")).unwrap_or_default()
    }

    fn identity(&self, sheet: &Path, more: &[&str]) -> Output {
        let path = std::env::join_paths([self.folder.path(), Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
        xtask().arg("identity").arg(sheet).args(more).env("PATH", path).output().unwrap()
    }
}

#[test]
fn an_identity_is_written_once_read_back_and_replaced_only_when_asked_to() {
    let sheet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/amplifier.toml");
    let board = Board::new();
    let output = board.identity(&sheet, &[]);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(told, "written and read back: SD 14-440 number 0001, 7.071 A for ever, 14.142 A at most, 440 V\n");
    assert!(output.status.success());
    let written = board.sector();
    assert_eq!((written.len(), &written[..4]), (80, b"SDPR".as_slice()));
    assert!(board.called().contains("download --chip STM32F407ZGTx --binary-format bin --base-address 0x080A0000 "));
    assert!(board.called().ends_with("reset --chip STM32F407ZGTx\n"), "{}", board.called());

    // The same again does nothing; another one is refused before anything is written.
    let again = board.identity(&sheet, &[]);
    assert!(again.status.success() && again.stdout.starts_with(b"there already: "));
    let other = board.folder.path().join("other.toml");
    let text = std::fs::read_to_string(&sheet).unwrap().replace("\"0001\"", "\"0002\"");
    std::fs::write(&other, text).unwrap();
    let line = refusal(&board.identity(&other, &[]));
    assert_eq!(line, "error: the board is SD 14-440 number 0001 already; --replace makes another one of it\n");
    assert_eq!(board.called().matches("download").count(), 1);
    assert_eq!(board.sector(), written);
    assert!(board.identity(&other, &["--replace"]).status.success());
    assert_ne!(board.sector(), written);

    // What nobody has written as a record is not overwritten by mistake either.
    std::fs::write(board.folder.path().join("sector"), [0x55; 80]).unwrap();
    let line = refusal(&board.identity(&sheet, &[]));
    assert!(line.contains("there is something else (production record: checksum 55555555H"), "{line}");
}

#[test]
fn a_data_sheet_that_is_wrong_is_refused_before_the_board_is_asked_and_leaves_no_file() {
    let board = Board::new();
    let sheet = board.folder.path().join("sheet.toml");
    let good =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/amplifier.toml")).unwrap();
    std::fs::write(&sheet, good.replace("overvoltage = 440", "overvoltage = 800")).unwrap();
    let output = board.folder.path().join("record.bin");
    let told = "sheet.toml: the firmware does not take it: P-0-0105: overvoltage in V of 800, expected 1 to 490";
    for more in [&[][..], &["--output", output.to_str().unwrap()]] {
        let line = refusal(&board.identity(&sheet, more));
        assert!(line.contains(told), "{line}");
    }
    assert!(!output.exists() && board.called().is_empty());
    std::fs::write(&sheet, good).unwrap();
    assert!(board.identity(&sheet, &["--output", output.to_str().unwrap()]).status.success());
    assert_eq!(std::fs::read(&output).unwrap().len(), 80);
    assert!(board.called().is_empty());
    let line = refusal(&board.identity(&board.folder.path().join("none.toml"), &[]));
    assert!(line.contains("cannot read") && line.contains("none.toml"), "{line}");
}

#[test]
fn a_missing_probe_rs_is_named_before_anything_is_built() {
    let empty = tempfile::tempdir().unwrap();
    let line = refusal(&xtask_without_tools(empty.path()).arg("flash").output().unwrap());
    assert!(line.contains("cargo install probe-rs-tools"), "{line}");
}

#[test]
fn a_missing_cargo_fuzz_is_named_with_the_command_that_installs_it() {
    let empty = tempfile::tempdir().unwrap();
    let mut command = xtask_without_tools(empty.path());
    // Cargo looks for its subcommands there, too.
    let line = refusal(&command.env("CARGO_HOME", empty.path()).args(["fuzz", "--no-install"]).output().unwrap());
    assert!(line.contains("cargo-fuzz is not installed"), "{line}");
    assert!(line.contains("cargo install cargo-fuzz --locked"), "{line}");
}

#[cfg(unix)]
#[test]
fn an_old_qemu_is_refused_with_both_versions() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("qemu-system-arm");
    std::fs::write(&program, "#!/bin/sh\necho 'QEMU emulator version 5.2.0 (Debian)'\n").unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let line = refusal(&xtask_without_tools(folder.path()).arg("demo").output().unwrap());
    assert!(line.contains("QEMU 5.2 is too old, 7.2 or newer is needed"), "{line}");
}

/// A program in place of QEMU that knows its version and nothing else.
#[cfg(unix)]
fn broken_qemu(folder: &Path) -> std::path::PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let program = folder.join("broken");
    let script = "#!/bin/sh\n[ \"$1\" = --version ] && echo 'QEMU emulator version 9.9.9' && exit\n\
                  echo 'no plugins are known here' >&2\nexit 3\n";
    std::fs::write(&program, script).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    program
}

#[cfg(unix)]
#[test]
#[ignore = "needs the ELF: cargo xtask test"]
fn a_qemu_that_ends_at_once_is_told_in_one_line_and_leaves_no_report() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report");
    let mut command = xtask();
    let output = command
        .args(["demo", "--no-install", "--output"])
        .arg(&report)
        .env("QEMU", broken_qemu(folder.path()))
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error")).collect();
    let [line] = errors[..] else { panic!("one error expected: {stderr}") };
    for cause in ["drive 2", "QEMU ended unexpectedly", "exit status: 3", "no plugins are known here"] {
        assert!(line.contains(cause), "{cause:?} expected in {line}");
    }
    assert!(!report.exists(), "nothing may be left half done");
}

#[test]
fn a_qemu_that_is_named_and_not_there_is_refused_before_anything_is_built() {
    let empty = tempfile::tempdir().unwrap();
    let mut command = xtask_without_tools(empty.path());
    let line = refusal(&command.arg("demo").env("QEMU", "no/such/qemu").output().unwrap());
    assert!(line.contains("`no/such/qemu --version` gives no version; unset QEMU"), "{line}");
}

#[test]
fn a_malformed_recording_is_refused_with_its_line_before_anything_else_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bad.tsv");
    let good = "0\tMST\tff 00\t87 f0\t3f81eabd6be03f\n";
    for (text, cause) in [
        ("", "no telegram"),
        ("# only a comment\n", "no telegram"),
        (&format!("{good}1\tMST\tff 00\n"), "line 2: 3 columns, expected 5"),
        (&format!("{good}1\tMST\tff 00\t87 f1\t3f81eabd6be03f\n"), "line 2: frame check sequence"),
        (&format!("# comment\n{good}5\tMST\tff 00\t87 f0\t3f81eabd6be03f\n"), "line 3: cycle 5, expected 1"),
    ] {
        std::fs::write(&file, text).unwrap();
        for on in ["host", "qemu"] {
            let output =
                xtask_without_tools(folder.path()).arg("replay").arg(&file).args(["--on", on]).output().unwrap();
            let line = refusal(&output);
            assert!(line.contains(cause), "{cause:?} expected in {line}");
            assert!(line.contains("bad.tsv"), "{line}");
        }
    }
}

#[test]
fn a_recording_that_is_not_there_is_named() {
    let line = refusal(&xtask().args(["replay", "nowhere/at-all.tsv"]).output().unwrap());
    assert!(line.contains("nowhere/at-all.tsv") && line.contains("No such file"), "{line}");
}

#[test]
fn a_recording_that_is_not_text_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("picture.tsv");
    std::fs::write(&file, [0xFF, 0x00, 0x9D]).unwrap();
    refusal(&xtask().arg("replay").arg(&file).output().unwrap());
}
