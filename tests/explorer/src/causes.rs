//! An error tells of something that has happened: what a life must have done before a diagnosis may be given.

use std::collections::BTreeSet;

use fault_matrix::Fault;

use crate::life::{Action, Axis};
use crate::units::setting;

pub(crate) const LAW: &str = "an error tells of something that has happened";
/// Holding brake: bit 0, there is one.
const BRAKE: u16 = 0x8000 | 120;

/// What can be the cause of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Cause {
    Encoder,
    Temperature,
    GateDriver,
    SafeTorqueOff,
    Supply,
    Ring,
    LateCycles,
}

/// What a life has done so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Causes {
    seen: BTreeSet<Cause>,
}

impl Causes {
    pub(crate) fn note(&mut self, action: &Action) {
        let cause = match action {
            Action::Break(fault) => match fault {
                // Current that is not seen is more than was asked for: the motor goes where it likes, or says nothing of where it goes.
                Fault::ConvertersStuck
                | Fault::Overspeed
                // A shaft that something stops looks like a counter that does.
                | Fault::AxisBlocked
                | Fault::Overload
                | Fault::EncoderFrozen
                | Fault::EncoderSlip
                | Fault::EncoderJump
                | Fault::CommutationDisturbed => Cause::Encoder,
                Fault::MotorHot
                | Fault::HeatSinkHot
                | Fault::TemperatureSensorBroken
                | Fault::TemperatureSensorShort
                | Fault::HeatSinkSensorBroken => Cause::Temperature,
                Fault::GateDriver => Cause::GateDriver,
                Fault::SafeTorqueOff | Fault::OneSafeTorqueChannel => Cause::SafeTorqueOff,
                Fault::Overvoltage | Fault::MainsFailure | Fault::MainPowerLost | Fault::EmergencyStop => Cause::Supply,
                Fault::RingJitter
                | Fault::MstLost
                | Fault::MdtLost
                | Fault::TwoMstsLost
                | Fault::TwoMdtsLost
                | Fault::FibreBroken
                | Fault::PhaseRegression => Cause::Ring,
                Fault::OneLateCycle | Fault::LateCycles => Cause::LateCycles,
                _ => return,
            },
            // A load may make the shaft faster than S-0-0113 and a quarter: a counter that fast is taken for one that jumps.
            Action::Load(_) => Cause::Encoder,
            // Whoever forgets the angle has it searched for.
            Action::Write(0x8076, _) => Cause::Encoder,
            Action::SafeTorqueOff(_) => Cause::SafeTorqueOff,
            Action::Mains(_) | Action::Contactor { .. } => Cause::Supply,
            // The undervoltage and overvoltage thresholds, those of the temperatures, and the sensor of the motor.
            Action::Write(0x8068 | 0x8069, _) => Cause::Supply,
            Action::Write(200..=204 | 0x8086, _) => Cause::Temperature,
            Action::LoseMst(_)
            | Action::LoseMdt(_)
            | Action::DamageMst(_)
            | Action::DamageMdt(_)
            | Action::WrongPhase(_)
            | Action::Dark(_)
            | Action::FallBack(_)
            | Action::SkipCheck(_) => Cause::Ring,
            _ => return,
        };
        self.seen.insert(cause);
    }

    /// Whether the count may be another one than the drive knows of: it shows at an index pulse, and that may be far away.
    pub(crate) fn may_have_moved_the_count(&self) -> bool {
        self.seen.contains(&Cause::Encoder)
    }

    /// Whether a diagnosis can be true of an axis.
    pub(crate) fn allow(&self, axis: &Axis, diagnosis: u16) -> bool {
        let seen = |cause| self.seen.contains(&cause);
        match diagnosis {
            0xF001..=0xF008 | 0xF116 => seen(Cause::Ring),
            0xF101 | 0xF102 | 0xF117 | 0xF11E => seen(Cause::Temperature),
            // An angle that was searched for may turn out wrong at the index.
            0xF105 => seen(Cause::Encoder) || !axis.aligned,
            0xF109 => seen(Cause::Supply) || seen(Cause::Encoder),
            0xF10F => seen(Cause::GateDriver),
            0xF111 => seen(Cause::LateCycles),
            0xF112 => setting(axis, BRAKE).map_or(axis.plant.axis().machine.brake.is_some(), |brake| brake & 1 != 0),
            0xF113 | 0xF114 => seen(Cause::SafeTorqueOff),
            _ => true,
        }
    }
}
