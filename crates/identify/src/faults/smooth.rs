//! A smooth but otherwise unknown function over the map.

use nalgebra::{DMatrix, DVector};

/// Prior of such a function: a polynomial in speed and angle, a friction term at low speed, and a Gaussian process for the remainder.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Smooth {
    /// Powers of speed and angle of each term, with the standard deviation of its coefficient.
    pub(crate) terms: &'static [(i32, i32, f64)],
    /// Standard deviation of the 1/N^2 term.
    pub(crate) slow: f64,
    /// Standard deviation of the deviation from the polynomial.
    pub(crate) amplitude: f64,
    /// Correlation lengths of that deviation, halves of the range of the points: speed, angle.
    pub(crate) lengths: (f64, f64),
}

/// Deviation of any map from such a function, ratio. Calibrated: with it the chi-squares of a public measured map (TurboTools, 93 points)
/// are 95 for the efficiencies and 118 for the heads.
pub(crate) const ANY_ROUGHNESS: f64 = 4e-3;

/// A position on the map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct At {
    /// Corrected speed, scaled to the points, -1 to 1.
    pub(crate) speed: f64,
    /// Angle from the axis of heads, scaled to the points, -1 to 1.
    pub(crate) angle: f64,
    /// `(middle speed/speed)^2 - 1`.
    pub(crate) slowness: f64,
}

impl Smooth {
    /// Covariance of the function's values between two positions.
    fn between(&self, a: &At, b: &At) -> f64 {
        let term = |(i, j, sigma): &(i32, i32, f64)| {
            sigma * sigma * (a.speed * b.speed).powi(*i) * (a.angle * b.angle).powi(*j)
        };
        let terms: f64 = self.terms.iter().map(term).sum();
        let apart =
            ((a.speed - b.speed) / self.lengths.0).powi(2) + ((a.angle - b.angle) / self.lengths.1).powi(2);
        terms + self.slow.powi(2) * a.slowness * b.slowness + self.amplitude.powi(2) * (-0.5 * apart).exp()
    }

    /// Covariance of the function's values.
    pub(crate) fn covariance(&self, places: &[At]) -> DMatrix<f64> {
        DMatrix::from_fn(places.len(), places.len(), |i, j| self.between(&places[i], &places[j]))
    }

    /// The most probable value at a position. `weights`: inverse covariance of the measured values times these values.
    pub(crate) fn value(&self, at: &At, places: &[At], weights: &DVector<f64>) -> f64 {
        places.iter().zip(weights.iter()).map(|(place, weight)| weight * self.between(at, place)).sum()
    }
}
