//! What can go wrong with bridge, motor, encoder and brake, and what has to be done about it.

/// Something that the motor side has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum MotorFault {
    /// The DC link is above its upper threshold.
    Overvoltage,
    /// The DC link is below its lower threshold.
    Undervoltage,
    /// A phase current was above the trip level.
    Overcurrent,
    /// The encoder tells what no shaft does: where the axis is, nobody knows any more.
    Feedback,
    /// The currents do not add up to nothing, or do not follow although all the voltage there is is given.
    CurrentSensor,
    /// The current loop came too late twice in a row.
    Deadline,
    /// The thermal model of motor or amplifier is above its limit.
    Overload,
    /// The heat sink is too hot.
    AmplifierTemperature,
    /// The motor is too hot.
    MotorTemperature,
    /// A wire of a temperature sensor is broken.
    ThermometerBroken,
    /// A temperature sensor is short-circuited.
    ThermometerShort,
    /// The commutation angle is not known and may not be searched for, or is not that of the index.
    Commutation,
    /// The search for the commutation angle: the motor does not move.
    AlignmentNoMovement,
    /// The search for the commutation angle: encoder and motor phases turn against each other.
    AlignmentDirection,
    /// The search for the commutation angle failed otherwise.
    Alignment,
    /// The bridge does not answer, or the torque is lost.
    Bridge,
    /// The holding brake does not do what it is told.
    Brake,
    /// A phase of the motor carries nothing of what is asked of it.
    OpenPhase,
}

/// What has to be done about a fault, at least.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultReaction {
    /// The motor can still be stopped under control.
    Stop,
    /// It can not: the torque goes at once.
    TorqueOff,
}

impl MotorFault {
    /// All of them, in the order of their declaration.
    pub const ALL: [Self; 18] = [
        Self::Overvoltage,
        Self::Undervoltage,
        Self::Overcurrent,
        Self::Feedback,
        Self::CurrentSensor,
        Self::Deadline,
        Self::Overload,
        Self::AmplifierTemperature,
        Self::MotorTemperature,
        Self::ThermometerBroken,
        Self::ThermometerShort,
        Self::Commutation,
        Self::AlignmentNoMovement,
        Self::AlignmentDirection,
        Self::Alignment,
        Self::Bridge,
        Self::Brake,
        Self::OpenPhase,
    ];

    /// What has to be done about it, at least.
    #[must_use]
    pub const fn reaction(self) -> FaultReaction {
        match self {
            Self::Overvoltage
            | Self::Undervoltage
            | Self::Overcurrent
            | Self::Feedback
            | Self::CurrentSensor
            | Self::Deadline
            | Self::Commutation
            | Self::AlignmentNoMovement
            | Self::AlignmentDirection
            | Self::Alignment
            | Self::Bridge
            | Self::OpenPhase => FaultReaction::TorqueOff,
            Self::Overload
            | Self::AmplifierTemperature
            | Self::MotorTemperature
            | Self::ThermometerBroken
            | Self::ThermometerShort
            | Self::Brake => FaultReaction::Stop,
        }
    }

    const fn bit(self) -> u32 {
        1 << self as u8
    }
}

/// Any number of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorFaults(u32);

impl MotorFaults {
    /// None.
    pub const NONE: Self = Self(0);

    /// What the sensor of the motor can say of the motor and of itself.
    pub const OF_THE_MOTORS_SENSOR: Self = Self(
        MotorFault::MotorTemperature.bit() | MotorFault::ThermometerBroken.bit() | MotorFault::ThermometerShort.bit(),
    );

    /// This one alone.
    #[must_use]
    pub const fn of(fault: MotorFault) -> Self {
        Self(fault.bit())
    }

    /// There is none.
    #[inline]
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// This one is among them.
    #[must_use]
    pub const fn contains(self, fault: MotorFault) -> bool {
        self.0 & fault.bit() != 0
    }

    /// Adds one.
    #[inline]
    pub const fn add(&mut self, fault: MotorFault) {
        self.0 |= fault.bit();
    }

    /// Adds those of another look.
    #[inline]
    pub const fn add_all(&mut self, faults: Self) {
        self.0 |= faults.0;
    }

    /// Those that are not among others.
    #[inline]
    #[must_use]
    pub const fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Each of them.
    pub fn iter(self) -> impl Iterator<Item = MotorFault> {
        MotorFault::ALL.into_iter().filter(move |fault| self.contains(*fault))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_faults_have_a_place_of_their_own() {
        let mut faults = MotorFaults::NONE;
        for (number, fault) in MotorFault::ALL.into_iter().enumerate() {
            assert_eq!(fault as usize, number);
            assert!(!faults.contains(fault));
            faults.add(fault);
            assert!(MotorFaults::of(fault).iter().eq([fault]));
            assert!(!faults.without(MotorFaults::of(fault)).contains(fault));
        }
        assert!(faults.iter().eq(MotorFault::ALL));
    }
}
