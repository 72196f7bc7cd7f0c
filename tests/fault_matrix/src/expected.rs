//! What the drive has to do: the one table that the runs are compared with.

use crate::Afterwards::{self, NoError, RunsAgain, RunsAgainReleased};
use crate::Mode::{self, Position, PositionWithoutLag, Torque, Velocity};
use crate::Reaction::{self, Error, Holds, None as GoesOn, Ramp, TorqueOff, Warning};
use crate::State::{self, AtSpeed, Halted, Off, Standstill, Stopping, SwitchingOn};
use crate::{Cell, Fault, Outcome};

/// A cell and what has to be seen in it.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Fault, state and mode.
    pub cell: Cell,
    row: &'static Row,
}

/// The same is expected in several states and modes.
#[derive(Debug)]
struct Row {
    fault: Fault,
    places: &'static [(State, Mode)],
    reaction: Reaction,
    /// Shortest and longest time from the fault to the bridge's switching off, in us.
    torque_off: Option<(u64, u64)>,
    /// S-0-0390; 0 where it tells of a state only.
    number: u16,
    afterwards: Afterwards,
}

impl Expected {
    /// What is not as expected, in one line.
    #[must_use]
    pub fn contradiction(&self, outcome: &Outcome) -> Option<String> {
        self.contradiction_later(outcome, 0)
    }

    /// The same for the flashed ELF, whose tasks take their time: the supervision decides up to 60 us later in its tick than that of the portable
    /// drive, and the axis is looked at every 62.5 us.
    #[must_use]
    pub fn contradiction_on_the_elf(&self, outcome: &Outcome) -> Option<String> {
        const LATER: u64 = 125;
        self.contradiction_later(outcome, LATER)
    }

    /// Microseconds `later` than a drive whose tasks take no time.
    fn contradiction_later(&self, outcome: &Outcome, later: u64) -> Option<String> {
        let row = self.row;
        let time = outcome.torque_off.map(|time| time.0 / 1_000);
        let in_time = match (row.torque_off, time) {
            (None, None) => true,
            (Some((shortest, longest)), Some(time)) => (shortest..=longest + later).contains(&time),
            _ => false,
        };
        let number = if outcome.number < 0xE000 { 0 } else { outcome.number };
        let right = (row.reaction, row.number, row.afterwards) == (outcome.reaction, number, outcome.afterwards);
        (!right || !in_time).then(|| {
            format!(
                "{}: {} after {time:?} us, {number:04X}H, S-0-0099: {}; expected {} after {:?} us, {:04X}H, S-0-0099: {}",
                self.cell, outcome.reaction, outcome.afterwards, row.reaction, row.torque_off, row.number, row.afterwards
            )
        })
    }
}

/// All cells, by fault.
#[must_use]
pub fn cells() -> Vec<Expected> {
    let of_row = |row: &'static Row| {
        row.places.iter().map(move |&(state, mode)| Expected { cell: Cell { fault: row.fault, state, mode }, row })
    };
    TABLE.iter().flat_map(of_row).collect()
}

/// What a reader has to know about the cells of a fault.
pub(crate) const fn note(fault: Fault) -> Option<&'static str> {
    Some(match fault {
        Fault::ConvertersStuck => {
            "Noticed when all the voltage there is makes no current: as soon as the loops ask for a tenth of the peak current, not before."
        }
        Fault::MotorPhaseOpen => {
            "Found as soon as half a per cent of the peak current is to flow in that phase: an axis that stands without a load asks for less, and a rotor that \
             stands with nothing in that phase is not found, whatever flows in the other two. Switched on with an \
             open phase, it gets no torque: `firmware/servo/tests/open_phase.rs`."
        }
        Fault::PositionLimit => {
            "These axes are not homed, and without a reference the limits mean nothing; `tests/travel.rs` has one that is."
        }
        Fault::EncoderFrozen => {
            "A standing axis shows nothing of it. When current makes the rotor turn, by a quarter of an electrical revolution and more, the \
             voltage that its magnets induce does: `tests/blocked.rs` measures 12 to 112 ms. Below 240 rpm (or 8 increments in 125 us) the stop is no proof, and \
             the same holds."
        }
        Fault::EnableBlinks => {
            "The axis coasts, and is caught at the speed that it has. What it has coasted behind its command, beside its lag, is within S-0-0159."
        }
        Fault::EncoderSlip => "Found at the next index pulse: within a revolution.",
        Fault::CommutationDisturbed => {
            "Found at the next index pulse, and in position modes by the following distance before it; the axis turns uncontrolled until then."
        }
        Fault::AxisBlocked => {
            "A rotor that stands induces nothing: the axis holds its torque, C3D bit 4. A dead encoder looks the same for as long as friction, a \
             brake or a stop holds the rotor."
        }
        Fault::EmergencyStop => {
            "The drive sees its input up to a cycle before bit 15, and takes the loss for an error."
        }
        Fault::MainPowerLostVertical | Fault::EmergencyStopVertical => {
            "3600 degrees are 100 mm. The brake closes under torque, which the DC link carries."
        }
        Fault::MainPowerLost => {
            "The DC link carries the stop. A stop that is under way already is finished, and the contactor is none of an error then."
        }
        Fault::MainsFailure => {
            "In torque mode the axis stands against the load and takes nothing out of the bus. Else the stop begins a sixteenth above P-0-0104; \
             here the load brakes harder than the ramp, so that it feeds nothing back, and the torque goes when the link is empty."
        }
        Fault::BrakeStuckOpen | Fault::BrakeWorn => {
            "The load is held until the control unit takes ENABLE back; S-0-0099 is refused while there is torque."
        }
        Fault::BrakeOpensLate => {
            "The brake of this machine is slow for good, so it cannot be switched on afterwards, either."
        }
        _ => return None,
    })
}

type Places = &'static [(State, Mode)];
type Time = Option<(u64, u64)>;

const EVERY_MODE: Places =
    &[(AtSpeed, Torque), (AtSpeed, Velocity), (AtSpeed, Position), (AtSpeed, PositionWithoutLag)];
const WITH_TORQUE: Places = &[
    (SwitchingOn, Velocity),
    (Standstill, Velocity),
    (AtSpeed, Torque),
    (AtSpeed, Velocity),
    (AtSpeed, Position),
    (AtSpeed, PositionWithoutLag),
    (Halted, Position),
    (Stopping, Velocity),
];
const LOOPS: Places = &[(AtSpeed, Velocity), (AtSpeed, Position), (AtSpeed, PositionWithoutLag)];
const POSITIONED: Places = &[(AtSpeed, Position), (AtSpeed, PositionWithoutLag)];
const STANDING: Places = &[(SwitchingOn, Velocity), (Standstill, Velocity), (Halted, Position)];
const IN_OPERATION: Places = &[
    (Standstill, Velocity),
    (AtSpeed, Torque),
    (AtSpeed, Velocity),
    (AtSpeed, Position),
    (AtSpeed, PositionWithoutLag),
    (Halted, Position),
];
const HELD: Places = &[(Standstill, Velocity), (Halted, Position)];
const CAUGHT: Places = &[(AtSpeed, Torque), (AtSpeed, Velocity), (AtSpeed, Position), (AtSpeed, PositionWithoutLag)];
const UPRIGHT: Places = &[(Standstill, PositionWithoutLag), (Halted, Position)];
const WHEN_OFF: Places = &[(Off, Velocity)];
const WHEN_SWITCHING_ON: Places = &[(SwitchingOn, Velocity)];
const WHEN_STOPPING: Places = &[(Stopping, Velocity)];

/// Within two cycles of the current loop.
const AT_ONCE: Time = Some((0, 125));
/// At the next look of the supervision, every 500 us, and a tick of the loops more.
const NEXT_SUPERVISION: Time = Some((60, 760));
/// 63 ms of ramp from 600 rpm and what the fault takes to be found after one or two cycles of 2 ms.
const RAMP: Time = Some((62_000, 70_000));
/// What is left of the ramp 5 ms after its beginning.
const REST_OF_RAMP: Time = Some((48_000, 57_000));

/// 60 ms of S-0-0207, the hold test, and a ramp of 12 ms from 600 rpm.
const CLOSING: Time = Some((60_000, 300_000));

/// The filter's 2 s, and 0.2 s for which it has to last.
const HOT: Time = Some((1_000_000, 2_500_000));

const fn row(
    fault: Fault,
    places: Places,
    reaction: Reaction,
    torque_off: Time,
    number: u16,
    afterwards: Afterwards,
) -> Row {
    Row { fault, places, reaction, torque_off, number, afterwards }
}

const TABLE: &[Row] = &[
    row(Fault::Overcurrent, WHEN_OFF, Warning, None, 0xE004, NoError),
    row(Fault::Overcurrent, WITH_TORQUE, TorqueOff, AT_ONCE, 0xF107, RunsAgain),
    row(Fault::CurrentSum, WHEN_OFF, Warning, None, 0xE004, NoError),
    row(Fault::CurrentSum, WITH_TORQUE, TorqueOff, AT_ONCE, 0xF110, RunsAgain),
    row(Fault::ConvertersStuck, WHEN_SWITCHING_ON, TorqueOff, Some((1_000, 30_000)), 0xF11A, RunsAgain),
    row(Fault::ConvertersStuck, EVERY_MODE, GoesOn, None, 0, NoError),
    row(Fault::ConvertersStuck, &[(Standstill, Velocity)], TorqueOff, Some((50_000, 400_000)), 0xF110, RunsAgain),
    row(Fault::ConvertersStuck, &[(Halted, Position)], TorqueOff, Some((50_000, 400_000)), 0xF110, RunsAgain),
    row(Fault::ConvertersStuck, WHEN_STOPPING, TorqueOff, Some((5_000, 60_000)), 0xF110, RunsAgain),
    row(Fault::MotorPhaseOpen, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::MotorPhaseOpen, WHEN_SWITCHING_ON, TorqueOff, Some((1_000, 60_000)), 0xF11C, RunsAgain),
    row(Fault::MotorPhaseOpen, EVERY_MODE, TorqueOff, Some((2_000, 200_000)), 0xF11C, RunsAgain),
    row(Fault::MotorPhaseOpen, &[(Halted, Position)], TorqueOff, Some((2_000, 200_000)), 0xF11C, RunsAgain),
    row(Fault::MotorPhaseOpen, &[(Standstill, Velocity)], GoesOn, None, 0, NoError),
    row(Fault::MotorPhaseOpen, WHEN_STOPPING, TorqueOff, Some((2_000, 60_000)), 0xF11C, RunsAgain),
    row(Fault::Overvoltage, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::Overvoltage, WITH_TORQUE, TorqueOff, Some((400, 900)), 0xF108, RunsAgain),
    row(Fault::MainsFailure, &[(AtSpeed, Torque)], GoesOn, None, 0, NoError),
    row(Fault::MainsFailure, LOOPS, TorqueOff, Some((50_000, 400_000)), 0xF109, RunsAgain),
    row(Fault::MainPowerLost, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::MainPowerLost, STANDING, TorqueOff, NEXT_SUPERVISION, 0xF109, RunsAgain),
    row(Fault::MainPowerLost, EVERY_MODE, Ramp, RAMP, 0xF109, RunsAgain),
    row(Fault::MainPowerLost, WHEN_STOPPING, GoesOn, REST_OF_RAMP, 0, NoError),
    row(Fault::MainPowerLostVertical, WHEN_SWITCHING_ON, TorqueOff, CLOSING, 0xF109, RunsAgain),
    row(Fault::MainPowerLostVertical, UPRIGHT, TorqueOff, CLOSING, 0xF109, RunsAgain),
    row(Fault::MainPowerLostVertical, POSITIONED, Ramp, CLOSING, 0xF109, RunsAgain),
    row(Fault::MainPowerLostVertical, WHEN_STOPPING, GoesOn, CLOSING, 0, NoError),
    row(Fault::EmergencyStop, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::EmergencyStop, STANDING, TorqueOff, NEXT_SUPERVISION, 0xF109, RunsAgain),
    row(Fault::EmergencyStop, EVERY_MODE, Ramp, RAMP, 0xF109, RunsAgain),
    row(Fault::EmergencyStop, WHEN_STOPPING, GoesOn, REST_OF_RAMP, 0, NoError),
    row(Fault::EmergencyStopVertical, UPRIGHT, TorqueOff, CLOSING, 0xF109, RunsAgain),
    row(Fault::EmergencyStopVertical, POSITIONED, Ramp, CLOSING, 0xF109, RunsAgain),
    row(Fault::EmergencyStopVertical, WHEN_STOPPING, GoesOn, CLOSING, 0, NoError),
    row(Fault::EnableBlinks, CAUGHT, GoesOn, Some((60, 3_000)), 0, NoError),
    row(Fault::GateDriver, WHEN_OFF, Warning, None, 0xE003, NoError),
    row(Fault::GateDriver, WITH_TORQUE, TorqueOff, AT_ONCE, 0xF10F, RunsAgain),
    row(Fault::EncoderFrozen, WHEN_SWITCHING_ON, TorqueOff, Some((250_000, 500_000)), 0xF118, RunsAgain),
    row(Fault::EncoderFrozen, &[(Standstill, Velocity)], GoesOn, None, 0, NoError),
    // The position loop works against the count at which the tracks froze, and the rotor turns.
    row(Fault::EncoderFrozen, &[(Halted, Position)], TorqueOff, Some((10_000, 400_000)), 0xF105, RunsAgain),
    row(Fault::EncoderFrozen, EVERY_MODE, TorqueOff, Some((400, 900)), 0xF105, RunsAgain),
    row(Fault::EncoderFrozen, WHEN_STOPPING, TorqueOff, Some((400, 900)), 0xF105, RunsAgain),
    row(Fault::EncoderSlip, EVERY_MODE, TorqueOff, Some((0, 110_000)), 0xF105, RunsAgain),
    row(Fault::EncoderJump, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::EncoderJump, WITH_TORQUE, TorqueOff, AT_ONCE, 0xF105, RunsAgain),
    row(Fault::CommutationDisturbed, STANDING, TorqueOff, Some((400, 900)), 0xF105, RunsAgain),
    // On top of the speed, 70 counts at once are more than a shaft of S-0-0113 makes.
    row(Fault::CommutationDisturbed, EVERY_MODE, TorqueOff, AT_ONCE, 0xF105, RunsAgain),
    row(Fault::MotorWarm, EVERY_MODE, Warning, None, 0xE012, NoError),
    row(Fault::MotorHot, WHEN_OFF, Error, None, 0xF102, RunsAgain),
    row(Fault::MotorHot, EVERY_MODE, Ramp, HOT, 0xF102, RunsAgain),
    row(Fault::MotorHot, HELD, TorqueOff, HOT, 0xF102, RunsAgain),
    row(Fault::HeatSinkHot, WHEN_OFF, Error, None, 0xF101, RunsAgain),
    row(Fault::HeatSinkHot, EVERY_MODE, Ramp, HOT, 0xF101, RunsAgain),
    row(Fault::HeatSinkHot, HELD, TorqueOff, HOT, 0xF101, RunsAgain),
    row(Fault::TemperatureSensorBroken, WHEN_OFF, Error, None, 0xF117, RunsAgain),
    row(Fault::TemperatureSensorBroken, EVERY_MODE, Ramp, Some((255_000, 272_000)), 0xF117, RunsAgain),
    row(Fault::TemperatureSensorBroken, HELD, TorqueOff, Some((195_000, 205_000)), 0xF117, RunsAgain),
    row(Fault::TemperatureSensorShort, WHEN_OFF, Error, None, 0xF11E, RunsAgain),
    row(Fault::TemperatureSensorShort, EVERY_MODE, Ramp, Some((255_000, 272_000)), 0xF11E, RunsAgain),
    row(Fault::TemperatureSensorShort, HELD, TorqueOff, Some((195_000, 205_000)), 0xF11E, RunsAgain),
    row(Fault::HeatSinkSensorBroken, WHEN_OFF, Error, None, 0xF117, RunsAgain),
    row(Fault::HeatSinkSensorBroken, EVERY_MODE, Ramp, Some((255_000, 272_000)), 0xF117, RunsAgain),
    row(Fault::HeatSinkSensorBroken, HELD, TorqueOff, Some((195_000, 205_000)), 0xF117, RunsAgain),
    row(Fault::Overload, &[(AtSpeed, Torque)], Warning, None, 0xE010, NoError),
    row(Fault::AxisBlocked, WHEN_SWITCHING_ON, TorqueOff, Some((250_000, 500_000)), 0xF118, RunsAgain),
    row(Fault::AxisBlocked, &[(AtSpeed, Torque), (AtSpeed, Velocity)], GoesOn, None, 0, NoError),
    row(Fault::AxisBlocked, POSITIONED, TorqueOff, Some((10_000, 14_000)), 0xF10B, RunsAgain),
    row(Fault::Overspeed, EVERY_MODE, Ramp, Some((3_000, 400_000)), 0xF115, RunsAgain),
    row(Fault::SafeTorqueOff, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::SafeTorqueOff, WITH_TORQUE, TorqueOff, NEXT_SUPERVISION, 0xF113, RunsAgain),
    row(Fault::OneSafeTorqueChannel, WHEN_OFF, Error, None, 0xF114, RunsAgain),
    row(Fault::OneSafeTorqueChannel, WITH_TORQUE, TorqueOff, NEXT_SUPERVISION, 0xF114, RunsAgain),
    row(Fault::PositionLimit, EVERY_MODE, GoesOn, None, 0, NoError),
    row(Fault::RingJitter, EVERY_MODE, Ramp, Some((70_000, 100_000)), 0xF116, RunsAgain),
    row(Fault::MstLost, IN_OPERATION, Warning, None, 0xE001, NoError),
    row(Fault::MdtLost, IN_OPERATION, Warning, None, 0xE001, NoError),
    row(Fault::TwoMstsLost, WHEN_OFF, Error, None, 0xF003, RunsAgain),
    row(Fault::TwoMstsLost, STANDING, TorqueOff, Some((1_900, 6_000)), 0xF003, RunsAgain),
    row(Fault::TwoMstsLost, EVERY_MODE, Ramp, RAMP, 0xF003, RunsAgain),
    row(Fault::TwoMstsLost, WHEN_STOPPING, Ramp, REST_OF_RAMP, 0xF003, RunsAgain),
    row(Fault::TwoMdtsLost, WHEN_OFF, Error, None, 0xF004, RunsAgain),
    row(Fault::TwoMdtsLost, STANDING, TorqueOff, Some((1_900, 6_000)), 0xF004, RunsAgain),
    row(Fault::TwoMdtsLost, EVERY_MODE, Ramp, RAMP, 0xF004, RunsAgain),
    row(Fault::TwoMdtsLost, WHEN_STOPPING, Ramp, REST_OF_RAMP, 0xF004, RunsAgain),
    row(Fault::FibreBroken, WHEN_OFF, Error, None, 0xF003, RunsAgain),
    row(Fault::FibreBroken, STANDING, TorqueOff, Some((1_900, 6_000)), 0xF003, RunsAgain),
    row(Fault::FibreBroken, EVERY_MODE, Ramp, RAMP, 0xF003, RunsAgain),
    row(Fault::FibreBroken, WHEN_STOPPING, Ramp, REST_OF_RAMP, 0xF003, RunsAgain),
    row(Fault::PhaseRegression, WHEN_OFF, Error, None, 0xF007, RunsAgain),
    row(Fault::PhaseRegression, STANDING, TorqueOff, NEXT_SUPERVISION, 0xF007, RunsAgain),
    row(Fault::PhaseRegression, EVERY_MODE, Ramp, RAMP, 0xF007, RunsAgain),
    row(Fault::PhaseRegression, WHEN_STOPPING, Ramp, REST_OF_RAMP, 0xF007, RunsAgain),
    row(Fault::OneLateCycle, IN_OPERATION, GoesOn, None, 0, NoError),
    row(Fault::LateCycles, WHEN_OFF, GoesOn, None, 0, NoError),
    row(Fault::LateCycles, WITH_TORQUE, TorqueOff, Some((60, 190)), 0xF111, RunsAgain),
    row(
        Fault::BrakeStuckClosed,
        &[(SwitchingOn, PositionWithoutLag)],
        TorqueOff,
        Some((180_000, 240_000)),
        0xF112,
        RunsAgain,
    ),
    row(
        Fault::BrakeOpensLate,
        &[(SwitchingOn, PositionWithoutLag)],
        TorqueOff,
        Some((180_000, 240_000)),
        0xF112,
        Afterwards::StaysOff,
    ),
    row(
        Fault::BrakeStuckOpen,
        &[(Stopping, PositionWithoutLag), (Stopping, Velocity)],
        Holds,
        None,
        0xF112,
        RunsAgainReleased,
    ),
    row(
        Fault::BrakeWorn,
        &[(Stopping, PositionWithoutLag), (Stopping, Velocity)],
        Holds,
        None,
        0xF112,
        RunsAgainReleased,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use ring::Nanoseconds;

    #[test]
    fn a_cell_stands_only_once() {
        let mut seen = std::collections::HashSet::new();
        for expected in cells() {
            assert!(seen.insert(expected.cell), "{}", expected.cell);
        }
    }

    #[test]
    fn whatever_is_not_as_expected_is_told() {
        let cells = cells();
        let expected =
            cells.iter().find(|expected| expected.cell.fault == Fault::SafeTorqueOff && expected.cell.state == AtSpeed);
        let expected = expected.unwrap();
        let right = Outcome {
            reaction: TorqueOff,
            torque_off: Some(Nanoseconds(125_000)),
            turned: Some(377.0),
            number: 0xF113,
            class_1: 1 << 15,
            brake_closed: None,
            afterwards: RunsAgain,
        };
        assert_eq!(expected.contradiction(&right), None);
        for wrong in [
            Outcome { reaction: Ramp, ..right },
            Outcome { torque_off: Some(Nanoseconds(30_000)), ..right },
            Outcome { torque_off: Some(Nanoseconds(800_000)), ..right },
            Outcome { torque_off: None, ..right },
            Outcome { number: 0xF105, ..right },
            Outcome { afterwards: NoError, ..right },
        ] {
            assert!(expected.contradiction(&wrong).is_some(), "{wrong:?}");
        }
    }
}
