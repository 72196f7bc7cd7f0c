//! Everything that breaks, how it is broken, and how it is repaired.

use plant::{BrakeFailure, HoldingBrake, ReferenceAxis, ThermometerFailure};
use ring::Nanoseconds;
use ring::fibre::{Effect, TelegramKind};
use ring::ident::{Idn, Value};
use std::fmt;

use crate::{MatrixError, Mode, State, Target};

/// Largest sample of the converters.
const FULL_SCALE: u16 = 4_095;
/// Sample of a current of zero.
const MIDDLE: u16 = 2_048;

/// Heat sink and windings of a machine that has run for a while, in degrees C.
const WARM: [f64; 2] = [60.0, 100.0];

/// What jams a blocked axis: friction of more than twice the peak torque, of which the drive knows nothing. It stops the axis from 600 rpm in
/// 1 ms; nothing stops in no time.
const JAM: HoldingBrake = HoldingBrake { holding_torque: 40.0, release_delay: 0.0, engage_delay: 0.002 };

/// What the axis works against when the mains fails.
const PROCESS: HoldingBrake = HoldingBrake { holding_torque: 4.0, ..JAM };

/// One fault, put in from outside the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum Fault {
    /// A current sensor shows the end of its range.
    Overcurrent,
    /// The zero of a current sensor moves by a fifth of its range.
    CurrentSum,
    /// All current sensors show zero for ever: the converters have stopped.
    ConvertersStuck,
    /// A core of the motor cable breaks.
    MotorPhaseOpen,
    /// Mains of 480 V in place of 320 V, rectified.
    Overvoltage,
    /// The mains fails under a load; the contactor stays closed.
    MainsFailure,
    /// The main power input goes away, and the mains with it.
    MainPowerLost,
    /// The same on a vertical axis.
    MainPowerLostVertical,
    /// An emergency stop circuit: the main contactor opens, and the control takes bit 15 away.
    EmergencyStop,
    /// The same on a vertical axis.
    EmergencyStopVertical,
    /// The control takes bits 15 and 14 away for 20 ms.
    EnableBlinks,
    /// The gate drivers report a fault; the break input takes the bridge off.
    GateDriver,
    /// The encoder's tracks stand still, whatever the axis does.
    EncoderFrozen,
    /// 20 counts that no movement has caused, too few for a jump.
    EncoderSlip,
    /// Half a revolution of counts at once.
    EncoderJump,
    /// 201 degrees of commutation angle lost in 20 small slips within 20 ms.
    CommutationDisturbed,
    /// The windings are at 160 degrees C.
    MotorHot,
    /// The windings are at 126 degrees C.
    MotorWarm,
    /// The heat sink is at 110 degrees C.
    HeatSinkHot,
    /// The wire of the motor's temperature sensor is broken.
    TemperatureSensorBroken,
    /// The wires of the motor's temperature sensor touch each other.
    TemperatureSensorShort,
    /// The wire of the heat sink's temperature sensor is broken.
    HeatSinkSensorBroken,
    /// The axis is blocked at the peak torque.
    Overload,
    /// The axis is blocked.
    AxisBlocked,
    /// The load drives the axis beyond 125 % of S-0-0113, set to 2000 rpm.
    Overspeed,
    /// Both channels of safe torque off open.
    SafeTorqueOff,
    /// Only the first channel opens.
    OneSafeTorqueChannel,
    /// The axis passes S-0-0049.
    PositionLimit,
    /// Every second MST comes 6 us late.
    RingJitter,
    /// One MST is lost.
    MstLost,
    /// One MDT is lost.
    MdtLost,
    /// Two MSTs in a row are lost.
    TwoMstsLost,
    /// Two MDTs in a row are lost.
    TwoMdtsLost,
    /// The fibre is dark.
    FibreBroken,
    /// An MST of phase 2 comes in CP4.
    PhaseRegression,
    /// One cycle of the current loop comes too late.
    OneLateCycle,
    /// Cycle after cycle of the current loop comes too late.
    LateCycles,
    /// The brake does not open.
    BrakeStuckClosed,
    /// The brake opens 400 ms late.
    BrakeOpensLate,
    /// The brake does not close.
    BrakeStuckOpen,
    /// The brake has a tenth of its torque left: less than the load.
    BrakeWorn,
}

impl Fault {
    /// The axis is the vertical one with a brake.
    pub const fn needs_brake(self) -> bool {
        matches!(
            self,
            Self::BrakeStuckClosed
                | Self::BrakeOpensLate
                | Self::BrakeStuckOpen
                | Self::BrakeWorn
                | Self::MainPowerLostVertical
                | Self::EmergencyStopVertical
        )
    }

    /// When it is found depends on where the shaft is (the next index pulse, up to 100 ms away), or on when the noise of a standing axis makes the loops
    /// ask for current. Such a time lies within the bounds of its row, and says no more.
    #[must_use]
    pub const fn is_found_by_chance(self, state: State) -> bool {
        matches!(
            (self, state),
            (Self::EncoderSlip | Self::ConvertersStuck | Self::MotorPhaseOpen, _)
                | (Self::EncoderFrozen, State::Halted)
        )
    }

    /// Friction comes with the fault.
    const fn has_friction(self) -> bool {
        matches!(self, Self::AxisBlocked | Self::Overload | Self::MainsFailure)
    }

    /// Torque command that turns the axis in torque mode, in 0.1 % of S-0-0111; S-0-0091 holds the speed.
    pub(crate) const fn driving(self) -> i16 {
        if matches!(self, Self::Overload) { 4_000 } else { 200 }
    }

    /// What is built differently from the beginning.
    pub fn prepare(self, axis: &mut ReferenceAxis) {
        match self {
            Self::BrakeOpensLate => {
                if let Some(brake) = &mut axis.machine.brake {
                    brake.release_delay = 0.4;
                }
            }
            Self::AxisBlocked | Self::Overload => axis.machine.brake = Some(JAM),
            Self::MainsFailure => axis.machine.brake = Some(PROCESS),
            _ => {}
        }
    }

    /// What is done to the machine before anything else.
    pub fn begin(self, rig: &impl Target) {
        if self.has_friction() {
            rig.break_brake(Some(BrakeFailure::StuckReleased));
        }
        rig.machine(|machine, now| machine.set_temperatures(WARM, now));
    }

    /// Parameters without which the fault could not come.
    pub(crate) fn parameters(self) -> Vec<(Idn, Value)> {
        match self {
            Self::Overspeed => vec![(Idn(113), Value::Long(20_000_000)), (Idn(91), Value::Long(20_000_000))],
            // 360 degrees from where the drive was switched on; 600 rpm pass them in the first tenth of a second.
            Self::PositionLimit => {
                vec![
                    (Idn(49), Value::Long(20_000_000)),
                    (Idn(50), Value::Long(0xFECE_D300)),
                    (Idn(55), Value::Word(0x10)),
                ]
            }
            Self::Overload => vec![(Idn(92), Value::Word(4_000))],
            _ => Vec::new(),
        }
    }

    /// How long it is watched.
    pub(crate) const fn span(self) -> Nanoseconds {
        Nanoseconds::from_millis(match self {
            Self::Overload => 2_500,
            Self::MotorHot | Self::MotorWarm | Self::HeatSinkHot => 2_600,
            Self::BrakeOpensLate | Self::BrakeStuckClosed | Self::BrakeStuckOpen | Self::BrakeWorn => 1_200,
            _ => 500,
        })
    }

    /// From the end of the cause until it has ended for the drive, too: its temperatures are filtered with 2 s.
    pub const fn aftermath(self) -> Nanoseconds {
        Nanoseconds::from_millis(match self {
            Self::MotorHot | Self::HeatSinkHot => 1_500,
            _ => 200,
        })
    }

    /// Puts it in.
    ///
    /// # Errors
    /// The simulation could not go on to the cycle of the disturbance.
    pub fn inject(self, rig: &mut impl Target) -> Result<(), MatrixError> {
        match self {
            Self::Overcurrent => rig.machine(|machine, now| machine.fail_current_sensor(0, Some(FULL_SCALE), now)),
            Self::CurrentSum => rig.machine(|machine, now| machine.shift_current_sensor(1, 410, now)),
            Self::ConvertersStuck => rig.machine(|machine, now| {
                for phase in 0..3 {
                    machine.fail_current_sensor(phase, Some(MIDDLE), now);
                }
            }),
            Self::MotorPhaseOpen => rig.machine(|machine, now| machine.open_phase(1, true, now)),
            Self::Overvoltage => rig.machine(|machine, now| machine.set_supply(480.0, now)),
            Self::MainsFailure => rig.machine(|machine, now| {
                machine.set_supply(0.0, now);
                machine.fail_brake(None, now);
            }),
            Self::MainPowerLost | Self::MainPowerLostVertical => open_the_contactor(rig),
            Self::EmergencyStop | Self::EmergencyStopVertical => {
                open_the_contactor(rig);
                rig.take_bit_15_away();
            }
            Self::EnableBlinks => rig.hold_switches(false),
            Self::GateDriver => rig.motor_side().borrow_mut().change_inputs(|inputs| inputs.bridge_ready = false),
            Self::EncoderFrozen => {
                // Five counts behind the command, 0.2 degrees: whether the tracks freeze there or at it is chance, and at it nothing is asked of the rotor.
                let beside = if rig.mode() == Mode::Position { -5 } else { 0 };
                rig.machine(|machine, now| {
                    machine.slip_encoder(beside, now);
                    machine.freeze_encoder(true, now);
                });
            }
            Self::EncoderSlip => rig.machine(|machine, now| machine.slip_encoder(20, now)),
            Self::EncoderJump => rig.machine(|machine, now| machine.slip_encoder(5_000, now)),
            // Slip by slip, see `go_on`.
            Self::CommutationDisturbed => {}
            Self::MotorHot => rig.machine(|machine, now| machine.set_temperatures([WARM[0], 160.0], now)),
            Self::MotorWarm => rig.machine(|machine, now| machine.set_temperatures([WARM[0], 126.0], now)),
            Self::HeatSinkHot => rig.machine(|machine, now| machine.set_temperatures([110.0, WARM[1]], now)),
            Self::TemperatureSensorBroken => fail_thermometer(rig, 1, ThermometerFailure::BrokenWire),
            Self::TemperatureSensorShort => fail_thermometer(rig, 1, ThermometerFailure::ShortCircuit),
            Self::HeatSinkSensorBroken => fail_thermometer(rig, 0, ThermometerFailure::BrokenWire),
            Self::Overload | Self::AxisBlocked => rig.break_brake(None),
            Self::Overspeed => {
                // In torque mode the drive does not oppose it before S-0-0091, and has 8 Nm to stop with.
                let torque = if rig.mode() == Mode::Torque { 7.0 } else { 12.0 };
                rig.machine(|machine, now| machine.set_load_torque(torque, now));
            }
            Self::SafeTorqueOff => rig.motor_side().borrow_mut().change_inputs(|inputs| {
                inputs.safe_torque_1 = false;
                inputs.safe_torque_2 = false;
            }),
            Self::OneSafeTorqueChannel => {
                rig.motor_side().borrow_mut().change_inputs(|inputs| inputs.safe_torque_1 = false);
            }
            Self::PositionLimit => {}
            Self::RingJitter => rig.jitter(100, Nanoseconds::from_microseconds(6))?,
            Self::MstLost => rig.disturb(TelegramKind::Mst, 1, Effect::Drop)?,
            Self::MdtLost => rig.disturb(TelegramKind::Mdt, 1, Effect::Drop)?,
            Self::TwoMstsLost => rig.disturb(TelegramKind::Mst, 2, Effect::Drop)?,
            Self::TwoMdtsLost => rig.disturb(TelegramKind::Mdt, 2, Effect::Drop)?,
            Self::FibreBroken => rig.darken(100)?,
            Self::PhaseRegression => rig.disturb(TelegramKind::Mst, 1, Effect::Phase(2))?,
            Self::OneLateCycle => rig.delay_cycles(1)?,
            Self::LateCycles => rig.delay_cycles(4)?,
            Self::BrakeStuckClosed => rig.break_brake(Some(BrakeFailure::StuckEngaged)),
            // Built so from the beginning, see `prepare`.
            Self::BrakeOpensLate => {}
            Self::BrakeStuckOpen => rig.break_brake(Some(BrakeFailure::StuckReleased)),
            Self::BrakeWorn => rig.break_brake(Some(BrakeFailure::Worn(0.1))),
        }
        Ok(())
    }

    /// What goes on while the fault is watched; `step` counts cycles of the current loop.
    pub fn go_on(self, rig: &mut impl Target, step: u64) {
        match self {
            Self::EnableBlinks if step == 20 * 16 => rig.hold_switches(true),
            // A slip a millisecond: 70 counts are 10 degrees of a motor with four pole pairs.
            Self::CommutationDisturbed if step.is_multiple_of(16) && step < 20 * 16 => {
                rig.machine(|machine, now| machine.slip_encoder(70, now));
            }
            // A push, not a load that would turn the axis for ever.
            Self::Overspeed if step == 20 * 16 => rig.machine(|machine, now| machine.set_load_torque(0.0, now)),
            _ => {}
        }
    }

    /// Takes the cause away.
    pub fn repair(self, rig: &mut impl Target) {
        rig.break_brake(self.has_friction().then_some(BrakeFailure::StuckReleased));
        rig.machine(|machine, now| {
            for phase in 0..3 {
                machine.fail_current_sensor(phase, None, now);
                machine.shift_current_sensor(phase, 0, now);
            }
            machine.open_phase(1, false, now);
            for sensor in 0..2 {
                machine.fail_temperature_sensor(sensor, None, now);
            }
            machine.freeze_encoder(false, now);
            machine.set_temperatures(WARM, now);
            machine.set_load_torque(0.0, now);
            let voltage = machine.settings().supply.voltage;
            machine.set_supply(voltage, now);
        });
        rig.motor_side().borrow_mut().change_inputs(|inputs| {
            inputs.main_power = true;
            inputs.bridge_ready = true;
            inputs.safe_torque_1 = true;
            inputs.safe_torque_2 = true;
        });
    }
}

/// Of the heat sink (0) or the motor (1).
fn fail_thermometer(rig: &impl Target, sensor: usize, failure: ThermometerFailure) {
    rig.machine(|machine, now| machine.fail_temperature_sensor(sensor, Some(failure), now));
}

fn open_the_contactor(rig: &impl Target) {
    rig.motor_side().borrow_mut().change_inputs(|inputs| inputs.main_power = false);
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(match self {
            Self::Overcurrent => "current sensor at full scale",
            Self::CurrentSum => "zero of a current sensor moved by 20 % of its range",
            Self::ConvertersStuck => "current converters stuck at zero",
            Self::MotorPhaseOpen => "motor phase open",
            Self::Overvoltage => "mains at 150 %",
            Self::MainsFailure => "mains fails under 4 Nm, contactor closed",
            Self::MainPowerLost => "main power switched off",
            Self::MainPowerLostVertical => "main power switched off, vertical axis",
            Self::EmergencyStop => "main power and bit 15 off at once",
            Self::EmergencyStopVertical => "main power and bit 15 off at once, vertical axis",
            Self::EnableBlinks => "bits 15 and 14 away for 20 ms",
            Self::GateDriver => "gate driver fault",
            Self::EncoderFrozen => "encoder tracks frozen",
            Self::EncoderSlip => "encoder slips by 20 counts",
            Self::EncoderJump => "encoder jumps by 180 degrees",
            Self::CommutationDisturbed => "commutation angle drifts away within 20 ms",
            Self::MotorHot => "motor at 160 degrees C",
            Self::MotorWarm => "motor at 126 degrees C",
            Self::HeatSinkHot => "heat sink at 110 degrees C",
            Self::TemperatureSensorBroken => "wire of the motor's temperature sensor broken",
            Self::TemperatureSensorShort => "motor's temperature sensor short-circuited",
            Self::HeatSinkSensorBroken => "wire of the heat sink's temperature sensor broken",
            Self::Overload => "axis blocked at peak torque",
            Self::AxisBlocked => "axis blocked",
            Self::Overspeed => "load drives the axis beyond 125 % of S-0-0113",
            Self::SafeTorqueOff => "safe torque off, both channels",
            Self::OneSafeTorqueChannel => "safe torque off, first channel only",
            Self::PositionLimit => "axis passes S-0-0049",
            Self::RingJitter => "every second MST 6 us late",
            Self::MstLost => "one MST lost",
            Self::MdtLost => "one MDT lost",
            Self::TwoMstsLost => "two MSTs lost",
            Self::TwoMdtsLost => "two MDTs lost",
            Self::FibreBroken => "fibre dark",
            Self::PhaseRegression => "MST of phase 2 in CP4",
            Self::OneLateCycle => "one cycle of the current loop late",
            Self::LateCycles => "four cycles of the current loop late",
            Self::BrakeStuckClosed => "brake stays closed",
            Self::BrakeOpensLate => "brake opens 400 ms late",
            Self::BrakeStuckOpen => "brake stays open",
            Self::BrakeWorn => "brake worn to a tenth",
        })
    }
}
