//! The host link: two FIFOs reached through semihosting, which blocks the machine until the host has answered.

use crate::protocol::{FROM_HOST, MESSAGE_WORDS, TO_HOST};

const OPEN: u32 = 0x01;
const WRITE: u32 = 0x05;
const READ: u32 = 0x06;
const EXIT: u32 = 0x18;
const MODE_READ: u32 = 1;
const MODE_WRITE: u32 = 5;

/// Both directions of the link.
#[derive(Clone, Copy)]
pub(crate) struct Link {
    to_host: u32,
    from_host: u32,
}

impl Link {
    /// Not opened.
    pub(crate) const CLOSED: Self = Self { to_host: 0, from_host: 0 };

    /// Opens both FIFOs in QEMU's working directory.
    pub(crate) fn open() -> Self {
        Self { to_host: open(TO_HOST, MODE_WRITE), from_host: open(FROM_HOST, MODE_READ) }
    }

    /// Sends the words as one message.
    pub(crate) fn send(self, words: &[u32]) {
        let bytes = (words.len() * 4) as u32;
        if call(WRITE, &[self.to_host, words.as_ptr() as u32, bytes]) != 0 {
            exit();
        }
    }

    /// Waits for one message and leaves it at the start of `words`.
    pub(crate) fn receive(self, words: &mut [u32; MESSAGE_WORDS]) {
        let bytes = (MESSAGE_WORDS * 4) as u32;
        if call(READ, &[self.from_host, words.as_mut_ptr() as u32, bytes]) == bytes {
            exit();
        }
    }
}

/// Ends QEMU.
pub(crate) fn exit() -> ! {
    const APPLICATION_EXIT: u32 = 0x2_0026;
    loop {
        // SAFETY: semihosting exit takes its reason in r1 and touches no memory.
        unsafe {
            core::arch::asm!("bkpt #0xab", inout("r0") EXIT => _, in("r1") APPLICATION_EXIT);
        }
    }
}

fn open(name: &str, mode: u32) -> u32 {
    let mut path = [0_u8; 16];
    for (to, from) in path.iter_mut().zip(name.bytes()) {
        *to = from;
    }
    let handle = call(OPEN, &[path.as_ptr() as u32, mode, name.len() as u32]);
    if handle == u32::MAX {
        exit();
    }
    handle
}

fn call(operation: u32, arguments: &[u32; 3]) -> u32 {
    let result;
    // SAFETY: the semihosting operations used read their three arguments and the buffer these name; the compiler is told
    // that memory changes, because no `nomem` is given.
    unsafe {
        core::arch::asm!(
            "bkpt #0xab",
            inout("r0") operation => result,
            in("r1") arguments.as_ptr(),
            options(nostack)
        );
    }
    result
}
