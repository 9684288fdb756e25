//! The seam between the diagnosis and the sides of a machine that it can be asked about.

use crate::Parameter;
use crate::rows::{Rows, Wanted};
use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// One side of a machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Which {
    /// The compressor's: speed, flow, P1, P2 and T1 drive, T2 and Tc are judged.
    Compressor,
    /// The turbine's: speed, its flow, P3, T3 and P4 drive, T4 and Tt are judged.
    Turbine,
}

impl Which {
    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Which::Compressor => "compressor",
            Which::Turbine => "turbine",
        }
    }
}

/// A side that no machine has.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("a machine has a compressor and a turbine side; `{name}` is none")]
pub struct NoSide {
    /// What was asked for.
    pub name: String,
}

impl FromStr for Which {
    type Err = NoSide;

    fn from_str(name: &str) -> Result<Self, NoSide> {
        let found = [Which::Compressor, Which::Turbine].into_iter().find(|which| which.name() == name);
        found.ok_or_else(|| NoSide { name: name.to_owned() })
    }
}

/// What a model leaves of a judged channel beside the noise of its sensor: alike over a while, as large as the fit finds it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Smooth {
    /// Median of what is known of its standard deviation beforehand, K.
    pub(crate) median_k: f64,
    /// Width of its logarithm; 0 where it is held.
    pub(crate) width: f64,
    /// It is alike over so long, s.
    pub(crate) alike_s: f64,
}

/// One side of a machine, driven by its measured neighbours.
pub(crate) trait Side: Sync + Sized {
    /// Which one.
    const WHICH: Which;

    /// The pressure that shows its phases, beside the speed.
    const PRESSURE: Channel;

    /// What it asks of a log.
    fn wanted() -> Wanted<'static>;

    /// What is not known of it, whatever the cause.
    fn unknowns() -> &'static [Parameter];

    /// What its model leaves of each judged channel.
    fn smooth() -> &'static [Smooth];

    /// The side under these rows.
    fn of(rows: Rows) -> Self;

    /// Its rows.
    fn rows(&self) -> &Rows;

    /// What a rig of these unknowns would have read, a column for each judged channel.
    fn predict(&self, rig: &Rig, unknowns: &[f64]) -> Vec<Vec<f64>>;

    /// Why an effect of this id is no cause here: one of the unknowns is the same.
    fn free(effect: &str) -> Option<&'static str>;

    /// Why an effect in this part of the machine cannot be asked here, where it changes nothing of what is judged.
    fn silent(&self, submodel: Submodel) -> &'static str;
}

/// The drives of a log as the sensors of a rig let believe they were: what a sensor's lag, gain and offset made of them is
/// taken off.
pub(crate) fn truth(rows: &Rows, rig: &Rig, channel: Channel) -> Vec<f64> {
    let path = rig.instruments.path(channel);
    let read = rows.drive(channel);
    let straight = |value: f64| (value - path.offset) / path.gain_ratio;
    let place = rows.drives.iter().position(|(of, _)| *of == channel);
    match place.and_then(|place| rows.rates.get(place)) {
        // Of a lag, y + lag dy/dt.
        Some(rates) if path.lag_s > 0.0 => {
            read.iter().zip(rates).map(|(value, rate)| straight(value + path.lag_s * rate)).collect()
        }
        _ => read.iter().map(|value| straight(*value)).collect(),
    }
}
