//! Elements 3 and 4 of data that follow a scaling type, read over the service channel under each scaling.

use crate::sample::DICTIONARY;
use crate::support::Slave;
use sercos::Idn;
use sercos::attribute::Attribute;
use sercos::unit::{Dimension, Unit};

/// What a data block reads as: unit, decimal places, conversion factor.
type Weight = (String, u8, u16);

/// A slave in CP2 with these data blocks written by its master.
fn scaled(changes: &[(u16, i32)]) -> Slave {
    let mut slave = Slave::in_cp2();
    for &(number, value) in changes {
        slave.parameters.set(Idn::standard(number), (value as u32).into()).unwrap();
    }
    slave
}

fn weight(slave: &mut Slave, idn: Idn) -> Weight {
    slave.open(idn).unwrap();
    let words = slave.read(3, 2).unwrap();
    let attribute = Attribute::new_with_raw_value(u32::from(words[0]) | u32::from(words[1]) << 16);
    let words = slave.read_list(4).unwrap();
    let bytes: Vec<u8> = words[2..].iter().flat_map(|word| word.to_le_bytes()).take(words[0].into()).collect();
    (String::from_utf8(bytes).unwrap(), attribute.decimal_places().value(), attribute.conversion_factor())
}

/// Every data block of a dimension reads like this.
fn expect(changes: &[(u16, i32)], dimension: Dimension, expected: (&str, u8, u16)) {
    let mut slave = scaled(changes);
    let mut seen = 0;
    for block in DICTIONARY.blocks().iter().filter(|block| block.unit == Unit::Scaled(dimension)) {
        let (unit, decimals, factor) = weight(&mut slave, block.idn);
        assert_eq!((unit.as_str(), decimals, factor), expected, "{} under {changes:?}", block.idn);
        seen += 1;
    }
    assert!(seen > 0, "{dimension:?}");
}

#[test]
fn positions_read_in_the_unit_and_decimals_of_their_scaling() {
    for (changes, expected) in [
        (&[][..], ("deg", 4, 1)),
        (&[(76, 0x01)], ("mm", 4, 1)),
        (&[(76, 0x41)], ("mm", 4, 1)),
        (&[(76, 0xC1)], ("mm", 4, 1)),
        (&[(76, 0x02)], ("deg", 4, 1)),
        (&[(76, 0xC2)], ("deg", 4, 1)),
        // The factor and exponent of a preferred scaling mean nothing.
        (&[(76, 0x01), (77, 5), (78, -3)], ("mm", 4, 1)),
        (&[(76, 0x09), (77, 1), (78, -6)], ("mm", 3, 1)),
        (&[(76, 0x09), (77, 25), (78, -8)], ("mm", 5, 25)),
        (&[(76, 0x09), (77, 1), (78, -3)], ("mm", 0, 1)),
        (&[(76, 0x09), (77, 2), (78, 0)], ("mm", 0, 2_000)),
        (&[(76, 0x09), (77, 1), (78, -18)], ("mm", 15, 1)),
        (&[(76, 0x09), (77, 1), (78, -19)], ("inc", 0, 1)),
        (&[(76, 0x09), (77, 66), (78, 0)], ("inc", 0, 1)),
        (&[(76, 0x0A), (79, 3_600_000)], ("deg", 4, 1)),
        (&[(76, 0x4A), (79, 36_000)], ("deg", 2, 1)),
        (&[(76, 0x0A), (79, 400)], ("deg", 1, 9)),
        (&[(76, 0x0A), (79, 360)], ("deg", 0, 1)),
        // 360 / 2^20 degrees are no decimal fraction of a factor that the attribute could hold.
        (&[(76, 0x0A), (79, 1 << 20)], ("inc", 0, 1)),
        (&[(76, 0x0A), (79, 7)], ("inc", 0, 1)),
        // Inches and what means nothing, which S-0-0128 refuses.
        (&[(76, 0x11)], ("inc", 0, 1)),
        (&[(76, 0)], ("inc", 0, 1)),
    ] {
        expect(changes, Dimension::Position, expected);
    }
}

#[test]
fn velocities_read_in_the_unit_and_decimals_of_their_scaling() {
    for (changes, expected) in [
        (&[][..], ("rpm", 4, 1)),
        (&[(44, 0x01)], ("mm/min", 3, 1)),
        (&[(44, 0x41)], ("mm/min", 3, 1)),
        (&[(44, 0x22)], ("1/s", 6, 1)),
        (&[(44, 0x09), (45, 5), (46, -6)], ("mm/min", 3, 5)),
        (&[(44, 0x29), (45, 1), (46, -8)], ("mm/s", 5, 1)),
        (&[(44, 0x0A), (45, 2), (46, -5)], ("rpm", 5, 2)),
        (&[(44, 0x4A), (45, 1), (46, 2)], ("rpm", 0, 100)),
        (&[(44, 0x2A), (45, 1), (46, -3)], ("1/s", 3, 1)),
        (&[(44, 0x21)], ("inc", 0, 1)),
        (&[(44, 0x12)], ("inc", 0, 1)),
    ] {
        expect(changes, Dimension::Velocity, expected);
    }
}

#[test]
fn accelerations_and_jerks_read_in_the_unit_and_decimals_of_their_scaling() {
    for (changes, acceleration, jerk, decimals, factor) in [
        (&[][..], "rad/s^2", "rad/s^3", 3, 1),
        (&[(160, 0x01)], "mm/s^2", "mm/s^3", 3, 1),
        (&[(160, 0x41)], "mm/s^2", "mm/s^3", 3, 1),
        (&[(160, 0x0A), (161, 25), (162, -4)], "rad/s^2", "rad/s^3", 4, 25),
        (&[(160, 0x49), (161, 1), (162, -5)], "mm/s^2", "mm/s^3", 2, 1),
        (&[(160, 0x22)], "inc", "inc", 0, 1),
    ] {
        expect(changes, Dimension::Acceleration, (acceleration, decimals, factor));
        expect(changes, Dimension::Jerk, (jerk, decimals, factor));
    }
}

#[test]
fn torques_read_in_the_unit_and_decimals_of_their_scaling() {
    for (changes, expected) in [
        (&[][..], ("%", 1, 1)),
        // Of per cent there is only one kind.
        (&[(93, 7), (94, -5)], ("%", 1, 1)),
        (&[(86, 0x01)], ("N", 0, 1)),
        (&[(86, 0x41)], ("N", 0, 1)),
        (&[(86, 0x02)], ("Nm", 2, 1)),
        (&[(86, 0x42)], ("Nm", 2, 1)),
        (&[(86, 0x0A), (93, 1), (94, -3)], ("Nm", 3, 1)),
        (&[(86, 0x49), (93, 5), (94, 1)], ("N", 0, 50)),
        // Per cent of the load, by parameters, in pounds.
        (&[(86, 0x40)], ("inc", 0, 1)),
        (&[(86, 0x08)], ("inc", 0, 1)),
        (&[(86, 0x12)], ("inc", 0, 1)),
    ] {
        expect(changes, Dimension::Torque, expected);
    }
}

#[test]
fn the_attributes_of_a_real_drive_with_linear_scaling_are_read_bit_for_bit() {
    let mut slave = scaled(&[(76, 0x01), (44, 0x01), (160, 0x01)]);
    for (number, attribute) in [
        (36, 0x0322_0001_u32),
        (40, 0x7322_0001),
        (47, 0x0422_0001),
        (51, 0x7422_0001),
        (91, 0x0312_0001),
        (103, 0x4422_0001),
        (138, 0x0322_0001),
        (189, 0x7422_0001),
        (193, 0x0322_0001),
        (259, 0x0322_0001),
        (278, 0x4422_0001),
        (347, 0x7322_0001),
        (349, 0x0322_0001),
        // The motor's own speed stays its own.
        (113, 0x4412_0001),
    ] {
        slave.open(Idn::standard(number)).unwrap();
        let words = slave.read(3, 2).unwrap();
        assert_eq!(u32::from(words[0]) | u32::from(words[1]) << 16, attribute, "S-0-{number:04}");
    }
}

#[test]
fn what_the_table_calls_the_default_is_what_the_default_scaling_makes() {
    let slave = Slave::in_cp2();
    for block in DICTIONARY.blocks() {
        assert_eq!(block.scaled_attribute(&slave.parameters), block.attribute, "{}", block.idn);
        assert_eq!(block.scaled_unit(&slave.parameters), block.unit.preferred(), "{}", block.idn);
    }
}
