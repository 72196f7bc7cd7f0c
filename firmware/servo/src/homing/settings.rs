//! Parameters of homing, checked once.

use core::fmt;

use crate::units::{Position, Velocity};

/// Parameters of homing in the units of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HomingParameters {
    /// Homing parameter S-0-0147: bit 0 negative direction, 1 switch active at 0 (falling edge), 2 switch at the drive, 3 external
    /// feedback, 4 homing enable evaluated, 5 switch not evaluated, 6 marker not evaluated, 7 stop at the reference point, 8 distance
    /// coded.
    pub homing_parameter: u16,
    /// Homing velocity S-0-0041, above zero.
    pub velocity: Velocity,
    /// Reference distance S-0-0052: coordinate of the reference point.
    pub reference_distance: Position,
    /// Reference offset S-0-0150, from the marker (without marker: from the edge of the switch) to the reference point, in counting
    /// direction.
    pub reference_offset: Position,
    /// Home switch offset S-0-0299: way behind the edge of the switch from which the next marker counts; 0 to 1 revolution.
    pub switch_offset: Position,
    /// Largest way from the start in either direction while the switch is looked for (as S-0-0278); `None`: unlimited.
    pub travel_limit: Option<Position>,
    /// Largest way on which the marker must come; `None`: one and a half revolutions.
    pub marker_limit: Option<Position>,
}

/// A way of homing that cannot be gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HomingSettingsError {
    /// Homing parameter S-0-0147 bit 3: there is no external feedback.
    ExternalFeedback,
    /// Homing parameter S-0-0147 bit 8: distance-coded markers are not evaluated.
    DistanceCoded,
    /// Homing parameter S-0-0147 bits 9 to 15 are reserved.
    ReservedBits {
        /// Those that are set.
        actual: u16,
    },
    /// Homing velocity S-0-0041 must be above zero.
    Velocity {
        /// Velocity given.
        actual: Velocity,
    },
    /// Home switch offset S-0-0299 must be 0 to 1 revolution.
    SwitchOffset {
        /// Offset given.
        actual: Position,
    },
    /// A limit of the way must be above zero.
    Limit {
        /// Limit given.
        actual: Position,
    },
}

impl fmt::Display for HomingSettingsError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ExternalFeedback => {
                formatter.write_str("homing at an external feedback (S-0-0147 bit 3) is not supported")
            }
            Self::DistanceCoded => formatter.write_str("distance-coded markers (S-0-0147 bit 8) are not supported"),
            Self::ReservedBits { actual } => write!(formatter, "reserved bits {actual:#06X} of S-0-0147 are set"),
            Self::Velocity { actual } => {
                write!(
                    formatter,
                    "homing velocity S-0-0041 of {} in 10^-4 rpm, expected more than 0",
                    actual.to_ten_thousandths_rpm()
                )
            }
            Self::SwitchOffset { actual } => {
                write!(
                    formatter,
                    "home switch offset S-0-0299 of {} revolutions, expected 0 to 1",
                    actual.to_revolutions()
                )
            }
            Self::Limit { actual } => {
                write!(
                    formatter,
                    "limit of the homing way of {} revolutions, expected more than 0",
                    actual.to_revolutions()
                )
            }
        }
    }
}

impl core::error::Error for HomingSettingsError {}

pub(super) const NEGATIVE: u16 = 1 << 0;
const FALLING_EDGE: u16 = 1 << 1;
const SWITCH_AT_DRIVE: u16 = 1 << 2;
const EXTERNAL_FEEDBACK: u16 = 1 << 3;
pub(super) const HOMING_ENABLE_EVALUATED: u16 = 1 << 4;
pub(super) const SWITCH_NOT_EVALUATED: u16 = 1 << 5;
pub(super) const MARKER_NOT_EVALUATED: u16 = 1 << 6;
pub(super) const STOP_AT_REFERENCE_POINT: u16 = 1 << 7;
const DISTANCE_CODED: u16 = 1 << 8;
const RESERVED: u16 = 0xFE00;

pub(super) const HALF_REVOLUTION: i64 = Position::REVOLUTION.to_bits() / 2;
/// A marker must come within one revolution; half of one more covers elastic couplings and the ramp.
const MARKER_LIMIT: i64 = 3 * HALF_REVOLUTION;
/// Settings of homing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HomingSettings {
    bits: u16,
    pub(super) velocity: Velocity,
    pub(super) reference_distance: Position,
    pub(super) reference_offset: Position,
    pub(super) switch_offset: i64,
    pub(super) travel_limit: i64,
    pub(super) marker_limit: i64,
}

impl HomingSettings {
    /// Checks the parameters.
    ///
    /// # Errors
    /// The first parameter that homing cannot work with.
    pub fn new(parameters: &HomingParameters) -> Result<Self, HomingSettingsError> {
        let bits = parameters.homing_parameter;
        if bits & EXTERNAL_FEEDBACK != 0 {
            return Err(HomingSettingsError::ExternalFeedback);
        }
        if bits & DISTANCE_CODED != 0 {
            return Err(HomingSettingsError::DistanceCoded);
        }
        if bits & RESERVED != 0 {
            return Err(HomingSettingsError::ReservedBits { actual: bits & RESERVED });
        }
        if parameters.velocity <= Velocity::ZERO {
            return Err(HomingSettingsError::Velocity { actual: parameters.velocity });
        }
        if !(Position::ZERO..=Position::REVOLUTION).contains(&parameters.switch_offset) {
            return Err(HomingSettingsError::SwitchOffset { actual: parameters.switch_offset });
        }
        let limit = |given: Option<Position>, otherwise| match given {
            Some(actual) if actual <= Position::ZERO => Err(HomingSettingsError::Limit { actual }),
            Some(limit) => Ok(limit.to_bits()),
            None => Ok(otherwise),
        };
        Ok(Self {
            bits,
            velocity: if bits & NEGATIVE != 0 { -parameters.velocity } else { parameters.velocity },
            reference_distance: parameters.reference_distance,
            reference_offset: parameters.reference_offset,
            switch_offset: parameters.switch_offset.to_bits(),
            travel_limit: limit(parameters.travel_limit, i64::MAX)?,
            marker_limit: limit(parameters.marker_limit, MARKER_LIMIT)?,
        })
    }

    /// The home switch is wired to the drive; else the control unit writes S-0-0400 (S-0-0147 bit 2).
    #[must_use]
    pub const fn is_switch_at_drive(&self) -> bool {
        self.has(SWITCH_AT_DRIVE)
    }

    #[inline]
    pub(super) const fn has(&self, bit: u16) -> bool {
        self.bits & bit != 0
    }

    /// The part of a way that goes in the homing direction.
    #[inline]
    pub(super) fn forwards(&self, way: Position) -> i64 {
        if self.has(NEGATIVE) { (-way).to_bits() } else { way.to_bits() }
    }

    #[inline]
    pub(super) fn is_on_switch(&self, home_switch: bool) -> bool {
        home_switch != self.has(FALLING_EDGE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: HomingParameters = HomingParameters {
        homing_parameter: 0,
        velocity: Velocity::from_bits(1),
        reference_distance: Position::ZERO,
        reference_offset: Position::ZERO,
        switch_offset: Position::REVOLUTION,
        travel_limit: None,
        marker_limit: None,
    };

    #[test]
    fn ways_that_are_not_there_are_refused_by_name() {
        let with = |homing_parameter| HomingSettings::new(&HomingParameters { homing_parameter, ..GOOD }).err();
        for bit in 0..16 {
            let expected = match bit {
                3 => Some(HomingSettingsError::ExternalFeedback),
                8 => Some(HomingSettingsError::DistanceCoded),
                9.. => Some(HomingSettingsError::ReservedBits { actual: 1 << bit }),
                _ => None,
            };
            assert_eq!(with(1 << bit), expected, "bit {bit}");
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused_with_their_value() {
        let error = |parameters: HomingParameters| HomingSettings::new(&parameters).err();
        for actual in [Velocity::ZERO, Velocity::from_bits(-1)] {
            assert_eq!(
                error(HomingParameters { velocity: actual, ..GOOD }),
                Some(HomingSettingsError::Velocity { actual })
            );
        }
        for actual in [Position::from_bits(-1), Position::REVOLUTION + Position::from_bits(1)] {
            let expected = Some(HomingSettingsError::SwitchOffset { actual });
            assert_eq!(error(HomingParameters { switch_offset: actual, ..GOOD }), expected);
        }
        let actual = Position::ZERO;
        let expected = Some(HomingSettingsError::Limit { actual });
        assert_eq!(error(HomingParameters { travel_limit: Some(actual), ..GOOD }), expected);
        assert_eq!(error(HomingParameters { marker_limit: Some(actual), ..GOOD }), expected);
        assert_eq!(error(GOOD), None);
    }

    #[test]
    fn the_place_of_the_switch_is_bit_2() {
        for (homing_parameter, expected) in [(SWITCH_AT_DRIVE, true), (0, false)] {
            let settings = HomingSettings::new(&HomingParameters { homing_parameter, ..GOOD }).unwrap();
            assert_eq!(settings.is_switch_at_drive(), expected);
        }
    }
}
