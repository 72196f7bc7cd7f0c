//! Data containers: what of a telegram goes where (sercon816.md 6.3).

use arbitrary_int::{u3, u10};
use bitbybit::bitfield;

/// Word 0 of a data container. A receive container has its position in the telegram in word 1; then follow the data.
#[bitfield(u16, default = 0, debug)]
#[derive(PartialEq, Eq)]
pub struct DataContainer {
    /// LEN: 16-bit words of this block.
    #[bits(0..=9, rw)]
    length: u10,
    /// SVFL: data words 0 and 1 are control or status word and service info word.
    #[bit(10, rw)]
    service_channel: bool,
    /// NSV: the service container, 0 to 7.
    #[bits(11..=13, rw)]
    service_container: u3,
    /// SCMASTER: the service channel is processed as master.
    #[bit(14, rw)]
    as_master: bool,
    /// LASTDC: the last container of the telegram.
    #[bit(15, rw)]
    last: bool,
}

impl DataContainer {
    /// The only container of a slave's telegram, with service container 0: 8400H | words.
    ///
    /// `words` counts the control or status word, the service info word and the cyclic data; above 1023 it wraps.
    #[must_use]
    pub const fn of_slave(words: u16) -> Self {
        Self::DEFAULT.with_last(true).with_service_channel(true).with_length(u10::new(words & 0x3FF))
    }

    /// The same for a master: C400H | words.
    #[must_use]
    pub const fn of_master(words: u16) -> Self {
        Self::of_slave(words).with_as_master(true)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn containers_match_the_published_words() {
        assert_eq!(DataContainer::of_master(2).raw_value(), 0xC402);
        assert_eq!(DataContainer::of_slave(2).raw_value(), 0x8402);
        assert_eq!(DataContainer::of_slave(4).raw_value(), 0x8404);
    }

    proptest! {
        #[test]
        fn every_word_reads_back_from_its_fields(raw: u16) {
            let word = DataContainer::new_with_raw_value(raw);
            let rebuilt = DataContainer::DEFAULT
                .with_length(word.length())
                .with_service_channel(word.service_channel())
                .with_service_container(word.service_container())
                .with_as_master(word.as_master())
                .with_last(word.last());
            prop_assert_eq!(rebuilt.raw_value(), raw);
        }
    }
}
