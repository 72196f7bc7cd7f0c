//! The service channel of a drive on the simulated ring, once a master has run it up.

use super::channel::{ChannelError, ServiceChannel};
use crate::report::data::Progress;
use bench::{DriveSetup, World, parameters_of, ring_of_drives};
use ring::ident::{Idn, Value};
use ring::master::{Activity, CommandValues, DriveScript, MasterScript, Motion, ScriptedMaster, Telegram};
use ring::service_client::{Reply, Request, ServiceError};
use ring::wire::BitRate;
use ring::{Nanoseconds, RingConfiguration};
use std::cell::Cell;
use std::rc::Rc;

const ADDRESS: u8 = 1;
/// Longest simulated time of a run-up.
const RUN_UP: Nanoseconds = Nanoseconds::from_millis(30_000);
const PROGRESS_EVERY: Nanoseconds = Nanoseconds::from_millis(50);
/// The ring goes on by this much between two looks at an answer: one communication cycle.
const LOOK: Nanoseconds = Nanoseconds::from_millis(2);
/// Longest simulated time that an answer may take.
const ANSWER: Nanoseconds = Nanoseconds::from_millis(4_000);
/// So many cycles the drive follows its commands: for ever.
const CYCLES: u64 = 1 << 40;

/// One drive in velocity mode at velocity command zero, and its service channel.
pub(crate) struct RingChannel {
    world: World<ScriptedMaster>,
    /// Simulated time in us, for those who show how far it is while the channel is busy.
    clock: Rc<Cell<u64>>,
}

impl RingChannel {
    /// Runs a drive up and switches it on; tells how far it is.
    pub(crate) fn run_up(progress: &mut dyn FnMut(&Progress)) -> Result<Self, ChannelError> {
        let setup = DriveSetup::new(ADDRESS);
        let master = ScriptedMaster::new(script(&setup));
        let (world, _) =
            ring_of_drives(RingConfiguration::new(1, BitRate::M2), master, &[setup]).map_err(|error| broken(&error))?;
        let mut channel = Self { world, clock: Rc::default() };
        while channel.world.now() < RUN_UP {
            channel.run(PROGRESS_EVERY)?;
            let master = channel.world.ring().master();
            let state = master.state();
            if let Some(error) = &master.report().error {
                return Err(broken(error));
            }
            let time_us = channel.world.now().as_microseconds();
            progress(&Progress { phase: state.phase, what: state.activity.to_string(), done: 0, of: 0, time_us });
            if matches!(state.activity, Activity::Moving { .. }) {
                return Ok(channel);
            }
        }
        let state = channel.world.ring().master().state();
        Err(ChannelError::Broken(format!("the run-up did not end; the master is {state}")))
    }

    /// Simulated time in us.
    pub(crate) fn clock(&self) -> Rc<Cell<u64>> {
        self.clock.clone()
    }

    fn run(&mut self, span: Nanoseconds) -> Result<(), ChannelError> {
        let until = self.world.now() + span;
        self.world.run_until(until).map_err(|error| broken(&error))?;
        self.clock.set(until.as_microseconds());
        match &self.world.ring().master().report().error {
            Some(error) => Err(broken(error)),
            None => Ok(()),
        }
    }

    fn ask(&mut self, idn: u16, request: Request) -> Result<Reply, ChannelError> {
        let done = self.world.ring().master().report().drives[0].services.len();
        self.world.ring_mut().master_mut().service(0).request(request);
        let end = self.world.now() + ANSWER;
        while self.world.now() < end {
            self.run(LOOK)?;
            if let Some(finished) = self.world.ring().master().report().drives[0].services.get(done) {
                return finished.result.clone().map_err(|error| match error {
                    ServiceError::Refused { code, .. } => ChannelError::Refused { idn, code },
                    error => broken(&error),
                });
            }
        }
        Err(ChannelError::Broken(format!("{}: no answer", Idn(idn))))
    }

    fn value(&mut self, idn: u16) -> Result<Value, ChannelError> {
        let reply = self.ask(idn, Request::Read(Idn(idn)))?;
        reply.value().cloned().ok_or(ChannelError::Format { idn, expected: "readable" })
    }

    /// Length of operation data in bytes, from the attribute.
    fn length(&mut self, idn: u16) -> Result<usize, ChannelError> {
        match self.ask(idn, Request::ReadAttribute(Idn(idn)))? {
            Reply::Attribute(attribute) => attribute.fixed_bytes(),
            _ => None,
        }
        .ok_or(ChannelError::Format { idn, expected: "of fixed length" })
    }
}

impl ServiceChannel for RingChannel {
    fn read(&mut self, idn: u16) -> Result<u64, ChannelError> {
        self.value(idn)?.as_number().ok_or(ChannelError::Format { idn, expected: "of fixed length" })
    }

    fn read_list(&mut self, idn: u16) -> Result<Vec<i32>, ChannelError> {
        match self.value(idn)? {
            Value::Bytes(bytes) if bytes.len().is_multiple_of(4) => {
                Ok(bytes.chunks_exact(4).map(|item| i32::from_le_bytes([item[0], item[1], item[2], item[3]])).collect())
            }
            _ => Err(ChannelError::Format { idn, expected: "a list of four-byte items" }),
        }
    }

    fn write(&mut self, idn: u16, value: u64) -> Result<(), ChannelError> {
        let value = match self.length(idn)? {
            2 => Value::Word((value & 0xFFFF) as u16),
            4 => Value::Long((value & 0xFFFF_FFFF) as u32),
            _ => Value::Quad(value),
        };
        self.ask(idn, Request::Write(Idn(idn), value)).map(|_| ())
    }

    fn wait(&mut self, microseconds: u64) -> Result<(), ChannelError> {
        self.run(Nanoseconds::from_microseconds(microseconds))
    }
}

/// A report of what is done in CP4. The count is in the words: the line of CP4 began when there was nothing to count yet.
pub(crate) fn progress(time_us: u64, what: &str, done: u64, of: u64) -> Progress {
    let what = if of > 0 { format!("{what}, {done} of {of}") } else { what.to_owned() };
    Progress { phase: 4, what, done: 0, of: 0, time_us }
}

/// A drive in velocity mode that is told to stand; the MDT leaves S-0-0037 to the service channel.
fn script(setup: &DriveSetup) -> MasterScript {
    let drive = DriveScript::new(ADDRESS, Telegram::application(&[Idn::VELOCITY_FEEDBACK], &[Idn::VELOCITY_COMMAND]))
        .with(Idn::OPERATION_MODE, Value::Word(2))
        .with_all(parameters_of(&setup.axis));
    let motion = Motion::new(CYCLES, |_| CommandValues::at_velocity(0));
    MasterScript { motion: Some(motion), stops_at_refusals: false, ..MasterScript::new(vec![drive]) }
}

fn broken(cause: &dyn std::fmt::Display) -> ChannelError {
    ChannelError::Broken(cause.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_on_the_ring_is_read_written_and_moved_over_its_service_channel() {
        let mut phases = Vec::new();
        let mut channel = RingChannel::run_up(&mut |progress| phases.push(progress.phase)).unwrap();
        phases.dedup();
        assert_eq!(phases.last(), Some(&4));
        assert_eq!(channel.read_list(0x8004), Ok(vec![]), "the times of errors, of which there are none");
        assert_eq!(channel.read(104), Ok(u64::from(DriveSetup::new(ADDRESS).axis.gains.position_gain)));
        assert_eq!(channel.write(4_095, 1), Err(ChannelError::Refused { idn: 4_095, code: 0x1001 }));
        assert_eq!(channel.write(51, 1), Err(ChannelError::Refused { idn: 51, code: 0x7004 }));
        assert!(matches!(channel.read_list(51), Err(ChannelError::Format { idn: 51, .. })));
        assert!(matches!(channel.read(17), Err(ChannelError::Format { idn: 17, .. })));
        channel.write(392, 750).unwrap();
        assert_eq!(channel.read(392), Ok(750), "two bytes");
        channel.write(37, 1_000_000).unwrap();
        channel.wait(500_000).unwrap();
        let rpm = channel.read(40).unwrap() as u32 as i32;
        assert!((990_000..1_010_000).contains(&rpm), "100 rpm, not {rpm} of 0.0001");
        assert!(channel.clock().get() > 500_000);
    }
}
