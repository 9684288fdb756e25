//! What a stand takes and how it becomes safe, as campaigns write it.

use mapper_core::{Channel, GuardName, SafeTrajectory, SetpointRange, SetpointRanges};
use mapper_yaml::units::{Duration, Pressure, PressureRate, Quantity, Temperature};
use serde::Deserialize;

/// Guards that no rig runs without, and what they look at.
pub const NEEDS: [(GuardName, Channel); 2] =
    [(GuardName::Overspeed, Channel::ShaftSpeed), (GuardName::TurbineInletPressure, Channel::P3)];

/// Something that is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// Turbine inlet total pressure, Pa.
    P3,
    /// Turbine inlet total temperature, K.
    T3,
    /// Opening of the back-pressure valve, ratio.
    Valve,
    /// Oil inlet temperature, K.
    OilTemperature,
    /// 1: air on, 0: off.
    Air,
    /// Counts up twice a second: the controller cuts the air by itself where it stands still.
    Heartbeat,
}

impl Target {
    /// All, in the order of campaigns.
    pub const ALL: [Target; 6] =
        [Target::P3, Target::T3, Target::Valve, Target::OilTemperature, Target::Air, Target::Heartbeat];

    /// Its key in campaigns.
    pub fn key(self) -> &'static str {
        match self {
            Target::P3 => "p3",
            Target::T3 => "t3",
            Target::Valve => "valve",
            Target::OilTemperature => "oil_temperature",
            Target::Air => "air",
            Target::Heartbeat => "heartbeat",
        }
    }
}

/// Highest count of the heartbeat; 0 follows.
pub(crate) const HEARTBEAT_MAX: u16 = 9999;

/// Setpoints that a rig takes.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accepts {
    /// Lowest and highest.
    pub p3: [Quantity<Pressure>; 2],
    /// Lowest and highest.
    pub t3: [Quantity<Temperature>; 2],
    /// Lowest and highest, ratio.
    pub valve: [f64; 2],
    /// Lowest and highest.
    pub oil_temperature: [Quantity<Temperature>; 2],
}

impl Accepts {
    /// What may be written there, SI.
    pub fn range(&self, target: Target) -> SetpointRange {
        let (low, high) = match target {
            Target::P3 => (self.p3[0].inside, self.p3[1].inside),
            Target::T3 => (self.t3[0].inside, self.t3[1].inside),
            Target::Valve => (self.valve[0], self.valve[1]),
            Target::OilTemperature => (self.oil_temperature[0].inside, self.oil_temperature[1].inside),
            Target::Air => (0.0, 1.0),
            Target::Heartbeat => (0.0, f64::from(HEARTBEAT_MAX)),
        };
        SetpointRange { low, high }
    }

    /// As a rig describes itself.
    pub fn ranges(&self) -> SetpointRanges {
        SetpointRanges {
            p3_pa: self.range(Target::P3),
            t3_k: self.range(Target::T3),
            valve_opening_ratio: self.range(Target::Valve),
            oil_temperature_k: self.range(Target::OilTemperature),
        }
    }
}

/// The way into the safe state.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Safe {
    /// How fast P3 goes down; cut at once if not said.
    pub pressure_slew: Option<Quantity<PressureRate>>,
    /// Opening of the valve on the way.
    pub opening: f64,
    /// Longest time of the way.
    pub within: Quantity<Duration>,
}

impl Safe {
    /// As a rig describes itself.
    pub fn trajectory(&self) -> SafeTrajectory {
        SafeTrajectory {
            p3_slew_pa_s: self.pressure_slew.as_ref().map(|slew| slew.inside),
            valve_opening_ratio: self.opening,
            within_s: self.within.inside,
        }
    }
}

/// A setting that no stand can have.
#[derive(Debug, thiserror::Error)]
pub enum LimitError {
    /// A number outside of what it may be.
    #[error("{value} {unit} is outside {low} to {high} {unit}")]
    Outside {
        /// The number.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Lowest.
        low: f64,
        /// Highest.
        high: f64,
    },
    /// A scale that loses the value.
    #[error("a scale of {0} loses the value; it is between 1e-12 and 1e12, or between -1e12 and -1e-12")]
    Scale(f64),
    /// A setpoint that goes in coarse steps.
    #[error(
        "holds whole numbers, so that it goes in steps of {step} from {low} to {high} (SI): what lies between would be rounded without a word. Use a \
         type with a fraction there, or a finer `scale`"
    )]
    Coarse {
        /// From one whole number to the next, SI.
        step: f64,
        /// Lowest setpoint, SI.
        low: f64,
        /// Highest setpoint, SI.
        high: f64,
    },
    /// A channel that a guard looks at is not there.
    #[error("the rig has to measure {0}: a guard needs it")]
    NotMeasured(Channel),
}

/// Largest step of a setpoint, of its range: 0.12 of a valve of 0.1 to 2.5, 15 kPa of 300 kPa.
const COARSE_RATIO: f64 = 0.05;

/// The scale, where it keeps a value.
///
/// # Errors
/// [`LimitError::Scale`], also for 0 and NaN.
pub fn scale(scale: f64) -> Result<f64, LimitError> {
    match (1e-12..=1e12).contains(&scale.abs()) {
        true => Ok(scale),
        false => Err(LimitError::Scale(scale)),
    }
}

/// Whether a setpoint that is written as a whole number goes in steps that are fine enough; `step`: from one to the next, SI.
///
/// # Errors
/// [`LimitError::Coarse`].
pub fn fine_enough(target: Target, step: f64, range: SetpointRange) -> Result<(), LimitError> {
    let SetpointRange { low, high } = range;
    match target {
        Target::Air | Target::Heartbeat => Ok(()),
        _ if step.abs() <= COARSE_RATIO * (high - low) => Ok(()),
        _ => Err(LimitError::Coarse { step: step.abs(), low, high }),
    }
}

/// The value, where it lies within bounds.
///
/// # Errors
/// [`LimitError::Outside`], also for NaN.
pub fn within(value: f64, unit: &'static str, low: f64, high: f64) -> Result<f64, LimitError> {
    match (low..=high).contains(&value) {
        true => Ok(value),
        false => Err(LimitError::Outside { value, unit, low, high }),
    }
}
