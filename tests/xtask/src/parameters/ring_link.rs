//! A drive on a ring of its own, run up to CP2 and kept there.

use super::link::{Failed, Link};
use anyhow::{Result, ensure};
use bench::{DriveHandle, DriveSetup, Executor, World, ring_of_drives_on};
use flash::FlashModel;
use ring::service_client::{AtWords, Finished, MdtWords, Pace, Request, ServiceClient, control, status};
use ring::tester::Plan;
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration, Tester};

pub(super) const ADDRESS: u8 = 1;
/// The shortest that a master may have before CP3 (sercos2.md 2.1).
const CYCLE: Nanoseconds = Nanoseconds::from_millis(1);
/// In the middle of the window of the MDT in CP1 and CP2 (sercos2.md 2.1).
const MDT: Nanoseconds = Nanoseconds::from_microseconds(600);
/// MSTs in a row that must come back before CP1 (sercos2.md 2.1).
const GOOD_MSTS: u32 = 10;
/// Cycles that a ring may take to close.
const PATIENCE: u32 = 10_000;
/// How often an address is asked for an answer before the master begins again with CP0.
const TRIES: u32 = 10;
/// How often it begins: a drive takes part from the first CP0 on that it sees, and may have a sector of its flash to erase before.
const RUN_UPS: u32 = 500;

/// The ring, and the master's end of the service channel.
pub(crate) struct RingLink {
    world: World<Tester>,
    drive: DriveHandle,
    client: ServiceClient,
    /// The answer to the last MDT.
    at: Option<AtWords>,
}

impl RingLink {
    /// Switches a drive on, and takes it to CP2; `progress` is told of a phase that has ended, and when in us.
    ///
    /// # Errors
    /// The drive does not start or does not answer.
    pub(crate) fn run_up(executor: &Executor, setup: DriveSetup, progress: &mut dyn FnMut(u8, u64)) -> Result<Self> {
        let tester = Tester::new(BitRate::M2, Plan::mst_only(0, CYCLE));
        let configuration = RingConfiguration::new(1, BitRate::M2);
        let (world, mut handles) = ring_of_drives_on(configuration, tester, &[setup], |_| executor.clone())?;
        let client = ServiceClient::new(true, Pace::FASTEST);
        let mut link = Self { world, drive: handles.remove(0), client, at: None };
        for _ in 0..RUN_UPS {
            link.close_ring()?;
            progress(0, link.time_us());
            if link.finds_drive()? {
                progress(1, link.time_us());
                return Ok(link);
            }
        }
        Err(Failed(format!("drive {ADDRESS} has not answered in {RUN_UPS} run-ups")).into())
    }

    /// What the drive would remember if its supply went now.
    pub(crate) fn flash(&self) -> FlashModel {
        match &self.drive.elf {
            Some(elf) => elf.guest.borrow().flash().clone(),
            None => self.drive.flash.borrow().clone(),
        }
    }

    fn close_ring(&mut self) -> Result<()> {
        let mut good = 0;
        for _ in 0..PATIENCE {
            self.cycle(0, None)?;
            good = if self.world.ring().master().mst_has_returned() { good + 1 } else { 0 };
            if good == GOOD_MSTS {
                return Ok(());
            }
        }
        Err(Failed(format!("the ring is still open after {PATIENCE} cycles")).into())
    }

    fn finds_drive(&mut self) -> Result<bool> {
        let hello = MdtWords { control: control::HANDSHAKE, info: 0 };
        for _ in 0..TRIES {
            let at = self.cycle(1, Some(hello))?;
            if at.is_some_and(|at| at.status & status::HANDSHAKE != 0) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The rest of this cycle with its MDT, and the next as far as its MDT; the AT in between.
    fn cycle(&mut self, phase: u8, words: Option<MdtWords>) -> Result<Option<AtWords>> {
        if let Some(words) = words {
            let [low, high] = words.control.to_le_bytes();
            let [first, second] = words.info.to_le_bytes();
            self.world.ring_mut().master_mut().set_mdt(vec![ADDRESS, low, high, first, second]);
        }
        let end = self.world.ring().master().end_of_cycle();
        self.world.run_until(end)?;
        let plan = Plan { mst: Some(phase), mdt: (phase > 0).then(|| (MDT, Vec::new())), cycle: CYCLE };
        self.world.ring_mut().master_mut().set_plan(plan);
        // The end of a cycle is just before the next MST is decided on.
        self.world.run_until(end + Nanoseconds(2))?;
        let until = self.world.ring().master().mark() + MDT - Nanoseconds::from_microseconds(1);
        self.world.run_until(until.max(self.world.now()))?;
        let received = self.world.ring().master().received();
        Ok(received.iter().find_map(|at| match at.bytes.as_slice() {
            [ADDRESS, low, high, first, second, ..] => {
                Some(AtWords { status: u16::from_le_bytes([*low, *high]), info: u16::from_le_bytes([*first, *second]) })
            }
            _ => None,
        }))
    }
}

impl Link for RingLink {
    fn ask(&mut self, request: Request) -> Result<Finished> {
        ensure!(self.client.is_idle(), "a request before this one has no end");
        self.client.request(request);
        loop {
            let words = self.client.poll(self.at.take());
            if let Some(finished) = self.client.take_finished() {
                // Nothing of the next request is known yet: these words are not sent.
                return Ok(finished);
            }
            self.at = self.cycle(2, Some(words))?;
        }
    }

    fn time_us(&self) -> u64 {
        self.world.now().as_microseconds()
    }
}
