//! The catalogue of known sensor faults, each with the error that it causes in a reading.
//!
//! A fault may be common to several channels: thermocouples share a reference junction, pressure transducers a barometer or a supply.

use mapper_core::Channel;

/// Form of the error of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// The same error in every reading, in the channel's unit (K, Pa, kg/s, rpm).
    Offset,
    /// An error proportional to the reading; for temperatures, to the difference from [`CALIBRATED_AT_K`]. Ratio.
    Gain,
    /// Zero at the start of the run, the full size at its end, and proportional to the time between: unit of the channel, but a ratio to the
    /// reading for flow and speed.
    Drift,
    /// A share of the way from the reading to the housing's temperature: the probe's stem conducts heat. Ratio.
    TowardsHousing,
}

/// A fault of one or several sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFault {
    /// The channels with the same error.
    pub channels: &'static [Channel],
    /// Form of the error.
    pub kind: FaultKind,
    /// Prior size of such faults, one standard deviation, in the unit of `kind`. It is some ten times the declared error of calibrated
    /// sensors, so that an ordinary error does not count as a fault. The odds of a fault depend on it only logarithmically.
    pub sigma: f64,
}

/// Temperature at which a thermocouple's gain error is zero, K: 20 degC, the reference temperature of ISO 1.
pub const CALIBRATED_AT_K: f64 = 293.15;

const TEMPERATURE_K: f64 = 3.0;
const PRESSURE_PA: f64 = 3e3;
const RATIO: f64 = 0.05;
/// Stems of probes that are too short for their pipe conduct some per cent to a tenth of the difference.
const STEM_RATIO: f64 = 0.1;

const fn fault(channels: &'static [Channel], kind: FaultKind, sigma: f64) -> SensorFault {
    SensorFault { channels, kind, sigma }
}

/// All faults considered.
pub const CATALOGUE: [SensorFault; 27] = {
    use Channel::{CompressorFlow, P1, P2, ShaftSpeed, T1, T2, Tc};
    use FaultKind::{Drift, Gain, Offset, TowardsHousing};
    [
        fault(&[T1], Offset, TEMPERATURE_K),
        fault(&[T2], Offset, TEMPERATURE_K),
        fault(&[Tc], Offset, TEMPERATURE_K),
        fault(&[T1, T2, Tc], Offset, TEMPERATURE_K),
        fault(&[T2], Gain, RATIO),
        fault(&[Tc], Gain, RATIO),
        fault(&[T1, T2, Tc], Gain, RATIO),
        fault(&[T2], TowardsHousing, STEM_RATIO),
        fault(&[T1], Drift, TEMPERATURE_K),
        fault(&[T2], Drift, TEMPERATURE_K),
        fault(&[Tc], Drift, TEMPERATURE_K),
        fault(&[T1, T2, Tc], Drift, TEMPERATURE_K),
        fault(&[P1], Offset, PRESSURE_PA),
        fault(&[P2], Offset, PRESSURE_PA),
        fault(&[P1, P2], Offset, PRESSURE_PA),
        fault(&[P1], Gain, RATIO),
        fault(&[P2], Gain, RATIO),
        fault(&[P1, P2], Gain, RATIO),
        fault(&[P1], Drift, PRESSURE_PA),
        fault(&[P2], Drift, PRESSURE_PA),
        fault(&[P1, P2], Drift, PRESSURE_PA),
        fault(&[CompressorFlow], Offset, 2e-3),
        fault(&[CompressorFlow], Gain, RATIO),
        fault(&[CompressorFlow], Drift, RATIO),
        fault(&[ShaftSpeed], Gain, RATIO),
        fault(&[ShaftSpeed], Drift, RATIO),
        fault(&[ShaftSpeed], Offset, 1e3),
    ]
};

/// Drifts of the turbine side, which identification does not need.
const TURBINE_DRIFTS: [SensorFault; 6] = {
    use Channel::{P3, P4, T3, T4, Tt, TurbineFlow};
    use FaultKind::Drift;
    [
        fault(&[TurbineFlow], Drift, RATIO),
        fault(&[P3], Drift, PRESSURE_PA),
        fault(&[T3], Drift, TEMPERATURE_K),
        fault(&[P4], Drift, PRESSURE_PA),
        fault(&[T4], Drift, TEMPERATURE_K),
        fault(&[Tt], Drift, TEMPERATURE_K),
    ]
};

/// All known drifts, both sides.
pub fn drifts() -> impl Iterator<Item = SensorFault> {
    CATALOGUE.into_iter().chain(TURBINE_DRIFTS).filter(|fault| fault.kind == FaultKind::Drift)
}

impl SensorFault {
    /// Error of a channel's reading by a fault of size 1. `housing_k`: Tc; `run_ratio`: time since the start of the run over its length.
    pub fn error_per_unit(&self, channel: Channel, reading: f64, housing_k: f64, run_ratio: f64) -> f64 {
        if !self.channels.contains(&channel) {
            return 0.0;
        }
        let relative = matches!(channel, Channel::CompressorFlow | Channel::ShaftSpeed);
        match self.kind {
            FaultKind::Offset => 1.0,
            FaultKind::Gain => gain_error(channel, reading),
            FaultKind::Drift if relative => run_ratio * reading,
            FaultKind::Drift => run_ratio,
            FaultKind::TowardsHousing => housing_k - reading,
        }
    }
}

/// Error of a reading by a gain error of 1.
pub fn gain_error(channel: Channel, reading: f64) -> f64 {
    if is_temperature(channel) { reading - CALIBRATED_AT_K } else { reading }
}

fn is_temperature(channel: Channel) -> bool {
    matches!(channel, Channel::T1 | Channel::T2 | Channel::Tc)
}
