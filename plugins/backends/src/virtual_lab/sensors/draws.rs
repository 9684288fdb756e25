//! Draws the errors of a sensor from its declared uncertainty, with a separate stream of random numbers for each sensor.

use crate::virtual_lab::sensors::sensor::SensorErrors;
use mapper_core::{Channel, DeclaredUncertainty};
use mapper_recording::logs::units::{difference, kind_of};
use mapper_yaml::units::Kind;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// White and first-order parts of the declared standard deviation, in quadrature.
const WHITE_SHARE: f64 = 0.8;
const COLOURED_SHARE: f64 = 0.6;
const COLOURED_TIME_CONSTANT_S: f64 = 2.0;

/// Rule for sensor errors from declared uncertainties.
pub(crate) struct Draws {
    pub(crate) seed: u64,
    /// Noise over declared noise.
    pub(crate) noise_ratio: f64,
    /// Whether offsets and gains are drawn; they are 0 otherwise.
    pub(crate) drawn: bool,
}

impl Draws {
    /// Errors of the sensor with this random stream.
    pub(crate) fn errors(&self, declared: &DeclaredUncertainty, stream: u64) -> SensorErrors {
        let (offset, gain) = self.of(stream);
        SensorErrors {
            white_sigma: self.noise_ratio * WHITE_SHARE * declared.noise_sigma,
            coloured_sigma: self.noise_ratio * COLOURED_SHARE * declared.noise_sigma,
            coloured_time_constant_s: COLOURED_TIME_CONSTANT_S,
            offset: offset * declared.offset_sigma,
            gain_ratio: gain * declared.gain_sigma_ratio,
        }
    }

    /// Standard normal numbers for offset and gain of a stream.
    pub(crate) fn of(&self, stream: u64) -> (f64, f64) {
        if self.drawn { draw(self.seed, stream) } else { (0.0, 0.0) }
    }
}

/// Draws two standard normal numbers of a stream, for offset and gain.
pub(crate) fn draw(seed: u64, stream: u64) -> (f64, f64) {
    // A stream separate from the noise of the sensor, which has other multipliers of the same seed.
    let mixed = seed.wrapping_mul(0xA24B_AED4_963E_E407) ^ (stream + 1).wrapping_mul(0x9FB2_1C65_1E98_DF25);
    let mut random = Pcg64::seed_from_u64(mixed);
    (StandardNormal.sample(&mut random), StandardNormal.sample(&mut random))
}

/// The kind of an offset of a channel.
pub(crate) fn offset_kind(channel: Channel) -> Kind {
    difference(kind_of(channel))
}
