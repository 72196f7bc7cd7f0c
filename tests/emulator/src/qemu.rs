//! The QEMU process.

use std::ffi::OsString;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::rc::Rc;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::cpu::OneCpu;
use crate::link::{Link, PAGE};
use crate::{EmulatorError, GuestConfiguration};

/// Longest wait for a message. QEMU runs some 10^8 instructions a second, and the guest speaks at least every 2^31.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often the process is looked at meanwhile.
const LOOK: Duration = Duration::from_secs(1);

/// A running QEMU; killed when dropped.
#[derive(Debug)]
pub(crate) struct Qemu {
    child: Child,
    link: Link,
    directory: TempDir,
    _cpu: Option<Rc<OneCpu>>,
}

impl Qemu {
    /// Starts QEMU with the product as kernel, and the bus, which answers its accesses.
    pub(crate) fn start(configuration: &GuestConfiguration) -> Result<Self, EmulatorError> {
        let absolute = |path: &Path| std::path::absolute(path).map_err(EmulatorError::io("path"));
        let product = absolute(&configuration.product)?;
        let directory =
            TempDir::new().map_err(EmulatorError::io("no temporary folder (TMPDIR names where it shall be)"))?;
        let mut command = Command::new(&configuration.qemu);
        command
            .args(["-machine", "netduinoplus2"])
            .args(["-display", "none", "-serial", "null", "-monitor", "none"])
            .args(["-nodefaults", "-no-user-config"]);
        let mut plugin = option("file=", &absolute(&configuration.bus)?);
        plugin.push(option(",page=", &directory.path().join(PAGE)));
        let blocks = if configuration.whole_blocks { "whole" } else { "one" };
        plugin.push(format!(",parent={},blocks={blocks}", std::process::id()));
        let link = Link::in_folder(directory.path())?;
        // QEMU inherits the CPU.
        let cpu = configuration.one_cpu.then(OneCpu::of_this_thread);
        let child = command
            .arg("-plugin")
            .arg(plugin)
            .arg("-kernel")
            .arg(product)
            .current_dir(directory.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| {
                if error.kind() == std::io::ErrorKind::NotFound {
                    EmulatorError::QemuMissing
                } else {
                    EmulatorError::io("starting")(error)
                }
            })?;
        Ok(Self { child, link, directory, _cpu: cpu })
    }

    /// Where its files are.
    pub(crate) fn folder(&self) -> &Path {
        self.directory.path()
    }

    /// Sends one command.
    pub(crate) fn send(&mut self, words: &[u32]) -> Result<(), EmulatorError> {
        self.link.send(words)
    }

    /// Waits for one message.
    pub(crate) fn receive(&mut self, words: &mut Vec<u32>) -> Result<(), EmulatorError> {
        let start = Instant::now();
        while !self.link.receive(words, LOOK)? {
            self.check(start)?;
        }
        Ok(())
    }

    fn check(&mut self, start: Instant) -> Result<(), EmulatorError> {
        if let Some(status) = self.child.try_wait().map_err(EmulatorError::io("asking for its state"))? {
            let mut stderr = String::new();
            if let Some(mut pipe) = self.child.stderr.take() {
                pipe.read_to_string(&mut stderr).map_err(EmulatorError::io("reading what it printed"))?;
            }
            return Err(EmulatorError::QemuEnded {
                status: status.to_string(),
                stderr: stderr.trim().replace('\n', "; "),
            });
        }
        if start.elapsed() > PATIENCE {
            return Err(EmulatorError::Silent { seconds: PATIENCE.as_secs() });
        }
        Ok(())
    }
}

/// A path in one of QEMU's options, where a comma ends a value and two of them are one.
fn option(name: &str, path: &Path) -> OsString {
    let mut option = OsString::from(name);
    for (index, part) in path.as_os_str().to_string_lossy().split(',').enumerate() {
        if index > 0 {
            option.push(",,");
        }
        option.push(part);
    }
    option
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_in_a_path_does_not_end_the_option() {
        assert_eq!(option("file=", Path::new("/a,b/c")), OsString::from("file=/a,,b/c"));
        assert_eq!(option("file=", Path::new("/a/c")), OsString::from("file=/a/c"));
    }
}
