//! The shared page.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use memmap2::MmapRaw;
use rustix::io::Errno;
use rustix::thread::futex;
use thiserror::Error;

use crate::protocol::{MESSAGE_WORDS, VERSION};

/// Who sends, who waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The bus inside QEMU; the first turn is its.
    Guest,
    /// The emulator.
    Host,
}

impl Side {
    const fn other(self) -> Self {
        match self {
            Self::Guest => Self::Host,
            Self::Host => Self::Guest,
        }
    }
}

/// Why there is no page.
#[derive(Debug, Error)]
pub enum PageError {
    /// The file cannot be made, opened or mapped.
    #[error("no shared page at {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is no page.
    #[error("{} is no shared page: it has {found} bytes, expected {expected}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Its length.
        found: u64,
        /// A page's.
        expected: u64,
    },
    /// The other side was built from other sources.
    #[error(
        "the other side of the shared page speaks protocol {found}, expected {VERSION}: build both from the same sources"
    )]
    Version {
        /// What the page says.
        found: u32,
    },
}

/// Both sides see this. Every word is atomic, so that sharing it is sound whatever the other side does.
#[repr(C)]
struct Layout {
    version: AtomicU32,
    /// [`Side`] as a number.
    turn: AtomicU32,
    /// Does the side wait in the futex?
    sleeps: [AtomicU32; 2],
    /// Words in the last message of a side.
    lengths: [AtomicU32; 2],
    messages: [[AtomicU32; MESSAGE_WORDS]; 2],
}

const SIZE: u64 = size_of::<Layout>() as u64;

/// A page that two processes share.
#[derive(Debug)]
pub struct Page {
    mapping: MmapRaw,
}

impl Page {
    /// Makes the file at `path`, which must not be there yet.
    ///
    /// # Errors
    /// The file cannot be made or mapped.
    pub fn create(path: &Path) -> Result<Self, PageError> {
        let io = |source| PageError::Io { path: path.to_owned(), source };
        let file = File::options().read(true).write(true).create_new(true).open(path).map_err(io)?;
        file.set_len(SIZE).map_err(io)?;
        let page = Self { mapping: MmapRaw::map_raw(&file).map_err(io)? };
        page.layout().version.store(VERSION, Ordering::SeqCst);
        Ok(page)
    }

    /// Opens the page that the other side has made.
    ///
    /// # Errors
    /// There is none, or it was made by other sources.
    pub fn open(path: &Path) -> Result<Self, PageError> {
        let io = |source| PageError::Io { path: path.to_owned(), source };
        let file = File::options().read(true).write(true).open(path).map_err(io)?;
        let found = file.metadata().map_err(io)?.len();
        if found != SIZE {
            return Err(PageError::Size { path: path.to_owned(), found, expected: SIZE });
        }
        let page = Self { mapping: MmapRaw::map_raw(&file).map_err(io)? };
        let found = page.layout().version.load(Ordering::SeqCst);
        if found != VERSION {
            return Err(PageError::Version { found });
        }
        Ok(page)
    }

    #[allow(unsafe_code, reason = "the one place where the mapping becomes what both sides see")]
    fn layout(&self) -> &Layout {
        // SAFETY: the mapping begins at a page's boundary, is as long as the layout (the file was given or checked for its length) and
        // lives as long as `self`. Every bit pattern is an atomic word, and atomics may change under us.
        unsafe { &*self.mapping.as_ptr().cast::<Layout>() }
    }

    /// Hands a message of `from` over, and the turn with it. What is beyond [`MESSAGE_WORDS`] is not sent.
    ///
    /// # Errors
    /// The system does not wake the other side.
    pub fn send(&self, from: Side, words: &[u32]) -> std::io::Result<()> {
        let layout = self.layout();
        for (slot, word) in layout.messages[from as usize].iter().zip(words) {
            slot.store(*word, Ordering::Relaxed);
        }
        let length = words.len().min(MESSAGE_WORDS) as u32;
        layout.lengths[from as usize].store(length, Ordering::Relaxed);
        let to = from.other();
        layout.turn.store(to as u32, Ordering::SeqCst);
        if layout.sleeps[to as usize].load(Ordering::SeqCst) != 0 {
            futex::wake(&layout.turn, futex::Flags::empty(), 1)?;
        }
        Ok(())
    }

    /// Waits until it is the turn of `side`, or gives up after `patience`. Tells whether it is.
    ///
    /// # Errors
    /// The system does not let it wait.
    pub fn wait(&self, side: Side, patience: Option<Duration>) -> std::io::Result<bool> {
        let layout = self.layout();
        let patience = patience.and_then(|patience| futex::Timespec::try_from(patience).ok());
        while layout.turn.load(Ordering::SeqCst) != side as u32 {
            layout.sleeps[side as usize].store(1, Ordering::SeqCst);
            // The kernel looks at the turn again before it sleeps: a message in between is not missed.
            let ended = futex::wait(&layout.turn, futex::Flags::empty(), side.other() as u32, patience.as_ref());
            layout.sleeps[side as usize].store(0, Ordering::SeqCst);
            match ended {
                Ok(()) | Err(Errno::AGAIN | Errno::INTR) => {}
                Err(Errno::TIMEDOUT) => return Ok(layout.turn.load(Ordering::SeqCst) == side as u32),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(true)
    }

    /// The last message of `from`; to be read while it is the other's turn.
    pub fn message(&self, from: Side) -> impl ExactSizeIterator<Item = u32> {
        let layout = self.layout();
        let length = layout.lengths[from as usize].load(Ordering::Relaxed) as usize;
        layout.messages[from as usize][..length.min(MESSAGE_WORDS)].iter().map(|word| word.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> (tempfile::TempDir, Page, Page) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page");
        let host = Page::create(&path).unwrap();
        let guest = Page::open(&path).unwrap();
        (folder, host, guest)
    }

    #[test]
    fn messages_go_back_and_forth_and_the_turn_with_them() {
        let (_folder, host, guest) = pair();
        let other = std::thread::spawn(move || {
            for number in 0..10_000_u32 {
                guest.send(Side::Guest, &[number, 7]).unwrap();
                assert!(guest.wait(Side::Guest, None).unwrap());
                assert_eq!(guest.message(Side::Host).collect::<Vec<_>>(), [number + 1]);
            }
        });
        for number in 0..10_000_u32 {
            assert!(host.wait(Side::Host, None).unwrap());
            assert_eq!(host.message(Side::Guest).collect::<Vec<_>>(), [number, 7]);
            host.send(Side::Host, &[number + 1]).unwrap();
        }
        other.join().unwrap();
    }

    #[test]
    fn nobody_waits_longer_than_patience() {
        let (_folder, host, _guest) = pair();
        assert!(!host.wait(Side::Host, Some(Duration::from_millis(5))).unwrap());
    }

    #[test]
    fn a_message_that_is_too_long_is_cut() {
        let (_folder, host, guest) = pair();
        guest.send(Side::Guest, &[9; MESSAGE_WORDS + 5]).unwrap();
        assert_eq!(host.message(Side::Guest).count(), MESSAGE_WORDS);
    }

    #[test]
    fn a_page_of_another_version_is_refused() {
        let (folder, host, _guest) = pair();
        host.layout().version.store(VERSION + 1, Ordering::SeqCst);
        let error = Page::open(&folder.path().join("page")).unwrap_err();
        assert!(matches!(error, PageError::Version { found } if found == VERSION + 1), "{error}");
    }

    #[test]
    fn what_is_no_page_is_refused_and_nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page");
        assert!(matches!(Page::open(&path).unwrap_err(), PageError::Io { .. }));
        std::fs::write(&path, "text").unwrap();
        assert!(matches!(Page::open(&path).unwrap_err(), PageError::Size { found: 4, .. }));
        assert!(matches!(Page::create(&path).unwrap_err(), PageError::Io { .. }));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "text");
    }
}
