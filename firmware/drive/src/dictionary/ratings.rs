//! What the amplifier is built for. Its production record tells it, or the board; no control and no backup of another drive can change it.

use sercos::parameters::Parameters;
use servo::motor::Facts;

use crate::amplifier::Amplifier;

sercos::data_blocks! {
    /// A rating of the amplifier.
    pub enum Rating in RATINGS: Parameter [];

    /// Largest current of the bridge, RMS of a phase. A motor that bears less has S-0-0109.
    S 110 "Amplifier peak current" ["A"] U32/3 written NEVER () = 0 => PeakCurrent;
    /// Current that the bridge carries for ever, RMS of a phase; from it and S-0-0110 the amplifier's thermal model is made.
    S 112 "Amplifier rated current" ["A"] U32/3 written NEVER () = 0 => ContinuousCurrent;
    /// Heat sink temperature from which C2D bit 1 warns.
    S 200 "Amplifier warning temperature" ["C"] U16/1 written NEVER () = 0 => WarningTemperature;
    /// Heat sink temperature at which the drive shuts down (C1D bit 1).
    S 203 "Amplifier shut-down temperature" ["C"] U16/1 written NEVER () = 0 => ShutdownTemperature;
    /// Phase current at full deflection of the current sensors, an instantaneous value: 1 to 8 times the amplitude of S-0-0110, which is 1.414 times it.
    P 100 "Measuring range of the phase currents" ["A"] U32/3 written NEVER () = 0 => CurrentRange;
    /// Bus voltage at the end of the converter's range.
    P 101 "Measuring range of the bus voltage" ["V"] U16/0 written NEVER () = 0 => BusRange;
    /// Time for which both transistors of a phase are off at a change, set in the bridge's timer.
    P 102 "Dead time of the bridge" ["ns"] U16/0 written NEVER () = 0 => DeadTime;
    /// Phase current, an instantaneous value, up to which the dead time is compensated in proportion, 0.2 % of the amplitude of S-0-0110 at least; 0: no compensation.
    P 103 "Band of the dead-time compensation" ["A"] U16/3 written NEVER () = 0 => DeadTimeBand;
    /// Bus voltage below which the torque goes (C1D bit 9). An eighth above it main power is there; below a sixteenth above it, it is gone, and an axis in operation is stopped out of the rest.
    P 104 "Undervoltage threshold" ["V"] U16/0 written NEVER () = 0 => Undervoltage;
    /// Bus voltage above which the bridge is switched off (C1D bit 8).
    P 105 "Overvoltage threshold" ["V"] U16/0 written NEVER () = 0 => Overvoltage;
    /// Phase current at which the current loop switches the bridge off (C1D bit 7) at the latest, at the crest of a sine with this RMS value; before that at 168 % of the smaller of S-0-0109 and S-0-0110, which is 125 % of it with the largest P-0-0107 across.
    P 106 "Trip level of the phase currents" ["A"] U32/3 written NEVER () = 0 => TripCurrent;
    /// Of the bridge.
    P 131 "Thermal time constant of the amplifier" ["s"] U32/3 written NEVER () = 0 => ThermalTimeConstant;
    /// Smallest resistor that the switch of the brake chopper bears; 0: there is no switch, and P-0-0235 is 0.
    P 234 "Least resistance of the brake chopper" ["Ohm"] U16/1 written NEVER () = 0 => LeastResistance;
    /// Bus voltage that DC link and bridge bear while the bridge is off. S-0-0128 refuses a motor that field weakening drives to a speed S-0-0113 at which its magnets make more: field weakening ends with every error.
    P 239 "Withstand voltage of the DC link" ["V"] U16/0 written NEVER () = 0 => WithstandVoltage;
}

impl Amplifier {
    /// Puts the ratings where the loops and the service channel look for them.
    pub fn show(&self, facts: &Facts, parameters: &mut Parameters) {
        for (block, rating) in RATINGS {
            // A rating has no range that it could miss.
            let _ = parameters.set(block.idn, self.value(*rating, facts).into());
        }
    }

    fn value(&self, rating: Rating, facts: &Facts) -> u32 {
        match rating {
            Rating::PeakCurrent => self.peak_current,
            Rating::ContinuousCurrent => self.continuous_current,
            Rating::WarningTemperature => self.warning_temperature.into(),
            Rating::ShutdownTemperature => self.shutdown_temperature.into(),
            Rating::CurrentRange => self.current_range,
            Rating::BusRange => self.bus_range.into(),
            Rating::DeadTime => facts.dead_time,
            Rating::DeadTimeBand => self.dead_time_band.into(),
            Rating::Undervoltage => self.undervoltage.into(),
            Rating::Overvoltage => self.overvoltage.into(),
            Rating::TripCurrent => self.trip_current,
            Rating::ThermalTimeConstant => self.thermal_time_constant,
            Rating::LeastResistance => self.least_resistance.into(),
            Rating::WithstandVoltage => self.withstand_voltage.into(),
        }
    }
}
