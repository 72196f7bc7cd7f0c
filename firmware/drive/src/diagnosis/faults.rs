//! From what is wrong to C1D and S-0-0129: for the faults of the motor side all of it, and the set in which a look collects.

use sercos::diagnostic::Class1;
use servo::motor::{FaultReaction, MotorFault, MotorFaults};

use super::words::Manufacturer1;

/// What a look has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Findings {
    /// Errors for C1D.
    pub(crate) class_1: Class1,
    /// Errors behind C1D bit 15.
    pub(crate) manufacturer_1: Manufacturer1,
    /// The motor cannot be stopped under control any more: torque off at once.
    pub(crate) fatal: bool,
}

impl Findings {
    pub(crate) fn add_own(&mut self, manufacturer_1: Manufacturer1, fatal: bool) {
        self.class_1 |= Class1::MANUFACTURER;
        self.manufacturer_1 |= manufacturer_1;
        self.fatal |= fatal;
    }
}

impl From<MotorFaults> for Findings {
    fn from(faults: MotorFaults) -> Self {
        let mut findings = Self::default();
        for fault in faults.iter() {
            let (class_1, manufacturer_1) = bits(fault);
            findings.class_1 |= class_1;
            findings.manufacturer_1 |= manufacturer_1;
            findings.fatal |= fault.reaction() == FaultReaction::TorqueOff;
        }
        findings
    }
}

/// C1D and S-0-0129 of a fault.
fn bits(fault: MotorFault) -> (Class1, Manufacturer1) {
    let own = |manufacturer_1| (Class1::MANUFACTURER, manufacturer_1);
    let no_angle = |manufacturer_1| (Class1::COMMUTATION | Class1::MANUFACTURER, manufacturer_1);
    let standard = |class_1| (class_1, Manufacturer1::empty());
    match fault {
        MotorFault::Overvoltage => standard(Class1::OVERVOLTAGE),
        MotorFault::Undervoltage => standard(Class1::UNDERVOLTAGE),
        MotorFault::Overcurrent => standard(Class1::OVERCURRENT),
        MotorFault::Feedback => standard(Class1::FEEDBACK),
        MotorFault::Overload => standard(Class1::OVERLOAD),
        MotorFault::AmplifierTemperature => standard(Class1::AMPLIFIER_TEMPERATURE),
        MotorFault::MotorTemperature => standard(Class1::MOTOR_TEMPERATURE),
        MotorFault::Commutation => standard(Class1::COMMUTATION),
        MotorFault::AlignmentNoMovement => no_angle(Manufacturer1::ALIGNMENT_NO_MOVEMENT),
        MotorFault::AlignmentDirection => no_angle(Manufacturer1::ALIGNMENT_DIRECTION),
        MotorFault::Alignment => no_angle(Manufacturer1::ALIGNMENT),
        MotorFault::CurrentSensor => own(Manufacturer1::CURRENT_SENSOR),
        MotorFault::Deadline => own(Manufacturer1::DEADLINE),
        MotorFault::ThermometerBroken => own(Manufacturer1::THERMOMETER_BROKEN),
        MotorFault::ThermometerShort => own(Manufacturer1::THERMOMETER_SHORT),
        MotorFault::Bridge => own(Manufacturer1::AMPLIFIER_FAULT),
        MotorFault::Brake => own(Manufacturer1::BRAKE),
        MotorFault::OpenPhase => own(Manufacturer1::OPEN_PHASE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_of_the_motor_side_is_told_and_each_otherwise() {
        let mut seen = [(Class1::empty(), Manufacturer1::empty()); MotorFault::ALL.len()];
        for (place, fault) in MotorFault::ALL.into_iter().enumerate() {
            let told = bits(fault);
            assert_eq!(told.0.contains(Class1::MANUFACTURER), !told.1.is_empty(), "{fault:?}");
            assert!(!told.0.is_empty() && !seen.contains(&told), "{fault:?}");
            seen[place] = told;
        }
    }

    #[test]
    fn faults_that_come_together_are_told_together_with_the_harder_reaction() {
        let mut faults = MotorFaults::of(MotorFault::Overload);
        assert_eq!(Findings::from(faults), Findings { class_1: Class1::OVERLOAD, ..Findings::default() });
        faults.add(MotorFault::CurrentSensor);
        assert_eq!(
            Findings::from(faults),
            Findings {
                class_1: Class1::OVERLOAD | Class1::MANUFACTURER,
                manufacturer_1: Manufacturer1::CURRENT_SENSOR,
                fatal: true,
            }
        );
        assert_eq!(Findings::from(MotorFaults::NONE), Findings::default());
    }
}
