//! Tries the flash of the parameters and prints what comes of it. Erases both sectors.
//!
//! A test runs it in QEMU (`tests/emulator/tests/flash.rs`); on a board probe-rs shows what it prints.
#![no_std]
#![no_main]

use core::pin::pin;

use board::parameter_flash::{PERMIT, ParameterFlash, ParameterFlashError, SECTOR_BYTES};
use board::timestamp::microseconds;
use board::{Board, pac};
use defmt::println;
use defmt_rtt as _;
use embassy_futures::{block_on, poll_once};
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};

type Outcome = Result<(), ParameterFlashError>;

defmt::timestamp!("{=u32:us}", microseconds());

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    println!("panic");
    loop {
        cortex_m::asm::wfi();
    }
}

fn erase(flash: &mut ParameterFlash, from: u32, to: u32) -> Outcome {
    block_on(flash.erase(from, to))
}

fn write(flash: &mut ParameterFlash, offset: u32, bytes: &[u8]) -> Outcome {
    block_on(flash.write(offset, bytes))
}

fn read(flash: &mut ParameterFlash, offset: u32) -> Result<[u8; 4], ParameterFlashError> {
    let mut bytes = [0; 4];
    block_on(flash.read(offset, &mut bytes)).map(|()| bytes)
}

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(peripherals) = pac::Peripherals::take() {
        let flash = &mut Board::new(peripherals).parameter_flash;
        permitted(flash);
        granted(flash);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// What is possible at start, and what is not.
fn permitted(flash: &mut ParameterFlash) {
    let end = flash.capacity() as u32;
    println!("capacity {}", end);
    println!("erase before it is permitted: {}", erase(flash, 0, end));
    PERMIT.always();
    println!("erase: {}", erase(flash, 0, end));
    let began = microseconds();
    println!("write: {}", write(flash, 4, &[1, 2, 3, 4, 5, 6, 7, 8]));
    println!("two words took {} us", microseconds().wrapping_sub(began));
    println!("read: {}", read(flash, 5));
    let mut byte = [0];
    println!("read a byte: {}, {}", block_on(flash.read(6, &mut byte)), byte);
    println!("write zeros over it: {}", write(flash, 4, &[0; 4]));
    println!("write ones over it: {}", write(flash, 4, &[0xFF; 4]));
    println!("write the last word: {}", write(flash, end.wrapping_sub(4), &[9; 4]));
    println!("read the last byte: {}, {}", block_on(flash.read(end.wrapping_sub(1), &mut byte)), byte);
    println!("write beyond the end: {}", write(flash, end.wrapping_sub(4), &[9; 8]));
    println!("read beyond the end: {}", read(flash, end.wrapping_sub(3)));
    println!("write off the words: {}", write(flash, 2, &[9; 4]));
    println!("write half a word: {}", write(flash, 8, &[9; 2]));
    println!("erase off the sectors: {}", erase(flash, 4, SECTOR_BYTES.wrapping_add(4)));
    println!("erase backwards: {}", erase(flash, SECTOR_BYTES, 0));
    println!("erase beyond the end: {}", erase(flash, 0, end.wrapping_add(SECTOR_BYTES)));
    println!("erase the second sector: {}", erase(flash, SECTOR_BYTES, end));
    println!("read: {}, {}", read(flash, 8), read(flash, end.wrapping_sub(4)));
}

/// Three words in a ring: one at each grant.
fn granted(flash: &mut ParameterFlash) {
    PERMIT.only_when_granted();
    {
        let mut writing = pin!(flash.write(64, &[0x11; 12]));
        let mut poll = |what: &str| println!("{}: ended {}", what, poll_once(writing.as_mut()).is_ready());
        poll("without a grant");
        PERMIT.grant(board::timestamp::microseconds().wrapping_add(1_000_000));
        PERMIT.grant(board::timestamp::microseconds().wrapping_add(1_000_000));
        poll("two grants at once");
        poll("without a second grant");
        PERMIT.grant(board::timestamp::microseconds().wrapping_add(1_000_000));
        PERMIT.withdraw();
        poll("a grant that was withdrawn");
        PERMIT.grant(board::timestamp::microseconds().wrapping_add(1_000_000));
        poll("second grant");
        PERMIT.grant(board::timestamp::microseconds().wrapping_add(1_000_000));
        poll("third grant");
    }
    println!("read: {}, {}", read(flash, 64), read(flash, 72));
    println!("erase in a ring: {}", erase(flash, 0, SECTOR_BYTES));
}
