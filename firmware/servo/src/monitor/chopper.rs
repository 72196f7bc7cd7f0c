//! The brake chopper: between which voltages of the DC link it switches, and how hot its resistor is.
//!
//! The current loop compares every sample of the DC link with the two levels, whether the bridge switches or not: mains that are too high, or a
//! motor that is driven, charge the link without a bridge too. The supervision counts for how many cycles the resistor was on and works out
//! its load from U²/R: a first-order model with the resistor's continuous power as 100 %. What the model starts with is a cold resistor.

use crate::arithmetic::gain::Gain;
use crate::current::settings::PwmFrequency;
use crate::error::{SettingsError, in_range};
use crate::units::LOOP_TICKS_PER_SUPERVISION;

/// Parameters of the chopper and its resistor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChopperParameters {
    /// Voltage of a sample of 4096 in V, 50 ..= 4000.
    pub full_scale: u16,
    /// Overvoltage threshold in V, of which the levels are parts.
    pub overvoltage: u16,
    /// Resistance in mOhm; 0: there is no chopper.
    pub resistance: u32,
    /// Power that the resistor carries for ever in W, 1 ..= 1 000 000.
    pub continuous_power: u32,
    /// Thermal time constant of the resistor in ms, 100 ..= 3 600 000. Continuous power times time constant is the energy of a short pulse.
    pub time_constant: u32,
    /// How often the current loop looks.
    pub frequency: PwmFrequency,
}

/// The chopper goes on above this part of the overvoltage threshold, and off below the other, in 0.1 %.
const ON: u32 = 950;
const OFF: u32 = 920;

/// Load from which it warns, above which it is switched off, and below which it may work again, in 0.1 %.
const WARNING: i64 = 900;
const TOO_HOT: i64 = 1_000;
const COOL: i64 = 800;

/// 100 % load is 2^30.
const FULL_LOAD_BITS: u32 = 30;
/// The state has 16 bits more, so that a time constant of an hour still counts every tick.
const FINE_BITS: u32 = 16;
/// 256 times the full load.
const LARGEST_LOAD: i64 = 1 << (30 + 8 + FINE_BITS);

/// Two levels of the bus voltage in counts, as one word: a reader of higher priority sees both or neither.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChopperLevels(u32);

impl ChopperLevels {
    /// No sample of 12 bits is above these.
    pub const NEVER: Self = Self(u32::MAX);

    /// On above the one, off at or below the other.
    const fn new(on: u16, off: u16) -> Self {
        Self((on as u32) << 16 | off as u32)
    }

    /// As a word, for another priority.
    #[inline]
    #[must_use]
    pub const fn to_word(self) -> u32 {
        self.0
    }

    /// From [`ChopperLevels::to_word`].
    #[inline]
    #[must_use]
    pub const fn from_word(word: u32) -> Self {
        Self(word)
    }

    /// A chopper that is off goes on with this sample.
    #[inline]
    #[must_use]
    pub const fn switches_on(self, sample: u32) -> bool {
        sample > self.0 >> 16
    }

    /// A chopper that is on stays on with this sample.
    #[inline]
    #[must_use]
    pub const fn stays_on(self, sample: u32) -> bool {
        sample > self.0 & 0xFFFF
    }
}

/// The chopper, scaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChopperSettings {
    levels: ChopperLevels,
    /// Squared sample times cycles of a supervision to load (2^-30); zero without a chopper.
    heating: Gain,
    /// Difference to the final load (2^-30) to the change in a tick (2^-46).
    share: Gain,
}

impl ChopperSettings {
    /// Scales the parameters. Divides.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] for a parameter beyond its range.
    pub fn new(parameters: &ChopperParameters) -> Result<Self, SettingsError> {
        let full_scale = in_range("bus voltage at full scale", parameters.full_scale.into(), 50, 4_000)?;
        let overvoltage = in_range("overvoltage threshold", parameters.overvoltage.into(), 1, full_scale)?;
        let power = in_range("continuous power of the chopper resistor", parameters.continuous_power, 1, 1_000_000)?;
        let time = in_range("time constant of the chopper resistor", parameters.time_constant, 100, 3_600_000)?;
        let ticks = crate::monitor::debounce::ticks_of(time);
        let share = Gain::from_ratio(1 << FINE_BITS, ticks.into()).unwrap_or(Gain::ZERO);
        if parameters.resistance == 0 {
            return Ok(Self { levels: ChopperLevels::NEVER, heating: Gain::ZERO, share });
        }
        let level = |share: u32| part_of(overvoltage, share, full_scale);
        let cycles = u32::from(parameters.frequency.cycles_per_tick()).saturating_mul(LOOP_TICKS_PER_SUPERVISION);
        let squared = u128::from(full_scale).saturating_mul(full_scale.into());
        // mOhm: 1 000.
        let numerator = squared.saturating_mul(1_000) << FULL_LOAD_BITS;
        let for_a_milliohm = u128::from(power).saturating_mul(cycles.into()).saturating_mul(1 << 24);
        // A factor stays below 2^24: 2 million times the continuous power is no resistor.
        let least = numerator.checked_div(for_a_milliohm).unwrap_or(0) >> 24;
        let least = u32::try_from(least.saturating_add(1)).unwrap_or(u32::MAX);
        let resistance = in_range("resistance of the chopper in mOhm", parameters.resistance, least, u32::MAX)?;
        let heating =
            Gain::from_ratio(numerator, for_a_milliohm.saturating_mul(resistance.into())).unwrap_or(Gain::ZERO);
        Ok(Self { levels: ChopperLevels::new(level(ON), level(OFF)), heating, share })
    }

    /// There is one.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        self.levels != ChopperLevels::NEVER
    }
}

/// So many 0.1 % of a voltage in counts of the converter, rounded down.
pub(super) fn part_of(voltage: u32, share: u32, full_scale: u32) -> u16 {
    let product = u64::from(voltage).saturating_mul(share.into()).saturating_mul(4_096);
    let counts = product.checked_div(u64::from(full_scale).saturating_mul(1_000)).unwrap_or(0);
    u16::try_from(counts).unwrap_or(u16::MAX).min(4_095)
}

/// What a tick says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChopperOutput {
    /// For the current loop.
    pub levels: ChopperLevels,
    /// Load of the resistor in 0.1 % of its continuous power, rounded down, at most 6553.5 %.
    pub load: u16,
    /// The load has reached 90 %.
    pub warning: bool,
    /// The resistor was too hot and is switched off until it has cooled down to 80 %.
    pub too_hot: bool,
    /// There is a chopper, and it is to be reckoned with.
    pub works: bool,
    /// It is too hot and goes off within 5 ms; until then nothing more may feed the link.
    pub hands_over: bool,
}

/// Load of the resistor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Chopper {
    /// In 2^-46.
    load: i64,
    too_hot: bool,
    /// Ticks until a resistor that is too hot goes off.
    notice: u8,
    /// Cycles with the resistor on, as last seen.
    cycles: u32,
}

impl Chopper {
    /// A cold resistor.
    #[must_use]
    pub const fn new() -> Self {
        Self { load: 0, too_hot: false, notice: 0, cycles: 0 }
    }

    /// One tick of the supervision. `cycles`: of the current loop with the resistor on, since the start, wrapping; `sample` of the bus voltage.
    #[inline]
    pub fn tick(&mut self, settings: &ChopperSettings, cycles: u32, sample: u16) -> ChopperOutput {
        let on = cycles.wrapping_sub(core::mem::replace(&mut self.cycles, cycles)).min(MOST_CYCLES);
        let sample = u32::from(sample);
        // 24 bits and some cycles.
        let heat = settings.heating.apply(i64::from(sample.wrapping_mul(sample).wrapping_mul(on)));
        let difference = heat.wrapping_sub(self.load >> FINE_BITS);
        self.load = self.load.wrapping_add(settings.share.apply(difference)).clamp(0, LARGEST_LOAD);
        // At most 256 000.
        let load = (self.load >> FINE_BITS).wrapping_mul(1_000) >> FULL_LOAD_BITS;
        self.too_hot = settings.is_fitted() && load >= if self.too_hot { COOL } else { TOO_HOT };
        let works = settings.is_fitted() && !self.too_hot;
        self.notice = if works { NOTICE } else { self.notice.saturating_sub(1) };
        ChopperOutput {
            hands_over: !works && self.notice > 0,
            levels: if works || self.notice > 0 { settings.levels } else { ChopperLevels::NEVER },
            load: load.min(i64::from(u16::MAX)) as u16,
            warning: settings.is_fitted() && load >= WARNING,
            too_hot: self.too_hot,
            works,
        }
    }
}

/// A current at the limit of the voltage takes two milliseconds to fall, in which a small link without its resistor would be full.
const NOTICE: u8 = 10;

/// A supervision that was held up has seen this many cycles at most: two ticks of it at 16 kHz.
const MOST_CYCLES: u32 = 16;

#[cfg(test)]
mod tests {
    use super::*;

    /// 47 Ohm, 100 W, 10 s at 440 V of 500 V.
    const PARAMETERS: ChopperParameters = ChopperParameters {
        full_scale: 500,
        overvoltage: 440,
        resistance: 47_000,
        continuous_power: 100,
        time_constant: 10_000,
        frequency: PwmFrequency::Khz16,
    };

    fn sample(volts: f64) -> u16 {
        (volts * 4_096.0 / 500.0) as u16
    }

    /// Ticks of 0.5 ms with the resistor on for `on` of 8 cycles until the output says so.
    fn ticks_until(
        chopper: &mut Chopper,
        settings: &ChopperSettings,
        (on, volts): (u32, f64),
        reached: impl Fn(&ChopperOutput) -> bool,
    ) -> f64 {
        for tick in 1..1_000_000_u32 {
            let output = chopper.tick(settings, chopper.cycles.wrapping_add(on), sample(volts));
            if reached(&output) {
                return f64::from(tick);
            }
        }
        panic!("never reached");
    }

    #[test]
    fn it_goes_on_above_95_percent_and_off_below_92_percent_of_the_threshold() {
        let levels = ChopperSettings::new(&PARAMETERS).unwrap().levels;
        for (volts, on, stays) in
            [(404.5, false, false), (405.2, false, true), (417.8, false, true), (418.3, true, true)]
        {
            assert_eq!(
                (levels.switches_on(sample(volts).into()), levels.stays_on(sample(volts).into())),
                (on, stays),
                "{volts} V"
            );
        }
        for count in [0, 4_095] {
            assert!(!ChopperLevels::NEVER.switches_on(count) && !ChopperLevels::NEVER.stays_on(count));
        }
    }

    #[test]
    fn the_load_follows_the_power_of_the_resistor() {
        let settings = ChopperSettings::new(&PARAMETERS).unwrap();
        // 410 V in 47 Ohm are 3 577 W. All of the time, half of it, an eighth of it.
        for on in [8, 4, 1] {
            let ratio = 410.0 * 410.0 / 47.0 / 100.0 * f64::from(on) / 8.0;
            for level in [500_u16, 900, 1_000] {
                // t = T ln(r / (r - level))
                let expected = 20_000.0 * (ratio / (ratio - f64::from(level) / 1_000.0)).ln();
                let ticks = ticks_until(&mut Chopper::new(), &settings, (on, 410.0), |output| output.load >= level);
                assert!((ticks / expected - 1.0).abs() < 0.005, "{ticks} ticks, expected {expected}");
            }
        }
    }

    #[test]
    fn at_its_continuous_power_a_resistor_settles_at_full_load() {
        // Half of the time at 400 V: 1 702 W.
        let settings = ChopperSettings::new(&ChopperParameters { continuous_power: 1_710, ..PARAMETERS }).unwrap();
        let mut chopper = Chopper::new();
        for _ in 0..200_000 {
            chopper.tick(&settings, chopper.cycles.wrapping_add(4), sample(400.0));
        }
        let output = chopper.tick(&settings, chopper.cycles.wrapping_add(4), sample(400.0));
        assert!((990..=998).contains(&output.load) && output.warning && !output.too_hot, "{output:?}");
    }

    #[test]
    fn it_warns_at_90_is_switched_off_at_100_and_works_again_below_80_percent() {
        let settings = ChopperSettings::new(&PARAMETERS).unwrap();
        let mut chopper = Chopper::new();
        ticks_until(&mut chopper, &settings, (8, 410.0), |output| output.warning);
        let warned = chopper.tick(&settings, chopper.cycles, 0);
        assert!((895..=902).contains(&warned.load) && warned.works && !warned.too_hot, "{warned:?}");
        ticks_until(&mut chopper, &settings, (8, 410.0), |output| output.too_hot);
        let warned_of = chopper.tick(&settings, chopper.cycles, sample(430.0));
        assert!(!warned_of.works && warned_of.levels == settings.levels, "it goes on while the current falls");
        let hot = (0..10).map(|_| chopper.tick(&settings, chopper.cycles, sample(430.0))).last().unwrap();
        assert!((990..=1_001).contains(&hot.load) && !hot.works && hot.levels == ChopperLevels::NEVER, "{hot:?}");
        // 10 s * ln(1 / 0.8) of cooling.
        let ticks = ticks_until(&mut chopper, &settings, (0, 430.0), |output| output.works);
        assert!((ticks / (20_000.0 * 1.25_f64.ln()) - 1.0).abs() < 0.01, "{ticks}");
        assert_eq!(chopper.tick(&settings, chopper.cycles, 0).levels, settings.levels);
    }

    #[test]
    fn without_a_resistor_there_is_nothing_to_switch_and_nothing_to_tell() {
        let settings = ChopperSettings::new(&ChopperParameters { resistance: 0, ..PARAMETERS }).unwrap();
        let output = Chopper::new().tick(&settings, 8, 4_095);
        let expected = ChopperOutput {
            levels: ChopperLevels::NEVER,
            load: 0,
            warning: false,
            too_hot: false,
            works: false,
            hands_over: false,
        };
        assert_eq!(output, expected);
    }

    #[test]
    fn impossible_settings_are_refused() {
        let refused = |parameters| matches!(ChopperSettings::new(&parameters), Err(SettingsError::OutOfRange { .. }));
        assert!(refused(ChopperParameters { overvoltage: 501, ..PARAMETERS }));
        assert!(refused(ChopperParameters { continuous_power: 0, ..PARAMETERS }));
        assert!(refused(ChopperParameters { time_constant: 99, ..PARAMETERS }));
        assert!(refused(ChopperParameters { resistance: 1, full_scale: 4_000, continuous_power: 1, ..PARAMETERS }));
        assert!(!refused(ChopperParameters {
            resistance: 8_000,
            full_scale: 4_000,
            continuous_power: 1,
            ..PARAMETERS
        }));
    }
}
