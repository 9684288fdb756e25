//! Smooths a varying quantity whose noise is known.
//!
//! The model is an integrated random walk with white and first-order noise. Its intensity is chosen by likelihood, and the smoothed time
//! history comes from the Kalman smoother (Rauch, Tung and Striebel 1965). A constant quantity becomes a straight line through the whole
//! recording. Otherwise the slope may also change at the times of command changes: a temperature that follows its command with a lag has a
//! kink at each of them.

use mapper_core::NoiseColour;
use mapper_core::SAMPLE_INTERVAL_S;
use mapper_numerics::coloured_noise::{memory, variance_of_mean};
use mapper_numerics::statistics::median;
use nalgebra::{Matrix3, RowVector3, Vector3};

/// Minimum noise of a sample, in its unit. Bound: excludes division by zero for values without noise.
const MIN_NOISE: f64 = 1e-12;
/// Minimum time constant of coloured noise, s. Bound: below it noise is white.
const MIN_TIME_CONSTANT_S: f64 = 1e-3;
/// Longest correlation time of the smoothed values, s. Bound: hours, longer than any step.
const MAX_CORRELATION_S: f64 = 1e4;
/// Standard deviation of the start value, in noise of a sample. Bound: so large that it does not enter the result.
const START_SIGMAS: f64 = 1e3;
/// Variance of the start slope over that of the value. Bound: a slope of ten noises per second, steeper than any drift.
const START_SLOPE_RATIO: f64 = 1e-4;

/// Length of the bins that are filtered, s. Bound: shorter than any time scale of an input but its jumps.
const BIN_S: f64 = 1.0;

/// A smooth time history with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeHistory {
    start_s: f64,
    value: Vec<f64>,
    slope_s: Vec<f64>,
    /// Whether the slope has a kink halfway between the previous value and each value; empty if there are no kinks.
    kinks: Vec<bool>,
    /// Typical standard deviation of the time history, in the quantity's unit.
    pub sigma: f64,
    /// Correlation time of its error, s.
    pub correlation_s: f64,
}

impl TimeHistory {
    /// A constant value.
    pub fn constant(value: f64) -> TimeHistory {
        TimeHistory {
            start_s: 0.0,
            value: vec![value],
            slope_s: vec![0.0],
            kinks: Vec::new(),
            sigma: 0.0,
            correlation_s: 1.0,
        }
    }

    /// Value at `t_s`; constant beyond both ends.
    pub fn at(&self, t_s: f64) -> f64 {
        let last = self.value.len() - 1;
        let place = (t_s - self.start_s) / BIN_S;
        if place <= 0.0 {
            return self.value[0];
        }
        if place >= last as f64 {
            return self.value[last];
        }
        let i = place as usize;
        let x = place - i as f64;
        let (a, b) = (self.value[i], self.value[i + 1]);
        let (da, db) = (BIN_S * self.slope_s[i], BIN_S * self.slope_s[i + 1]);
        if self.kinks.get(i + 1) == Some(&true) {
            // Extrapolate both sides to the kink.
            let kink = 0.5 * (a + 0.5 * da + b - 0.5 * db);
            return if x < 0.5 { a + 2.0 * x * (kink - a) } else { b + 2.0 * (1.0 - x) * (kink - b) };
        }
        // Cubic with the slopes of the smoother.
        let rise = b - a;
        a + x * (da + x * (3.0 * rise - 2.0 * da - db + x * (da + db - 2.0 * rise)))
    }
}

struct Bin {
    /// Mean of the samples; `None` if there are none.
    mean: Option<f64>,
    samples: f64,
}

/// Candidate standard deviations of a change of slope, in noise of a sample per second. Bound: the data choose among them.
const KINKS_PER_S: [f64; 4] = [0.01, 0.1, 1.0, 10.0];
/// Minimum gain of the log likelihood for changes of slope. Bound: that of one more parameter at three standard deviations.
const MIN_LIKELIHOOD_GAIN: f64 = 4.5;
/// Candidate exponents of the ratio of intensity to variance, in half decades. Bound: from a straight line over hours to a time history
/// that follows each bin.
const EXPONENTS: std::ops::RangeInclusive<i32> = -26..=4;

/// Smooths `values` at `t_s` (rising; NaN counts as missing); one sample has the noise `noise_sigma`. The slope may change
/// at `kinks_s`. `None` if all values are missing.
pub fn smooth(
    t_s: &[f64],
    values: &[f64],
    noise_sigma: f64,
    colour: NoiseColour,
    kinks_s: &[f64],
) -> Option<TimeHistory> {
    let bins = bins(t_s, values);
    let first = bins.iter().find_map(|bin| bin.mean)?;
    let start_s = t_s[0] + 0.5 * BIN_S;
    let noise_sigma = noise_sigma.max(MIN_NOISE);
    let c2 = colour.first_order_share_ratio.powi(2);
    let tau_s = colour.time_constant_s.max(MIN_TIME_CONSTANT_S);
    let mut kinks = vec![false; bins.len()];
    for kink_s in kinks_s {
        // Move the kink to the nearest edge between two bins.
        let edge = ((kink_s - t_s[0]) / BIN_S).round();
        if let Some(kink) = (edge >= 1.0).then(|| kinks.get_mut(edge as usize)).flatten() {
            *kink = true;
        }
    }
    let filter = Filter {
        bins: &bins,
        kinks: &kinks,
        first,
        noise_sigma,
        white_variance: (1.0 - c2) * noise_sigma * noise_sigma,
        coloured_variance: variance_of_mean(c2 * noise_sigma * noise_sigma, BIN_S, tau_s),
        coloured_decay: memory(BIN_S, tau_s),
    };
    // From a straight line over hours to a time history that follows each bin.
    let intensity = |exponent: i32| noise_sigma * noise_sigma * 10f64.powf(0.5 * f64::from(exponent));
    let most_likely = |kink_variance: f64, exponents: std::ops::RangeInclusive<i32>| {
        let mut best = (f64::NEG_INFINITY, *exponents.start());
        for exponent in exponents {
            let likelihood = filter.filter(intensity(exponent), kink_variance, None);
            if likelihood > best.0 {
                best = (likelihood, exponent);
            }
        }
        best
    };
    let (likelihood, smooth_exponent) = most_likely(0.0, EXPONENTS);
    let mut best = (likelihood + MIN_LIKELIHOOD_GAIN, smooth_exponent, 0.0);
    // Kinks only reduce the intensity, and a constant has none.
    if smooth_exponent > *EXPONENTS.start() && kinks.contains(&true) {
        for kink_per_s in KINKS_PER_S {
            let variance = (kink_per_s * noise_sigma).powi(2);
            let (likelihood, exponent) = most_likely(variance, *EXPONENTS.start()..=smooth_exponent);
            if likelihood > best.0 {
                best = (likelihood, exponent, variance);
            }
        }
    }
    let (_, exponent, kink_variance) = best;
    let best_intensity = intensity(exponent);
    let mut tracks = Vec::with_capacity(bins.len());
    filter.filter(best_intensity, kink_variance, Some(&mut tracks));
    let (value, slope_s, variance) = filter.smooth(&tracks);
    let kinks = if kink_variance > 0.0 { kinks.clone() } else { Vec::new() };
    // Density of the noise at low frequency; the smoother's window is the fourth root of its ratio to the intensity.
    let density = filter.white_variance * SAMPLE_INTERVAL_S + 2.0 * tau_s * c2 * noise_sigma * noise_sigma;
    let correlation_s =
        (density / best_intensity).powf(0.25).clamp(2.0, MAX_CORRELATION_S) * std::f64::consts::SQRT_2;
    let sigma = median(&variance).unwrap_or(0.0).max(0.0).sqrt();
    Some(TimeHistory { start_s, value, slope_s, kinks, sigma, correlation_s })
}

fn bins(t_s: &[f64], values: &[f64]) -> Vec<Bin> {
    let (Some(first_s), Some(last_s)) = (t_s.first(), t_s.last()) else { return Vec::new() };
    // At most two days: a longer file is not a campaign.
    let count = (((last_s - first_s) / BIN_S).floor() as usize + 1).min(200_000);
    let mut sums = vec![(0.0, 0usize); count];
    for (t, value) in t_s.iter().zip(values) {
        let index = ((t - first_s) / BIN_S) as usize;
        if let (Some(sum), true) = (sums.get_mut(index), value.is_finite()) {
            *sum = (sum.0 + value, sum.1 + 1);
        }
    }
    sums.into_iter()
        .map(|(sum, n)| Bin { mean: (n > 0).then(|| sum / n as f64), samples: n as f64 })
        .collect()
}

struct Filter<'a> {
    bins: &'a [Bin],
    /// Whether the slope may change at the start of each bin.
    kinks: &'a [bool],
    first: f64,
    noise_sigma: f64,
    white_variance: f64,
    coloured_variance: f64,
    coloured_decay: f64,
}

/// State of the filter before and after each bin.
type Track = (Vector3<f64>, Matrix3<f64>, Vector3<f64>, Matrix3<f64>);

impl Filter<'_> {
    fn transition(&self) -> Matrix3<f64> {
        Matrix3::new(1.0, BIN_S, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, self.coloured_decay)
    }

    /// Forward pass: log likelihood, up to a constant independent of the intensity.
    fn filter(&self, intensity: f64, kink_variance: f64, mut tracks: Option<&mut Vec<Track>>) -> f64 {
        let transition = self.transition();
        let (d, q) = (BIN_S, intensity);
        let coloured = self.coloured_variance * (1.0 - self.coloured_decay * self.coloured_decay);
        let process_noise = Matrix3::new(
            q * d * d * d / 3.0,
            q * d * d / 2.0,
            0.0,
            q * d * d / 2.0,
            q * d,
            0.0,
            0.0,
            0.0,
            coloured,
        );
        // The kink is halfway between the middles of two bins.
        let kink = Vector3::new(0.5 * d, 1.0, 0.0);
        let process_noise_at_kink = process_noise + kink * kink.transpose() * kink_variance;
        let observe = RowVector3::new(1.0, 0.0, 1.0);
        let wide = START_SIGMAS * self.noise_sigma;
        let mut mean = Vector3::new(self.first, 0.0, 0.0);
        let mut covariance = Matrix3::from_diagonal(&Vector3::new(
            wide * wide,
            wide * wide * START_SLOPE_RATIO,
            self.coloured_variance,
        ));
        let mut likelihood = 0.0;
        for (place, bin) in self.bins.iter().enumerate() {
            let (before, before_covariance) = (mean, covariance);
            if let Some(observed) = bin.mean {
                let variance = (observe * covariance * observe.transpose())[0]
                    + self.white_variance / bin.samples.max(1.0);
                let gain = covariance * observe.transpose() / variance;
                let innovation = observed - (observe * mean)[0];
                likelihood -= 0.5 * (innovation * innovation / variance + variance.ln());
                mean += gain * innovation;
                covariance -= gain * observe * covariance;
                covariance = 0.5 * (covariance + covariance.transpose());
            }
            if let Some(tracks) = tracks.as_deref_mut() {
                tracks.push((before, before_covariance, mean, covariance));
            }
            mean = transition * mean;
            let has_kink = self.kinks.get(place + 1) == Some(&true);
            covariance = transition * covariance * transition.transpose()
                + if has_kink { process_noise_at_kink } else { process_noise };
        }
        likelihood
    }

    /// Backward pass: smoothed values, slopes and variances of the time history.
    fn smooth(&self, tracks: &[Track]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let transition = self.transition();
        let n = tracks.len();
        let (mut value, mut slope, mut variance) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let Some(&(_, _, mut mean, mut covariance)) = tracks.last() else { return (value, slope, variance) };
        for k in (0..n).rev() {
            if k + 1 < n {
                let (next, next_covariance, ..) = tracks[k + 1];
                let (_, _, filtered, filtered_covariance) = tracks[k];
                if let Some(inverse) = next_covariance.try_inverse() {
                    let gain = filtered_covariance * transition.transpose() * inverse;
                    mean = filtered + gain * (mean - next);
                    covariance =
                        filtered_covariance + gain * (covariance - next_covariance) * gain.transpose();
                } else {
                    (mean, covariance) = (filtered, filtered_covariance);
                }
            }
            (value[k], slope[k], variance[k]) = (mean[0], mean[1], covariance[(0, 0)]);
        }
        (value, slope, variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    fn noisy(history: impl Fn(f64) -> f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut random = Pcg64::seed_from_u64(seed);
        let colour = NoiseColour::default();
        let decay = (-0.1 / colour.time_constant_s).exp();
        let mut slow: f64 = random.sample(StandardNormal);
        let t_s: Vec<f64> = (0..12_000).map(|i| 0.1 * f64::from(i)).collect();
        let values = t_s
            .iter()
            .map(|t| {
                let kick: f64 = random.sample(StandardNormal);
                slow = decay * slow + (1.0 - decay * decay).sqrt() * kick;
                let white: f64 = random.sample(StandardNormal);
                history(*t) + 0.1 * (0.8 * white + 0.6 * slow)
            })
            .collect();
        (t_s, values)
    }

    #[test]
    fn a_constant_is_found_within_the_error_of_its_mean_and_a_wave_within_its_own_statement() {
        let (t_s, values) = noisy(|_| 5.0, 1);
        let history = smooth(&t_s, &values, 0.1, NoiseColour::default(), &[]).unwrap();
        // Noise of a mean over 1200 s: sqrt((2 * 2 * 0.36 + 0.1 * 0.64)/1200) * 0.1 = 0.0035; a line doubles it at its
        // ends. Four of these.
        for t in [0.0, 300.0, 600.0, 1190.0] {
            assert!((history.at(t) - 5.0).abs() < 0.03, "{t}: {}", history.at(t));
        }
        let wave = |t: f64| 2.0 * (t / 7.0).sin();
        let (t_s, values) = noisy(wave, 2);
        let history = smooth(&t_s, &values, 0.1, NoiseColour::default(), &[]).unwrap();
        let n = 1150;
        let mean_square = (0..n)
            .map(|i| (history.at(20.0 + f64::from(i)) - wave(20.0 + f64::from(i))).powi(2))
            .sum::<f64>()
            / f64::from(n);
        // A wave is not a random walk, so its error estimate is only good to a factor of two either way.
        let ratio = mean_square.sqrt() / history.sigma;
        assert!((0.5..2.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn missing_values_are_bridged_and_nothing_gives_nothing() {
        let (t_s, mut values) = noisy(|t| t / 100.0, 3);
        for value in &mut values[4_000..5_000] {
            *value = f64::NAN;
        }
        let history = smooth(&t_s, &values, 0.1, NoiseColour::default(), &[]).unwrap();
        // Ten times the error of a straight line through all of it.
        assert!((history.at(450.0) - 4.5).abs() < 0.1, "{}", history.at(450.0));
        assert!(smooth(&t_s, &vec![f64::NAN; t_s.len()], 0.1, NoiseColour::default(), &[]).is_none());
        assert!(smooth(&[], &[], 0.1, NoiseColour::default(), &[]).is_none());
    }

    /// A temperature that follows its command with 20 s, in steps of 50 K every two minutes.
    #[test]
    fn a_kink_is_not_rounded() {
        let kinks_s: Vec<f64> = (1..10).map(|step| 120.0 * f64::from(step)).collect();
        let lagged = |t: f64| {
            let step = (t / 120.0).floor();
            let up = if step as u32 % 2 == 1 { 1.0 } else { -1.0 };
            if step < 1.0 { 0.0 } else { 25.0 + 25.0 * up * (1.0 - 2.0 * (-(t - 120.0 * step) / 20.0).exp()) }
        };
        let (t_s, values) = noisy(lagged, 4);
        // Within two seconds of each kink but the first, which is half as high.
        let near: Vec<f64> = kinks_s[1..]
            .iter()
            .flat_map(|kink_s| (-4..=4).map(move |i| kink_s + 0.5 * f64::from(i)))
            .collect();
        let off = |kinks_s: &[f64]| {
            let history = smooth(&t_s, &values, 0.1, NoiseColour::default(), kinks_s).unwrap();
            (near.iter().map(|t| (history.at(*t) - lagged(*t)).powi(2)).sum::<f64>() / near.len() as f64)
                .sqrt()
        };
        let (rounded, kinked) = (off(&[]), off(&kinks_s));
        assert!(kinked < 0.5 * rounded && kinked < 0.15, "{kinked} K, {rounded} K without");
    }
}
