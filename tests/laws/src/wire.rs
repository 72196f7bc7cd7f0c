//! The fibre of one drive: what reaches it, and what it sends.

use ring::Nanoseconds;
use ring::ident::Idn;
use ring::service_client::{AtWords, MdtWords, control, status};
use ring::wire::BROADCAST;

use crate::settings::Settings;

/// This many telegrams in a row that do not come are a lost ring (sercos2.md 2.4), and half a cycle more until it is sure.
const LOST_AFTER_HALF_CYCLES: u64 = 5;
/// An MST is taken for sure within this.
const WINDOW: Nanoseconds = Nanoseconds::from_microseconds(1);
/// Control word bits 15 and 14.
const SWITCHED_ON: u16 = control::ON | control::ENABLE;

/// The cyclic telegrams of one drive.
#[derive(Clone, Debug, Default)]
pub struct Wire {
    address: u8,
    /// Phase of the last MST.
    pub phase: u8,
    /// Since when.
    pub phase_since: Nanoseconds,
    /// The phase before it.
    pub phase_before: u8,
    /// The master has broken the order of phases since the last CP0.
    pub disordered: bool,
    /// End of the last MST.
    pub mst: Nanoseconds,
    /// End of the MST before it.
    pub mst_before: Nanoseconds,
    /// End of the last MDT.
    pub mdt: Nanoseconds,
    /// How many records have come since CP4 began.
    pub records: u64,
    /// Start of the last AT.
    pub at: Nanoseconds,
    /// Last words for the drive.
    pub control: u16,
    /// The ones before.
    pub control_before: u16,
    /// Last words of the drive.
    pub status: u16,
    /// The ones before.
    pub status_before: u16,
    /// How many ATs have been sent since CP4 began.
    pub answers: u64,
    /// When bits 15 and 14 were last seen to come together in this CP4, after they had not been.
    pub edge: Option<Nanoseconds>,
    /// Bits 15 and 14 have been seen not both set in this CP4.
    pub released: bool,
    commands: Vec<(Idn, u32)>,
    feedback: Vec<(Idn, u32)>,
    info: [u16; 2],
}

/// What a telegram was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Telegram {
    /// MST.
    Mst,
    /// MDT with a record for this drive.
    Record,
}

impl Wire {
    /// The fibre of the drive of this address.
    #[must_use]
    pub fn new(address: u8) -> Self {
        Self { address, ..Self::default() }
    }

    /// Takes a telegram that has reached the drive without an error of the line.
    pub(crate) fn arrived(&mut self, end: Nanoseconds, bytes: &[u8], settings: &Settings) -> Option<Telegram> {
        match *bytes {
            [BROADCAST, phase] => {
                self.take_phase(end, phase, settings);
                Some(Telegram::Mst)
            }
            [address, ref data @ ..] => {
                let own = if address == BROADCAST && self.phase >= 3 {
                    data.get(usize::from(settings.word(Idn::MDT_POSITION)?).checked_sub(1)?..)?
                } else if address == self.address && self.phase < 3 {
                    data
                } else {
                    return None;
                };
                self.take_record(end, own, settings);
                Some(Telegram::Record)
            }
            [] => None,
        }
    }

    fn take_phase(&mut self, end: Nanoseconds, phase: u8, settings: &Settings) {
        self.mst_before = self.mst;
        self.mst = end;
        if phase == self.phase || self.misses(settings) {
            return;
        }
        self.disordered = phase != 0 && (self.disordered || phase != self.phase + 1 || phase > 4);
        self.phase_before = self.phase;
        self.phase = phase;
        self.phase_since = end;
        self.mdt = end;
        self.at = end;
        self.edge = None;
        self.released = false;
        self.records = 0;
        self.answers = 0;
    }

    /// From CP3 on the chip may not take an MST that is beside its time, and the drive does not see its phase. If it does it falls silent, which is
    /// a lost ring. One that comes after a gap is taken.
    fn misses(&self, settings: &Settings) -> bool {
        let cycle = settings.unsigned(Idn::CYCLE).unwrap_or(2_000).unsigned_abs() * 1_000;
        let beside = self.mst.saturating_sub(self.mst_before).0.abs_diff(cycle);
        self.phase >= 3 && beside > WINDOW.0 && beside < cycle / 4
    }

    fn take_record(&mut self, end: Nanoseconds, own: &[u8], settings: &Settings) {
        let [control_low, control_high, info_low, info_high, ref data @ ..] = *own else { return };
        self.mdt = end;
        self.records += 1;
        self.control_before = self.control;
        self.control = u16::from_le_bytes([control_low, control_high]);
        self.info[0] = u16::from_le_bytes([info_low, info_high]);
        if self.phase == 4 {
            let on = self.control & SWITCHED_ON == SWITCHED_ON;
            if on && self.released && self.control_before & SWITCHED_ON != SWITCHED_ON {
                self.edge = Some(end);
            }
            self.released |= !on;
        }
        if self.phase >= 3 {
            split(data, settings.mdt_contents(), &mut self.commands);
        }
    }

    /// Takes a telegram of the drive itself.
    pub(crate) fn sent(&mut self, now: Nanoseconds, bytes: &[u8], settings: &Settings) {
        let [_, status_low, status_high, info_low, info_high, ref data @ ..] = *bytes else { return };
        self.at = now;
        self.answers += 1;
        self.status_before = self.status;
        self.status = u16::from_le_bytes([status_low, status_high]);
        self.info[1] = u16::from_le_bytes([info_low, info_high]);
        if self.phase >= 3 {
            split(data, settings.at_contents(), &mut self.feedback);
        }
    }

    /// The service channel's part of the last record.
    #[must_use]
    pub const fn request(&self) -> MdtWords {
        MdtWords { control: self.control, info: self.info[0] }
    }

    /// The service channel's part of the last AT.
    #[must_use]
    pub const fn reply(&self) -> AtWords {
        AtWords { status: self.status, info: self.info[1] }
    }

    /// A value of the last record, as it stands there.
    #[must_use]
    pub fn command(&self, idn: Idn) -> Option<u32> {
        self.commands.iter().find(|(at, _)| *at == idn).map(|(_, value)| *value)
    }

    /// All values of the last record.
    #[must_use]
    pub fn commands(&self) -> &[(Idn, u32)] {
        &self.commands
    }

    /// A value of the last AT, as it stands there.
    #[must_use]
    pub fn feedback(&self, idn: Idn) -> Option<u32> {
        self.feedback.iter().find(|(at, _)| *at == idn).map(|(_, value)| *value)
    }

    /// All values of the last AT.
    #[must_use]
    pub fn feedbacks(&self) -> &[(Idn, u32)] {
        &self.feedback
    }

    /// In CP4, with the ring intact as far as the drive can know.
    #[must_use]
    pub fn is_operating(&self, now: Nanoseconds, cycle: Nanoseconds) -> bool {
        self.phase == 4 && !self.is_lost(now, cycle)
    }

    /// From CP3 on: telegrams of the master do not come, or the drive does not answer, or the order of phases is broken.
    #[must_use]
    pub fn is_lost(&self, now: Nanoseconds, cycle: Nanoseconds) -> bool {
        let since = |then: Nanoseconds| 2 * now.saturating_sub(then).0 > LOST_AFTER_HALF_CYCLES * cycle.0;
        self.disordered || self.phase >= 3 && (since(self.mst) || since(self.mdt) || since(self.at))
    }

    /// Bits 15 and 14 are both set.
    #[must_use]
    pub const fn asks_for_torque(&self) -> bool {
        self.control & SWITCHED_ON == SWITCHED_ON
    }

    /// Bits 15, 14 and 13 are set.
    #[must_use]
    pub const fn asks_to_follow(&self) -> bool {
        self.asks_for_torque() && self.control & control::NO_HALT != 0
    }

    /// The AT says that command values are followed.
    #[must_use]
    pub const fn follows(&self) -> bool {
        self.status & status::FOLLOWS != 0
    }

    /// The AT says that there is a class 1 diagnostic.
    #[must_use]
    pub const fn has_error(&self) -> bool {
        self.status & status::SHUT_DOWN != 0
    }

    /// Number of the operation mode in the status word, bits 10 to 8.
    #[must_use]
    pub const fn actual_mode(&self) -> u16 {
        self.status >> 8 & 7
    }
}

/// The values of a record; what lies behind a value of unknown length is left out.
fn split(mut data: &[u8], contents: &[Idn], values: &mut Vec<(Idn, u32)>) {
    values.clear();
    for idn in contents {
        let Some(length) = Settings::bytes_of(*idn) else { break };
        let Some((own, rest)) = data.split_at_checked(length) else { break };
        values.push((*idn, own.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))));
        data = rest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_found_at_its_place_and_split() {
        let mut settings = Settings::default();
        settings.note(Idn::MDT_POSITION, vec![5]);
        let mut wire = Wire::new(1);
        for phase in 0..=4 {
            assert_eq!(wire.arrived(Nanoseconds(1), &[255, phase], &settings), Some(Telegram::Mst));
        }
        let mdt = [255, 9, 9, 9, 9, 0x3F, 0xE0, 7, 0, 0x40, 0xE2, 1, 0];
        assert_eq!(wire.arrived(Nanoseconds(2), &mdt, &settings), Some(Telegram::Record));
        assert_eq!((wire.control, wire.request().info), (0xE03F, 7));
        // Telegram type 4 is the default.
        assert_eq!(wire.command(Idn::POSITION_COMMAND), Some(123_456));
        assert!(!wire.disordered);
    }

    #[test]
    fn an_mst_beside_its_time_brings_no_phase() {
        for (late, phase) in [(0, 2), (900, 2), (-900, 2), (6_000, 4), (-6_000, 4), (2_000_000, 2)] {
            let (settings, mut wire) = (Settings::default(), Wire::new(1));
            for (cycle, phase) in (0..).zip([0, 1, 2, 3, 4, 4]) {
                wire.arrived(Nanoseconds(cycle * 2_000_000), &[255, phase], &settings);
            }
            wire.arrived(Nanoseconds(12_000_000_u64.strict_add_signed(late)), &[255, 2], &settings);
            assert_eq!((wire.phase, wire.disordered), (phase, phase != 4), "{late} ns");
        }
    }

    #[test]
    fn switches_that_were_never_off_in_this_cp4_make_no_edge() {
        let settings = Settings::default();
        let mut wire = Wire::new(1);
        let enter = |wire: &mut Wire| {
            for phase in 0..=4 {
                wire.arrived(Nanoseconds(1), &[255, phase], &settings);
            }
        };
        let send = |wire: &mut Wire, high: u8| wire.arrived(Nanoseconds(2), &[255, 0, high, 0, 0], &settings);
        enter(&mut wire);
        send(&mut wire, 0xE0);
        assert_eq!(wire.edge, None);
        send(&mut wire, 0x40);
        send(&mut wire, 0xC0);
        assert_eq!(wire.edge, Some(Nanoseconds(2)));
        enter(&mut wire);
        assert_eq!(wire.edge, None);
    }
}
