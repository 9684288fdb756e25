//! The model of coloured noise: share and time constant of its first-order part.

use super::first_order;

/// White noise plus a first-order process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColouredNoise {
    /// Standard deviation of the first-order part over that of the whole, 0 to 1.
    pub first_order_share_ratio: f64,
    /// Time constant of the first-order part, s, 0 or more.
    pub time_constant_s: f64,
}

impl ColouredNoise {
    /// Noise whose first-order part has `first_order_share_ratio` of the standard deviation; values outside 0 to 1 are clamped.
    pub fn new(first_order_share_ratio: f64, time_constant_s: f64) -> Self {
        ColouredNoise { first_order_share_ratio: first_order_share_ratio.clamp(0.0, 1.0), time_constant_s }
    }

    /// Variance of the first-order part over that of the whole.
    pub fn first_order_variance_ratio(self) -> f64 {
        self.first_order_share_ratio * self.first_order_share_ratio
    }

    /// Variance of the white part over that of the whole.
    pub fn white_variance_ratio(self) -> f64 {
        1.0 - self.first_order_variance_ratio()
    }

    /// Correlation of two samples at a distance of `distance_s`. The white parts of different samples are independent.
    pub fn correlation(self, distance_s: f64) -> f64 {
        if distance_s == 0.0 {
            return 1.0;
        }
        self.first_order_variance_ratio() * first_order::memory(distance_s, self.time_constant_s)
    }

    /// Variance of the mean of `samples` readings spread evenly over `length_s`, over the variance of one reading.
    ///
    /// The first-order part is averaged over the whole length, not over the instants of the samples. The relative error is one
    /// twelfth of the square of the sample interval in time constants.
    pub fn variance_of_mean(self, samples: usize, length_s: f64) -> f64 {
        let first_order = self.first_order_variance_ratio();
        self.white_variance_ratio() / samples.max(1) as f64
            + first_order::variance_of_mean(first_order, length_s, self.time_constant_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_has_the_variance_of_white_and_first_order_noise() {
        let noise = |share| ColouredNoise::new(share, 2.0);
        assert!((noise(0.0).variance_of_mean(300, 30.0) - 1.0 / 300.0).abs() < 1e-15);
        // Integral of exp(-|t - s|/2) over the square of 30 s, over 900 s2: (2*2*30 - 2*4*(1 - exp(-15)))/900.
        let expected = (120.0 - 8.0 * (1.0 - (-15.0_f64).exp())) / 900.0;
        assert!((noise(1.0).variance_of_mean(300, 30.0) - expected).abs() < 1e-12);
    }

    /// The double sum over all pairs of samples, which no formula shortens.
    #[test]
    fn the_mean_of_samples_scatters_as_their_covariance_says() {
        let noise = ColouredNoise::new(0.6, 2.0);
        let times_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let pairs = times_s.iter().flat_map(|a| times_s.iter().map(move |b| a - b));
        let direct = pairs.map(|distance_s| noise.correlation(distance_s)).sum::<f64>() / 4e4;
        // Samples 0.1 s apart under 2 s: (0.05)^2 / 12 of the first-order part.
        assert!((noise.variance_of_mean(200, 20.0) / direct - 1.0).abs() < 5e-4);
    }

    #[test]
    fn white_noise_has_as_many_samples_as_there_are() {
        assert!((50.0 * ColouredNoise::new(0.0, 2.0).variance_of_mean(50, 5.0) - 1.0).abs() < 1e-12);
        assert_eq!(ColouredNoise::new(2.0, 1.0).first_order_share_ratio, 1.0);
    }
}
