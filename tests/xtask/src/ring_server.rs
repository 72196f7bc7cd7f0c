//! A master's SERCON816 behind a Unix socket, so that foreign master software can drive our ring.
//!
//! The dialogue is `ring::chip::socket`'s; here are the addresses, the socket's place and what the user is told.

use crate::Verdict;
use crate::firmware;
use crate::report::data::Platform;
use crate::setup::Installing;
use anyhow::{Context, Result, bail};
use bench::{DriveSetup, Executor};
use ring::RingConfiguration;
use ring::chip::socket::{self, ChipServer, ServedChip};
use ring::chip::{Alternatives, Chip, ChipMaster, SharedChip};
use ring::wire::BitRate;
use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;

/// Serves the chip of a ring with these drives until interrupted.
pub(crate) fn run(drives: &[u8], on: Platform, chip_socket: &Path, installing: Installing) -> Result<Verdict> {
    refuse_doubles(drives)?;
    let executor = firmware::executor(on, installing)?;
    let mut server = chip_server(drives, &executor)?;
    let listener = socket::bind(chip_socket).with_context(|| {
        format!(
            "cannot serve at {}; give --chip-socket a path in a folder of yours where nothing is yet",
            chip_socket.display()
        )
    })?;
    eprintln!("ring with drives {drives:?}; the master's chip is served at {}", chip_socket.display());
    loop {
        socket::serve_next(&listener, &mut server).context("the socket takes no more clients; start again")?;
    }
}

/// The master's chip, with a ring of drives around it; foreign software makes it the master.
fn chip_server(drives: &[u8], executor: &Executor) -> Result<impl ChipServer> {
    let setups: Vec<DriveSetup> = drives.iter().copied().map(DriveSetup::catalogue).collect();
    // Garbage in the RAM, as after power-on; the seed only makes it the same at every start.
    let chip: SharedChip = Rc::new(RefCell::new(Chip::new(Alternatives::default(), 0)));
    let configuration = RingConfiguration::new(drives.len(), BitRate::M2);
    let clock = configuration.clock.clone();
    let master = ChipMaster::new(chip.clone());
    let (mut world, _) = bench::ring_of_drives_on(configuration, master, &setups, |_| executor.clone())?;
    Ok(ServedChip::new(chip, clock, move |until| {
        if let Err(error) = world.run_until(until) {
            eprintln!("error: {error}; the drives stand still from now on");
        }
    }))
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

    /// The order of sercon816.md 9 with the timing of 2 Mbit/s and 2 ms: stop, program one AT and one MDT, close the ring in CP0, and look for
    /// drive 1 in CP1.
    const MASTER: &str = "w 01 0002\nw 01 0661\nw 02 0383\nw 0d ff0a\nw 0e 051f\nw 0f 07d0\nw 10 07d0\nw 13 0003\nw 14 0000\n\
        w 15 fffc\nw 16 000a\nw 18 0006\nw 19 001e\n\
        W 000 0010\nW 001 0010\nW 010 1801\nW 011 0096\nW 012 0002\nW 013 0020\nW 014 0000\nW 015 8002\nW 016 0000\nW 017 0000\n\
        W 020 5001\nW 021 0258\nW 022 0002\nW 023 0028\nW 024 8002\nW 025 0001\nW 026 0000\nW 028 c000\nW 029 076c\n\
        w 0a 0000\nw 04 ffff\ncycles 20\nr 04\ntime\n\
        w 0a 0001\nw 03 0100\ncycles 20\nR 010\nR 016\n";

    #[test]
    fn a_foreign_master_finds_the_ring_of_our_drives_closed() {
        finds_the_ring_closed(&Executor::Host);
    }

    #[test]
    #[ignore = "needs QEMU and the ELF: cargo xtask test"]
    fn a_foreign_master_finds_the_ring_of_flashed_elves_closed() {
        let path = |name: &str| {
            std::env::var_os(name)
                .unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test`, which builds the ELF"))
        };
        finds_the_ring_closed(&Executor::Qemu(bench::Elves::new(path("PRODUCT_ELF"), path("BUS_PLUGIN"))));
    }

    fn finds_the_ring_closed(executor: &Executor) {
        let mut server = chip_server(&[1, 2, 3], executor).unwrap();
        let mut output = Vec::new();
        socket::serve(&mut MASTER.as_bytes(), &mut output, &mut server).unwrap();
        let output = String::from_utf8(output).unwrap();
        let told: Vec<&str> = output.lines().filter(|line| *line != "ok").collect();
        let [status, time, header, drive_status] = told[..] else { panic!("four answers expected: {told:?}") };
        let [status, header, drive_status] =
            [status, header, drive_status].map(|word| u16::from_str_radix(word, 16).unwrap());
        assert_eq!(status & 0x0382, 0, "fibre break or lost MST: {status:04x}");
        assert_eq!(time, "40000000");
        // A ring of drives that sleep is closed as well: their chips repeat.
        assert_eq!(header, 0x1801 | 1 << 10, "the AT of drive 1");
        assert_eq!(drive_status & 0xC000, 0, "no torque in CP1: {drive_status:04x}");
    }

    #[test]
    fn an_address_may_stand_only_once() {
        assert!(refuse_doubles(&[1, 2, 3]).is_ok());
        assert!(refuse_doubles(&[1, 2, 1]).unwrap_err().to_string().contains("address 1"));
    }
}
