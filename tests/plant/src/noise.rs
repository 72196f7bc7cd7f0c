//! Noise that belongs to an instant: asked twice, it is the same.

/// Channels of a machine draw from different noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Noise {
    /// Different seeds give unrelated noise.
    pub(crate) seed: u64,
}

impl Noise {
    /// A value of standard deviation 1 and mean 0 for a channel's sample at an instant: the sum of four even distributions, within 3.47.
    pub(crate) fn at(self, channel: u64, instant: u64) -> f64 {
        let bits = scramble(scramble(scramble(self.seed).wrapping_add(channel)).wrapping_add(instant));
        let sum: u64 = (0..4).map(|part| (bits >> (16 * part)) & 0xFFFF).sum();
        // A part is even over 0 ..= 65535: mean 32767.5, standard deviation 65536 / sqrt(12); four of them have twice that.
        const SQRT_3: f64 = 1.732_050_807_568_877_2;
        (sum as f64 - 131_070.0) / 65_536.0 * SQRT_3
    }
}

/// One step of the generator xorshift64* (Vigna 2016), from a state that is never zero.
fn scramble(state: u64) -> u64 {
    let mut x = state.wrapping_add(0x9E37_79B9_7F4A_7C15).max(1);
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    x.wrapping_mul(0x2545_F491_4F6C_DD1D)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(values: &[f64]) -> (f64, f64) {
        let number = values.len() as f64;
        let mean = values.iter().sum::<f64>() / number;
        (mean, (values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / number).sqrt())
    }

    #[test]
    fn the_noise_has_mean_zero_and_deviation_one() {
        let values: Vec<f64> = (0..100_000).map(|n| Noise { seed: 1 }.at(0, n * 62_500)).collect();
        let (mean, deviation) = moments(&values);
        assert!(mean.abs() < 0.01, "{mean}");
        assert!((deviation - 1.0).abs() < 0.01, "{deviation}");
        let next = values.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / values.len() as f64;
        assert!(next.abs() < 0.01, "correlated with the next sample by {next}");
    }

    #[test]
    fn channels_and_seeds_are_unrelated_and_an_instant_repeats() {
        let product = |a: Noise, channel_a: u64, b: Noise, channel_b: u64| {
            (0..100_000).map(|n| a.at(channel_a, n * 62_500) * b.at(channel_b, n * 62_500)).sum::<f64>() / 100_000.0
        };
        let (one, two) = (Noise { seed: 1 }, Noise { seed: 2 });
        assert!((product(one, 0, one, 0) - 1.0).abs() < 0.01);
        assert!(product(one, 0, one, 1).abs() < 0.01);
        assert!(product(one, 0, two, 0).abs() < 0.01);
        assert!(product(one, 1, two, 0).abs() < 0.01);
    }
}
