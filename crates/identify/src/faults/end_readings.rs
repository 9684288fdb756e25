//! Readings at the ends of the steps for the search of faults, smoothed over the campaign.

use crate::IdentifyConfig;
use crate::reading_checks::ends::Ends;
use mapper_core::{Channel, Recording};
use mapper_physics::gas::air::Air;
use mapper_physics::rig::sensor_fault::ExactReadings;
use nalgebra::{DMatrix, DVector};

/// Maximum number of correlated rows, evenly spread. Bound: the cost grows with the cube, and these take a second.
pub const MAX_CORRELATED_ROWS: usize = 500;

/// The channels of the compressor, in the order of all arrays here.
pub(crate) const CHANNELS: [Channel; 7] = [
    Channel::T1,
    Channel::T2,
    Channel::Tc,
    Channel::P1,
    Channel::P2,
    Channel::CompressorFlow,
    Channel::ShaftSpeed,
];

pub(crate) type PerChannel = [f64; CHANNELS.len()];

/// Readings with the time at which they were taken.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Readings {
    /// SI, total pressures, speed in rpm.
    pub(crate) values: PerChannel,
    /// Time since the first step's start over the whole run's length.
    pub(crate) run_ratio: f64,
    /// As in [`IdentifyConfig`].
    pub(crate) exact_at: ExactReadings,
    pub(crate) air: Air,
}

/// Start of the first and end of the last step, s.
pub(crate) fn span_s(recording: &Recording) -> Option<(f64, f64)> {
    let first_s = recording.steps.iter().map(|step| step.start_s).fold(f64::INFINITY, f64::min);
    let last_s = recording.steps.iter().map(|step| step.end_s).fold(f64::NEG_INFINITY, f64::max);
    (last_s > first_s).then_some((first_s, last_s))
}

/// Steps for derivatives. Bound: small compared with the curvature of the balances, large compared with rounding.
const DIFFERENCES: PerChannel = [0.05, 0.05, 0.05, 20.0, 20.0, 1e-5, 20.0];

impl Readings {
    pub(crate) fn of(end: &Ends, first_s: f64, last_s: f64, exact_at: ExactReadings) -> Self {
        Readings {
            values: [
                end.t1_k,
                end.t2_k,
                end.tc_k.unwrap_or(f64::NAN),
                end.p1_pa,
                end.p2_pa,
                end.flow_kg_s,
                end.speed_rpm,
            ],
            exact_at,
            air: end.air,
            run_ratio: (end.end_s - first_s) / (last_s - first_s).max(f64::MIN_POSITIVE),
        }
    }

    /// Flow of dry air at the same Mach numbers, kg/s.
    pub(crate) fn dry_flow_kg_s(&self) -> f64 {
        self.flow_kg_s() * self.air.dry_flow_ratio()
    }

    pub(crate) fn t1_k(&self) -> f64 {
        self.values[0]
    }

    pub(crate) fn t2_k(&self) -> f64 {
        self.values[1]
    }

    pub(crate) fn tc_k(&self) -> f64 {
        self.values[2]
    }

    pub(crate) fn p1_pa(&self) -> f64 {
        self.values[3]
    }

    pub(crate) fn p2_pa(&self) -> f64 {
        self.values[4]
    }

    pub(crate) fn flow_kg_s(&self) -> f64 {
        self.values[5]
    }

    pub(crate) fn speed_rpm(&self) -> f64 {
        self.values[6]
    }

    /// Derivatives of a function of the readings by each of them; 0 if it does not depend on one.
    pub(crate) fn derivatives(&self, function: impl Fn(&Readings) -> f64) -> PerChannel {
        std::array::from_fn(|channel| {
            let moved = |by: f64| {
                let mut other = *self;
                other.values[channel] += by;
                function(&other)
            };
            let step = DIFFERENCES[channel];
            let slope = (moved(step) - moved(-step)) / (2.0 * step);
            if slope.is_finite() { slope } else { 0.0 }
        })
    }
}

/// Standard errors of the readings at a step's end from the declared noise, [`CHANNELS`].
pub(crate) fn noise(config: &IdentifyConfig, recording: &Recording) -> PerChannel {
    let (colour, last_s) = (config.noise(), config.thresholds.steady_mean_s);
    CHANNELS.map(|channel| {
        let sigma = config.sensor(channel).noise_sigma;
        let samples =
            recording.series.get(&channel).zip(recording.steps.last()).map_or(1, |(series, step)| {
                series.range((step.end_s - last_s).max(step.start_s), step.end_s).len()
            });
        sigma * colour.variance_of_mean(samples, last_s).sqrt()
    })
}

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

    pub(crate) fn covariance(&self, places: &[At]) -> DMatrix<f64> {
        DMatrix::from_fn(places.len(), places.len(), |i, j| self.between(&places[i], &places[j]))
    }

    /// The most probable value at a position. `weights`: inverse covariance of the measured values times these values.
    pub(crate) fn value(&self, at: &At, places: &[At], weights: &DVector<f64>) -> f64 {
        places.iter().zip(weights.iter()).map(|(place, weight)| weight * self.between(at, place)).sum()
    }
}
