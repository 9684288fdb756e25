//! Periodic errors and the relaxation of the temperatures in a soak.
//!
//! Declared noise is white with one time constant. A periodic error does not average out within a step: without this it would be taken for a cause or a
//! fault. Two sensors that read the same at rest are compared, so that a wandering temperature of the cell is none.

use crate::IdentifyConfig;
use mapper_core::{Channel, DeclaredUncertainty, Recording, is_reading};
use mapper_numerics::statistics::mean;
use mapper_observe::declared::usual_noise_sigma;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Sensors that are compared.
const PAIRS: [(Channel, Channel); 3] =
    [(Channel::T1, Channel::T2), (Channel::P1, Channel::P2), (Channel::Tc, Channel::T1)];
/// Length of a mean, s. Bound: periods from four seconds on act on the mean over the end of a step.
const BLOCK_S: f64 = 1.0;
/// Minimum number of means. Bound: two minutes contain four periods of 30 s.
const MIN_BLOCKS: usize = 120;
/// Fewest periods within the segment: slower changes are drift. Bound: a straight line leaves a fifth of a wave of two periods.
const FEWEST_PERIODS: usize = 4;
/// Shortest period, means. Bound: faster waves average out over the end of a step.
const SHORTEST_PERIOD_BLOCKS: usize = 4;
/// Power over that of the declared noise from which a line is real. Bound: exp(-20) for each of 500 frequencies is one in a million recordings.
const MIN_POWER_RATIO: f64 = 20.0;

/// A periodic error of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PeriodicError {
    /// The sensor.
    pub channel: Channel,
    /// Period as recorded, s.
    pub period_s: f64,
    /// Amplitude, in the channel's unit.
    pub amplitude: f64,
}

impl PeriodicError {
    /// `declared` with as much noise as gives means over `mean_s` the spread of this error: a wave that is slower than the mean does not average
    /// out.
    pub(crate) fn widen(
        &self,
        declared: DeclaredUncertainty,
        config: &IdentifyConfig,
        mean_s: f64,
    ) -> DeclaredUncertainty {
        let samples = (mean_s / mapper_core::SAMPLE_INTERVAL_S) as usize;
        let averaged = config.noise().variance_of_mean(samples, mean_s).sqrt();
        let of_wave = std::f64::consts::FRAC_1_SQRT_2 * self.amplitude / averaged;
        DeclaredUncertainty { noise_sigma: declared.noise_sigma.hypot(of_wave), ..declared }
    }
}

/// The periodic errors between `start_s` and `end_s` of a soak, at most one for each pair of sensors.
pub(crate) fn find(recording: &Recording, config: &IdentifyConfig, span_s: (f64, f64)) -> Vec<PeriodicError> {
    let mut found: Vec<PeriodicError> = Vec::new();
    for (first, second) in PAIRS {
        let Some(error) = find_in_pair(recording, config, span_s, first, second) else { continue };
        if found.iter().all(|other| other.channel != error.channel) {
            found.push(error);
        }
    }
    found
}

fn find_in_pair(
    recording: &Recording,
    config: &IdentifyConfig,
    span_s: (f64, f64),
    first: Channel,
    second: Channel,
) -> Option<PeriodicError> {
    let (a, b) = (blocks(recording, first, span_s)?, blocks(recording, second, span_s)?);
    let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
    let count = difference.len();
    if count < MIN_BLOCKS {
        return None;
    }
    let [difference, a, b] = [difference, a, b].map(|values| without_line(&values));
    let noise = |channel: Channel, frequency_hz: f64| expected_power(config, channel, frequency_hz);
    let ratio = |index: usize| {
        let frequency_hz = index as f64 / (count as f64 * BLOCK_S);
        power(&difference, frequency_hz) / (noise(first, frequency_hz) + noise(second, frequency_hz))
    };
    let ratios = (FEWEST_PERIODS..count / SHORTEST_PERIOD_BLOCKS).map(|index| (index, ratio(index)));
    let (index, _) =
        ratios.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, ratio)| *ratio > MIN_POWER_RATIO)?;
    let frequency_hz = index as f64 / (count as f64 * BLOCK_S);
    let [of_a, of_b] = [&a, &b].map(|values| power(values, frequency_hz));
    Some(PeriodicError {
        channel: if of_a > of_b { first } else { second },
        period_s: frequency_hz.recip(),
        amplitude: 2.0 * (power(&difference, frequency_hz) / count as f64).sqrt(),
    })
}

/// Means of a channel over successive seconds; `None` if one is missing.
fn blocks(recording: &Recording, channel: Channel, (start_s, end_s): (f64, f64)) -> Option<Vec<f64>> {
    let series = recording.series.get(&channel)?;
    let count = ((end_s - start_s) / BLOCK_S) as usize;
    let block = |index: usize| {
        let from_s = start_s + index as f64 * BLOCK_S;
        let values = series.slice(from_s, from_s + BLOCK_S).1;
        mean(values.iter().copied().filter(|value| is_reading(channel, *value)))
    };
    (0..count).map(block).collect()
}

/// Values minus their straight line.
fn without_line(values: &[f64]) -> Vec<f64> {
    let middle = 0.5 * (values.len() as f64 - 1.0);
    let centre = values.iter().sum::<f64>() / values.len() as f64;
    let places = || (0..values.len()).map(|i| i as f64 - middle);
    let square: f64 = places().map(|x| x * x).sum();
    let slope = places().zip(values).map(|(x, y)| x * (y - centre)).sum::<f64>() / square;
    places().zip(values).map(|(x, y)| y - centre - slope * x).collect()
}

/// Power of a frequency: the mean square of white noise has this power at every frequency.
fn power(values: &[f64], frequency_hz: f64) -> f64 {
    let angle = TAU * frequency_hz * BLOCK_S;
    let (cos, sin) = values.iter().enumerate().fold((0.0, 0.0), |(cos, sin), (i, value)| {
        let phase = angle * i as f64;
        (cos + value * phase.cos(), sin + value * phase.sin())
    });
    (cos * cos + sin * sin) / values.len() as f64
}

/// Power of the declared noise of a channel, white and first order.
fn expected_power(config: &IdentifyConfig, channel: Channel, frequency_hz: f64) -> f64 {
    let declared = config.sensor(channel).noise_sigma;
    let sigma = if declared > 0.0 { declared } else { usual_noise_sigma(channel) };
    let colour = config.noise_colour;
    let first_order = colour.first_order_share_ratio.powi(2);
    let turn = TAU * frequency_hz * colour.time_constant_s;
    let white = (1.0 - first_order) * mapper_core::SAMPLE_INTERVAL_S / BLOCK_S;
    sigma * sigma * (white + first_order * 2.0 * colour.time_constant_s / BLOCK_S / (1.0 + turn * turn))
}

/// Time constants of stopped turbocharger housings, s. Bound: 1 to 2 kg of aluminium at 1 to 2 W/K. Longer ones, which the readings
/// cannot exclude, would bias the limit.
const TIME_CONSTANTS_S: [f64; 5] = [400.0, 550.0, 700.0, 900.0, 1200.0];
/// Prior standard deviation of the initial distance from the limit, K. Bound: ten times the non-uniformity of a finished soak.
const START_SIGMA_K: f64 = 3.0;

/// Distance of a typical housing from its limit after `t_s` of soak, K: a kelvin at the beginning, with the middle time constant. A housing
/// that settled long ago determines no time constant and needs none; the limit of this one is the least certain.
pub(crate) fn usual_k(t_s: f64) -> f64 {
    (-t_s / TIME_CONSTANTS_S[TIME_CONSTANTS_S.len() / 2]).exp()
}

/// The limit of `values` (at `t_s`, each with the standard error `sigma`) under `limit + start exp(-t/tau)`, and its standard error. Limit and
/// start are found by least squares for each time constant, and averaged with the posterior weights of the time constants. `None` for fewer
/// than six values.
pub(crate) fn limit(t_s: &[f64], values: &[f64], sigma: f64) -> Option<(f64, f64)> {
    let first_s = *t_s.first()?;
    if values.len() < 6 || values.len() != t_s.len() || sigma.is_nan() || sigma <= 0.0 {
        return None;
    }
    // Relative to the first value, so that sums of squares keep their digits.
    let origin = *values.first()?;
    let weight = sigma.powi(-2);
    let fits: Vec<(f64, f64, f64)> = TIME_CONSTANTS_S
        .iter()
        .map(|tau_s| {
            let (mut n, mut e1, mut e2, mut y1, mut ey) = (0.0, 0.0, START_SIGMA_K.powi(-2), 0.0, 0.0);
            let mut y2 = 0.0;
            for (t, value) in t_s.iter().zip(values) {
                let (e, y) = ((-(t - first_s) / tau_s).exp(), value - origin);
                n += weight;
                e1 += weight * e;
                e2 += weight * e * e;
                y1 += weight * y;
                ey += weight * e * y;
                y2 += weight * y * y;
            }
            let determinant = n * e2 - e1 * e1;
            let (limit, start) = ((e2 * y1 - e1 * ey) / determinant, (n * ey - e1 * y1) / determinant);
            let square = y2 - limit * y1 - start * ey;
            (limit, e2 / determinant, -0.5 * (square + determinant.ln()))
        })
        .collect();
    let best = fits.iter().map(|(.., log)| *log).fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = fits.iter().map(|(.., log)| (log - best).exp()).sum();
    let share = |log: f64| (log - best).exp() / total;
    let mean: f64 = fits.iter().map(|(limit, _, log)| share(*log) * limit).sum();
    let variance: f64 =
        fits.iter().map(|(limit, own, log)| share(*log) * (own + (limit - mean).powi(2))).sum();
    (mean.is_finite() && variance.is_finite()).then_some((origin + mean, variance.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::Series;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    /// 300 s of T1 and T2 at rest: declared noise of 0.1 K, white and first order, a cell that wanders by 1 K, and a wave on T2.
    fn at_rest(amplitude_k: f64, seed: u64) -> (Recording, IdentifyConfig) {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let t_s: Vec<f64> = (0..3000).map(|i| 0.1 * f64::from(i)).collect();
        let memory = (-0.1f64 / 2.0).exp();
        let mut noisy = |wave_k: f64| {
            let mut slow = 0.06 * normal();
            let value = |t: &f64| {
                let kick = 0.06 * (1.0 - memory * memory).sqrt();
                let read = 298.0 + 0.5 * (t / 200.0).sin() + wave_k * (TAU * t / 33.0).sin();
                let read = read + 0.08 * normal() + slow;
                slow = memory * slow + kick * normal();
                read
            };
            let values: Vec<f64> = t_s.iter().map(value).collect();
            Series { t_s: t_s.clone(), values }
        };
        let series = [(Channel::T1, noisy(0.0)), (Channel::T2, noisy(amplitude_k))].into();
        let declared =
            DeclaredUncertainty { noise_sigma: 0.1, offset_sigma: 0.25, ..DeclaredUncertainty::default() };
        let config = IdentifyConfig {
            declared: [(Channel::T1, declared), (Channel::T2, declared)].into(),
            ..IdentifyConfig::default()
        };
        (Recording { series, ..Recording::default() }, config)
    }

    #[test]
    fn a_wave_on_one_of_two_sensors_is_found_and_noise_is_none() {
        for seed in 0..40 {
            let (quiet, config) = at_rest(0.0, seed);
            assert_eq!(find(&quiet, &config, (0.0, 299.0)), [], "seed {seed}");
        }
        for seed in 0..10 {
            let (disturbed, config) = at_rest(0.15, 100 + seed);
            let found = find(&disturbed, &config, (0.0, 299.0));
            let [error] = found.as_slice() else { panic!("seed {seed}: {found:?}") };
            assert_eq!(error.channel, Channel::T2);
            // Frequencies are 1/300 s apart.
            assert!((29.0..38.0).contains(&error.period_s), "{error:?}");
            assert!((0.1..0.2).contains(&error.amplitude), "{error:?}");
            let declared = error.widen(config.declared[&Channel::T2], &config, 2.0);
            let of_mean = declared.noise_sigma * config.noise().variance_of_mean(20, 2.0).sqrt();
            // The mean over 2 s of a wave of 0.15 K and 33 s has a standard deviation of 0.106 K, and that of the noise 0.05 K.
            assert!((0.08..0.16).contains(&of_mean), "{of_mean}");
        }
    }
}

#[cfg(test)]
mod relaxation_tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    /// 0.5 K above the cell at the beginning, 0.09 K at the end: the mean of the last half would be wrong by 0.14 K.
    #[test]
    fn the_limit_is_found_and_its_error_is_that_of_many_draws() {
        let t_s: Vec<f64> = (0..40).map(|i| 30.0 * f64::from(i)).collect();
        let mut random = Pcg64::seed_from_u64(1);
        let (mut squares, mut claimed) = (0.0, 0.0);
        for _ in 0..200 {
            let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
            let values: Vec<f64> =
                t_s.iter().map(|t| 298.15 + 0.5 * (-t / 680.0).exp() + 0.03 * noise()).collect();
            let (found, sigma) = limit(&t_s, &values, 0.03).unwrap();
            squares += (found - 298.15).powi(2) / 200.0;
            claimed += sigma * sigma / 200.0;
        }
        // Half the error of the mean; such data determine the time constant to a factor of two.
        assert!(squares.sqrt() < 0.07, "{} K rms", squares.sqrt());
        // 200 draws determine their standard deviation to 5 %; the weights of five time constants are only an approximate posterior.
        let ratio = (squares / claimed).sqrt();
        assert!((0.75..1.25).contains(&ratio), "errors are {ratio} of what is claimed");
    }

    /// The forecast standard error of a typical housing equals that of random draws: after half an hour it is four times that after an hour.
    #[test]
    fn the_error_of_a_usual_housing_is_that_of_readings_without_noise() {
        let mut random = Pcg64::seed_from_u64(2);
        let sigma_k = 0.03;
        let mut forecasts = Vec::new();
        for soak_s in [1800.0, 3600.0] {
            let blocks = (2.0 / 3.0 * soak_s / 30.0) as usize;
            let t_s: Vec<f64> = (0..blocks).map(|i| soak_s / 3.0 + 30.0 * (i as f64 + 0.5)).collect();
            let still: Vec<f64> = t_s.iter().map(|t_s| usual_k(*t_s)).collect();
            let (_, forecast) = limit(&t_s, &still, sigma_k).unwrap();
            let claimed = (0..100).map(|_| {
                let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
                let values: Vec<f64> = still.iter().map(|value| value + sigma_k * noise()).collect();
                limit(&t_s, &values, sigma_k).unwrap().1
            });
            let claimed = claimed.sum::<f64>() / 100.0;
            // Each draw gives the time constants different weights.
            assert!((0.8..1.25).contains(&(claimed / forecast)), "{soak_s} s: {claimed} K of {forecast} K");
            forecasts.push(forecast);
        }
        assert!((3.0..6.0).contains(&(forecasts[0] / forecasts[1])), "{forecasts:?}");
    }

    #[test]
    fn a_reading_that_rests_is_its_own_limit() {
        let t_s: Vec<f64> = (0..40).map(|i| 30.0 * f64::from(i)).collect();
        let (found, sigma) = limit(&t_s, &[301.5; 40], 0.01).unwrap();
        assert!((found - 301.5).abs() < 1e-9 && sigma < 0.02, "{found} +/- {sigma} K");
        assert_eq!(limit(&t_s[..5], &[301.5; 5], 0.01), None);
    }
}
