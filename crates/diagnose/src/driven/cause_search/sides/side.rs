//! Interface between the diagnosis and the sides of a machine.

use crate::driven::Parameter;
use crate::driven::log_rows::{Rows, Wanted};
use mapper_core::Channel;
use mapper_physics::rig::effect::{Rig, Submodel};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// One side of a machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    /// Compressor: speed, flow, P1, P2 and T1 drive, T2 and Tc are judged.
    Compressor,
    /// Turbine: speed, turbine flow, P3, T3 and P4 drive, T4 and Tt are judged.
    Turbine,
}

impl Which {
    /// Display name.
    pub fn name(self) -> &'static str {
        match self {
            Which::Compressor => "compressor",
            Which::Turbine => "turbine",
        }
    }
}

/// An unknown side.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("a machine has a compressor and a turbine side; `{name}` is none")]
pub struct NoSide {
    /// The requested name.
    pub name: String,
}

impl FromStr for Which {
    type Err = NoSide;

    fn from_str(name: &str) -> Result<Self, NoSide> {
        let found = [Which::Compressor, Which::Turbine].into_iter().find(|which| which.name() == name);
        found.ok_or_else(|| NoSide { name: name.to_owned() })
    }
}

/// Model error of a judged channel, in addition to sensor noise: correlated in time, with a fitted size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Smooth {
    /// Prior median of its standard deviation, K.
    pub(crate) median_k: f64,
    /// Prior width of its logarithm; 0 if fixed.
    pub(crate) width: f64,
    /// Correlation time, s.
    pub(crate) alike_s: f64,
}

/// One side of a machine, driven by its measured neighbours.
pub(crate) trait Side: Sync + Sized {
    /// Identifier.
    const WHICH: Which;

    /// The pressure that shows its phases, in addition to the speed.
    const PRESSURE: Channel;

    /// Channels that it needs from a log.
    fn wanted() -> Wanted<'static>;

    /// Unknowns, independent of the cause.
    fn unknowns() -> &'static [Parameter];

    /// Model error of each judged channel.
    fn smooth() -> &'static [Smooth];

    /// The side for these rows.
    fn of(rows: Rows) -> Self;

    /// Its rows.
    fn rows(&self) -> &Rows;

    /// Predicted readings of a rig with these unknowns, one column per judged channel.
    fn predict(&self, rig: &Rig, unknowns: &[f64]) -> Vec<Vec<f64>>;

    /// Why an effect with this id is not a candidate: an unknown already covers it.
    fn free(effect: &str) -> Option<&'static str>;

    /// Why an effect in this machine part cannot be diagnosed here, if it changes no judged channel.
    fn silent(&self, submodel: Submodel) -> &'static str;
}

/// True drives of a log, given a rig's sensors: corrects the lag, gain and offset of a sensor.
pub(crate) fn truth(rows: &Rows, rig: &Rig, channel: Channel) -> Vec<f64> {
    let path = rig.instruments.path(channel);
    let read = rows.drive(channel);
    let straight = |value: f64| (value - path.offset) / path.gain_ratio;
    let place = rows.drives.iter().position(|(of, _)| *of == channel);
    match place.and_then(|place| rows.rates.get(place)) {
        // For a lag: y + lag dy/dt.
        Some(rates) if path.lag_s > 0.0 => {
            read.iter().zip(rates).map(|(value, rate)| straight(value + path.lag_s * rate)).collect()
        }
        _ => read.iter().map(|value| straight(*value)).collect(),
    }
}
