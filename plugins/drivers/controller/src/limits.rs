//! Setpoint limits and safe state of a stand, as campaigns write them, and the plausibility check of the first readings, before anything is written: a wrong word
//! order, unit or scale in the readings is also wrong in the setpoints.

use crate::Controller;
use mapper_core::{
    Channel, GuardName, SafeTrajectory, SetpointRange, SetpointRanges, measurable, named_enum,
};
use mapper_yaml::units::{Duration, Pressure, PressureRate, Quantity, Temperature};
use serde::Deserialize;

/// Guards that every rig requires, with their channels.
pub const REQUIRED_GUARDS: [(GuardName, Channel); 2] =
    [(GuardName::Overspeed, Channel::ShaftSpeed), (GuardName::TurbineInletPressure, Channel::P3)];

named_enum! {
    /// A quantity that the driver writes.
    pub enum Target {
        /// Turbine inlet total pressure, Pa.
        P3 = "p3",
        /// Turbine inlet total temperature, K.
        T3 = "t3",
        /// Opening of the back-pressure valve, ratio.
        Valve = "valve",
        /// Oil inlet temperature, K.
        OilTemperature = "oil_temperature",
        /// 1: air on, 0: off.
        Air = "air",
        /// Counts up twice a second; the controller cuts the air if it stops.
        Heartbeat = "heartbeat",
    }
}

/// Maximum count of the heartbeat; 0 follows.
pub(crate) const MAX_HEARTBEAT: u16 = 9999;

/// Where each target is written, as the protocol gives places.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WriteSettings<T> {
    p3: T,
    t3: T,
    valve: T,
    oil_temperature: T,
    air: T,
    heartbeat: T,
}

impl<T> WriteSettings<T> {
    /// The place of a target.
    pub fn of(&self, target: Target) -> &T {
        match target {
            Target::P3 => &self.p3,
            Target::T3 => &self.t3,
            Target::Valve => &self.valve,
            Target::OilTemperature => &self.oil_temperature,
            Target::Air => &self.air,
            Target::Heartbeat => &self.heartbeat,
        }
    }
}

/// Setpoint ranges that a rig accepts.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AcceptedRanges {
    /// Minimum and maximum.
    pub p3: [Quantity<Pressure>; 2],
    /// Minimum and maximum.
    pub t3: [Quantity<Temperature>; 2],
    /// Minimum and maximum, ratio.
    pub valve: [f64; 2],
    /// Minimum and maximum.
    pub oil_temperature: [Quantity<Temperature>; 2],
}

impl AcceptedRanges {
    /// The permitted range, SI.
    pub fn range(&self, target: Target) -> SetpointRange {
        let (low, high) = match target {
            Target::P3 => (self.p3[0].value, self.p3[1].value),
            Target::T3 => (self.t3[0].value, self.t3[1].value),
            Target::Valve => (self.valve[0], self.valve[1]),
            Target::OilTemperature => (self.oil_temperature[0].value, self.oil_temperature[1].value),
            Target::Air => (0.0, 1.0),
            Target::Heartbeat => (0.0, f64::from(MAX_HEARTBEAT)),
        };
        SetpointRange { low, high }
    }

    /// The ranges for the rig's description.
    pub fn ranges(&self) -> SetpointRanges {
        SetpointRanges {
            p3_pa: self.range(Target::P3),
            t3_k: self.range(Target::T3),
            valve_opening_ratio: self.range(Target::Valve),
            oil_temperature_k: self.range(Target::OilTemperature),
        }
    }
}

/// The safe trajectory.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafeSettings {
    /// Maximum rate of fall of P3; without it the air is cut at once.
    pub pressure_slew: Option<Quantity<PressureRate>>,
    /// Valve opening during the run-down.
    pub opening: f64,
    /// Maximum duration of the run-down.
    pub within: Quantity<Duration>,
}

impl SafeSettings {
    /// The trajectory for the rig's description.
    pub fn trajectory(&self) -> SafeTrajectory {
        SafeTrajectory {
            p3_slew_pa_s: self.pressure_slew.as_ref().map(|slew| slew.value),
            valve_opening_ratio: self.opening,
            within_s: self.within.value,
        }
    }
}

/// A setting that is out of range.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LimitError {
    #[error("{value} {unit} is outside {low} to {high} {unit}")]
    Outside { value: f64, unit: &'static str, low: f64, high: f64 },
    #[error("a scale of {0} loses the value; its magnitude must be between 1e-12 and 1e12")]
    Scale(f64),
    /// All values in SI.
    #[error(
        "holds integers, so the setpoint would be rounded to steps of {step} from {low} to {high} (SI). Use a floating-point type, or a smaller \
                 `scale`"
    )]
    Coarse { step: f64, low: f64, high: f64 },
    #[error("the rig has to measure {0}: a guard needs it")]
    NotMeasured(Channel),
}

/// Maximum increment of a setpoint over its range: 0.12 of a valve of 0.1 to 2.5, 15 kPa of 300 kPa.
const MAX_STEP_RATIO: f64 = 0.05;

/// Returns the scale if it is invertible.
pub fn check_scale(scale: f64) -> Result<f64, LimitError> {
    if (1e-12..=1e12).contains(&scale.abs()) { Ok(scale) } else { Err(LimitError::Scale(scale)) }
}

/// Checks the resolution of a setpoint that is written as a whole number; `step` is its increment, SI.
pub fn check_resolution(target: Target, step: f64, range: SetpointRange) -> Result<(), LimitError> {
    let SetpointRange { low, high } = range;
    match target {
        Target::Air | Target::Heartbeat => Ok(()),
        _ if step.abs() <= MAX_STEP_RATIO * (high - low) => Ok(()),
        _ => Err(LimitError::Coarse { step: step.abs(), low, high }),
    }
}

/// Returns the value if it lies within bounds.
pub fn check_range(value: f64, unit: &'static str, low: f64, high: f64) -> Result<f64, LimitError> {
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(LimitError::Outside { value, unit, low, high })
    }
}

/// Readings that no sensor can deliver.
#[derive(Debug, thiserror::Error)]
#[error(
    "{channel} reads {} {unit} from {source_text}; plausible are {} to {} {unit}{}. {remedy}. No setpoint was written",
    format_short(*.value),
    format_short(*.low),
    format_short(*.high),
    describe_others(.others)
)]
pub(crate) struct ImplausibleReading {
    /// The first implausible channel.
    pub(crate) channel: Channel,
    value: f64,
    unit: &'static str,
    low: f64,
    high: f64,
    source_text: String,
    others: Vec<Channel>,
    remedy: String,
}

fn describe_others(others: &[Channel]) -> String {
    match others {
        [] => String::new(),
        _ => {
            let symbols: Vec<_> = others.iter().map(|channel| channel.symbol()).collect();
            format!("; {} are implausible too", symbols.join(", "))
        }
    }
}

/// Four significant digits; a power of ten for very large or small values.
pub fn format_short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e7).contains(&size) => {
            // Digits before the decimal point are never rounded away.
            let decimals = (3.0 - size.log10().floor()).max(0.0);
            let text = format!("{value:.0$}", decimals as usize);
            if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                text
            }
        }
        _ => format!("{value:.3e}"),
    }
}

/// Whether a sensor can read this value, SI. NaN passes: the guards count how long it lasts.
pub fn is_plausible(channel: Channel, value: f64) -> bool {
    !value.is_finite() || measurable(channel.info().dimension).contains(&value)
}

pub(crate) fn check_readings(
    controller: &impl Controller,
    readings: impl Iterator<Item = (Channel, f64)>,
) -> Result<(), Box<ImplausibleReading>> {
    let mut implausible = readings.filter(|(channel, value)| !is_plausible(*channel, *value));
    let Some((channel, value)) = implausible.next() else { return Ok(()) };
    let range = measurable(channel.info().dimension);
    Err(Box::new(ImplausibleReading {
        channel,
        value,
        unit: channel.unit(),
        low: *range.start(),
        high: *range.end(),
        source_text: controller.describe_source(channel),
        others: implausible.map(|(channel, _)| channel).collect(),
        remedy: controller.remedy(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_with_few_digits() {
        for (value, expected) in [
            (128_426_750.014_884_53, "1.284e8"),
            (2.26e-27, "2.260e-27"),
            (101_325.25, "101325"),
            (298.15, "298.1"),
            (-1000.0, "-1000"),
            (5e6, "5000000"),
            (0.5, "0.5"),
            (0.0, "0"),
        ] {
            assert_eq!(format_short(value), expected);
        }
    }
}
