//! A master's SERCON816 behind a Unix socket, so that foreign master software can drive our ring.
//!
//! The dialogue is `ring::chip::socket`'s; here are the addresses, the socket's place and what the user is told.

use crate::Verdict;
use anyhow::{Context, Result, bail};
use ring::chip::socket::{self, ChipServer};
use std::path::Path;

/// Serves the chip of a ring with these drives until interrupted.
pub(crate) fn run(drives: &[u8], chip_socket: &Path) -> Result<Verdict> {
    refuse_doubles(drives)?;
    let mut server = chip_server(drives)?;
    let listener = socket::bind(chip_socket).with_context(|| {
        format!(
            "cannot serve at {}; give --chip-socket a path in a folder of yours where nothing is yet",
            chip_socket.display()
        )
    })?;
    eprintln!("ring with drives {drives:?}; the master's chip is served at {}", chip_socket.display());
    loop {
        socket::serve_next(&listener, server.as_mut()).context("the socket takes no more clients; start again")?;
    }
}

/// The ring and its master's chip.
fn chip_server(_drives: &[u8]) -> Result<Box<dyn ChipServer>> {
    bail!("the bench is not built yet")
}

fn refuse_doubles(drives: &[u8]) -> Result<()> {
    for (index, drive) in drives.iter().enumerate() {
        if drives[..index].contains(drive) {
            bail!("two drives have the address {drive}; give each address of --drives once");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_may_stand_only_once() {
        assert!(refuse_doubles(&[1, 2, 3]).is_ok());
        assert!(refuse_doubles(&[1, 2, 1]).unwrap_err().to_string().contains("address 1"));
    }
}
