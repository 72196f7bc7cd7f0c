//! Axes that tests and the demonstration are built on.
//!
//! No public source gives the motor data of a press drive; the values are those of ordinary catalogue motors of the class,
//! chosen by us, and the derived figures are written beside them.

use crate::{
    Chopper, Coupling, CurrentSensors, Effects, Encoder, HeatedBody, HoldingBrake, Inverter, Load, Machine,
    MachineSettings, Mechanics, Motor, MotorSettings, Saturation, Supply, Thermal, Thermometer, Windings,
};

/// A complete axis: the plant, its amplifier, and parameters that suit it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceAxis {
    /// Name for reports.
    pub name: &'static str,
    /// Motor, load and encoder behind a current-controlled amplifier.
    pub motor: MotorSettings,
    /// The same axis with all of its power stage and sensors.
    pub machine: MachineSettings,
    /// Largest current of the amplifier in mA, amplitude; gives `motor.peak_torque`.
    pub peak_current: u32,
    /// Motor continuous current at standstill in mA, amplitude.
    pub standstill_current: u32,
    /// Maximum speed S-0-0113 in rpm.
    pub maximum_speed: u32,
    /// Travel in micrometres per motor revolution, for an axis that moves in a line.
    pub feed_constant: Option<u32>,
    /// Loop parameters that suit the axis.
    pub gains: SuggestedGains,
}

/// Loop parameters in the units of their IDNs (sercos2.md 4.2 and appendix A).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SuggestedGains {
    /// Velocity loop proportional gain, in 0.1 A s/rad, amplitude.
    pub velocity_gain: u16,
    /// S-0-0101 velocity loop integral action time, in 0.1 ms.
    pub integral_time: u16,
    /// S-0-0104 position loop Kv-factor, in 0.01 * 1000/min.
    pub position_gain: u16,
    /// S-0-0392 velocity feedback filter, in microseconds.
    pub velocity_filter: u16,
    /// S-0-0138 bipolar acceleration limit, in 0.001 rad/s².
    pub acceleration_limit: u32,
}

impl ReferenceAxis {
    /// Each of them.
    pub const ALL: [fn() -> Self; 5] = [Self::press, Self::small_cnc, Self::precise, Self::vertical, Self::catalogue];

    /// A printing unit of a shaftless newspaper press: a servo motor of the 10 kW class on a cylinder train.
    ///
    /// * Torque constant 2 Nm/A, 60 A peak: 120 Nm. Rotor 0.03 kg m² and cylinders 0.12 kg m² at the motor (ratio 4): 800 rad/s² at peak.
    /// * Friction 6 Nm + 0.05 Nm s/rad (the ink train): 9 Nm at 600 rpm.
    /// * Encoder 65 536 increments (2 048 sine periods, interpolated): 0.0055 degree.
    /// * Gains: velocity loop crossing at 250 rad/s: Kp = 250 * 0.15 / 2 = 18.8 A s/rad; Tn = 4 / 250 = 16 ms; Kv = 250 / 4 = 62.5 1/s =
    ///   3.75 * 1000/min.
    /// * Windings: 4 pole pairs, so flux 2 / (1.5 * 4) = 0.333 Vs. 50 Nm at standstill (25 A) leave 1.5 * 0.35 * 25² = 330 W in 0.35 ohm,
    ///   3 % of 10 kW. 3.8 mH give 11 ms with it, and 32 V across them at 25 A and 800 rpm. Amplitude of the EMF 1.333 V s/rad: the bus
    ///   of 560 V gives a phase 323 V and carries it to 242 rad/s = 2 310 rpm without weakening the field; the maximum speed is the
    ///   mechanics'.
    /// * Heat: the 330 W warm the windings by 80 K with 0.24 K/W, in 20 minutes with 5 kJ/K.
    #[must_use]
    pub fn press() -> Self {
        let mechanics = Mechanics {
            rotor_inertia: 0.15,
            coulomb_friction: 6.0,
            viscous_friction: 0.05,
            load: None,
            gravity_torque: 0.0,
        };
        let encoder = Encoder {
            increments_per_revolution: 65_536,
            initial_count: 0,
            index_at: 0.250_007,
            electrical_zero: 0.083,
        };
        Self {
            name: "press printing unit",
            motor: motor(&mechanics, &encoder, 120.0, 200e-6),
            machine: MachineSettings {
                windings: Windings {
                    pole_pairs: 4,
                    resistance: 0.35,
                    inductance_d: 3.5e-3,
                    inductance_q: 3.8e-3,
                    flux: 2.0 / (1.5 * 4.0),
                    // A tenth of the inductance is gone at the peak current.
                    saturation: Some(Saturation { current: 120.0 }),
                },
                inverter: INVERTER,
                supply: Supply {
                    voltage: 560.0,
                    resistance: 0.2,
                    capacitance: 1.0e-3,
                    // 21 kW at 680 V.
                    chopper: Some(Chopper { on_above: 680.0, off_below: 660.0, resistance: 22.0 }),
                    resistor: None,
                },
                current_sensors: current_sensors(60.0),
                bus_range: 1_000.0,
                encoder,
                mechanics,
                brake: None,
                thermal: Thermal {
                    winding: HeatedBody { capacity: 5_000.0, resistance: 0.24 },
                    heat_sink: HeatedBody { capacity: 2_000.0, resistance: 0.25 },
                    ambient: AMBIENT,
                },
                thermometers: Thermometer::USUAL,
                effects: Effects::NONE,
                seed: 1,
            },
            peak_current: 60_000,
            standstill_current: 25_000,
            maximum_speed: 3_000,
            feed_constant: None,
            gains: SuggestedGains {
                velocity_gain: 188,
                integral_time: 160,
                position_gain: 375,
                velocity_filter: 500,
                acceleration_limit: 400_000,
            },
        }
    }

    /// A feed axis of a small machine tool: a 400 W class motor on a ball screw.
    ///
    /// * Torque constant 0.48 Nm/A, 8 A peak: 3.84 Nm. Rotor 0.00003 kg m², screw and table 0.00007 kg m² at the motor: 38 400 rad/s² at
    ///   peak.
    /// * Friction 0.15 Nm + 0.0002 Nm s/rad.
    /// * Encoder 10 000 increments (2 500 lines): 0.036 degree.
    /// * Gains: steps of 0.1 A s/rad; 0.1 gives a crossing at 0.1 * 0.48 / 0.0001 = 480 rad/s; Tn = 8.3 ms; Kv = 120 1/s =
    ///   7.20 * 1000/min.
    /// * Windings: 4 pole pairs, so flux 0.48 / (1.5 * 4) = 0.08 Vs. 1.3 Nm at standstill (2.7 A) leave 1.5 * 2.4 * 2.7² = 26 W in 2.4
    ///   ohm. 6.5 mH give 2.7 ms with it. EMF 0.32 V s/rad: 168 V at 5 000 rpm, of the 185 V that a bus of 320 V gives a phase.
    /// * Heat: the 26 W warm the windings by 80 K with 3 K/W, in 10 minutes with 200 J/K.
    #[must_use]
    pub fn small_cnc() -> Self {
        let mechanics = Mechanics {
            rotor_inertia: 0.000_1,
            coulomb_friction: 0.15,
            viscous_friction: 0.000_2,
            load: None,
            gravity_torque: 0.0,
        };
        let encoder =
            Encoder { increments_per_revolution: 10_000, initial_count: 0, index_at: 0.400_05, electrical_zero: 0.031 };
        Self {
            name: "small CNC feed axis",
            motor: motor(&mechanics, &encoder, 3.84, 100e-6),
            machine: MachineSettings {
                windings: Windings {
                    pole_pairs: 4,
                    resistance: 2.4,
                    inductance_d: 6.5e-3,
                    inductance_q: 6.5e-3,
                    flux: 0.48 / (1.5 * 4.0),
                    saturation: Some(Saturation { current: 16.0 }),
                },
                inverter: INVERTER,
                supply: SINGLE_PHASE,
                current_sensors: current_sensors(8.0),
                bus_range: 500.0,
                encoder,
                mechanics,
                brake: None,
                thermal: Thermal {
                    winding: HeatedBody { capacity: 200.0, resistance: 3.0 },
                    heat_sink: HeatedBody { capacity: 300.0, resistance: 1.5 },
                    ambient: AMBIENT,
                },
                thermometers: Thermometer::USUAL,
                effects: Effects::NONE,
                seed: 2,
            },
            peak_current: 8_000,
            standstill_current: 2_700,
            maximum_speed: 5_000,
            feed_constant: None,
            gains: SuggestedGains {
                velocity_gain: 1,
                integral_time: 83,
                position_gain: 720,
                velocity_filter: 500,
                acceleration_limit: 5_000_000,
            },
        }
    }

    /// A stiff axis of a precision machine, with which accuracy is measured: a 1 kW class motor coupled to a rotary table.
    ///
    /// * Torque constant 1.2 Nm/A, 20 A peak: 24 Nm. Rotor 0.0008 kg m², table 0.0016 kg m²: 10 000 rad/s² at peak.
    /// * Shaft 100 000 Nm/rad: the motor swings against the table at sqrt(100 000 * (1 / 0.0008 + 1 / 0.0016)) = 13 700 rad/s = 2 180 Hz,
    ///   with a damping ratio of 0.5 * 1.5 * 1 875 / 13 700 = 0.10.
    /// * Friction 0.08 Nm + 0.0005 Nm s/rad: rolling bearings without seals.
    /// * Encoder 1 048 576 increments (2 048 sine periods, interpolated): 1.2 seconds of arc.
    /// * Gains: velocity loop crossing at 1 200 rad/s: Kp = 1 200 * 0.0024 / 1.2 = 2.4 A s/rad; Tn = 4 / 1 200 = 3.3 ms; Kv = 1 200 / 4 =
    ///   300 1/s = 18.00 * 1000/min. The small times are the filter's 0.1 ms, 0.14 ms of a current loop of 2.2 kHz and 0.19 ms of the
    ///   ticks: 1 200 * 0.00043 = 30 degrees. The resonance raises the open loop 15-fold to 1.3; current loop and filter leave 0.5 of it.
    /// * Windings: 5 pole pairs, so flux 1.2 / (1.5 * 5) = 0.16 Vs. 6 Nm at standstill (5 A) leave 1.5 * 1 * 5² = 38 W in 1 ohm. 5 mH
    ///   give 5 ms with it. EMF 0.8 V s/rad: 168 V at 2 000 rpm, of the 185 V that a bus of 320 V gives a phase. 1 kW are 4.8 Nm at 2 000
    ///   rpm.
    /// * Heat: the 38 W warm the windings by 76 K with 2 K/W, in 20 minutes with 600 J/K.
    #[must_use]
    pub fn precise() -> Self {
        let mechanics = Mechanics {
            rotor_inertia: 0.000_8,
            coulomb_friction: 0.08,
            viscous_friction: 0.000_5,
            load: Some(Load { inertia: 0.001_6, stiffness: 100_000.0, damping: 1.5, backlash: 0.0 }),
            gravity_torque: 0.0,
        };
        let encoder =
            Encoder { increments_per_revolution: 1 << 20, initial_count: 0, index_at: 0.6, electrical_zero: 0.047 };
        Self {
            name: "precise rotary axis",
            motor: motor(&mechanics, &encoder, 24.0, 100e-6),
            machine: MachineSettings {
                windings: Windings {
                    pole_pairs: 5,
                    resistance: 1.0,
                    inductance_d: 5.0e-3,
                    inductance_q: 5.0e-3,
                    flux: 1.2 / (1.5 * 5.0),
                    saturation: Some(Saturation { current: 40.0 }),
                },
                inverter: INVERTER,
                supply: SINGLE_PHASE,
                current_sensors: current_sensors(20.0),
                bus_range: 500.0,
                encoder,
                mechanics,
                brake: None,
                thermal: Thermal {
                    winding: HeatedBody { capacity: 600.0, resistance: 2.0 },
                    heat_sink: HeatedBody { capacity: 600.0, resistance: 1.0 },
                    ambient: AMBIENT,
                },
                thermometers: Thermometer::USUAL,
                effects: Effects::NONE,
                seed: 3,
            },
            peak_current: 20_000,
            standstill_current: 5_000,
            maximum_speed: 2_000,
            feed_constant: None,
            gains: SuggestedGains {
                velocity_gain: 24,
                integral_time: 33,
                position_gain: 1_800,
                velocity_filter: 100,
                acceleration_limit: 5_000_000,
            },
        }
    }

    /// A vertical ball screw axis with a holding brake: a 750 W class motor that falls when nothing holds it.
    ///
    /// * Torque constant 1 Nm/A, 15 A peak: 15 Nm; 5 Nm at standstill.
    /// * Gravity pulls down, against counting direction, with 30 % of that: 1.5 Nm, at 10 mm per revolution 1.5 * 2 pi / 0.01 = 942 N or
    ///   96 kg.
    /// * Rotor with brake 0.0005 kg m². The 96 kg are 96 * (0.01 / 2 pi)² = 0.00024 kg m² and the screw has 0.00026: 0.0005 kg m². 15 000
    ///   rad/s² at peak.
    /// * Screw 8 000 Nm/rad: the motor swings against it at sqrt(8 000 * 2 / 0.0005) = 5 660 rad/s = 900 Hz, damping ratio 0.07.
    /// * Friction 0.25 Nm + 0.001 Nm s/rad (preloaded nut): less than gravity, the axis falls by itself.
    /// * Brake 9 Nm, six times gravity; releases in 40 ms, engages in 25 ms.
    /// * Encoder 131 072 increments: 0.08 um.
    /// * Gains: velocity loop crossing at 300 rad/s: Kp = 300 * 0.001 / 1 = 0.3 A s/rad; Tn = 4 / 300 = 13.3 ms; Kv = 300 / 4 = 75 1/s =
    ///   4.50 * 1000/min.
    /// * Windings: 5 pole pairs, so flux 1 / (1.5 * 5) = 0.133 Vs. 5 A leave 1.5 * 1.1 * 5² = 41 W in 1.1 ohm. 4.4 mH give 4 ms with it.
    ///   EMF 0.667 V s/rad: 175 V at 2 500 rpm, of the 185 V that a bus of 320 V gives a phase.
    ///
    /// [`Self::motor`] knows neither gravity nor brake.
    #[must_use]
    pub fn vertical() -> Self {
        let mechanics = Mechanics {
            rotor_inertia: 0.000_5,
            coulomb_friction: 0.25,
            viscous_friction: 0.001,
            load: Some(Load { inertia: 0.000_5, stiffness: 8_000.0, damping: 0.2, backlash: 0.0 }),
            gravity_torque: -1.5,
        };
        let encoder =
            Encoder { increments_per_revolution: 131_072, initial_count: 0, index_at: 0.7, electrical_zero: 0.112 };
        Self {
            name: "vertical ball screw axis",
            motor: motor(&mechanics, &encoder, 15.0, 100e-6),
            machine: MachineSettings {
                windings: Windings {
                    pole_pairs: 5,
                    resistance: 1.1,
                    inductance_d: 4.4e-3,
                    inductance_q: 4.4e-3,
                    flux: 1.0 / (1.5 * 5.0),
                    saturation: Some(Saturation { current: 30.0 }),
                },
                inverter: INVERTER,
                supply: SINGLE_PHASE,
                current_sensors: current_sensors(15.0),
                bus_range: 500.0,
                encoder,
                mechanics,
                brake: Some(HoldingBrake { holding_torque: 9.0, release_delay: 0.040, engage_delay: 0.025 }),
                thermal: Thermal {
                    winding: HeatedBody { capacity: 500.0, resistance: 2.0 },
                    heat_sink: HeatedBody { capacity: 600.0, resistance: 1.0 },
                    ambient: AMBIENT,
                },
                thermometers: Thermometer::USUAL,
                effects: Effects::NONE,
                seed: 4,
            },
            peak_current: 15_000,
            standstill_current: 5_000,
            maximum_speed: 2_500,
            feed_constant: Some(10_000),
            gains: SuggestedGains {
                velocity_gain: 3,
                integral_time: 133,
                position_gain: 450,
                velocity_filter: 500,
                acceleration_limit: 5_000_000,
            },
        }
    }

    /// The axis that the defaults of the drive's parameters describe: a catalogue motor of 750 W on a belt.
    ///
    /// * Torque constant 0.8 Nm/A, 20 A peak: 16 Nm. 0.0004 kg m²: 40 000 rad/s² at peak.
    /// * Windings: 4 pole pairs, so flux 0.8 / (1.5 * 4) = 0.133 Vs. 4 Nm at standstill (5 A) leave 1.5 * 1.2 * 5² = 45 W in 1.2 ohm.
    ///   320 V carry the EMF of 0.533 V s/rad to 346 rad/s = 3 300 rpm.
    /// * Encoder 10 000 increments (2 500 lines).
    /// * Gains: 0.1 A s/rad crosses at 0.1 * 0.8 / 0.0004 = 200 rad/s; Tn 10 ms; Kv 16.7 1/s = 1.00 * 1000/min: the defaults.
    #[must_use]
    pub fn catalogue() -> Self {
        let mechanics = Mechanics {
            rotor_inertia: 0.000_4,
            coulomb_friction: 0.1,
            viscous_friction: 0.000_5,
            load: None,
            gravity_torque: 0.0,
        };
        let encoder =
            Encoder { increments_per_revolution: 10_000, initial_count: 0, index_at: 0.300_05, electrical_zero: 0.019 };
        Self {
            name: "catalogue motor on a belt",
            motor: motor(&mechanics, &encoder, 16.0, 100e-6),
            machine: MachineSettings {
                windings: Windings {
                    pole_pairs: 4,
                    resistance: 1.2,
                    inductance_d: 6.0e-3,
                    inductance_q: 6.0e-3,
                    flux: 0.8 / (1.5 * 4.0),
                    saturation: Some(Saturation { current: 40.0 }),
                },
                inverter: INVERTER,
                supply: SINGLE_PHASE,
                current_sensors: current_sensors(20.0),
                bus_range: 500.0,
                encoder,
                mechanics,
                brake: None,
                thermal: Thermal {
                    winding: HeatedBody { capacity: 500.0, resistance: 1.8 },
                    heat_sink: HeatedBody { capacity: 600.0, resistance: 1.0 },
                    ambient: AMBIENT,
                },
                thermometers: Thermometer::USUAL,
                effects: Effects::NONE,
                seed: 5,
            },
            peak_current: 20_000,
            standstill_current: 5_000,
            maximum_speed: 6_000,
            feed_constant: None,
            gains: SuggestedGains {
                velocity_gain: 1,
                integral_time: 100,
                position_gain: 100,
                velocity_filter: 500,
                acceleration_limit: 1_000_000,
            },
        }
    }

    /// Whether the magnets alone make more than so many volts between two phases, peak value, at the maximum speed.
    #[must_use]
    pub fn induces_more_than(&self, volts: f64) -> bool {
        let windings = &self.machine.windings;
        let speed = f64::from(self.maximum_speed) * core::f64::consts::TAU / 60.0;
        f64::sqrt(3.0) * windings.flux * f64::from(windings.pole_pairs) * speed > volts
    }

    /// The same axis without anything that burns what it feeds back.
    #[must_use]
    pub fn without_chopper(mut self) -> Self {
        self.machine.supply.chopper = None;
        self
    }

    /// The same axis with a resistor of so many ohms in the hands of the drive.
    #[must_use]
    pub fn with_resistor(self, ohms: f64) -> Self {
        let mut axis = self.without_chopper();
        axis.machine.supply.resistor = Some(ohms);
        axis
    }

    /// A motor of this axis at rest.
    #[must_use]
    pub fn motor(&self) -> Motor {
        Motor::new(self.motor)
    }

    /// A machine of this axis at rest.
    #[must_use]
    pub fn machine(&self) -> Machine {
        Machine::new(self.machine)
    }
}

/// Degrees Celsius in a control cabinet.
const AMBIENT: f64 = 25.0;

/// IGBT module of the usual kind, switched with 16 kHz: of 560 V the dead time takes 9 V.
const INVERTER: Inverter = Inverter { dead_time: 1.0e-6, period: 62.5e-6, voltage_drop: 1.5 };

/// 230 V mains, rectified.
const SINGLE_PHASE: Supply = Supply {
    voltage: 320.0,
    resistance: 0.4,
    capacitance: 1.0e-3,
    // 3.2 kW at 390 V.
    chopper: Some(Chopper { on_above: 390.0, off_below: 380.0, resistance: 47.0 }),
    resistor: None,
};

/// Shunts with amplifiers of 1 % parts after a trim: they reach a quarter beyond the peak current.
fn current_sensors(peak_current: f64) -> CurrentSensors {
    CurrentSensors {
        range: 1.25 * peak_current,
        offset: [3.2, -4.6, 1.7],
        gain_error: [0.005, -0.003, -0.005],
        noise: 1.0,
    }
}

/// The axis with a current-controlled amplifier.
fn motor(mechanics: &Mechanics, encoder: &Encoder, peak_torque: f64, current_time_constant: f64) -> MotorSettings {
    MotorSettings {
        peak_torque,
        inertia: mechanics.rotor_inertia,
        coulomb_friction: mechanics.coulomb_friction,
        viscous_friction: mechanics.viscous_friction,
        current_time_constant,
        increments_per_revolution: encoder.increments_per_revolution,
        initial_count: encoder.initial_count,
        coupling: mechanics.load.map(|load| Coupling {
            load_inertia: load.inertia,
            stiffness: load.stiffness,
            damping: load.damping,
        }),
    }
}
