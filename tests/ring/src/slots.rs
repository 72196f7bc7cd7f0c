//! Time slots of a cycle: t1 to t4 from what the drives need (sercos2.md 5.2, 5.3).

use serde::Serialize;
use thiserror::Error;

use crate::wire::BitRate;

/// Jitter that the slots leave room for: AT start, MDT start and MST period, us each (sercos2.md 5.4).
pub const JITTER_MICROSECONDS: u64 = 1;

/// Bytes between the flags of a telegram with `data` data bytes: address and check sequence besides.
pub const fn telegram_bytes(data: usize) -> usize {
    data + 3
}

/// The longest that a telegram of so many data bytes can last, us, rounded up: (16 + 9.6 n) bit times, n with address
/// and frame check sequence (sercos2.md 5.2).
pub const fn longest_microseconds(data: usize, rate: BitRate) -> u64 {
    let tenths_of_bits = 160 + 96 * telegram_bytes(data) as u64;
    tenths_of_bits.div_ceil(10 * rate.megabits())
}

/// What one drive needs, read from it in CP2; us.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default, Serialize)]
pub struct DriveTimes {
    /// S-0-0003, earliest AT start.
    pub t1_min: u16,
    /// S-0-0004, from the end of its AT to the MDT.
    pub t_at_mdt: u16,
    /// S-0-0005, from feedback capture to the end of the next MST.
    pub t5: u16,
    /// S-0-0088, from the end of the MDT to the next MST.
    pub t_mdt_mst: u16,
    /// S-0-0090, from the end of the MDT to usable command values.
    pub t_mdt_command: u16,
    /// S-0-0087, from the end of one AT to the next of the same slave.
    pub t_at_at: u16,
    /// S-0-0096, slave arrangement: drives with the same word stand in one slave.
    pub arrangement: u16,
}

/// What one drive transmits.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default, Serialize)]
pub struct DriveData {
    /// Bytes of configurable data in its AT.
    pub at_bytes: usize,
    /// Bytes of configurable data in its record of the MDT.
    pub mdt_bytes: usize,
}

/// The slots of a ring; all times in us after the end of the MST.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Slots {
    /// S-0-0006 of every drive.
    pub t1: Vec<u16>,
    /// S-0-0089.
    pub t2: u16,
    /// S-0-0008.
    pub t3: u16,
    /// S-0-0007.
    pub t4: u16,
}

/// Where the MDT is put.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Default)]
pub enum MdtPlace {
    /// As late as the rules allow, as the recorded master does: the service channel has the time of the ATs.
    #[default]
    Late,
    /// Right behind the last AT.
    Early,
}

/// The drives' needs do not fit into the cycle.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Error, Serialize)]
#[error("no room for all telegrams: {what} at {needed} us, {allowed} us at most in a cycle of {cycle} us")]
pub struct SlotError {
    /// Which instant cannot be placed.
    pub what: &'static str,
    /// Where it would be.
    pub needed: u64,
    /// Where it must be.
    pub allowed: u64,
    /// S-0-0002.
    pub cycle: u64,
}

impl Slots {
    /// Bytes of all records of the MDT, S-0-0010.
    pub fn mdt_length(data: &[DriveData]) -> usize {
        data.iter().map(|drive| 4 + drive.mdt_bytes).sum()
    }

    /// S-0-0009 of every drive: its record's first byte, counted from 1.
    pub fn mdt_positions(data: &[DriveData]) -> Vec<u16> {
        let ends = data.iter().scan(1, |position, drive| {
            let begin = *position;
            *position += 4 + drive.mdt_bytes;
            Some(begin as u16)
        });
        ends.collect()
    }

    /// The slots by the rules of sercos2.md 5.3, ATs as early and as close as possible.
    ///
    /// # Errors
    ///
    /// When the telegrams do not fit into `cycle` microseconds.
    pub fn compute(
        times: &[DriveTimes],
        data: &[DriveData],
        cycle: u16,
        rate: BitRate,
        place: MdtPlace,
    ) -> Result<Self, SlotError> {
        let cycle = u64::from(cycle);
        let most = |time: fn(&DriveTimes) -> u16| times.iter().map(time).max().map_or(0, u64::from);
        let mut t1 = Vec::new();
        let mut end_of_last = 0;
        let mut earliest_t2 = 0;
        for (drive, (needs, sends)) in times.iter().zip(data).enumerate() {
            let same_slave = drive > 0 && times[drive - 1].arrangement == needs.arrangement;
            let recovery = if same_slave { u64::from(times[drive - 1].t_at_at) } else { 0 };
            let after_last = if drive == 0 { 0 } else { end_of_last + 2 * JITTER_MICROSECONDS + recovery };
            let start = after_last.max(u64::from(needs.t1_min));
            end_of_last = start + longest_microseconds(4 + sends.at_bytes, rate);
            earliest_t2 = earliest_t2.max(end_of_last + u64::from(needs.t_at_mdt) + 2 * JITTER_MICROSECONDS);
            t1.push(start as u16);
        }
        let mdt = longest_microseconds(Self::mdt_length(data), rate);
        let mst = longest_microseconds(1, rate);
        let behind = mdt + mst + most(|drive| drive.t_mdt_mst) + 2 * JITTER_MICROSECONDS;
        let fits = |what, needed, allowed| {
            if needed <= allowed { Ok(()) } else { Err(SlotError { what, needed, allowed, cycle }) }
        };
        let latest_t2 = cycle.saturating_sub(behind);
        fits("MDT start t2", earliest_t2, latest_t2)?;
        let t3_after_t2 = mdt + most(|drive| drive.t_mdt_command) + 2 * JITTER_MICROSECONDS;
        fits("command value valid t3", earliest_t2 + t3_after_t2, cycle)?;
        let t2 = match place {
            MdtPlace::Early => earliest_t2,
            MdtPlace::Late => latest_t2.min(cycle - t3_after_t2),
        };
        let t5 = most(|drive| drive.t5) + 2 * JITTER_MICROSECONDS;
        fits("feedback processing t5", t5, cycle)?;
        Ok(Self { t1, t2: t2 as u16, t3: (t2 + t3_after_t2) as u16, t4: (cycle - t5) as u16 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn durations_of_the_reference() {
        // sercos2.md 5.2, rounded up to whole microseconds.
        assert_eq!(longest_microseconds(1, BitRate::M2), 28); // 27.2
        assert_eq!(longest_microseconds(4, BitRate::M2), 42); // 41.6
        assert_eq!(longest_microseconds(12, BitRate::M2), 80);
        assert_eq!(longest_microseconds(32, BitRate::M2), 176);
        assert_eq!(longest_microseconds(12, BitRate::M16), 10);
    }

    #[test]
    fn the_recorded_masters_t2_t3_t4_come_out_of_its_drives_times() {
        // sercos2.md 5.4: with tMTSG = 5, t5 = 300, tMTSY = 12 the recorded slots follow from the rules.
        let times = [DriveTimes {
            t1_min: 92,
            t_at_mdt: 12,
            t5: 300,
            t_mdt_mst: 12,
            t_mdt_command: 5,
            t_at_at: 0,
            arrangement: 0,
        }; 4];
        let data = [DriveData { at_bytes: 8, mdt_bytes: 4 }; 4];
        let slots =
            Slots::compute(&times, &data, 2000, BitRate::M2, MdtPlace::Late).expect("the recorded ring has room");
        assert_eq!((slots.t2, slots.t3, slots.t4), (1782, 1965, 1698));
        assert_eq!(slots.t1, [92, 174, 256, 338]);
        assert_eq!(Slots::mdt_positions(&data), [1, 9, 17, 25]);
        assert_eq!(Slots::mdt_length(&data), 32);
    }

    #[test]
    fn too_many_drives_for_the_cycle_are_refused() {
        let times = [DriveTimes {
            t1_min: 20,
            t_at_mdt: 10,
            t5: 80,
            t_mdt_mst: 10,
            t_mdt_command: 20,
            ..DriveTimes::default()
        }; 8];
        let data = [DriveData { at_bytes: 8, mdt_bytes: 8 }; 8];
        let error = Slots::compute(&times, &data, 500, BitRate::M2, MdtPlace::Late)
            .expect_err("eight drives need more than 500 us");
        assert_eq!(
            error.to_string(),
            "no room for all telegrams: MDT start t2 at 686 us, 0 us at most in a cycle of 500 us"
        );
        assert!(Slots::compute(&times, &data, 500, BitRate::M16, MdtPlace::Late).is_ok());
    }

    proptest! {
        #[test]
        fn slots_keep_the_rules(
            drives in prop::collection::vec((1u16..200, 0u16..50, 0u16..400, 0u16..60, 0u16..60, 0usize..9, 0usize..9), 1..9),
            cycle in 4u16..40,
            rate in prop::sample::select(&BitRate::ALL[..]),
            early in any::<bool>(),
        ) {
            let times: Vec<_> = drives
                .iter()
                .map(|d| DriveTimes { t1_min: d.0, t_at_mdt: d.1, t5: d.2, t_mdt_mst: d.3, t_mdt_command: d.4, t_at_at: 0, arrangement: 0 })
                .collect();
            let data: Vec<_> = drives.iter().map(|d| DriveData { at_bytes: 2 * d.5, mdt_bytes: 2 * d.6 }).collect();
            let cycle = cycle * 250;
            let place = if early { MdtPlace::Early } else { MdtPlace::Late };
            let Ok(slots) = Slots::compute(&times, &data, cycle, rate, place) else { return Ok(()) };
            let cycle = u64::from(cycle);
            let at = |drive: usize| longest_microseconds(4 + data[drive].at_bytes, rate);
            let mdt = longest_microseconds(Slots::mdt_length(&data), rate);
            let [t2, t3, t4] = [slots.t2, slots.t3, slots.t4].map(u64::from);
            for (drive, times) in times.iter().enumerate() {
                let t1 = u64::from(slots.t1[drive]);
                prop_assert!(t1 >= u64::from(times.t1_min));
                prop_assert!(drive == 0 || t1 >= u64::from(slots.t1[drive - 1]) + at(drive - 1) + 2);
                prop_assert!(t2 >= t1 + at(drive) + u64::from(times.t_at_mdt) + 2);
                prop_assert!(t3 >= t2 + mdt + u64::from(times.t_mdt_command) + 2 && t3 <= cycle);
                prop_assert!(t2 + mdt + longest_microseconds(1, rate) + u64::from(times.t_mdt_mst) + 2 <= cycle);
                prop_assert!(t4 + u64::from(times.t5) + 2 <= cycle);
            }
        }
    }
}
