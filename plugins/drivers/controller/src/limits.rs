//! Setpoint limits and safe state of a stand, as campaigns write them.

use mapper_core::{Channel, GuardName, SafeTrajectory, SetpointRange, SetpointRanges, named_enum};
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
///
/// # Errors
/// [`LimitError::Scale`], also for 0 and NaN.
pub fn check_scale(scale: f64) -> Result<f64, LimitError> {
    if (1e-12..=1e12).contains(&scale.abs()) { Ok(scale) } else { Err(LimitError::Scale(scale)) }
}

/// Checks the resolution of a setpoint that is written as a whole number; `step` is its increment, SI.
///
/// # Errors
/// [`LimitError::Coarse`].
pub fn check_resolution(target: Target, step: f64, range: SetpointRange) -> Result<(), LimitError> {
    let SetpointRange { low, high } = range;
    match target {
        Target::Air | Target::Heartbeat => Ok(()),
        _ if step.abs() <= MAX_STEP_RATIO * (high - low) => Ok(()),
        _ => Err(LimitError::Coarse { step: step.abs(), low, high }),
    }
}

/// Returns the value if it lies within bounds.
///
/// # Errors
/// [`LimitError::Outside`], also for NaN.
pub fn check_range(value: f64, unit: &'static str, low: f64, high: f64) -> Result<f64, LimitError> {
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(LimitError::Outside { value, unit, low, high })
    }
}
