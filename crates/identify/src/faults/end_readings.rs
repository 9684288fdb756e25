//! Readings at the end of a step, and derivatives with respect to them.

use crate::IdentifyConfig;
use crate::reading_checks::ends::Ends;
use mapper_core::{Channel, Recording};
use mapper_physics::gas::air::Air;
use mapper_physics::rig::sensor_fault::ExactReadings;

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
    /// The compressed air.
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
