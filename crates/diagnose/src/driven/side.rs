//! Interface between the diagnosis and the sides of a machine, and their unknown parameters with priors.

use crate::driven::log_rows::{Rows, SideChannels};
use mapper_core::{Channel, named_enum};
use mapper_physics::rig::effect::{Rig, Submodel};

named_enum! {
    /// One side of a machine.
    pub enum Side {
        /// Speed, flow, P1, P2 and T1 drive it; T2 and Tc are judged.
        Compressor = "compressor",
        /// Speed, turbine flow, P3, T3 and P4 drive it; T4 and Tt are judged.
        Turbine = "turbine",
    }
}

/// Correlation time of model and sensor errors, s. Bound: a probe's own time constant.
pub(crate) const CORRELATION_S: f64 = 2.0;
/// Correlation time of the housing's error, s. Bound: the time constant of a housing.
pub(crate) const HOUSING_CORRELATION_S: f64 = 60.0;

/// Prior of the model error of a judged channel. It is correlated in time, and its size is fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ModelError {
    /// Median of its standard deviation, K.
    pub(crate) median_k: f64,
    /// Standard deviation of its logarithm; 0 if fixed.
    pub(crate) width: f64,
    /// Correlation time, s.
    pub(crate) correlation_s: f64,
}

/// One side of a machine, driven by its measured neighbours.
pub(crate) trait SideModel: Sync + Sized {
    const SIDE: Side;

    /// The pressure whose changes separate the phases of a log, in addition to the speed.
    const PRESSURE: Channel;

    fn channels() -> SideChannels<'static>;

    /// Unknown parameters that are fitted with or without a cause.
    fn unknowns() -> &'static [Parameter];

    /// Model error of each judged channel.
    fn model_errors() -> &'static [ModelError];

    fn of(rows: Rows) -> Self;

    fn rows(&self) -> &Rows;

    /// Predicted readings of a rig with these unknowns, one column per judged channel.
    fn predict(&self, rig: &Rig, unknowns: &[f64]) -> Vec<Vec<f64>>;

    /// Why the effect with this id is not a candidate: an unknown covers it.
    fn covered(effect: &str) -> Option<&'static str>;

    /// Why an effect in this machine part changes no judged channel.
    fn why_silent(&self, submodel: Submodel) -> &'static str;
}

/// A temperature, K, after `elapsed_s` with this heat flow and conductance at its start: the exact exponential, which stays bounded over a gap in the log.
pub(crate) fn relaxed_k(
    from_k: f64,
    heat_w: f64,
    conductance_w_k: f64,
    capacity_j_k: f64,
    elapsed_s: f64,
) -> f64 {
    from_k + heat_w / conductance_w_k * -(-conductance_w_k * elapsed_s / capacity_j_k).exp_m1()
}

/// True values of a driving channel: its readings without lag, gain and offset of the rig's sensor.
pub(crate) fn true_drive(rows: &Rows, rig: &Rig, channel: Channel) -> Vec<f64> {
    let path = rig.instruments.path(channel);
    let read = rows.drive(channel);
    let correct = |value: f64| (value - path.offset) / path.gain_ratio;
    let place = rows.drives.iter().position(|(of, _)| *of == channel);
    match place.and_then(|place| rows.rates.get(place)) {
        // A lagging reading y has the input y + lag dy/dt.
        Some(rates) if path.lag_s > 0.0 => {
            read.iter().zip(rates).map(|(value, rate)| correct(value + path.lag_s * rate)).collect()
        }
        _ => read.iter().map(|value| correct(*value)).collect(),
    }
}

/// Form of a prior.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Spread {
    /// Normal about the middle.
    Normal,
    /// Normal in the logarithm: the middle is the median, the width one standard deviation of the logarithm.
    LogNormal,
}

/// A parameter with its prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parameter {
    /// Short name.
    pub(crate) name: &'static str,
    /// Description.
    pub(crate) description: &'static str,
    /// Its unit; empty for a ratio.
    pub(crate) unit: &'static str,
    middle: f64,
    width: f64,
    spread: Spread,
}

type Text = &'static str;

/// A parameter with a normal prior.
pub(crate) const fn normal(name: Text, unit: Text, middle: f64, width: f64, description: Text) -> Parameter {
    Parameter { name, description, unit, middle, width, spread: Spread::Normal }
}

/// A parameter with a log-normal prior.
pub(crate) const fn log_normal(
    name: Text,
    unit: Text,
    middle: f64,
    width: f64,
    description: Text,
) -> Parameter {
    Parameter { name, description, unit, middle, width, spread: Spread::LogNormal }
}

impl Parameter {
    /// Value at this number of prior standard deviations above the middle.
    pub(crate) fn at(&self, standard: f64) -> f64 {
        match self.spread {
            Spread::Normal => self.middle + self.width * standard,
            Spread::LogNormal => self.middle * (self.width * standard).exp(),
        }
    }
}
