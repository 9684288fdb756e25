//! Sensor errors: offset, white noise, coloured noise.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Errors of one sensor, in the unit of its channel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorErrors {
    /// Standard deviation of white noise.
    pub white_sigma: f64,
    /// Standard deviation of first-order coloured noise.
    pub coloured_sigma: f64,
    /// Time constant of the coloured noise, s.
    pub coloured_time_constant_s: f64,
    /// Fixed offset.
    pub offset: f64,
    /// Fixed gain error, ratio.
    pub gain_ratio: f64,
}

/// A sensor with its own random stream, so that its noise does not depend on other sensors.
#[derive(Debug, Clone)]
pub struct Sensor {
    errors: SensorErrors,
    random: Pcg64,
    coloured: f64,
    /// Memory of the coloured noise from one sample to the next.
    memory_ratio: f64,
}

impl Sensor {
    /// A sensor sampled every `sample_s`; `stream` distinguishes the sensors of one seed.
    pub fn new(errors: SensorErrors, sample_s: f64, seed: u64, stream: u64) -> Self {
        // Two different odd multipliers spread (seed, stream) over the generator's state.
        let mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ stream.wrapping_mul(0xD1B5_4A32_D192_ED03);
        let mut random = Pcg64::seed_from_u64(mixed);
        let memory_ratio = if errors.coloured_time_constant_s > 0.0 {
            (-sample_s / errors.coloured_time_constant_s).exp()
        } else {
            0.0
        };
        // Start in the stationary state of the coloured noise.
        let first: f64 = StandardNormal.sample(&mut random);
        Sensor { errors, random, coloured: errors.coloured_sigma * first, memory_ratio }
    }

    /// The reading of `truth`; advances the noise by one sample.
    pub fn read(&mut self, truth: f64) -> f64 {
        let white: f64 = StandardNormal.sample(&mut self.random);
        let kick: f64 = StandardNormal.sample(&mut self.random);
        let reading = truth * (1.0 + self.errors.gain_ratio)
            + self.errors.offset
            + self.errors.white_sigma * white
            + self.coloured;
        let fresh_ratio = (1.0 - self.memory_ratio * self.memory_ratio).sqrt();
        self.coloured = self.memory_ratio * self.coloured + self.errors.coloured_sigma * fresh_ratio * kick;
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_declared_size_and_memory() {
        let errors = SensorErrors {
            white_sigma: 0.8,
            coloured_sigma: 0.6,
            coloured_time_constant_s: 2.0,
            offset: 5.0,
            gain_ratio: 0.0,
        };
        let mut sensor = Sensor::new(errors, 0.1, 7, 3);
        let readings: Vec<f64> = (0..200_000).map(|_| sensor.read(100.0)).collect();
        let n = readings.len() as f64;
        let mean = readings.iter().sum::<f64>() / n;
        let covariance = |lag: usize| {
            readings.iter().zip(&readings[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / n
        };
        // 200 000 samples contain some 5 000 independent ones of the coloured part: a standard error of 1 %.
        assert!((mean - 105.0).abs() < 0.03, "{mean}");
        assert!((covariance(0) - 1.0).abs() < 0.04, "{}", covariance(0));
        // After one second the white part is uncorrelated and exp(-1/2) of the coloured variance remains.
        assert!((covariance(10) - 0.36 * (-0.5f64).exp()).abs() < 0.03, "{}", covariance(10));
    }

    #[test]
    fn a_seed_is_repeatable_and_streams_differ() {
        let errors = SensorErrors { white_sigma: 1.0, ..SensorErrors::default() };
        let draw = |seed, stream| Sensor::new(errors, 0.1, seed, stream).read(0.0);
        assert_eq!(draw(1, 2), draw(1, 2));
        assert_ne!(draw(1, 2), draw(1, 3));
        assert_ne!(draw(1, 2), draw(2, 2));
    }
}
