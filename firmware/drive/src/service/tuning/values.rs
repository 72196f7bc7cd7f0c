//! What P-0-0240 makes of the parameters, and parameters of what it has found.

use sercos::Idn;
use sercos::parameters::Parameters;
use servo::SettingsError;
use servo::axis::{FilterSection, ShapingRequest, VelocityRate};
use servo::units::LOOP_TICKS_PER_SECOND;
use servo::units::{CurrentFraction, Position, Velocity};

use crate::service::commissioning::Finding;
use crate::settings::current::{amplitude as amplitude_of, torque_constant};

const S: fn(u16) -> Idn = Idn::standard;
const P: fn(u16) -> Idn = Idn::product;

/// What is known of the axis, and what is wanted of its velocity loop.
pub(crate) fn shaping_request(parameters: &Parameters, rate: VelocityRate) -> ShapingRequest {
    let sections = sections(parameters);
    ShapingRequest {
        phase_margin: parameters.get_word(P(241)),
        gain_margin: parameters.get_word(P(242)),
        gain: parameters.get(S(100)),
        integral_time: parameters.get_word(S(101)),
        rate,
        differences: if parameters.get(S(392)) == 0 { rate.hertz() } else { LOOP_TICKS_PER_SECOND },
        increments: parameters.get(S(116)).saturating_mul(4),
        peak_current: parameters.get(S(109)).min(parameters.get(S(110))),
        exchanged: exchanged(&sections),
        has_room: place_of_notch(&sections).is_some(),
    }
}

/// The filters of the current command with this low-pass, where it is the drive's to choose, and with this notch, where there is room: P-0-0170 to
/// P-0-0173 and P-0-0174 to P-0-0177. What is not set stays.
pub(super) fn filters(parameters: &Parameters, low_pass: FilterSection, notch: FilterSection) -> [[(Idn, u32); 4]; 2] {
    let [mut first, mut second] = sections(parameters);
    let place = place_of_notch(&[first, second]).filter(|_| notch != FilterSection::Off);
    if exchanged(&[first, second]).is_some() {
        second = low_pass;
    }
    match place {
        Some(0) => first = notch,
        Some(_) => second = notch,
        None => {}
    }
    [(first, 170), (second, 174)].map(|(section, number)| numbers(parameters, section, number))
}

/// The four parameters of a section, from its first one on.
fn numbers(parameters: &Parameters, section: FilterSection, first: u16) -> [(Idn, u32); 4] {
    let [kind, frequency, width, depth] = [0, 1, 2, 3].map(|offset| P(first.saturating_add(offset)));
    let kept = |idn: Idn| (idn, parameters.get(idn));
    match section {
        FilterSection::Off => [(kind, 0), kept(frequency), kept(width), kept(depth)],
        FilterSection::LowPass { frequency: hertz, damping } => {
            [(kind, 1), (frequency, hertz.into()), (width, damping.into()), kept(depth)]
        }
        FilterSection::Notch { frequency: hertz, width: band, depth: left } => {
            [(kind, 2), (frequency, hertz.into()), (width, band.into()), (depth, left.into())]
        }
    }
}

/// Both filters of the current command.
fn sections(parameters: &Parameters) -> [FilterSection; 2] {
    [170, 174].map(|first: u16| {
        let [kind, frequency, width, depth] =
            [0, 1, 2, 3].map(|offset| parameters.get_word(P(first.saturating_add(offset))));
        match kind {
            1 => FilterSection::LowPass { frequency, damping: width },
            2 => FilterSection::Notch { frequency, width, depth },
            _ => FilterSection::Off,
        }
    })
}

/// The second one, where it is the drive's to choose: a notch is somebody's answer to a resonance, and one low-pass is enough.
fn exchanged(&[first, second]: &[FilterSection; 2]) -> Option<FilterSection> {
    let keeps = matches!(second, FilterSection::Notch { .. }) || matches!(first, FilterSection::LowPass { .. });
    (!keeps).then_some(second)
}

/// Where a notch has room.
fn place_of_notch(sections: &[FilterSection; 2]) -> Option<usize> {
    match sections {
        [FilterSection::Off, _] => Some(0),
        [_, FilterSection::Off] if exchanged(sections).is_none() => Some(1),
        _ => None,
    }
}

/// Amplitude of an excitation at a frequency in 0.01 Hz of an axis that turns at this velocity, with the gain S-0-0100 in its loop: it swings the axis by
/// a third of the velocity, or takes 15 % of the peak current where that is less, when the loop has taken its part; at most 30 %, and no more than a third of
/// the voltage `longest`, 2^-14 V, drives through the winding. Divides.
pub(super) fn amplitude(
    parameters: &Parameters,
    inertia: u32,
    gain: u32,
    frequency: u32,
    velocity: Velocity,
    longest: i32,
) -> CurrentFraction {
    const LARGEST: u64 = 4_915;
    // At the peak current, in 10^-3 rad/s^2: uNm/A times mA over 10^-7 kg m^2.
    let peak = u64::from(amplitude_of(parameters.get(S(110))));
    let torque = u64::from(torque_constant(parameters)).saturating_mul(peak).saturating_mul(10);
    let acceleration = torque.checked_div(inertia.into()).unwrap_or(0).max(1);
    // 2 pi f v / 3 in 10^-3 rad/s^2, of 0.01 Hz and 0.0001 rpm.
    let speed = u64::from(velocity.to_ten_thousandths_rpm().unsigned_abs());
    let swing = u64::from(frequency).saturating_mul(speed).saturating_mul(2_193) / 10_000_000;
    let left = (swing << 15).checked_div(acceleration).unwrap_or(LARGEST).clamp(1, LARGEST);
    // Gain times acceleration over peak current is the crossing in 10^-3 rad/s; 0.01 Hz are 62.8 of them.
    let per_peak = u64::from(parameters.get(S(110))).saturating_mul(63);
    let crossing = u64::from(gain).saturating_mul(acceleration).checked_div(per_peak).unwrap_or(0);
    let raised = left.saturating_mul(crossing.max(frequency.into())).checked_div(frequency.into()).unwrap_or(left);
    // V / (3 2 pi f L) in mA, of mV, 0.01 Hz and uH.
    let millivolts = u64::try_from(longest).unwrap_or(0).saturating_mul(1_000) >> 14;
    let reactance = u64::from(frequency).saturating_mul(parameters.get(P(113)).into());
    let driven = millivolts.saturating_mul(5_305_165).checked_div(reactance).unwrap_or(u64::MAX);
    let driven = (driven.min(u32::MAX.into()) << 15).checked_div(peak).unwrap_or(LARGEST);
    CurrentFraction::from_bits(raised.min(2 * LARGEST).min(driven).max(1) as i16)
}

/// Way of P-0-0226 in 0.01 revolutions: v^2 / a + 1.02 s v. Divides.
pub(super) fn way_of_inertia(parameters: &Parameters) -> u64 {
    let speed = u128::from(parameters.get_signed(P(218)).unsigned_abs());
    let acceleration = u128::from(parameters.get(P(219))).max(1);
    // 0.0001 rpm are 1 / 600 000 revolutions in a second, and 0.001 rad/s^2 1 / 2 000 pi of them.
    let ramps =
        speed.saturating_mul(speed).saturating_mul(17_453).checked_div(acceleration.saturating_mul(10_000_000_000));
    let ramps = ramps.unwrap_or(u128::MAX);
    let steady = speed.saturating_mul(102) / 600_000;
    u64::try_from(ramps.saturating_add(steady)).unwrap_or(u64::MAX)
}

/// A way in 0.01 revolutions fits into the room that there is.
pub(super) fn fits(way: u64, room: Position) -> Result<(), Finding> {
    let maximum = u32::try_from(room.to_bits().saturating_mul(100) >> 32).unwrap_or(0);
    let actual = u32::try_from(way).unwrap_or(u32::MAX);
    if actual > maximum {
        let parameter = "way of P-0-0240 in 0.01 revolutions";
        return Err(SettingsError::OutOfRange { parameter, actual, minimum: 0, maximum }.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    /// 2 Nm/A and 60 A of amplitude.
    fn press() -> Parameters {
        let mut parameters = crate::service::rig::parameters();
        for (idn, value) in [(P(113), 3_800), (P(114), 2_828_427), (S(110), 42_426), (S(100), 13_329)] {
            parameters.set(idn, value).unwrap();
        }
        parameters
    }

    #[test]
    fn an_excitation_swings_the_axis_by_a_third_of_its_velocity_or_takes_15_per_cent() {
        let parameters = press();
        let velocity = Velocity::from_ten_thousandths_rpm(750_000);
        let of = |hertz: f64, gain: u32| {
            amplitude(&parameters, 1_500_000, gain, (hertz * 100.0) as u32, velocity, 323 << 14).to_num::<f64>()
        };
        // 800 rad/s^2 at peak; 75 rpm are 7.85 rad/s.
        let share = |hertz: f64| TAU * hertz * 7.85 / 3.0 / 800.0;
        for hertz in [2.0, 5.0, 7.0] {
            assert!((of(hertz, 1) / share(hertz) - 1.0).abs() < 0.02, "{hertz} Hz: {}", of(hertz, 1));
        }
        assert!((of(500.0, 1) - 0.15).abs() < 1e-3);
        // 108 V over 42 Ohm.
        assert!((of(1_770.0, 1) / (323.0 / 3.0 / (TAU * 1_770.0 * 3.8e-3) / 60.0) - 1.0).abs() < 0.01);
        // 13.329 A s/rad of RMS cross at 40 Hz: at 20 Hz the loop takes half.
        assert!((of(20.0, 13_329) - 0.3).abs() < 1e-3 && (of(30.0, 13_329) / 0.2 - 1.0).abs() < 0.02);
    }

    #[test]
    fn the_way_is_that_of_p_0_0226_and_one_that_does_not_fit_is_told_of() {
        let mut parameters = press();
        parameters.set(P(218), 3_000_000).unwrap();
        parameters.set(P(219), 100_000).unwrap();
        // 5 rev/s: 25 / 15.9 + 5.1.
        assert!((665..=670).contains(&way_of_inertia(&parameters)), "{}", way_of_inertia(&parameters));
        assert_eq!(fits(500, Position::from_bits(5 << 32)), Ok(()));
        assert!(matches!(fits(501, Position::from_bits(5 << 32)), Err(Finding::Settings(_))));
    }

    #[test]
    fn a_filter_that_is_somebody_s_own_stays_and_a_notch_takes_what_is_free() {
        let low_pass = FilterSection::LowPass { frequency: 2_000, damping: 707 };
        let notch = FilterSection::Notch { frequency: 9_000, width: 4_500, depth: 1_000 };
        let with = |kinds: [u64; 2], low_pass, notch| {
            let mut parameters = press();
            for (first, kind) in [170, 174].into_iter().zip(kinds) {
                for (offset, value) in [(0, kind), (1, 3_000), (2, 1_500), (3, 100)] {
                    parameters.set(P(first + offset), value).unwrap();
                }
            }
            filters(&parameters, low_pass, notch).map(|section| section.map(|(_, value)| value))
        };
        let (found, band) = ([1, 2_000, 707, 100], [2, 9_000, 4_500, 1_000]);
        let own = |kind| [kind, 3_000, 1_500, 100];
        assert_eq!(with([0, 0], low_pass, notch), [band, found]);
        assert_eq!(with([0, 0], FilterSection::Off, FilterSection::Off), [own(0), own(0)]);
        assert_eq!(with([0, 1], FilterSection::Off, notch), [band, own(0)], "the low-pass is chosen anew");
        assert_eq!(with([2, 1], low_pass, notch), [own(2), found], "a notch is kept");
        assert_eq!(with([1, 0], low_pass, notch), [own(1), band], "one low-pass is enough");
        assert_eq!(with([1, 2], low_pass, notch), [own(1), own(2)]);
        assert_eq!(with([0, 2], low_pass, notch), [band, own(2)]);
    }
}
