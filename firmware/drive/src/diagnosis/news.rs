//! News of the drive for the AT and the error memory: worked out only when something that it depends on has changed.
//!
//! The background looks after every step of the service channel and whenever the motion side asks for it; nearly always everything is as it
//! was.

use sercos::diagnostic::Class1;

use crate::diagnosis::table::{Diagnosis, diagnose, drive_errors};
use crate::diagnosis::words::{Circumstances, Manufacturer1};

/// What has been announced.
#[derive(Debug, Default)]
pub(crate) struct Announcement {
    /// `None`: nothing yet.
    announced: Option<Circumstances>,
}

/// What is to be announced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct News {
    /// S-0-0014.
    pub(crate) interface_status: u16,
    /// S-0-0390.
    pub(crate) number: u16,
    new_errors: (Class1, Manufacturer1),
}

impl Announcement {
    /// `None`: the same as before. [`Circumstances`] are all that a diagnosis can depend on, and each of them is compared.
    #[inline]
    pub(crate) fn news(&mut self, now: &Circumstances) -> Option<News> {
        if self.announced.as_ref() == Some(now) {
            return None;
        }
        let before = self.announced.replace(*now);
        let (class_1, manufacturer_1) =
            before.map_or_else(Default::default, |before| (before.class_1, before.manufacturer_1));
        Some(News {
            interface_status: now.interface.raw_value(),
            number: diagnose(now).number,
            new_errors: (now.class_1.difference(class_1), now.manufacturer_1.difference(manufacturer_1)),
        })
    }
}

impl News {
    /// The errors that have come, for the error memory.
    pub(crate) fn errors(&self) -> impl Iterator<Item = &'static Diagnosis> {
        drive_errors(self.new_errors.0, self.new_errors.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnosis::words::{Manufacturer2, Manufacturer3};
    use crate::state::DriveState;
    use sercos::Phase;
    use sercos::diagnostic::Class2;
    use sercos::phase::InterfaceStatus;
    use std::vec::Vec;

    const STATES: [DriveState; 8] = [
        DriveState::Off,
        DriveState::SwitchingOn,
        DriveState::Following,
        DriveState::Halted,
        DriveState::SwitchingOff,
        DriveState::FaultReaction,
        DriveState::Engaging,
        DriveState::Fault,
    ];
    const PHASES: [Phase; 5] = [Phase::Cp0, Phase::Cp1, Phase::Cp2, Phase::Cp3, Phase::Cp4];

    /// Changes one thing; a word of bits loses all of them as often as it gets or loses one.
    fn change(circumstances: &mut Circumstances, random: u32) {
        let place = (random >> 8) as usize;
        let bit = 1_u16 << (random >> 8 & 15);
        let keep = if random & 1 << 12 == 0 { u16::MAX } else { 0 };
        let changed = |word: u16| (word ^ bit) & keep;
        match random % 10 {
            0 => circumstances.phase = PHASES[place % PHASES.len()],
            1 => {
                let interface = changed(circumstances.interface.raw_value()) & 0x03FF;
                circumstances.interface = InterfaceStatus::new_with_raw_value(interface);
            }
            2 => circumstances.state = STATES[place % STATES.len()],
            3 => circumstances.power = !circumstances.power,
            4 => circumstances.homing = !circumstances.homing,
            5 => circumstances.class_1 = Class1::from_bits_truncate(changed(circumstances.class_1.bits())),
            6 => circumstances.class_2 = Class2::from_bits_truncate(changed(circumstances.class_2.bits())),
            7 => {
                let changed = changed(circumstances.manufacturer_1.bits());
                circumstances.manufacturer_1 = Manufacturer1::from_bits_truncate(changed);
            }
            8 => {
                let changed = changed(circumstances.manufacturer_2.bits());
                circumstances.manufacturer_2 = Manufacturer2::from_bits_truncate(changed);
            }
            _ => {
                let changed = changed(circumstances.manufacturer_3.bits());
                circumstances.manufacturer_3 = Manufacturer3::from_bits_truncate(changed);
            }
        }
    }

    #[test]
    fn who_looks_for_news_ends_up_with_what_working_it_out_each_time_gives() {
        let mut random = 1_u32;
        let mut announcement = Announcement::default();
        let mut now = Circumstances::default();
        let (mut shown, mut kept) = ((0, 0), Vec::new());
        let mut remembered = Default::default();
        let (mut news, mut diagnoses) = (0, std::collections::BTreeSet::new());
        for step in 0..200_000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // In three steps of four nothing happens.
            if random >> 30 == 0 {
                change(&mut now, random >> 4);
            }
            let (class_1, manufacturer_1): (Class1, Manufacturer1) = remembered;
            let always = (now.interface.raw_value(), diagnose(&now).number);
            let errors = drive_errors(now.class_1.difference(class_1), now.manufacturer_1.difference(manufacturer_1));
            let errors: Vec<u16> = errors.map(|diagnosis| diagnosis.number).collect();
            remembered = (now.class_1, now.manufacturer_1);

            kept.clear();
            if let Some(found) = announcement.news(&now) {
                news += 1;
                shown = (found.interface_status, found.number);
                kept.extend(found.errors().map(|diagnosis| diagnosis.number));
            }
            assert_eq!((shown, &kept), (always, &errors), "step {step}: {now:?}");
            diagnoses.insert(always.1);
        }
        // The walk comes through much of the table, and rests often enough for the comparison to mean something.
        assert!(diagnoses.len() > 25, "{diagnoses:x?}");
        assert!((20_000..60_000).contains(&news), "{news}");
    }

    #[test]
    fn the_first_look_is_news_and_the_second_is_none() {
        let mut announcement = Announcement::default();
        let now = Circumstances { class_1: Class1::OVERCURRENT, ..Circumstances::default() };
        let errors = announcement.news(&now).map(|news| news.errors().map(|error| error.number).collect::<Vec<_>>());
        assert_eq!(errors, Some([0xF107].to_vec()));
        assert_eq!(announcement.news(&now), None);
    }

    #[test]
    fn an_error_that_comes_again_is_new_again() {
        let mut announcement = Announcement::default();
        let error = Circumstances { class_1: Class1::OVERCURRENT, ..Circumstances::default() };
        for now in [error, Circumstances::default(), error] {
            let news = announcement.news(&now).unwrap();
            assert_eq!(news.errors().count(), usize::from(!now.class_1.is_empty()));
        }
    }
}
