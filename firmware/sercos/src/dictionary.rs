//! The table of all data blocks. Everything that knows IDNs (service channel, IDN lists, parameter memory, manual,
//! host tool) is derived from it.
//!
//! Attributes are those of a real drive where ours does not differ (sercos2.md Appendix A). An IDN is listed only if
//! somebody in the drive reads or writes it.

use crate::attribute::Attribute;
use crate::data_block::Location::{Command, Dictionary, Live, Parameter};
use crate::data_block::{Cyclic, DataBlock, NeededFor, Selection};
use crate::idn::Idn;

/// The data block of an IDN.
pub fn find(idn: Idn) -> Option<&'static DataBlock> {
    DICTIONARY.get(index_of(idn)?)
}

/// The data blocks of a selection, in ascending order of their IDN.
pub fn select(selection: Selection) -> impl Iterator<Item = &'static DataBlock> {
    DICTIONARY.iter().filter(move |block| block.is_in(selection))
}

/// Position of an IDN in [`DICTIONARY`].
pub(crate) fn index_of(idn: Idn) -> Option<usize> {
    DICTIONARY.binary_search_by_key(&idn, |block| block.idn).ok()
}

// Formats of operation data: the attribute without decimal places and write protection.
const BITS: u32 = 0x0001_0001;
const U16: u32 = 0x0011_0001;
const I16: u32 = 0x0021_0001;
const HEX: u32 = 0x0031_0001;
const U32: u32 = 0x0012_0001;
const I32: u32 = 0x0022_0001;
const TEXT: u32 = 0x0044_0001;
const IDNS: u32 = 0x0055_0001;
const HEXES: u32 = 0x0035_0001;
const COMMAND: u32 = 0x0009_0001;

// Phases in which the master may write.
const ALWAYS: u32 = 0;
const IN_CP2: u32 = 0x6000_0000;
const IN_CP3: u32 = 0x5000_0000;
const IN_CP2_CP3: u32 = 0x4000_0000;
const NEVER: u32 = 0x7000_0000;

macro_rules! limits {
    () => {
        (None::<i64>, None::<i64>)
    };
    ($minimum:literal $maximum:literal) => {
        (Some::<i64>($minimum), Some::<i64>($maximum))
    };
}

/// One row: documentation; set and number, name, unit; format with decimal places, phases in which the master may
/// write; limits; default; location and further properties.
macro_rules! dictionary {
    ($(
        $(#[doc = $documentation:literal])+
        $set:ident $number:literal $name:literal [$unit:literal]
        $format:ident / $decimals:literal written $phases:ident
        ($($minimum:literal to $maximum:literal)?) = $default:literal
        => $location:expr $(, $property:ident)*;
    )+) => {
        pub(crate) const ROWS: &[DataBlock] = &[$(
            DataBlock {
                idn: idn!($set $number),
                name: $name,
                unit: $unit,
                attribute: Attribute::new_with_raw_value($format | $phases | ($decimals << 24)),
                minimum: limits!($($minimum $maximum)?).0,
                maximum: limits!($($minimum $maximum)?).1,
                default: $default,
                location: $location,
                stored: false,
                needed_for: NeededFor::Neither,
                cyclic: Cyclic::Never,
                documentation: concat!($($documentation),+).trim_ascii(),
            }
            $(.$property())*
        ),+];
    };
}

macro_rules! idn {
    (S $number:literal) => {
        Idn::standard($number)
    };
    (P $number:literal) => {
        Idn::product($number)
    };
}

/// All data blocks in ascending order of their IDN.
pub static DICTIONARY: &[DataBlock] = ROWS;

dictionary! {
    /// Interval of new command values; a multiple of S-0-0002, and equal to it if the master never writes it.
    S 1 "Control unit cycle time (tNcyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3;
    /// Distance of two MSTs from CP3 on; a multiple of 250 us.
    S 2 "Communication cycle time (tScyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3;
    /// End of the MST to the earliest AT of this drive.
    S 3 "Shortest AT transmission starting time (t1min)" ["us"] U16/0 written NEVER () = 12 => Parameter;
    /// End of the own AT to the earliest start of the MDT.
    S 4 "Transmit/receive transition time (tATMT)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// Feedback capture (t4) to the end of the MST before the AT that carries the value.
    S 5 "Minimum feedback processing time (t5)" ["us"] U16/0 written NEVER () = 30 => Parameter;
    /// End of the MST to the start of this drive's AT, from CP3 on.
    S 6 "AT transmission starting time (t1)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives capture their feedback.
    S 7 "Feedback acquisition capture point (t4)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives make their command values valid.
    S 8 "Command value valid time (t3)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// First byte of this drive's data record in the MDT, counted from 1 after the address; odd.
    S 9 "Position of data record in MDT" [""] U16/0 written IN_CP2 (1 to 65_531) = 1 => Parameter, needed_for_cp3;
    /// Bytes of all data records of the MDT; even.
    S 10 "Length of MDT" [""] U16/0 written IN_CP2 (4 to 65_534) = 4 => Parameter, needed_for_cp3;
    /// Errors that shut the drive down, until S-0-0099 clears them.
    S 11 "Class 1 diagnostic (C1D)" [""] BITS/0 written NEVER () = 0 => Live, in_at;
    /// Warnings. Reading it over the service channel clears bit 12 of the status word.
    S 12 "Class 2 diagnostic (C2D)" [""] BITS/0 written NEVER () = 0 => Live, in_at;
    /// Operation status. Reading it over the service channel clears bit 11 of the status word.
    S 13 "Class 3 diagnostic (C3D)" [""] BITS/0 written NEVER () = 0 => Live, in_at;
    /// Phase in bits 2 to 0; communication errors in bits 3 to 9, until S-0-0099 clears them.
    S 14 "Interface status" [""] BITS/0 written NEVER () = 0 => Live, in_at;
    /// 0 to 7: contents of the cyclic telegrams; 7 takes them from S-0-0016 and S-0-0024.
    S 15 "Telegram type parameter" [""] BITS/0 written IN_CP2 () = 4 => Parameter, needed_for_cp3;
    /// IDNs in the AT if the telegram type is 7, in this order.
    S 16 "Configuration list of AT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3;
    /// Every IDN of the drive.
    S 17 "IDN list of all operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::All);
    /// IDNs that S-0-0127 checks.
    S 18 "IDN list of operation data for CP2" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::NeededForCp3);
    /// IDNs that S-0-0128 checks.
    S 19 "IDN list of operation data for CP3" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::NeededForCp4);
    /// IDNs that S-0-0127 found invalid; empty after a positive check.
    S 21 "IDN list of invalid operation data for CP2" [""] IDNS/0 written NEVER () = 0 => Live;
    /// IDNs that S-0-0128 found invalid; empty after a positive check.
    S 22 "IDN list of invalid operation data for CP3" [""] IDNS/0 written NEVER () = 0 => Live;
    /// IDNs in this drive's MDT record if the telegram type is 7, in this order.
    S 24 "Configuration list of MDT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3;
    /// All procedure commands.
    S 25 "IDN list of all procedure commands" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::Commands);
    /// Invalid MSTs in CP3 and CP4; two of a burst count; cleared on the way to CP3.
    S 28 "MST error counter" [""] U16/0 written NEVER () = 0 => Live;
    /// Invalid MDTs in CP3 and CP4; two of a burst count; cleared on the way to CP3.
    S 29 "MDT error counter" [""] U16/0 written NEVER () = 0 => Live;
    /// Firmware and its version.
    S 30 "Manufacturer version" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Operation mode of control word bits 11, 9, 8 = 000: 2 velocity, 3 position, 11 position without lag.
    S 32 "Primary operation mode" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 001; 0: none.
    S 33 "Secondary operation mode 1" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 010; 0: none.
    S 34 "Secondary operation mode 2" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 011; 0: none.
    S 35 "Secondary operation mode 3" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Velocity command of the control unit.
    S 36 "Velocity command value" ["rpm"] I32/4 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Velocity of the motor encoder.
    S 40 "Velocity feedback value 1" ["rpm"] I32/4 written NEVER () = 0 => Live, in_at;
    /// Bit 0 inverts the velocity command, bit 2 the velocity feedback.
    S 43 "Velocity polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Bits 2 to 0: 2 rotary; bit 3: by S-0-0045 and S-0-0046 instead of 0.0001 rpm; bit 5: per second.
    S 44 "Velocity data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one velocity increment, with the exponent of S-0-0046.
    S 45 "Velocity data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0045.
    S 46 "Velocity data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -4 => Parameter, stored, needed_for_cp4;
    /// Position command of the control unit.
    S 47 "Position command value" ["deg"] I32/4 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Position of the motor encoder, captured at t4.
    S 51 "Position feedback value 1 (motor feedback)" ["deg"] I32/4 written NEVER () = 0 => Live, in_at;
    /// Bit 0 inverts the position command, bit 2 the position feedback.
    S 55 "Position polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Following distance below which C3D bit 6 (in position) is set.
    S 57 "Position window" ["deg"] I32/4 written ALWAYS (0 to 2_147_483_647) = 10_000 => Parameter, stored;
    /// Bits 2 to 0: 2 rotary; bit 3: by S-0-0079 instead of 0.0001 deg; bit 7: modulo.
    S 76 "Position data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Position increments of one motor revolution, if bit 3 of S-0-0076 is set.
    S 79 "Rotational position resolution" [""] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Torque-producing current in per cent of S-0-0111.
    S 84 "Torque feedback value" ["%"] I16/1 written NEVER () = 0 => Live, in_at;
    /// Recovery time between two ATs of the same slave; this slave sends one.
    S 87 "Transmit/transmit recovery time (tATAT)" ["us"] U16/0 written NEVER () = 0 => Parameter;
    /// End of the MDT to the start of the next MST.
    S 88 "Receive/receive recovery time (tMTSY)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// End of the MST to the start of the MDT, from CP3 on.
    S 89 "MDT transmission starting time (t2)" ["us"] U16/0 written IN_CP2 (0 to 65_535) = 0 => Parameter, needed_for_cp3;
    /// End of the MDT to the earliest t3.
    S 90 "Command value proceeding time (tMTSG)" ["us"] U16/0 written NEVER () = 2 => Parameter;
    /// Largest velocity that the drive commands in either direction.
    S 91 "Bipolar velocity limit value" ["rpm"] U32/4 written ALWAYS (1 to 2_147_483_647) = 30_000_000 => Parameter, stored, needed_for_cp4;
    /// Largest torque in either direction, in per cent of S-0-0111.
    S 92 "Bipolar torque limit value" ["%"] U16/1 written ALWAYS (0 to 65_535) = 2_000 => Parameter, stored, needed_for_cp4;
    /// State or error of the drive in plain words; belongs to S-0-0390.
    S 95 "Diagnostic message" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Both bytes are the drive address: one drive in this slave.
    S 96 "Slave arrangement (SLKN)" [""] HEX/0 written NEVER () = 0 => Live;
    /// Bits of S-0-0012 that set the change bit 12 of the status word.
    S 97 "Mask class 2 diagnostic" [""] BITS/0 written ALWAYS () = 0xFFFF => Parameter, stored;
    /// Bits of S-0-0013 that set the change bit 11 of the status word.
    S 98 "Mask class 3 diagnostic" [""] BITS/0 written ALWAYS () = 0xFFFF => Parameter, stored;
    /// Clears errors whose cause is gone.
    S 99 "Reset class 1 diagnostic" [""] COMMAND/0 written ALWAYS () = 0 => Command;
    /// Current for one unit of velocity difference at the motor; one increment is 1 mA s/rad.
    S 100 "Velocity loop proportional gain" ["As/rad"] U16/3 written ALWAYS (0 to 65_535) = 100 => Parameter, stored;
    /// Time in which the integral part reaches the proportional part; 0 switches the integral part off.
    S 101 "Velocity loop integral action time" ["ms"] U16/1 written ALWAYS (0 to 65_535) = 100 => Parameter, stored;
    /// Position range if bit 7 of S-0-0076 is set.
    S 103 "Modulo value" ["deg"] I32/4 written IN_CP2_CP3 (0 to 2_147_483_647) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Velocity for one unit of following distance.
    S 104 "Position loop Kv-factor" ["1000/min"] U16/2 written ALWAYS (1 to 65_535) = 100 => Parameter, stored;
    /// Largest current of the motor.
    S 109 "Motor peak current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 20_000 => Parameter, stored, needed_for_cp4;
    /// Current at full scale of the amplifier's command input; writable, because the amplifier is chosen by the builder.
    S 110 "Amplifier peak current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 20_000 => Parameter, stored, needed_for_cp4;
    /// Current of the motor at its continuous stall torque: 100 % of all torque data.
    S 111 "Motor continuous stall current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 5_000 => Parameter, stored, needed_for_cp4;
    /// The drive never commands a higher velocity.
    S 113 "Maximum motor speed" ["rpm"] U32/4 written IN_CP2_CP3 (1 to 2_147_483_647) = 60_000_000 => Parameter, stored, needed_for_cp4;
    /// Lines of the motor encoder; four increments each.
    S 116 "Resolution of feedback 1" ["cycles/rev"] U32/0 written IN_CP2_CP3 (1 to 1_048_576) = 2_500 => Parameter, stored, needed_for_cp4;
    /// Velocity below which C3D bit 1 (standstill) is set.
    S 124 "Standstill window" ["rpm"] I32/4 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Checks everything that CP3 needs; findings in S-0-0021.
    S 127 "CP3 transition check" [""] COMMAND/0 written IN_CP2 () = 0 => Command;
    /// Checks everything that CP4 needs; findings in S-0-0022.
    S 128 "CP4 transition check" [""] COMMAND/0 written IN_CP3 () = 0 => Command;
    /// The control word of the last MDT.
    S 134 "Master control word" [""] BITS/0 written NEVER () = 0 => Live;
    /// The status word of the last AT.
    S 135 "Drive status word" [""] BITS/0 written NEVER () = 0 => Live;
    /// Ramp of halt and of stopping after an error or Drive OFF.
    S 138 "Bipolar acceleration limit value" ["rad/s^2"] I32/3 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored;
    /// Type of the drive.
    S 140 "Controller type" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Type of the motor, for the reader; up to 40 characters.
    S 141 "Motor type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// What the axis does, for the reader; up to 40 characters.
    S 142 "Application type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// Version of the SERCOS specification.
    S 143 "System interface version" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Velocity difference below which C3D bit 0 (n_feedback = n_command) is set.
    S 157 "Velocity window" ["rpm"] I32/4 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Following distance above which the drive shuts down with C1D bit 11; 0: not monitored.
    S 159 "Monitoring window" ["deg"] I32/4 written ALWAYS (0 to 2_147_483_647) = 300_000 => Parameter, stored;
    /// Bytes of configurable data that the AT can hold.
    S 185 "Length of the configurable data record in the AT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// Bytes of configurable data that this drive's MDT record can hold.
    S 186 "Length of the configurable data record in the MDT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// IDNs that S-0-0016 may name.
    S 187 "IDN list of configurable data in the AT" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::ConfigurableInAt);
    /// IDNs that S-0-0024 may name.
    S 188 "IDN list of configurable data in the MDT" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::ConfigurableInMdt);
    /// Position command minus position feedback.
    S 189 "Following distance" ["deg"] I32/4 written NEVER () = 0 => Live, in_at;
    /// IDNs that a control saves and restores.
    S 192 "IDN list of backup operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::Backup);
    /// Operation modes that S-0-0032 to S-0-0035 may name.
    S 292 "List of supported operation modes" [""] HEXES/0 written NEVER () = 0 => Live;
    /// Part of the commanded velocity that goes past the position loop in modes without lag; 100 % leaves no lag.
    S 296 "Velocity feed-forward gain" ["%"] U16/1 written ALWAYS (0 to 1_000) = 1_000 => Parameter, stored;
    /// State or error of the drive as a number; belongs to S-0-0095.
    S 390 "Diagnostic number" [""] HEX/0 written NEVER () = 0 => Live, in_at;
    /// A word of the control's own choice that comes back in the AT.
    P 19 "Application word" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, in_at;
}

const fn is_ascending(rows: &[DataBlock]) -> bool {
    let mut rest = rows;
    while let [first, tail @ ..] = rest {
        if let [second, ..] = tail {
            if first.idn.0 >= second.idn.0 {
                return false;
            }
        }
        rest = tail;
    }
    true
}

const _: () = assert!(is_ascending(ROWS), "the rows of the dictionary are not in ascending order of their IDN");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attribute::{Format, Length};
    use crate::data_block::Location;

    #[test]
    fn every_row_is_consistent() {
        for block in DICTIONARY {
            let idn = block.idn;
            let attribute = block.attribute;
            assert_eq!(find(idn).map(|found| found.idn), Some(idn));
            assert_eq!(attribute.conversion_factor(), 1, "{idn}");
            assert!(!block.name.is_empty() && block.name.is_ascii() && block.name.len() <= 60, "{idn}: {}", block.name);
            assert!(block.unit.is_ascii(), "{idn}");
            assert!(block.documentation.ends_with('.'), "{idn}: {}", block.documentation);
            assert_eq!(attribute.command(), block.location == Location::Command, "{idn}");
            match block.location {
                Location::Command => assert_eq!(attribute.length(), Length::Two, "{idn}"),
                Location::Dictionary(_) => {
                    assert_eq!((attribute.format(), attribute.is_read_only()), (Format::Idn, true), "{idn}")
                }
                _ => {}
            }
            // What the service channel can handle.
            match attribute.length() {
                Length::Two | Length::Four => {}
                Length::ListOfBytes => assert_eq!(attribute.format(), Format::Text, "{idn}"),
                Length::ListOfTwo => assert_ne!(attribute.format(), Format::Text, "{idn}"),
                length => panic!("{idn}: {length:?}"),
            }
            for limit in [block.minimum, block.maximum].into_iter().flatten() {
                let raw = match attribute.length() {
                    Length::Two => limit as u32 & 0xFFFF,
                    _ => limit as u32,
                };
                assert_eq!(attribute.value_of(raw), limit, "{idn}: a limit does not fit the format");
                assert!(block.fixed_bytes().is_some(), "{idn}: a list has no limits");
            }
            if block.location == Location::Parameter && block.fixed_bytes().is_some() {
                assert!(block.minimum.is_none_or(|minimum| block.default >= minimum), "{idn}");
                assert!(block.maximum.is_none_or(|maximum| block.default <= maximum), "{idn}");
            }
            assert!(
                block.cyclic == Cyclic::Never || block.fixed_bytes().is_some(),
                "{idn}: only fixed lengths are cyclic"
            );
            assert!(!block.stored || (block.location == Location::Parameter && !attribute.is_read_only()), "{idn}");
            assert!(block.needed_for == NeededFor::Neither || block.location == Location::Parameter, "{idn}");
        }
    }

    #[test]
    fn the_attributes_that_masters_know_by_heart_are_those_of_a_real_drive() {
        for (number, attribute) in [
            (1, 0x6011_0001u32),
            (3, 0x7011_0001),
            (11, 0x7001_0001),
            (15, 0x6001_0001),
            (16, 0x6055_0001),
            (17, 0x7055_0001),
            (30, 0x7044_0001),
            (32, 0x4001_0001),
            (46, 0x4021_0001),
            (47, 0x0422_0001),
            (51, 0x7422_0001),
            (79, 0x4012_0001),
            (84, 0x7121_0001),
            (96, 0x7031_0001),
            (97, 0x0001_0001),
            (99, 0x0009_0001),
            (103, 0x4422_0001),
            (109, 0x4312_0001),
            (113, 0x4412_0001),
            (127, 0x6009_0001),
            (128, 0x5009_0001),
            (141, 0x0044_0001),
            (188, 0x7055_0001),
            (292, 0x7035_0001),
            (390, 0x7031_0001),
        ] {
            let block = find(Idn::standard(number)).unwrap();
            assert_eq!(block.attribute.raw_value(), attribute, "{}", block.idn);
        }
    }

    #[test]
    fn the_amplifiers_peak_current_is_as_writable_as_the_motors_for_the_builder_chooses_both() {
        // A real drive has 7312_0001H: its amplifier is built in.
        let [motor, amplifier] = [109, 110].map(|number| find(Idn::standard(number)).unwrap());
        assert_eq!(amplifier.attribute, motor.attribute);
        assert_eq!(amplifier.attribute.raw_value(), 0x4312_0001);
        assert!(amplifier.stored);
    }

    #[test]
    fn the_idn_lists_hold_what_the_reference_asks_for() {
        let numbers = |selection| -> std::vec::Vec<u16> { select(selection).map(|block| block.idn.0).collect() };
        assert_eq!(numbers(Selection::NeededForCp3), [1, 2, 6, 7, 8, 9, 10, 15, 16, 24, 89]);
        assert_eq!(numbers(Selection::Commands), [99, 127, 128]);
        assert_eq!(numbers(Selection::ConfigurableInMdt), [36, 47]);
        assert_eq!(numbers(Selection::ConfigurableInAt), [11, 12, 13, 14, 40, 51, 84, 189, 390, 0x8013]);
        assert!(numbers(Selection::NeededForCp4).contains(&32));
        assert_eq!(numbers(Selection::All).len(), DICTIONARY.len());
        assert!(!numbers(Selection::Backup).contains(&2));
    }

    #[test]
    fn an_unknown_idn_is_not_found() {
        assert!(find(Idn::standard(0)).is_none());
        assert!(find(Idn(0x1002)).is_none(), "parameter set 1 does not exist");
        assert!(find(Idn::product(4095)).is_none());
    }
}
