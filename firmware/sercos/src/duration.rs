//! How long telegrams take on the fibre (sercos2.md 5.2).

/// Bit rate of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BitRate {
    /// 2 Mbit/s.
    Mbit2,
    /// 4 Mbit/s.
    Mbit4,
    /// 8 Mbit/s.
    Mbit8,
    /// 16 Mbit/s.
    Mbit16,
}

impl BitRate {
    /// 2, 4, 8 or 16.
    pub const fn megabits_per_second(self) -> u32 {
        match self {
            BitRate::Mbit2 => 2,
            BitRate::Mbit4 => 4,
            BitRate::Mbit8 => 8,
            BitRate::Mbit16 => 16,
        }
    }

    /// Longest duration in ns of a telegram with so many bytes between its flags: (16 + 9.6 n) bit times, 9.6 for
    /// eight bits and the most zero insertions. Exact up to 400 000 bytes, above which it saturates.
    pub const fn longest_nanoseconds(self, bytes: u32) -> u32 {
        self.per_rate(bytes.saturating_mul(9_600).saturating_add(16_000))
    }

    /// Shortest duration in ns, without zero insertion: (16 + 8 n) bit times.
    pub const fn shortest_nanoseconds(self, bytes: u32) -> u32 {
        self.per_rate(bytes.saturating_mul(8_000).saturating_add(16_000))
    }

    const fn per_rate(self, nanoseconds_at_one_megabit: u32) -> u32 {
        match self {
            BitRate::Mbit2 => nanoseconds_at_one_megabit >> 1,
            BitRate::Mbit4 => nanoseconds_at_one_megabit >> 2,
            BitRate::Mbit8 => nanoseconds_at_one_megabit >> 3,
            BitRate::Mbit16 => nanoseconds_at_one_megabit >> 4,
        }
    }
}

/// Bytes of an MST between its flags: address, phase, FCS.
pub const MST_BYTES: u32 = 4;

/// Bytes of an MDT of CP1 and CP2 between its flags: address, control word, INFO, FCS.
pub const MDT_BYTES_CP1_CP2: u32 = 7;

/// Bytes of an AT between its flags, with so many bytes of configurable data: address, status word, INFO, data, FCS.
pub const fn at_bytes(data_bytes: u16) -> u32 {
    (data_bytes as u32).saturating_add(7)
}

/// Bytes of an MDT of CP3 and CP4 between its flags, with the length of S-0-0010: address, all data records, FCS.
pub const fn mdt_bytes(length_of_mdt: u16) -> u32 {
    (length_of_mdt as u32).saturating_add(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_durations_are_those_of_the_table_of_the_reference() {
        let tenths = |rate: BitRate, bytes| rate.longest_nanoseconds(bytes) / 100;
        for (bytes, expected) in [
            (MST_BYTES, [272, 136, 68, 34]),
            (at_bytes(0), [416, 208, 104, 52]),
            (at_bytes(8), [800, 400, 200, 100]),
            (at_bytes(16), [1184, 592, 296, 148]),
            (MDT_BYTES_CP1_CP2, [416, 208, 104, 52]),
            (mdt_bytes(32), [1760, 880, 440, 220]),
            (mdt_bytes(48 * 12), [27_872, 13_936, 6_968, 3_484]),
        ] {
            for (rate, expected) in
                [BitRate::Mbit2, BitRate::Mbit4, BitRate::Mbit8, BitRate::Mbit16].into_iter().zip(expected)
            {
                assert_eq!(tenths(rate, bytes), expected, "{bytes} bytes at {rate:?}");
            }
        }
        assert_eq!(BitRate::Mbit2.shortest_nanoseconds(MST_BYTES), 24_000);
        assert_eq!(BitRate::Mbit16.shortest_nanoseconds(MST_BYTES), 3_000);
    }

    #[test]
    fn the_longest_mdt_that_s_0_0010_can_name_is_exact() {
        assert_eq!(BitRate::Mbit2.longest_nanoseconds(mdt_bytes(65_534)), 8_000 + 65_537 * 4_800);
    }
}
