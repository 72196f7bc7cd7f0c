//! The table of all data blocks. Everything that knows IDNs (service channel, IDN lists, parameter memory, manual,
//! host tool) is derived from it.
//!
//! Attributes are those of a real drive where ours does not differ (sercos2.md Appendix A). An IDN is listed only if
//! somebody in the drive reads or writes it.

use crate::attribute::Attribute;
use crate::data_block::Location::{Command, Dictionary, Live, Parameter};
use crate::data_block::{Bits, Cyclic, DataBlock, NeededFor, Selection};
use crate::idn::Idn;
use crate::weighting::{Dimension, Unit};

/// The data block of an IDN.
pub fn find(idn: Idn) -> Option<&'static DataBlock> {
    DICTIONARY.get(index_of(idn)?)
}

/// The data blocks of a selection, in ascending order of their IDN.
pub fn select(selection: Selection) -> impl Iterator<Item = &'static DataBlock> {
    DICTIONARY.iter().filter(move |block| block.is_in(selection))
}

/// The IDNs of a selection, in ascending order: the contents of an IDN list, put together by the compiler.
pub fn list(selection: Selection) -> &'static [Idn] {
    macro_rules! lists {
        ($($name:ident),+ $(,)?) => {
            match selection {
                $(Selection::$name => {
                    static IDNS: [Idn; count(Selection::$name)] = collect(Selection::$name);
                    &IDNS
                })+
            }
        };
    }
    lists!(
        All,
        NeededForCp3,
        NeededForCp4,
        ChangeableInCp4,
        Commands,
        ConfigurableInAt,
        ConfigurableInMdt,
        Backup,
        BitSources,
        BitTargets,
    )
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn count(selection: Selection) -> usize {
    let mut count = 0;
    let mut row = 0;
    while row < ROWS.len() {
        if ROWS[row].is_in(selection) {
            count += 1;
        }
        row += 1;
    }
    count
}

#[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler only")]
const fn collect<const N: usize>(selection: Selection) -> [Idn; N] {
    let mut idns = [Idn(0); N];
    let mut found = 0;
    let mut row = 0;
    while row < ROWS.len() {
        if ROWS[row].is_in(selection) {
            idns[found] = ROWS[row].idn;
            found += 1;
        }
        row += 1;
    }
    idns
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
const HEX32: u32 = 0x0032_0001;
const I32: u32 = 0x0022_0001;
const TEXT: u32 = 0x0044_0001;
const IDNS: u32 = 0x0055_0001;
const HEXES: u32 = 0x0035_0001;
const NUMBERS: u32 = 0x0015_0001;
const LONGS: u32 = 0x0016_0001;
const HEX_LONGS: u32 = 0x0036_0001;
const SIGNED_LONGS: u32 = 0x0026_0001;
const COMMAND: u32 = 0x0009_0001;

// Phases in which the master may write.
const ALWAYS: u32 = 0;
const IN_CP2: u32 = 0x6000_0000;
const IN_CP3: u32 = 0x5000_0000;
const IN_CP2_CP3: u32 = 0x4000_0000;
const IN_CP4: u32 = 0x3000_0000;
const NEVER: u32 = 0x7000_0000;

macro_rules! unit {
    (position) => {
        Unit::Scaled(Dimension::Position)
    };
    (velocity) => {
        Unit::Scaled(Dimension::Velocity)
    };
    (acceleration) => {
        Unit::Scaled(Dimension::Acceleration)
    };
    (jerk) => {
        Unit::Scaled(Dimension::Jerk)
    };
    (torque) => {
        Unit::Scaled(Dimension::Torque)
    };
    ($unit:literal) => {
        Unit::Fixed($unit)
    };
}

macro_rules! limits {
    () => {
        (None::<i64>, None::<i64>)
    };
    ($minimum:literal $maximum:literal) => {
        (Some::<i64>($minimum), Some::<i64>($maximum))
    };
}

/// One row: documentation; set and number, name, unit or what the data measure in the increments of their scaling; format, with decimal
/// places for a unit; phases in which the master may write; limits; default; location and further properties.
macro_rules! dictionary {
    ($(
        $(#[doc = $documentation:literal])+
        $set:ident $number:literal $name:literal [$unit:tt]
        $format:ident $(/ $decimals:literal)? written $phases:ident
        ($($minimum:literal to $maximum:literal)?) = $default:literal
        => $location:expr $(, $property:ident)*;
    )+) => {
        pub(crate) const ROWS: &[DataBlock] = &[$(
            DataBlock {
                idn: idn!($set $number),
                name: $name,
                unit: unit!($unit),
                attribute: Attribute::new_with_raw_value(
                    $format | $phases | ((unit!($unit).preferred_decimals(0 $(+ $decimals)?) as u32) << 24)
                ),
                minimum: limits!($($minimum $maximum)?).0,
                maximum: limits!($($minimum $maximum)?).1,
                default: $default,
                location: $location,
                stored: false,
                needed_for: NeededFor::Neither,
                cyclic: Cyclic::Never,
                bits: Bits::Never,
                restricted: false,
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
pub static DICTIONARY: &[DataBlock] = &DATA_BLOCKS;

/// One object with a name of its own, which the size check looks for in the ELF.
static DATA_BLOCKS: [DataBlock; ROWS.len()] = match ROWS.first_chunk() {
    Some(rows) => *rows,
    None => unreachable!(),
};

dictionary! {
    /// Interval of new command values; a multiple of S-0-0002, which it follows unless the master writes it. Like that a multiple of 250 us (7008H).
    S 1 "Control unit cycle time (tNcyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3, restricted;
    /// Distance of two MSTs from CP3 on; a multiple of 250 us (7008H).
    S 2 "Communication cycle time (tScyc)" ["us"] U16/0 written IN_CP2 (500 to 65_000) = 2_000 => Parameter, needed_for_cp3, restricted;
    /// End of the MST to the earliest AT of this drive.
    S 3 "Shortest AT transmission starting time (t1min)" ["us"] U16/0 written NEVER () = 12 => Parameter;
    /// End of the own AT to the earliest start of the MDT.
    S 4 "Transmit/receive transition time (tATMT)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// Feedback capture (t4) to the end of the MST before the AT that carries the value.
    S 5 "Minimum feedback processing time (t5)" ["us"] U16/0 written NEVER () = 30 => Parameter;
    /// End of the MST to the start of this drive's AT, from CP3 on; S-0-0003 at least.
    S 6 "AT transmission starting time (t1)" ["us"] U16/0 written IN_CP2 (12 to 65_000) = 12 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives capture their feedback.
    S 7 "Feedback acquisition capture point (t4)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// End of the MST to the instant at which all drives make their command values valid.
    S 8 "Command value valid time (t3)" ["us"] U16/0 written IN_CP2 (0 to 65_000) = 0 => Parameter, needed_for_cp3;
    /// First byte of this drive's data record in the MDT, counted from 1 after the address; odd.
    S 9 "Position of data record in MDT" [""] U16/0 written IN_CP2 (1 to 65_531) = 1 => Parameter, needed_for_cp3;
    /// Bytes of all data records of the MDT; even.
    S 10 "Length of MDT" [""] U16/0 written IN_CP2 (4 to 65_534) = 4 => Parameter, needed_for_cp3;
    /// Errors that shut the drive down, until S-0-0099 clears them.
    S 11 "Class 1 diagnostic (C1D)" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Warnings: bit 0 load of motor or amplifier, 1 amplifier temperature (S-0-0200), 2 motor temperature (S-0-0201), 9 switched on without main power, 11 velocity deviation (S-0-0377), 15 see S-0-0181. Reading it over the service channel clears bit 12 of the status word.
    S 12 "Class 2 diagnostic (C2D)" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Operation status. Reading it over the service channel clears bit 11 of the status word.
    S 13 "Class 3 diagnostic (C3D)" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Phase in bits 2 to 0; communication errors in bits 3 to 9 (10, duplicate address, cannot be seen by a slave), until S-0-0099 clears them.
    S 14 "Interface status" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// 0 to 7: contents of the cyclic telegrams; 7 takes them from S-0-0016 and S-0-0024. 11 to 13: as 3 to 5 with S-0-0053.
    S 15 "Telegram type parameter" [""] BITS/0 written IN_CP2 () = 2 => Parameter, needed_for_cp3;
    /// IDNs in the AT if the telegram type is 7, in this order.
    S 16 "Configuration list of AT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3, restricted;
    /// Every IDN of the drive.
    S 17 "IDN list of all operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::All);
    /// IDNs that S-0-0127 checks.
    S 18 "IDN list of operation data for CP2" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::NeededForCp3);
    /// IDNs that S-0-0128 checks.
    S 19 "IDN list of operation data for CP3" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::NeededForCp4);
    /// IDNs that can be written in CP4.
    S 20 "IDN list of operation data for CP4" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::ChangeableInCp4);
    /// IDNs that S-0-0127 found invalid; empty after a positive check.
    S 21 "IDN list of invalid operation data for CP2" [""] IDNS/0 written NEVER () = 0 => Live;
    /// IDNs that S-0-0128 found invalid; empty after a positive check.
    S 22 "IDN list of invalid operation data for CP3" [""] IDNS/0 written NEVER () = 0 => Live;
    /// The operation mode parameter that control word bits 11, 9, 8 asked for in CP4 and that was not initialised; empty again after S-0-0099.
    S 23 "IDN list of invalid operation data for CP4" [""] IDNS/0 written NEVER () = 0 => Live;
    /// IDNs in this drive's MDT record if the telegram type is 7, in this order.
    S 24 "Configuration list of MDT" [""] IDNS/0 written IN_CP2 () = 0 => Parameter, needed_for_cp3, restricted;
    /// All procedure commands.
    S 25 "IDN list of all procedure commands" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::Commands);
    /// What the bits of S-0-0144 show, from bit 0 up; which bit of it says S-0-0328.
    S 26 "Configuration list for signal status word" [""] IDNS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// What the bits of S-0-0145 set, from bit 0 up; which bit of it says S-0-0329.
    S 27 "Configuration list for signal control word" [""] IDNS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Invalid MSTs in CP3 and CP4; two of a burst count; cleared on the way to CP3.
    S 28 "MST error counter" [""] U16/0 written NEVER () = 0 => Live;
    /// Invalid MDTs in CP3 and CP4; two of a burst count; cleared on the way to CP3.
    S 29 "MDT error counter" [""] U16/0 written NEVER () = 0 => Live;
    /// Firmware and its version.
    S 30 "Manufacturer version" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Operation mode of control word bits 11, 9, 8 = 000: 1 torque, 2 velocity, 3 position, 11 position without lag.
    S 32 "Primary operation mode" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 001; 0: none.
    S 33 "Secondary operation mode 1" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 010; 0: none.
    S 34 "Secondary operation mode 2" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 011; 0: none.
    S 35 "Secondary operation mode 3" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Velocity command of the control unit.
    S 36 "Velocity command value" [velocity] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Added to S-0-0036.
    S 37 "Additive velocity command value" [velocity] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Highest velocity command; 0: only S-0-0091 counts.
    S 38 "Positive velocity limit value" [velocity] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt;
    /// Lowest velocity command; 0: only S-0-0091 counts.
    S 39 "Negative velocity limit value" [velocity] I32 written ALWAYS (-2_147_483_648 to 0) = 0 => Parameter, stored, in_mdt;
    /// Velocity of the motor encoder.
    S 40 "Velocity feedback value 1" [velocity] I32 written NEVER () = 0 => Live, in_at;
    /// Speed of homing.
    S 41 "Homing velocity" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored;
    /// Acceleration of homing.
    S 42 "Homing acceleration" [acceleration] I32 written ALWAYS (1_000 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Bit 0 inverts the velocity command, bit 1 the additive one, bit 2 the velocity feedback.
    S 43 "Velocity polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0045 and S-0-0046 instead of 0.0001 rpm or 1 um/min; bit 5: per second;
    /// bit 6: of the load.
    S 44 "Velocity data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one velocity increment, with the exponent of S-0-0046.
    S 45 "Velocity data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0045.
    S 46 "Velocity data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -4 => Parameter, stored, needed_for_cp4;
    /// Position command of the control unit, compared with S-0-0051 modulo 2^32 or S-0-0103. While S-0-0148 is set it reads the place where the axis is held.
    S 47 "Position command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Added to S-0-0047: the angle of this axis against the line shaft.
    S 48 "Additive position command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Highest position, while bit 4 of S-0-0055 is set and the axis is homed; not below S-0-0050. Beyond it the axis may be held and go back.
    S 49 "Positive position limit value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 2_147_483_647 => Parameter, stored, needed_for_cp4, restricted;
    /// Lowest position, while bit 4 of S-0-0055 is set and the axis is homed.
    S 50 "Negative position limit value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = -2_147_483_647 => Parameter, stored, needed_for_cp4, restricted;
    /// Position of the motor encoder, captured at t4.
    S 51 "Position feedback value 1 (motor feedback)" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Position that S-0-0148 and S-0-0447 give to the place where the motor stands. Not while S-0-0148 is set (700CH).
    S 52 "Reference distance 1" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Parameter, stored, restricted;
    /// Position of the second encoder; where it comes from says P-0-2705.
    S 53 "Position feedback value 2 (external feedback)" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Bits 0 and 2, which must be equal, invert all positions that are written and read (docs/polarity.md), bit 1 the additive command; bit 4 switches S-0-0049 and S-0-0050 on, not with modulo data.
    S 55 "Position polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Window of C3D bit 6 (in position), for the following distance, and of C3D bit 8, for the way to S-0-0430.
    S 57 "Position window" [position] I32 written ALWAYS (0 to 2_147_483_647) = 10_000 => Parameter, stored;
    /// Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0077 and S-0-0078 instead of 0.1 um, or by S-0-0079 instead of 0.0001 deg;
    /// bit 6: of the load; bit 7: modulo.
    S 76 "Position data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Metres of one position increment, with the exponent of S-0-0078, if bit 3 of a linear S-0-0076 is set.
    S 77 "Linear position data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0077.
    S 78 "Linear position data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -7 => Parameter, stored, needed_for_cp4;
    /// Position increments of one revolution of the motor or the load, if bit 3 of a rotary S-0-0076 is set.
    S 79 "Rotational position resolution" [""] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Torque command of the control unit.
    S 80 "Torque command value" [torque] I16 written ALWAYS (-32_768 to 32_767) = 0 => Live, in_mdt;
    /// Added to S-0-0080.
    S 81 "Additive torque command value" [torque] I16 written ALWAYS (-32_768 to 32_767) = 0 => Live, in_mdt;
    /// Highest torque.
    S 82 "Positive torque limit value" [torque] I16 written ALWAYS (0 to 32_767) = 32_767 => Parameter, stored, in_mdt;
    /// Lowest torque.
    S 83 "Negative torque limit value" [torque] I16 written ALWAYS (-32_768 to 0) = -32_767 => Parameter, stored, in_mdt;
    /// Torque that the measured current makes.
    S 84 "Torque feedback value" [torque] I16 written NEVER () = 0 => Live, in_at;
    /// Bit 0 inverts the torque command, bit 1 the additive one, bit 2 the torque feedback.
    S 85 "Torque polarity parameter" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// 0: per cent of S-0-0111, 0.1 % an increment. Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0093 and S-0-0094 instead of 1 N or
    /// 0.01 Nm; bit 6: of the load. Newton metres are made of P-0-0110 and P-0-0114.
    S 86 "Torque data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Recovery time between two ATs of the same slave; this slave sends one.
    S 87 "Transmit/transmit recovery time (tATAT)" ["us"] U16/0 written NEVER () = 0 => Parameter;
    /// End of the MDT to the start of the next MST.
    S 88 "Receive/receive recovery time (tMTSY)" ["us"] U16/0 written NEVER () = 10 => Parameter;
    /// End of the MST to the start of the MDT, from CP3 on.
    S 89 "MDT transmission starting time (t2)" ["us"] U16/0 written IN_CP2 (0 to 65_535) = 0 => Parameter, needed_for_cp3;
    /// End of the MDT to the earliest t3.
    S 90 "Command value proceeding time (tMTSG)" ["us"] U16/0 written NEVER () = 2 => Parameter;
    /// Largest velocity that the drive commands in either direction.
    S 91 "Bipolar velocity limit value" [velocity] U32 written ALWAYS (1 to 2_147_483_647) = 30_000_000 => Parameter, stored, needed_for_cp4, in_mdt, restricted;
    /// Largest torque in either direction.
    S 92 "Bipolar torque limit value" [torque] U16 written ALWAYS (0 to 65_535) = 2_000 => Parameter, stored, needed_for_cp4, in_mdt;
    /// Weight of one torque increment in N or Nm, with the exponent of S-0-0094.
    S 93 "Torque data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0093.
    S 94 "Torque data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -1 => Parameter, stored, needed_for_cp4;
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
    S 100 "Velocity loop proportional gain" ["As/rad"] U16/3 written ALWAYS (0 to 65_535) = 100 => Parameter, stored, restricted;
    /// Time in which the integral part reaches the proportional part; 0 switches the integral part off.
    S 101 "Velocity loop integral action time" ["ms"] U16/1 written ALWAYS (0 to 65_535) = 100 => Parameter, stored, restricted;
    /// Position range if bit 7 of S-0-0076 is set.
    S 103 "Modulo value" [position] I32 written IN_CP2_CP3 (0 to 2_147_483_647) = 3_600_000 => Parameter, stored, needed_for_cp4;
    /// Velocity for one unit of following distance.
    S 104 "Position loop Kv-factor" ["1000/min"] U16/2 written ALWAYS (1 to 65_535) = 100 => Parameter, stored;
    /// Voltage for one ampere of current difference in the d and q axis.
    S 106 "Current loop proportional gain 1" ["V/A"] U16/3 written ALWAYS (1 to 65_535) = 40_000 => Parameter, stored, needed_for_cp4, restricted;
    /// Time in which the integral part of the current loop reaches the proportional part; 0 switches it off.
    S 107 "Current loop integral action time 1" ["ms"] U16/1 written ALWAYS (0 to 65_535) = 50 => Parameter, stored, needed_for_cp4, restricted;
    /// Share of S-0-0259 that positioning may use, within S-0-0091 whatever it is.
    S 108 "Feedrate override" ["%"] U16/2 written ALWAYS (0 to 32_767) = 10_000 => Parameter, stored;
    /// Largest current of the motor.
    S 109 "Motor peak current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 20_000 => Parameter, stored, needed_for_cp4;
    /// Current at full scale of the amplifier's command input; writable, because the amplifier is chosen by the builder.
    S 110 "Amplifier peak current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 20_000 => Parameter, stored, needed_for_cp4;
    /// Current of the motor at its continuous stall torque: 100 % of torque data, see S-0-0086.
    S 111 "Motor continuous stall current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 5_000 => Parameter, stored, needed_for_cp4;
    /// Current that the bridge carries for ever; from it and S-0-0110 the amplifier's thermal model is made.
    S 112 "Amplifier rated current" ["A"] U32/3 written IN_CP2_CP3 (1 to 500_000) = 10_000 => Parameter, stored, needed_for_cp4;
    /// The drive never commands a higher velocity.
    S 113 "Maximum motor speed" ["rpm"] U32/4 written IN_CP2_CP3 (1 to 2_147_483_647) = 60_000_000 => Parameter, stored, needed_for_cp4;
    /// Load of the thermal models at which the drive shuts down (C1D bit 0); 100 % is the continuous current for ever.
    S 114 "Load limit of the motor" ["%"] U16/1 written IN_CP2_CP3 (901 to 2_000) = 1_100 => Parameter, stored, needed_for_cp4;
    /// Lines of the motor encoder; four increments each.
    S 116 "Resolution of feedback 1" ["cycles/rev"] U32/0 written IN_CP2_CP3 (1 to 1_048_576) = 2_500 => Parameter, stored, needed_for_cp4;
    /// Revolutions of the motor while the load turns S-0-0122, for data of the load.
    S 121 "Input revolutions of load gear" ["rev"] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 1 => Parameter, stored, needed_for_cp4;
    /// Revolutions of the load while the motor turns S-0-0121.
    S 122 "Output revolutions of load gear" ["rev"] U32/0 written IN_CP2_CP3 (1 to 4_294_967_295) = 1 => Parameter, stored, needed_for_cp4;
    /// What one revolution moves, for linear data: of the load behind the gear, or of the motor with linear data of the motor.
    S 123 "Feed constant" ["mm/rev"] I32/4 written IN_CP2_CP3 (1 to 2_147_483_647) = 100_000 => Parameter, stored, needed_for_cp4;
    /// Velocity below which C3D bit 1 (standstill) is set.
    S 124 "Standstill window" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Velocity below which C3D bit 2 is set.
    S 125 "Velocity threshold (nx)" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored;
    /// Torque from which C3D bit 3 is set.
    S 126 "Torque threshold (Tx)" [torque] U16 written ALWAYS (0 to 65_535) = 1_000 => Parameter, stored;
    /// Checks everything that CP3 needs; findings in S-0-0021.
    S 127 "CP3 transition check" [""] COMMAND/0 written IN_CP2 () = 0 => Command;
    /// Checks everything that CP4 needs; findings in S-0-0022.
    S 128 "CP4 transition check" [""] COMMAND/0 written IN_CP3 () = 0 => Command;
    /// The errors behind C1D bit 15: bit 0 amplifier fault, 1 current sensor, 2 current loop too late, 3 brake, 4 safe torque off, 5 its channels contradict each other, 6 overspeed, 7 loops lost the ring, 8 temperature sensor, 9 to 11 search for the commutation angle.
    S 129 "Manufacturer class 1 diagnostic" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Position at the last positive edge of probe 1 that S-0-0170 took.
    S 130 "Probe value 1 positive edge" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Position at the last negative edge of probe 1 that S-0-0170 took.
    S 131 "Probe value 1 negative edge" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Position at the last positive edge of probe 2 that S-0-0170 took.
    S 132 "Probe value 2 positive edge" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Position at the last negative edge of probe 2 that S-0-0170 took.
    S 133 "Probe value 2 negative edge" [position] I32 written NEVER () = 0 => Live, in_at;
    /// The control word of the last MDT.
    S 134 "Master control word" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// The status word of the last AT.
    S 135 "Drive status word" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Largest acceleration of velocity commands away from standstill; 0 with S-0-0137 also 0: they are followed as they come.
    S 136 "Positive acceleration limit value" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt, restricted;
    /// Largest acceleration of velocity commands towards standstill; see S-0-0136.
    S 137 "Negative acceleration limit value" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt, restricted;
    /// Ramp of halt and of stopping after an error or Drive OFF.
    S 138 "Bipolar acceleration limit value" [acceleration] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored, in_mdt, restricted;
    /// Takes the axis out: no torque until it is cancelled or the next run-up passes CP2.
    S 139 "Park axis" [""] COMMAND/0 written IN_CP2 () = 0 => Command;
    /// Type of the drive.
    S 140 "Controller type" [""] TEXT/0 written NEVER () = 0 => Live;
    /// Type of the motor, for the reader; up to 40 characters.
    S 141 "Motor type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// What the axis does, for the reader; up to 40 characters.
    S 142 "Application type" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// Version of the SERCOS specification.
    S 143 "System interface version" [""] TEXT/0 written NEVER () = 0 => Live;
    /// The bits that S-0-0026 and S-0-0328 have chosen.
    S 144 "Signal status word" [""] BITS/0 written NEVER () = 0 => Live, in_at;
    /// Sets the bits that S-0-0027 and S-0-0329 have chosen, whenever it changes.
    S 145 "Signal control word" [""] BITS/0 written ALWAYS () = 0 => Live, in_mdt;
    /// Bit 0: negative direction; bit 1: falling edge of the home switch; bit 2: switch at the drive (else S-0-0400 is written); bit 4: S-0-0407 is evaluated; bit 5: no switch; bit 6: no marker; bit 7: stop at the reference point. With bits 5 and 6 and without 7 the reference is where the motor stands. Not while S-0-0148 is set (700CH).
    S 147 "Homing parameter" [""] BITS/0 written ALWAYS () = 0x0060 => Parameter, stored, restricted;
    /// Finds the reference point in the way of S-0-0147, gives it the position S-0-0052, and sets S-0-0403 bit 0. What it fails of says P-0-0003.
    S 148 "Drive controlled homing procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// Takes the axis to a mechanical stop by the commands of the control: no following distance (S-0-0159) is monitored while it is set, and no brake is suspected. Executed when the axis has stood at its torque limit for 50 ms (S-0-0092, S-0-0124); failed when the torque goes before. The axis holds its torque until the command is cancelled; then the monitoring is there again.
    S 149 "Positive stop drive procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// From the marker, or the edge of the switch, to the reference point.
    S 150 "Reference offset 1" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Parameter, stored;
    /// Coulomb friction that the velocity loop is helped with.
    S 155 "Friction compensation" [torque] U16 written ALWAYS (0 to 1_000) = 0 => Parameter, stored, restricted;
    /// Velocity difference below which C3D bit 0 (n_feedback = n_command) is set.
    S 157 "Velocity window" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Following distance above which the drive shuts down with C1D bit 11; 0: not monitored.
    S 159 "Monitoring window" [position] I32 written ALWAYS (0 to 2_147_483_647) = 300_000 => Parameter, stored;
    /// Bits 2 to 0: 1 linear, 2 rotary; bit 3: by S-0-0161 and S-0-0162 instead of 1 um/s^2 or 0.001 rad/s^2; bit 6: of the load.
    /// Jerks have the same increments a second.
    S 160 "Acceleration data scaling type" [""] BITS/0 written IN_CP2_CP3 () = 2 => Parameter, stored, needed_for_cp4;
    /// Weight of one acceleration increment, with the exponent of S-0-0162.
    S 161 "Acceleration data scaling factor" [""] U16/0 written IN_CP2_CP3 (1 to 65_535) = 1 => Parameter, stored, needed_for_cp4;
    /// Power of ten of S-0-0161.
    S 162 "Acceleration data scaling exponent" [""] I16/0 written IN_CP2_CP3 (-32 to 32) = -3 => Parameter, stored, needed_for_cp4;
    /// Bit 0: positive edge of probe 1; bit 1: negative edge; bits 2 and 3: those of probe 2.
    S 169 "Probe control" [""] BITS/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Positions at the edges of S-0-0169, each armed by S-0-0405 or S-0-0406; until it is cancelled.
    S 170 "Probing cycle procedure command" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// Bits 0 to 3: positive and negative edge of probe 1 and of probe 2 taken since they were armed.
    S 179 "Probe status" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// The warnings behind C2D bit 15: bit 0 loops not locked to the ring in CP4, 1 telegram lost within the last second, 2 amplifier fault without torque, 3 zero of the current sensors not known.
    S 181 "Manufacturer class 2 diagnostic" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// The states behind C3D bit 15: bit 0 loops locked to the ring, 1 axis parked, 2 parameters locked by the password.
    S 182 "Manufacturer class 3 diagnostic" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Bytes of configurable data that the AT can hold.
    S 185 "Length of the configurable data record in the AT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// Bytes of configurable data that this drive's MDT record can hold.
    S 186 "Length of the configurable data record in the MDT" [""] U16/0 written NEVER () = 32 => Parameter;
    /// IDNs that S-0-0016 may name.
    S 187 "IDN list of configurable data in the AT" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::ConfigurableInAt);
    /// IDNs that S-0-0024 may name.
    S 188 "IDN list of configurable data in the MDT" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::ConfigurableInMdt);
    /// Position command minus position feedback; a longer one than fits is the longest.
    S 189 "Following distance" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Takes S-0-0403 bit 0 away.
    S 191 "Cancel reference point procedure command" [""] COMMAND/0 written ALWAYS () = 0 => Command;
    /// IDNs that a control saves and restores.
    S 192 "IDN list of backup operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::Backup);
    /// Jerk of positioning; 0: not limited.
    S 193 "Positioning jerk" [jerk] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt, restricted;
    /// Heat sink temperature from which C2D bit 1 warns.
    S 200 "Amplifier warning temperature" ["C"] U16/1 written ALWAYS (1 to 2_000) = 800 => Parameter, stored, needed_for_cp4, restricted;
    /// Motor temperature from which C2D bit 2 warns.
    S 201 "Motor warning temperature" ["C"] U16/1 written ALWAYS (1 to 2_500) = 1_150 => Parameter, stored, needed_for_cp4, restricted;
    /// Heat sink temperature at which the drive shuts down (C1D bit 1).
    S 203 "Amplifier shut-down temperature" ["C"] U16/1 written ALWAYS (2 to 2_000) = 900 => Parameter, stored, needed_for_cp4, restricted;
    /// Motor temperature at which the drive shuts down (C1D bit 2).
    S 204 "Motor shut-down temperature" ["C"] U16/1 written ALWAYS (2 to 2_500) = 1_300 => Parameter, stored, needed_for_cp4, restricted;
    /// From the brake's current to its opening: no movement before.
    S 206 "Drive on delay time" ["ms"] U16/0 written ALWAYS (0 to 10_000) = 100 => Parameter, stored;
    /// From the end of the brake's current to its holding: torque stays so long.
    S 207 "Drive off delay time" ["ms"] U16/0 written ALWAYS (0 to 10_000) = 100 => Parameter, stored;
    /// Bit 0: 0 degrees Celsius, which is all that this drive has.
    S 208 "Temperature data scaling type" [""] BITS/0 written ALWAYS (0 to 0) = 0 => Parameter;
    /// Increments of one line of the motor encoder.
    S 256 "Multiplication 1" [""] U32/0 written NEVER () = 4 => Parameter;
    /// Where the drive goes by itself in the modes 0013H and 001BH; a modulo axis in the direction of S-0-0393, an absolute one never over the border between its highest and its lowest number. If S-0-0393 drops the target when the mode begins, this becomes the position where the axis stands, unless it was written since the mode ended.
    S 258 "Target position" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Speed of positioning, within S-0-0091.
    S 259 "Positioning velocity" [velocity] I32 written ALWAYS (1 to 2_147_483_647) = 1_000_000 => Parameter, stored, needed_for_cp4, in_mdt, restricted;
    /// Acceleration of positioning; also its deceleration if S-0-0359 is 0.
    S 260 "Positioning acceleration" [acceleration] I32 written ALWAYS (1_000 to 2_147_483_647) = 1_000_000 => Parameter, stored, in_mdt, restricted;
    /// Way to S-0-0430 within which C3D bit 11 (in coarse position) is set.
    S 261 "Coarse position window" [position] I32 written ALWAYS (0 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Gives everything in S-0-0192 its default. Not in CP4, which protects some of it, and not while torque is on (7012H).
    S 262 "Load defaults procedure command" [""] COMMAND/0 written ALWAYS () = 0 => Command;
    /// Language of S-0-0095, P-0-0003, P-0-0010 and P-0-0011: 0 German (S-0-0095 only, the others stay English), 1 English.
    S 265 "Language selection" [""] U16/0 written ALWAYS (0 to 1) = 1 => Parameter, stored;
    /// Values that S-0-0265 may have.
    S 266 "List of available languages" [""] NUMBERS/0 written NEVER () = 0 => Live;
    /// Locks S-0-0279: 3 to 10 characters lock with them as password, the password unlocks, an empty text forgets it. Reads *** while locked.
    S 267 "Password" [""] TEXT/0 written ALWAYS () = 0 => Live, restricted;
    /// 1: operation data live in RAM and are lost with the supply. This drive has no other mode.
    S 269 "Storage mode" [""] BITS/0 written ALWAYS (1 to 1) = 1 => Parameter;
    /// Time after which an axis that does not come to a standstill is braked all the same; 0: never.
    S 273 "Maximum drive off delay time" ["ms"] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored;
    /// Bit 3: the encoder counts the other way round. Rotary, incremental, at the motor: all other bits 0.
    S 277 "Position feedback 1 type" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Longest way to the home switch; 0: not limited.
    S 278 "Maximum travel range" [position] I32 written IN_CP2_CP3 (0 to 2_147_483_647) = 0 => Parameter, stored, needed_for_cp4;
    /// What S-0-0267 locks.
    S 279 "IDN list of password-protected operation data" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::Backup);
    /// Position or distance of the modes 0213H and 021BH, which S-0-0346 says; taken over when bit 0 of that changes.
    S 282 "Positioning command value" [position] I32 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Live, in_mdt;
    /// Operation mode of control word bits 11, 9, 8 = 100; 0: none.
    S 284 "Secondary operation mode 4" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 101; 0: none.
    S 285 "Secondary operation mode 5" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 110; 0: none.
    S 286 "Secondary operation mode 6" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation mode of control word bits 11, 9, 8 = 111; 0: none.
    S 287 "Secondary operation mode 7" [""] BITS/0 written IN_CP2_CP3 () = 0 => Parameter, stored, needed_for_cp4;
    /// Operation modes that S-0-0032 to S-0-0035 and S-0-0284 to S-0-0287 may name.
    S 292 "List of supported operation modes" [""] HEXES/0 written NEVER () = 0 => Live;
    /// Part of the commanded velocity that goes past the position loop in modes without lag; 100 % leaves no lag, above it the axis leads.
    S 296 "Velocity feed-forward gain" ["%"] U16/1 written ALWAYS (0 to 1_200) = 1_000 => Parameter, stored;
    /// From the edge of the home switch to where the marker counts, at most a revolution of the motor.
    S 299 "Home switch offset 1" [position] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored;
    /// Bit 0 is control word bit 6 of the last MDT.
    S 300 "Real-time control bit 1" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// IDN of S-0-0399 whose bit S-0-0413 follows control word bit 6; 0: none.
    S 301 "Allocation of real-time control bit 1" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Bit 0 is control word bit 7 of the last MDT.
    S 302 "Real-time control bit 2" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// IDN of S-0-0399 whose bit S-0-0414 follows control word bit 7; 0: none.
    S 303 "Allocation of real-time control bit 2" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Bit 0 is status word bit 6.
    S 304 "Real-time status bit 1" [""] BITS/0 written NEVER () = 0 => Live;
    /// IDN of S-0-0398 whose bit S-0-0415 status word bit 6 shows; 0: none.
    S 305 "Allocation of real-time status bit 1" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Bit 0 is status word bit 7.
    S 306 "Real-time status bit 2" [""] BITS/0 written NEVER () = 0 => Live;
    /// IDN of S-0-0398 whose bit S-0-0416 status word bit 7 shows; 0: none.
    S 307 "Allocation of real-time status bit 2" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Bit 0 is C2D bit 0: load of motor or amplifier.
    S 310 "Overload warning" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C2D bit 1: heat sink warmer than S-0-0200.
    S 311 "Amplifier overtemperature warning" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C2D bit 2: motor warmer than S-0-0201.
    S 312 "Motor overtemperature warning" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C2D bit 9: switched on without main power.
    S 319 "Undervoltage warning" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C2D bit 11: velocity deviation beyond S-0-0377.
    S 321 "Excessive velocity deviation" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Checksum of S-0-0327: equal settings, equal checksum.
    S 326 "Parameter checksum" [""] HEX32/0 written NEVER () = 0 => Live;
    /// What S-0-0326 covers.
    S 327 "IDN list of checksum parameter" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::Backup);
    /// Bit number for each entry of S-0-0026, 0 to 15; 0 where the list is shorter.
    S 328 "Bit number allocation list for signal status word" [""] NUMBERS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Bit number for each entry of S-0-0027, 0 to 15; 0 where the list is shorter.
    S 329 "Bit number allocation list for signal control word" [""] NUMBERS/0 written ALWAYS () = 0 => Parameter, stored, restricted;
    /// Bit 0 is C3D bit 0.
    S 330 "Status n_feedback = n_command" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 1.
    S 331 "Status n_feedback = 0" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 2.
    S 332 "Status n_feedback < nx" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 3.
    S 333 "Status T >= Tx" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 4.
    S 334 "Status T >= Tlimit" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 5.
    S 335 "Status n_command > n_limit" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 6: the following distance is within S-0-0057, and a drive that moves by itself has arrived.
    S 336 "Status in position" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 8: the drive goes to a target, and the position is within S-0-0057 of it.
    S 338 "Status position feedback = active target position" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 11: the drive goes to a target, and the position is within S-0-0261 of it.
    S 341 "Status in coarse position" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 12: the drive goes to a target, and its internal position command has arrived there.
    S 342 "Status target position attained" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0 is C3D bit 13: the internal position command of a drive that goes to a target stands, at the target or (HALT, S-0-0108, S-0-0346) before it.
    S 343 "Status interpolator halted" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Of the modes 0213H and 021BH. A change of bit 0 takes S-0-0282 over. Bits 2 and 1: 0 goes to S-0-0430, 1 turns in positive, 2 in negative direction until it ends, 3 stops and keeps the target. Bit 3: S-0-0282 is 0 a position, 1 a distance, bit 4: from 0 S-0-0430, 1 the actual position. Bit 5: it is taken 0 when the last target is attained, 1 at once. Changes of bit 0 while torque is off or another mode is active take nothing over, then or later.
    S 346 "Positioning control" [""] BITS/0 written ALWAYS () = 0 => Live, in_mdt;
    /// Velocity command minus velocity feedback.
    S 347 "Velocity error" [velocity] I32 written NEVER () = 0 => Live, in_at;
    /// Current for one unit of commanded acceleration at the motor, in mode 11.
    S 348 "Acceleration feed-forward gain" ["mAs^2/rad"] U16/1 written ALWAYS (0 to 65_535) = 0 => Parameter, stored;
    /// Jerk of halt and of the ramps of velocity commands; 0: not limited.
    S 349 "Bipolar jerk limit value" [jerk] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, in_mdt, restricted;
    /// Deceleration of positioning; 0: as S-0-0260.
    S 359 "Positioning deceleration" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, restricted;
    /// Ramp of halt; 0: as S-0-0138.
    S 372 "Drive halt acceleration bipolar" [acceleration] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored, restricted;
    /// S-0-0390 of the last 32 errors since the supply came on, the newest first; their times are in P-0-0004.
    S 375 "List of diagnostic numbers" [""] HEXES/0 written NEVER () = 0 => Live;
    /// Velocity deviation above which C2D bit 11 warns; 0: not monitored.
    S 377 "Velocity feedback monitoring window" [velocity] I32 written ALWAYS (0 to 2_147_483_647) = 0 => Parameter, stored;
    /// Filtered voltage of the DC link.
    S 380 "DC bus voltage" ["V"] U16/0 written NEVER () = 0 => Live, in_at;
    /// From the sensor in the motor.
    S 383 "Motor temperature" ["C"] I16/1 written NEVER () = 0 => Live, in_at;
    /// Of the heat sink.
    S 384 "Amplifier temperature" ["C"] I16/1 written NEVER () = 0 => Live, in_at;
    /// State or error of the drive as a number; belongs to S-0-0095.
    S 390 "Diagnostic number" [""] HEX/0 written NEVER () = 0 => Live, in_at;
    /// Time constant of the velocity that the velocity loop controls.
    S 392 "Velocity feedback filter" ["us"] U16/0 written ALWAYS (250 to 65_500) = 500 => Parameter, stored;
    /// Bits 1 and 0: a modulo axis goes to a position 0 the shortest way, 1 in positive, 2 in negative direction. Bit 2: a target that was not attained when its mode ended or the torque went is, when it comes back, 0 gone to, 1 dropped.
    S 393 "Command value mode" [""] U16/0 written ALWAYS (0 to 6) = 4 => Parameter, stored, restricted;
    /// What S-0-0305, S-0-0307 and S-0-0026 may name.
    S 398 "IDN list of configurable data for status bits" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::BitSources);
    /// What S-0-0301, S-0-0303 and S-0-0027 may name.
    S 399 "IDN list of configurable data for control bits" [""] IDNS/0 written NEVER () = 0 => Dictionary(Selection::BitTargets);
    /// Bit 0: the home switch, that at the drive or, where S-0-0147 bit 2 is 0, what the control has written. Whatever has another owner, the input or a bit of the MDT (S-0-0301, 303, 27), takes no other value over the service channel (700CH); S-0-0405 to 0407 and P-0-0019 likewise.
    S 400 "Home switch" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Live, bit_target, restricted;
    /// Bit 0: level of probe 1.
    S 401 "Probe 1" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0: level of probe 2.
    S 402 "Probe 2" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0: the position refers to the reference point.
    S 403 "Position feedback value status" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Bit 0 from 0 to 1 arms probe 1.
    S 405 "Probe 1 enable" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Live, bit_target, restricted;
    /// Bit 0 from 0 to 1 arms probe 2.
    S 406 "Probe 2 enable" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Live, bit_target, restricted;
    /// Bit 0: switch and marker may be taken, if S-0-0147 bit 4 asks for it.
    S 407 "Homing enable" [""] BITS/0 written ALWAYS (0 to 1) = 0 => Live, bit_target, restricted;
    /// Bit 0: the marker has been found.
    S 408 "Reference marker pulse registered" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0: positive edge of probe 1 taken.
    S 409 "Probe 1 positive latched" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0: negative edge of probe 1 taken.
    S 410 "Probe 1 negative latched" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0: positive edge of probe 2 taken.
    S 411 "Probe 2 positive latched" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit 0: negative edge of probe 2 taken.
    S 412 "Probe 2 negative latched" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Bit of the data block in S-0-0301.
    S 413 "Bit number allocation of real-time control bit 1" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Bit of the data block in S-0-0303.
    S 414 "Bit number allocation of real-time control bit 2" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Bit of the data block in S-0-0305.
    S 415 "Bit number allocation of real-time status bit 1" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// Bit of the data block in S-0-0307.
    S 416 "Bit number allocation of real-time status bit 2" [""] U16/0 written ALWAYS (0 to 15) = 0 => Parameter, stored;
    /// A position that lies no further than this behind an axis at rest is gone to backwards, whatever S-0-0393 says.
    S 418 "Target position window in modulo mode" [position] I32 written ALWAYS (0 to 2_147_483_647) = 1_000 => Parameter, stored;
    /// Bit 0 is bit 0 of the S-0-0346 that has taken S-0-0282 over last.
    S 419 "Positioning acknowledge" [""] BITS/0 written NEVER () = 0 => Live, bit_source;
    /// Where the drive goes by itself.
    S 430 "Effective target position" [position] I32 written NEVER () = 0 => Live, in_at;
    /// Bit 0 S-0-0419, 1 S-0-0342, 2 S-0-0343, 3 S-0-0338, 4 S-0-0341, 5 S-0-0336; 6 turns by bits 2 and 1 of S-0-0346; 7 a change of bit 0 of it waits; 8 one of the modes 0013H, 001BH, 0213H, 021BH is active.
    S 437 "Positioning status" [""] BITS/0 written NEVER () = 0 => Live, in_at, bit_source;
    /// Makes the place where the motor stands the position S-0-0052. Not while torque is on.
    S 447 "Set absolute position procedure command" [""] COMMAND/0 written ALWAYS () = 0 => Command;
    /// Why S-0-0127 blames each IDN of S-0-0021, in the same order; the codes are in the manual.
    P 1 "Reasons of S-0-0021" [""] HEXES/0 written NEVER () = 0 => Live;
    /// Why S-0-0128 blames each IDN of S-0-0022, in the same order; the codes are in the manual.
    P 2 "Reasons of S-0-0022" [""] HEXES/0 written NEVER () = 0 => Live;
    /// What the last transition check or homing that failed has found, or why the last write was refused with 7008H, in plain words; empty after a success.
    P 3 "Finding of the last check or write" [""] TEXT/0 written NEVER () = 0 => Live;
    /// When each error of S-0-0375 came, in seconds since the supply came on.
    P 4 "Times of the last errors" ["s"] LONGS/0 written NEVER () = 0 => Live;
    /// Time since the processor was started.
    P 6 "Operating time" ["s"] U32/0 written NEVER () = 0 => Live;
    /// Up to eight numbers of the control's own choice.
    P 7 "Application data" [""] LONGS/0 written ALWAYS () = 0 => Parameter, stored;
    /// A text of the control's own choice, as the serial number of the machine; up to 40 characters.
    P 8 "Application identifier" [""] TEXT/0 written ALWAYS () = 0 => Parameter, stored;
    /// Why the processor was started: 1 supply, 2 reset pin, 3 watchdog, 4 software, 5 low power, 0 unknown.
    P 9 "Reset cause" [""] U16/0 written NEVER () = 0 => Live;
    /// What led to the state or error in S-0-0095.
    P 10 "Cause of the diagnostic message" [""] TEXT/0 written NEVER () = 0 => Live;
    /// What to do about the error in S-0-0095; empty for a state that needs nothing.
    P 11 "Remedy for the diagnostic message" [""] TEXT/0 written NEVER () = 0 => Live;
    /// How the program ended last since the supply came on, and where, in plain words; empty when it did not. Numbers F120H to F125H of S-0-0375.
    P 12 "Last crash" [""] TEXT/0 written NEVER () = 0 => Live;
    /// P-0-0012 for the maker: cause (1 fault, 2 panic, 3 stack, 4 crystal, 5 unbound interrupt, 6 watchdog, 7 control stopped) in bits 6 to 0, exception from bit 16 up; crashes since the supply came on; pc, lr, sp, xPSR, r0 to r12; CFSR, HFSR, MMFAR, BFAR; line of a panic or tasks that did not begin; end of the file's name. Empty without a crash.
    P 13 "Record of the last crash" [""] HEX_LONGS/0 written NEVER () = 0 => Live;
    /// A word of the control's own choice that comes back in the AT. Real-time and signal bits can set its bits.
    P 19 "Application word" [""] U16/0 written ALWAYS (0 to 65_535) = 0 => Live, in_at, bit_target, restricted;
    /// Phase current at full deflection of the current sensors, 1 to 8 times S-0-0110.
    P 100 "Measuring range of the phase currents" ["A"] U32/3 written IN_CP2_CP3 (1 to 4_000_000) = 25_000 => Parameter, stored, needed_for_cp4;
    /// Bus voltage at the end of the converter's range.
    P 101 "Measuring range of the bus voltage" ["V"] U16/0 written IN_CP2_CP3 (50 to 4_000) = 500 => Parameter, stored, needed_for_cp4;
    /// Time for which both transistors of a phase are off at a change, set in the bridge's timer.
    P 102 "Dead time of the bridge" ["ns"] U16/0 written NEVER () = 1_000 => Parameter;
    /// Phase current up to which the dead time is compensated in proportion, 0.2 % of S-0-0110 at least; 0: no compensation.
    P 103 "Band of the dead-time compensation" ["A"] U16/3 written ALWAYS (0 to 65_535) = 200 => Parameter, stored;
    /// Bus voltage below which the torque goes (C1D bit 9). An eighth above it main power is there; below a sixteenth above it, it is gone, and an axis in operation is stopped out of the rest.
    P 104 "Undervoltage threshold" ["V"] U16/0 written ALWAYS (1 to 4_000) = 150 => Parameter, stored, needed_for_cp4, restricted;
    /// Bus voltage above which the bridge is switched off (C1D bit 8).
    P 105 "Overvoltage threshold" ["V"] U16/0 written ALWAYS (1 to 4_000) = 440 => Parameter, stored, needed_for_cp4, restricted;
    /// Phase current at which the current loop switches the bridge off (C1D bit 7); 0: 125 % of S-0-0110.
    P 106 "Trip level of the phase currents" ["A"] U32/3 written IN_CP2_CP3 (0 to 4_000_000) = 0 => Parameter, stored, needed_for_cp4;
    /// Largest current that weakens the field above the speed that the bus voltage reaches, in per cent of S-0-0110; 0: none, and a speed above it ends in an overcurrent.
    P 107 "Field weakening current" ["%"] U16/1 written ALWAYS (0 to 900) = 500 => Parameter, stored;
    /// Pole pairs of the motor; another number makes the commutation angle unknown.
    P 110 "Pole pairs" [""] U16/0 written IN_CP2_CP3 (1 to 64) = 4 => Parameter, stored, needed_for_cp4;
    /// Resistance of a phase.
    P 111 "Winding resistance" ["Ohm"] U32/3 written ALWAYS (1 to 1_000_000) = 1_200 => Parameter, stored;
    /// Inductance of a phase in the d axis; for the decoupling.
    P 112 "Direct inductance" ["mH"] U32/3 written ALWAYS (0 to 1_000_000) = 6_000 => Parameter, stored, needed_for_cp4, restricted;
    /// Inductance of a phase in the q axis; for the decoupling.
    P 113 "Quadrature inductance" ["mH"] U32/3 written ALWAYS (0 to 1_000_000) = 6_000 => Parameter, stored, needed_for_cp4, restricted;
    /// Flux linkage of the magnets with a phase, peak value: the torque constant over 1.5 times P-0-0110.
    P 114 "Flux linkage" ["mVs"] U32/3 written ALWAYS (0 to 2_499_999) = 133_333 => Parameter, stored, needed_for_cp4;
    /// Electrical angle at the encoder's index; -1: not known, the angle is then only that of the alignment.
    P 115 "Commutation angle at the index" ["deg"] I32/2 written ALWAYS (-1 to 35_999) = -1 => Parameter, stored;
    /// Largest current of the search for the commutation angle, in per cent of S-0-0110; ten times the friction.
    P 116 "Alignment current" ["%"] U16/1 written ALWAYS (1 to 1_000) = 500 => Parameter, stored, needed_for_cp4;
    /// 1: the encoder's index is connected, and lost or added increments are found by it.
    P 117 "Encoder index" [""] BITS/0 written IN_CP2_CP3 (0 to 1) = 1 => Parameter, stored, needed_for_cp4;
    /// Electrical angle at this moment; -1: not known. Written without torque it is taken over: for an axis whose angle was kept elsewhere while its brake held it; -1 lets the drive search again.
    P 118 "Commutation angle" ["deg"] I32/2 written ALWAYS (-1 to 35_999) = -1 => Live, restricted;
    /// 0: the commutation angle is not known; 1: from the alignment or from P-0-0118; 2: checked by the index.
    P 119 "Commutation state" [""] U16/0 written NEVER () = 0 => Live;
    /// Bit 0: there is a holding brake; bit 1: it has a contact; bit 2: the axis stays where it is with its brake open and without torque, and may be aligned so.
    P 120 "Holding brake" [""] BITS/0 written IN_CP2_CP3 (0 to 7) = 0 => Parameter, stored, needed_for_cp4;
    /// Current of the d axis with which the torque is proven before the brake opens, in per cent of S-0-0110.
    P 121 "Test current of the torque proof" ["%"] U16/1 written ALWAYS (10 to 1_000) = 100 => Parameter, stored, needed_for_cp4;
    /// Movement beyond which a brake does not hold.
    P 122 "Window of the brake test" ["deg"] U16/2 written ALWAYS (1 to 36_000) = 100 => Parameter, stored, needed_for_cp4;
    /// Time in which the torque goes after the brake has closed, and for which the axis is watched then.
    P 123 "Time of the brake test" ["ms"] U16/0 written ALWAYS (1 to 10_000) = 20 => Parameter, stored, needed_for_cp4;
    /// Of the motor's winding.
    P 130 "Thermal time constant of the motor" ["s"] U32/3 written IN_CP2_CP3 (1_000 to 3_600_000) = 60_000 => Parameter, stored, needed_for_cp4;
    /// Of the bridge.
    P 131 "Thermal time constant of the amplifier" ["s"] U32/3 written IN_CP2_CP3 (1_000 to 3_600_000) = 5_000 => Parameter, stored, needed_for_cp4;
    /// Load of the motor's thermal model; the current is folded back from 90 % on.
    P 132 "Motor load" ["%"] U16/1 written NEVER () = 0 => Live;
    /// Load of the amplifier's thermal model.
    P 133 "Amplifier load" ["%"] U16/1 written NEVER () = 0 => Live;
    /// What an error does to a motor that runs: 0 velocity command zero at the torque limit, 1 torque-free, 2 ramp S-0-0138.
    P 140 "Reaction to errors" [""] U16/0 written ALWAYS (0 to 2) = 2 => Parameter, stored;
    /// Path between position commands: 0 straight lines, 1 cubic.
    P 141 "Interpolation" [""] U16/0 written ALWAYS (0 to 1) = 0 => Parameter, stored;
    /// Friction that grows with the velocity.
    P 142 "Viscous friction compensation" ["mA/rpm"] U16/3 written ALWAYS (0 to 65_535) = 0 => Parameter, stored, restricted;
    /// Phase error of the loop tick to the ring at the last t3; positive: the tick comes early.
    P 150 "Phase error of the loops" ["ns"] I32/0 written NEVER () = 0 => Live;
    /// Largest magnitude of the phase error since the loops locked; 0 again in CP2.
    P 151 "Largest phase error of the loops" ["ns"] I32/0 written NEVER () = 0 => Live;
    /// How often the phase error had a magnitude of up to 50, 100, 200, 500, 1000, 2000 ns and above, since the loops locked.
    P 152 "Histogram of the phase error" [""] LONGS/0 written NEVER () = 0 => Live;
    /// Cycles of the current loop that came too late, since the start.
    P 153 "Late current loops" [""] U32/0 written NEVER () = 0 => Live;
    /// What limits the drive right now: bits 0 to 2 torque S-0-0082, 0083, 0092; 3 S-0-0109; 4 S-0-0110; 5, 6 load of motor and amplifier; 7 bus voltage; 8 field weakening; 9 to 11 velocity S-0-0038, 0039, 0091; 12 acceleration; 13 jerk; 14, 15 position S-0-0049, 0050.
    P 160 "Limits in force" [""] BITS/0 written NEVER () = 0 => Live, in_at;
    /// Filter 1 of the current command: 0 off, 1 low-pass, 2 notch.
    P 170 "Current filter 1" [""] U16/0 written ALWAYS (0 to 2) = 0 => Parameter, stored;
    /// Of filter 1.
    P 171 "Frequency of current filter 1" ["Hz"] U16/1 written ALWAYS (100 to 35_000) = 8_000 => Parameter, stored;
    /// Damping of the low-pass in 0.001 (200 to 2000), or width of the notch in 0.1 Hz (100 to 20 000).
    P 172 "Width of current filter 1" [""] U16/0 written ALWAYS (100 to 20_000) = 707 => Parameter, stored;
    /// What the notch leaves of its centre frequency.
    P 173 "Depth of current filter 1" ["%"] U16/2 written ALWAYS (0 to 10_000) = 0 => Parameter, stored;
    /// Filter 2 of the current command: 0 off, 1 low-pass, 2 notch.
    P 174 "Current filter 2" [""] U16/0 written ALWAYS (0 to 2) = 0 => Parameter, stored;
    /// Of filter 2.
    P 175 "Frequency of current filter 2" ["Hz"] U16/1 written ALWAYS (100 to 35_000) = 8_000 => Parameter, stored;
    /// As P-0-0172.
    P 176 "Width of current filter 2" [""] U16/0 written ALWAYS (100 to 20_000) = 707 => Parameter, stored;
    /// What the notch leaves of its centre frequency.
    P 177 "Depth of current filter 2" ["%"] U16/2 written ALWAYS (0 to 10_000) = 0 => Parameter, stored;
    /// Oscilloscope: 0 idle, 1 fills the points before the trigger, 2 waits for the trigger, 3 fills those behind it, 4 done.
    P 200 "Oscilloscope state" [""] U16/0 written NEVER () = 0 => Live;
    /// What channel 1 records: the IDN of a parameter of two or four bytes, of a command or feedback value or of a word of bits, or a signal inside the loops (F000H up); 0: nothing. All settings count from the next arming on.
    P 201 "Oscilloscope signal 1" [""] HEX/0 written ALWAYS (0 to 65_535) = 0xF004 => Parameter, restricted;
    /// As P-0-0201, for channel 2.
    P 202 "Oscilloscope signal 2" [""] HEX/0 written ALWAYS (0 to 65_535) = 0xF003 => Parameter, restricted;
    /// As P-0-0201, for channel 3.
    P 203 "Oscilloscope signal 3" [""] HEX/0 written ALWAYS (0 to 65_535) = 0xF006 => Parameter, restricted;
    /// As P-0-0201, for channel 4.
    P 204 "Oscilloscope signal 4" [""] HEX/0 written ALWAYS (0 to 65_535) = 0 => Parameter, restricted;
    /// Bits 7 to 0: the channel that triggers, 0 to 3 for channel 1 to 4. Bits 15 to 8: 0 at once, 1 it rises to P-0-0206, 2 it falls to P-0-0206.
    P 205 "Oscilloscope trigger" [""] HEX/0 written ALWAYS (0 to 65_535) = 0 => Parameter, restricted;
    /// In the weight of the signal that triggers.
    P 206 "Oscilloscope trigger level" [""] I32/0 written ALWAYS (-2_147_483_648 to 2_147_483_647) = 0 => Parameter;
    /// How many of the 2048 points lie before the trigger.
    P 207 "Oscilloscope pre-trigger" [""] U16/0 written ALWAYS (0 to 2_047) = 128 => Parameter;
    /// 0: a point every current loop (62.5 us); n: a point every n loop ticks of 125 us.
    P 208 "Oscilloscope sampling" [""] U16/0 written ALWAYS (0 to 65_535) = 1 => Parameter;
    /// Writing 1 arms with P-0-0201 to P-0-0208, or is refused if they do not go together; 0 stops. Reads what was written last.
    P 209 "Oscilloscope control" [""] U16/0 written ALWAYS (0 to 1) = 0 => Parameter, restricted;
    /// Points of channel 1 from P-0-0214 on, in order of time, at most 32: the trigger is point P-0-0207. Empty unless P-0-0200 is 4.
    P 210 "Oscilloscope points 1" [""] SIGNED_LONGS/0 written NEVER () = 0 => Live;
    /// As P-0-0210, for channel 2.
    P 211 "Oscilloscope points 2" [""] SIGNED_LONGS/0 written NEVER () = 0 => Live;
    /// As P-0-0210, for channel 3.
    P 212 "Oscilloscope points 3" [""] SIGNED_LONGS/0 written NEVER () = 0 => Live;
    /// As P-0-0210, for channel 4.
    P 213 "Oscilloscope points 4" [""] SIGNED_LONGS/0 written NEVER () = 0 => Live;
    /// First point that P-0-0210 to P-0-0213 show; 0 after arming.
    P 214 "Oscilloscope window" [""] U16/0 written ALWAYS (0 to 2_047) = 0 => Live;
    /// Time between two points of the recording.
    P 215 "Oscilloscope interval" ["us"] U32/1 written NEVER () = 0 => Live;
    /// Highest velocity of P-0-0225 and P-0-0226, and by its sign their direction; half of it is used too.
    P 218 "Velocity of the identification" ["rpm"] I32/4 written ALWAYS (-2_147_483_647 to 2_147_483_647) = 3_000_000 => Parameter, stored;
    /// Ramps of P-0-0225 and P-0-0226; where S-0-0136 and S-0-0137 are set, not above them. For P-0-0226 it should take some times the current of the friction.
    P 219 "Acceleration of the identification" ["rad/s^2"] U32/3 written ALWAYS (1 to 2_147_483_647) = 100_000 => Parameter, stored;
    /// Works out S-0-0100, 0101, 0104, 0106 and 0107 from P-0-0110 to P-0-0114 and P-0-0221 to P-0-0223. All of them or, with the reason in P-0-0228, none.
    P 220 "Compute gains" [""] COMMAND/0 written ALWAYS () = 0 => Command;
    /// Motor and load at the motor's shaft.
    P 221 "Moment of inertia" ["kg cm^2"] U32/3 written ALWAYS (1 to 1_000_000_000) = 10_000 => Parameter, stored;
    /// At -3 dB, for P-0-0220.
    P 222 "Bandwidth of the current loop" ["Hz"] U16/0 written ALWAYS (10 to 2_716) = 1_000 => Parameter, stored;
    /// Where its open loop crosses, for P-0-0220.
    P 223 "Bandwidth of the velocity loop" ["Hz"] U16/0 written ALWAYS (1 to 444) = 40 => Parameter, stored;
    /// Measures P-0-0111 to P-0-0113 with direct current up to S-0-0111. Needs torque, drive HALT and standstill (7012H); the motor turns by up to 30 electrical degrees. Ends with an error when HALT ends.
    P 224 "Identify resistance and inductances" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// Measures P-0-0114 at P-0-0218 and half of it; the motor turns. Conditions as for P-0-0224.
    P 225 "Identify flux linkage" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// Measures P-0-0221 with ramps P-0-0219 between P-0-0218 and half of it; the motor turns. Conditions as for P-0-0224.
    P 226 "Identify moment of inertia" [""] COMMAND/0 written IN_CP4 () = 0 => Command;
    /// How far P-0-0224, P-0-0225 or P-0-0226 has come; 100 when it is done.
    P 227 "Progress of the identification" ["%"] U16/0 written NEVER () = 0 => Live;
    /// Why P-0-0220, P-0-0224, P-0-0225 or P-0-0226 has failed last, in plain words; empty after a success.
    P 228 "Finding of the identification" [""] TEXT/0 written NEVER () = 0 => Live;
    /// How far P-0-0225 and P-0-0226 may turn the motor from where it stands; they fail and HALT stops the motor when it is further.
    P 229 "Movement of the identification" ["rev"] U32/2 written ALWAYS (1 to 104_857_600) = 1_500 => Parameter, stored;
    /// 0: there is no second encoder, telegram types 11 to 13 and S-0-0053 are refused; 1: the motor encoder stands in for it.
    P 2705 "Source of position feedback 2" [""] U16/0 written IN_CP2_CP3 (0 to 1) = 0 => Parameter, stored;
}

const fn is_ascending(rows: &[DataBlock]) -> bool {
    let mut rest = rows;
    while let [first, tail @ ..] = rest {
        if let [second, ..] = tail
            && first.idn.0 >= second.idn.0
        {
            return false;
        }
        rest = tail;
    }
    true
}

const _: () = assert!(is_ascending(ROWS), "the rows of the dictionary are not in ascending order of their IDN");

#[cfg(test)]
mod tests;
