//! The QEMU process and the two FIFOs to the shim in it.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::rc::Rc;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{CWD, FileType, Mode, OFlags, mknodat};
use tempfile::TempDir;

use crate::cpu::OneCpu;
use crate::protocol::{FROM_HOST, MESSAGE_WORDS, TO_HOST};
use crate::{EmulatorError, GuestConfiguration};

/// Longest wait for a message. QEMU runs some 10^8 instructions a second, and the shim speaks at least every 2^31.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running QEMU; killed when dropped.
#[derive(Debug)]
pub(crate) struct Qemu {
    child: Child,
    from_shim: File,
    to_shim: File,
    bytes: Vec<u8>,
    _directory: TempDir,
    _cpu: Rc<OneCpu>,
}

impl Qemu {
    /// Starts QEMU with the product as kernel and the shim beside it, which takes the reset at `shim_vectors`.
    pub(crate) fn start(configuration: &GuestConfiguration, shim_vectors: u32) -> Result<Self, EmulatorError> {
        let absolute = |path: &Path| std::path::absolute(path).map_err(EmulatorError::io("path"));
        let (product, shim) = (absolute(&configuration.product)?, absolute(&configuration.shim)?);
        let directory = TempDir::new().map_err(EmulatorError::io("temporary directory"))?;
        for name in [TO_HOST, FROM_HOST] {
            let mode = Mode::RUSR | Mode::WUSR;
            mknodat(CWD, directory.path().join(name), FileType::Fifo, mode, 0)
                .map_err(|error| EmulatorError::Io { what: "creating a FIFO", source: error.into() })?;
        }
        // Opened for both directions, so that neither open waits for QEMU.
        let open = |name: &str| {
            OpenOptions::new()
                .read(true)
                .write(true)
                .open(directory.path().join(name))
                .map_err(EmulatorError::io("opening a FIFO"))
        };
        let (from_shim, to_shim) = (open(TO_HOST)?, open(FROM_HOST)?);
        rustix::fs::fcntl_setfl(&from_shim, OFlags::NONBLOCK)
            .map_err(|error| EmulatorError::Io { what: "FIFO mode", source: error.into() })?;
        let cpu = OneCpu::of_this_thread();
        let mut loader = std::ffi::OsString::from("loader,file=");
        loader.push(shim);
        let child = Command::new(&configuration.qemu)
            .args(["-machine", "netduinoplus2"])
            .args(["-display", "none", "-serial", "null", "-monitor", "none"])
            .args(["-nodefaults", "-no-user-config"])
            .args(["-icount", "shift=0,sleep=off"])
            .args(["-semihosting-config", "enable=on,target=native"])
            .arg("-kernel")
            .arg(product)
            .arg("-device")
            .arg(loader)
            .arg("-global")
            .arg(format!("armv7m.init-nsvtor={shim_vectors:#x}"))
            .args(&configuration.arguments)
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
        Ok(Self { child, from_shim, to_shim, bytes: vec![0; MESSAGE_WORDS * 4], _directory: directory, _cpu: cpu })
    }

    /// Sends one command.
    pub(crate) fn send(&mut self, words: &[u32]) -> Result<(), EmulatorError> {
        let length = words.len() * 4;
        for (bytes, word) in self.bytes.chunks_exact_mut(4).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        self.to_shim.write_all(&self.bytes[..length]).map_err(EmulatorError::io("writing to the shim"))
    }

    /// Waits for one message.
    pub(crate) fn receive(&mut self, words: &mut Vec<u32>) -> Result<(), EmulatorError> {
        let length = self.wait_for_bytes()?;
        words.clear();
        words.extend(
            self.bytes[..length].chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])),
        );
        Ok(())
    }

    fn wait_for_bytes(&mut self) -> Result<usize, EmulatorError> {
        let start = Instant::now();
        loop {
            match self.from_shim.read(&mut self.bytes) {
                Ok(length) => return Ok(length),
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(EmulatorError::io("reading from the shim")(error)),
            }
            let mut files = [PollFd::new(&self.from_shim, PollFlags::IN)];
            let patience = Timespec { tv_sec: 1, tv_nsec: 0 };
            match poll(&mut files, Some(&patience)) {
                Ok(0) => self.check(start)?,
                Ok(_) | Err(rustix::io::Errno::INTR) => {}
                Err(error) => {
                    return Err(EmulatorError::Io { what: "waiting for the shim", source: error.into() });
                }
            }
        }
    }

    fn check(&mut self, start: Instant) -> Result<(), EmulatorError> {
        if let Some(status) = self.child.try_wait().map_err(EmulatorError::io("asking for its state"))? {
            let mut stderr = String::new();
            if let Some(mut pipe) = self.child.stderr.take() {
                let _ = pipe.read_to_string(&mut stderr);
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

impl Drop for Qemu {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
