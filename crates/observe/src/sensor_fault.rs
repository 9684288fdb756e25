//! What sensors are known to do wrong: one catalogue of faults, each with the error that it puts into a reading.
//!
//! A fault may be common to several channels: thermocouples share a reference junction, pressure transducers a barometer or a supply.

use mapper_core::Channel;

/// How the error of a reading comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FaultKind {
    /// The same error in every reading, in the channel's unit (K, Pa, kg/s, rpm).
    Offset,
    /// An error in proportion to the reading; temperatures from [`CALIBRATED_AT_K`] on. Ratio.
    Gain,
    /// Nothing at the start of the run and the size at its end, in between in proportion to the time: unit of the channel, but a ratio to the
    /// reading for flow and speed.
    Drift,
}

/// A fault of one or several sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFault {
    /// The channels that err alike.
    pub channels: &'static [Channel],
    /// How they err.
    pub kind: FaultKind,
    /// How large such faults are, one standard deviation, in the unit of `kind`. What a reader takes for a fault and not for
    /// an ordinary error: some ten times what calibrated sensors are declared to have. The odds of a fault change by the
    /// logarithm of it alone.
    pub sigma: f64,
}

/// Temperature at which a thermocouple's gain error is zero, K: 20 degC, the reference temperature of ISO 1.
pub const CALIBRATED_AT_K: f64 = 293.15;

const TEMPERATURE_K: f64 = 3.0;
const PRESSURE_PA: f64 = 3e3;
const RATIO: f64 = 0.05;

const fn fault(channels: &'static [Channel], kind: FaultKind, sigma: f64) -> SensorFault {
    SensorFault { channels, kind, sigma }
}

/// All faults that are looked for.
pub const CATALOGUE: [SensorFault; 25] = {
    use Channel::{CompressorFlow, P1, P2, ShaftSpeed, T1, T2, Tc};
    use FaultKind::{Drift, Gain, Offset};
    [
        fault(&[T1], Offset, TEMPERATURE_K),
        fault(&[T2], Offset, TEMPERATURE_K),
        fault(&[Tc], Offset, TEMPERATURE_K),
        fault(&[T1, T2, Tc], Offset, TEMPERATURE_K),
        fault(&[T2], Gain, RATIO),
        fault(&[Tc], Gain, RATIO),
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

/// The turbine side, which identification does not need: what of it drifts.
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

/// Everything of which drift is known, both sides.
pub fn drifts() -> impl Iterator<Item = SensorFault> {
    CATALOGUE.into_iter().chain(TURBINE_DRIFTS).filter(|fault| fault.kind == FaultKind::Drift)
}

impl SensorFault {
    /// Error of a channel's reading by a fault of size 1. `run_ratio`: time since the start of the run over its length.
    pub fn error_per_unit(&self, channel: Channel, reading: f64, run_ratio: f64) -> f64 {
        if !self.channels.contains(&channel) {
            return 0.0;
        }
        let relative = matches!(channel, Channel::CompressorFlow | Channel::ShaftSpeed);
        match self.kind {
            FaultKind::Offset => 1.0,
            FaultKind::Gain if is_temperature(channel) => reading - CALIBRATED_AT_K,
            FaultKind::Gain => reading,
            FaultKind::Drift if relative => run_ratio * reading,
            FaultKind::Drift => run_ratio,
        }
    }
}

fn is_temperature(channel: Channel) -> bool {
    matches!(channel, Channel::T1 | Channel::T2 | Channel::Tc)
}
