//! Currents of the data blocks are RMS values of a phase, as name plates and data sheets give them; the loops reckon with amplitudes.
//!
//! Where only a ratio of two currents counts (limits, thermal models, gains), it is the same of both and nothing is converted.

use sercos::Idn;
use sercos::parameters::Parameters;

/// sqrt(2) and sqrt(1/2), in 10^-9.
const AMPLITUDE_OF_RMS: u64 = 1_414_213_562;
const RMS_OF_AMPLITUDE: u64 = 707_106_781;
const ONE: u64 = 1_000_000_000;

/// The amplitude of a sine with this RMS value, in the same unit, rounded to the nearest. Divides.
pub(crate) fn amplitude(rms: u32) -> u32 {
    scaled(rms, AMPLITUDE_OF_RMS)
}

/// The RMS value of a sine with this amplitude, in the same unit, rounded to the nearest. Divides.
pub(crate) fn rms(amplitude: u32) -> u32 {
    scaled(amplitude, RMS_OF_AMPLITUDE)
}

fn scaled(value: u32, factor: u64) -> u32 {
    let product = u64::from(value).saturating_mul(factor).saturating_add(ONE / 2);
    u32::try_from(product / ONE).unwrap_or(u32::MAX)
}

/// P-0-0114 per ampere of amplitude, in uNm/A. Divides.
pub(crate) fn torque_constant(parameters: &Parameters) -> u32 {
    rms(parameters.get(Idn::product(114)))
}

/// The flux linkage of the magnets with a phase, peak value, in uVs: torque = 1.5 * pole pairs * flux linkage * amplitude of the current. Divides.
pub(crate) fn flux_linkage(parameters: &Parameters) -> u32 {
    let pole_pairs = u64::from(parameters.get_word(Idn::product(110)));
    let twice = u64::from(torque_constant(parameters)).saturating_mul(2);
    let divisor = pole_pairs.saturating_mul(3).max(1);
    let linkage = twice.saturating_add(divisor / 2).checked_div(divisor);
    linkage.and_then(|linkage| u32::try_from(linkage).ok()).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_amplitude_is_the_square_root_of_two_times_its_rms_value_and_back() {
        for value in [0_u32, 1, 5_000, 20_000, 500_000, 4_000_000, u32::MAX / 2] {
            let expected = f64::from(value) * core::f64::consts::SQRT_2;
            assert!((f64::from(amplitude(value)) - expected).abs() <= 0.5 + expected * 1e-9, "{value}");
            assert!(rms(amplitude(value)).abs_diff(value) <= 1, "{value}");
        }
        assert_eq!(amplitude(u32::MAX), u32::MAX, "cut, not wrapped");
    }

    #[test]
    fn the_torque_of_the_name_plate_is_that_of_the_flux() {
        let mut parameters = crate::service::rig::parameters();
        // A press motor: 3 Nm per ampere RMS, 4 pole pairs. At 10 A the machine makes 1.5 * 4 * flux * 14.142 A.
        parameters.set(Idn::product(114), 3_000_000).unwrap();
        parameters.set(Idn::product(110), 4).unwrap();
        let torque = 1.5 * 4.0 * f64::from(flux_linkage(&parameters)) * 1e-6 * 10.0 * core::f64::consts::SQRT_2;
        assert!((torque - 30.0).abs() < 1e-3, "{torque} Nm");
        assert!((f64::from(torque_constant(&parameters)) * core::f64::consts::SQRT_2 - 3e6).abs() < 2.0);
    }
}
