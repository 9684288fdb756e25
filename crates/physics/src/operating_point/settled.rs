//! The definition of a settled operating point that plan, sequence and identification share.
//!
//! **Definition.** A quantity has settled at a time if, from that time to the end of the evaluated segment,
//! its maximum minus its minimum, minus the spread caused by its noise, is at most its band
//! ([`SettleBands`]) times the mean. An operating point has settled when shaft speed, compressor flow and pressure ratio
//! all have. Values of a model have no noise; recorded ones are condensed to medians over blocks first.
//!
//! Housing and outlet temperature do not count: at a settled operating point they still change, which the identification needs. Bands: Burke et al., section 3.

use mapper_core::SettleBands;
use mapper_numerics::statistics::robust_sigma;

/// Blocks over which recorded signals are condensed (to their median) before they are compared, s.
pub const BLOCK_S: f64 = 1.0;
/// Spread (maximum minus minimum) of about a hundred normally distributed values, standard deviations.
const NOISE_SPREAD_SIGMAS: f64 = 5.0;
/// Distance of the blocks whose second difference measures noise: longer than the correlation of noise.
const NOISE_LAG_BLOCKS: usize = 4;

/// Number of values, from the last one backwards, whose spread minus `noise_spread` (in the unit of the values, >= 0) is at most
/// `allowed_ratio` of their mean. NaN counts as settled; a series of only NaN never settles.
pub fn settled_count(
    backwards: impl IntoIterator<Item = f64>,
    allowed_ratio: f64,
    noise_spread: f64,
) -> usize {
    let (mut low, mut high, mut sum, mut valid) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    let mut count = 0;
    for value in backwards {
        if !value.is_nan() {
            (low, high, sum, valid) = (low.min(value), high.max(value), sum + value, valid + 1.0);
            if high - low - noise_spread > allowed_ratio * (sum / valid).abs() {
                return count;
            }
        }
        count += 1;
    }
    if valid > 0.0 { count } else { 0 }
}

/// Signals of an operating point by their names in messages, each with its band, for values counted backwards.
pub fn with_bands<T>(
    speed: T,
    flow: T,
    pressure_ratio: T,
    bands: &SettleBands,
) -> [(&'static str, T, f64); 3] {
    [
        ("speed", speed, bands.speed_ratio),
        ("flow", flow, bands.flow_ratio),
        ("pressure ratio", pressure_ratio, bands.pressure_ratio_ratio),
    ]
}

/// Spread caused by the noise of recorded `blocks` (medians, in order), from the median of their second differences, which ignores real
/// changes of the signal. 0 if there are too few blocks.
pub fn noise_spread(blocks: &[f64]) -> f64 {
    let lag = NOISE_LAG_BLOCKS;
    let differences = (2 * lag..blocks.len())
        .map(|i| blocks[i] - 2.0 * blocks[i - lag] + blocks[i - 2 * lag])
        .filter(|difference| difference.is_finite());
    // The second difference has six times the variance of a value.
    let sigma = robust_sigma(differences).map_or(0.0, |sigma| sigma / 6f64.sqrt());
    NOISE_SPREAD_SIGMAS * sigma
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_where_a_signal_varies_within_its_band() {
        // Range over mean of the last n values, by hand: 0, 0.01, 0.01, 0.0297.
        let backwards = [100.0, 101.0, 101.0, 103.0];
        for (allowed_ratio, noise, count) in
            [(0.0, 0.0, 1), (0.01, 0.0, 3), (0.029, 0.0, 3), (0.03, 0.0, 4), (0.01, 2.0, 4)]
        {
            assert_eq!(settled_count(backwards, allowed_ratio, noise), count, "{allowed_ratio} {noise}");
        }
        assert_eq!(settled_count([f64::NAN; 3], 0.01, 0.0), 0, "nothing known never settles");
        assert_eq!(settled_count([100.0, f64::NAN, 100.0], 0.01, 0.0), 3, "a gap is not a variation");
    }

    #[test]
    fn a_ramp_has_no_noise() {
        let ramp: Vec<f64> = (0..50).map(|i| 3.0 * f64::from(i)).collect();
        assert!(noise_spread(&ramp) < 1e-9, "second differences of a line vanish");
        assert_eq!(noise_spread(&[1.0; 8]), 0.0, "too few to judge");
    }
}
