//! What an increment of position, velocity, acceleration, jerk and torque data is: the scaling types S-0-0044, 76, 86 and 160 with their
//! factors and exponents (sercos2.md 6.5), and what elements 3 and 4 of a data block say of it.

use arbitrary_int::u4;

use crate::attribute::Attribute;
use crate::data_block::DataBlock;
use crate::idn::Idn;
use crate::parameters::Parameters;
use crate::unit::{Dimension, Unit, Weight};

impl Weight {
    /// Of data whose increment no factor of 16 bits and no 15 decimal places can express, and of data whose scaling type means nothing: the
    /// bare number of increments.
    pub const INCREMENTS: Self = Self { unit: "inc", decimals: 0, factor: 1 };

    /// How the data of a dimension read under the scaling of these parameters.
    pub fn of(dimension: Dimension, parameters: &Parameters) -> Self {
        Weighting::of(dimension, parameters).map_or(Self::INCREMENTS, |weighting| weighting.shown(dimension))
    }

    /// `factor` times ten to `exponent` of a unit.
    fn decimal(unit: &'static str, factor: u16, exponent: i32) -> Option<Self> {
        const MOST_DECIMALS: u8 = 15;
        if exponent <= 0 {
            let decimals = u8::try_from(exponent.unsigned_abs()).ok().filter(|&decimals| decimals <= MOST_DECIMALS)?;
            return Some(Self { unit, decimals, factor });
        }
        let factor = 10_u16.checked_pow(exponent.unsigned_abs())?.checked_mul(factor)?;
        Some(Self { unit, decimals: 0, factor })
    }

    /// One of so many increments of a revolution, in degrees: only where a decimal fraction is exactly that. Divides.
    fn of_revolution(increments: u32) -> Option<Self> {
        const FINEST: u8 = 9;
        let mut circle = 360_u64;
        for decimals in 0..=FINEST {
            if circle.checked_rem(increments.into()) == Some(0) {
                let factor = circle.checked_div(increments.into()).and_then(|factor| u16::try_from(factor).ok())?;
                return Some(Self { unit: "deg", decimals, factor });
            }
            circle = circle.saturating_mul(10);
        }
        None
    }
}

impl DataBlock {
    /// Element 4 under the scaling of these parameters; empty: there is none.
    pub fn scaled_unit(&self, parameters: &Parameters) -> &'static str {
        match self.unit {
            Unit::Fixed(unit) => unit,
            Unit::Scaled(dimension) => Weight::of(dimension, parameters).unit,
        }
    }

    /// Element 3 under the scaling of these parameters.
    pub fn scaled_attribute(&self, parameters: &Parameters) -> Attribute {
        match self.unit {
            Unit::Fixed(_) => self.attribute,
            Unit::Scaled(dimension) => {
                let weight = Weight::of(dimension, parameters);
                let decimals = u4::new(weight.decimals & 0xF);
                self.attribute.with_decimal_places(decimals).with_conversion_factor(weight.factor)
            }
        }
    }
}

/// Bits 2 to 0 of a scaling type: what the data count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kind {
    /// Torque data only: per cent of S-0-0111.
    Percent,
    /// Metres, or newtons.
    Linear,
    /// Degrees, revolutions or radians, or newton metres.
    Rotary,
}

/// An increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Increment {
    /// A factor times a power of ten of the unit: m, m/min, m/s, m/s², 1/min, 1/s, rad/s², %, N or Nm.
    Decimal {
        /// 1 to 65 535.
        factor: u16,
        /// -32 to 32.
        exponent: i32,
    },
    /// One of so many that are a revolution; rotary position data only.
    OfRevolution(u32),
}

/// The scaling of a dimension, decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Weighting {
    /// Bits 2 to 0.
    pub kind: Kind,
    /// What bit 3, factor and exponent or resolution make.
    pub increment: Increment,
    /// Bit 3: the increment is that of factor and exponent, or of S-0-0079, not the preferred one.
    pub by_parameter: bool,
    /// Bit 5 of S-0-0044: per second instead of per minute.
    pub per_second: bool,
    /// Bit 6: of the load instead of the motor.
    pub at_load: bool,
    /// Bit 7 of S-0-0076: modulo.
    pub modulo: bool,
}

impl Weighting {
    /// The scaling of these parameters.
    ///
    /// # Errors
    /// The scaling type, if this drive does not have it: inches and pounds (bit 4), reserved bits, and the preferred linear scaling of a
    /// velocity per second, which is in no public paper.
    pub fn of(dimension: Dimension, parameters: &Parameters) -> Result<Self, Idn> {
        const BY_PARAMETER: u16 = 1 << 3;
        const PER_SECOND: u16 = 1 << 5;
        const AT_LOAD: u16 = 1 << 6;
        const MODULO: u16 = 1 << 7;
        let idn = dimension.scaling_type();
        let word = parameters.get_word(idn);
        let own = match dimension {
            Dimension::Position => MODULO,
            Dimension::Velocity => PER_SECOND,
            _ => 0,
        };
        let kind = match (word & !(BY_PARAMETER | AT_LOAD | own), dimension) {
            // Nothing else of the type means anything then.
            (0, Dimension::Torque) if word == 0 => Kind::Percent,
            (1, _) => Kind::Linear,
            (2, _) => Kind::Rotary,
            _ => return Err(idn),
        };
        let per_second = word & own & PER_SECOND != 0;
        let by_parameter = word & BY_PARAMETER != 0;
        let increment = match by_parameter {
            true => Self::by_parameter(dimension, kind, parameters),
            false => Self::preferred(dimension, kind, per_second).ok_or(idn)?,
        };
        let (at_load, modulo) = (word & AT_LOAD != 0, word & own & MODULO != 0);
        Ok(Self { kind, increment, by_parameter, per_second, at_load, modulo })
    }

    const fn preferred(dimension: Dimension, kind: Kind, per_second: bool) -> Option<Increment> {
        /// 0.0001 degree.
        const OF_REVOLUTION: Increment = Increment::OfRevolution(3_600_000);
        let exponent = match (dimension, kind, per_second) {
            (Dimension::Position, Kind::Rotary, _) => return Some(OF_REVOLUTION),
            (Dimension::Position, _, _) => -7,
            (Dimension::Velocity, Kind::Rotary, false) => -4,
            (Dimension::Velocity, Kind::Rotary, true) | (Dimension::Velocity, Kind::Linear, false) => -6,
            (Dimension::Velocity, _, _) => return None,
            (Dimension::Acceleration | Dimension::Jerk, Kind::Rotary, _) => -3,
            (Dimension::Acceleration | Dimension::Jerk, _, _) => -6,
            (Dimension::Torque, Kind::Percent, _) => -1,
            (Dimension::Torque, Kind::Linear, _) => 0,
            (Dimension::Torque, Kind::Rotary, _) => -2,
        };
        Some(Increment::Decimal { factor: 1, exponent })
    }

    fn by_parameter(dimension: Dimension, kind: Kind, parameters: &Parameters) -> Increment {
        let (factor, exponent) = match dimension {
            Dimension::Position if kind == Kind::Rotary => {
                return Increment::OfRevolution(parameters.get(Idn::standard(79)));
            }
            Dimension::Position => (77, 78),
            Dimension::Velocity => (45, 46),
            Dimension::Acceleration | Dimension::Jerk => (161, 162),
            Dimension::Torque => (93, 94),
        };
        Increment::Decimal {
            factor: parameters.get_word(Idn::standard(factor)),
            exponent: parameters.get_word(Idn::standard(exponent)).cast_signed().into(),
        }
    }

    /// How the data read. People think of metres in millimetres.
    fn shown(&self, dimension: Dimension) -> Weight {
        const MILLI: i32 = 3;
        let (unit, finer) = match (dimension, self.kind) {
            (Dimension::Position, Kind::Linear) => ("mm", MILLI),
            (Dimension::Position, _) => ("deg", 0),
            (Dimension::Velocity, Kind::Linear) if self.per_second => ("mm/s", MILLI),
            (Dimension::Velocity, Kind::Linear) => ("mm/min", MILLI),
            (Dimension::Velocity, _) if self.per_second => ("1/s", 0),
            (Dimension::Velocity, _) => ("rpm", 0),
            (Dimension::Acceleration, Kind::Linear) => ("mm/s^2", MILLI),
            (Dimension::Acceleration, _) => ("rad/s^2", 0),
            (Dimension::Jerk, Kind::Linear) => ("mm/s^3", MILLI),
            (Dimension::Jerk, _) => ("rad/s^3", 0),
            (Dimension::Torque, Kind::Percent) => ("%", 0),
            (Dimension::Torque, Kind::Linear) => ("N", 0),
            (Dimension::Torque, Kind::Rotary) => ("Nm", 0),
        };
        let weight = match self.increment {
            Increment::OfRevolution(increments) => Weight::of_revolution(increments),
            Increment::Decimal { factor, exponent } => Weight::decimal(unit, factor, exponent.saturating_add(finer)),
        };
        weight.unwrap_or(Weight::INCREMENTS)
    }
}
