//! Unknown parameters of the compressor side, with their priors.
//!
//! The priors cover turbochargers of cars and lorries: efficiency from published maps, heat from Burke et al., Appendix A, scaled to the declared
//! machine. They are wide, and a parameter that the log does not identify keeps its prior width.

use serde::Serialize;

/// Form of a prior.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Spread {
    /// Normal about the middle.
    Normal,
    /// Normal in the logarithm: the middle is the median, the width one standard deviation of the logarithm.
    LogNormal,
}

/// A parameter with its prior.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Parameter {
    /// Short name.
    pub name: &'static str,
    /// Description.
    pub description: &'static str,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    /// Middle of the prior.
    pub middle: f64,
    /// Its width.
    pub width: f64,
    /// Its form.
    pub spread: Spread,
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

pub(crate) const COUNT: usize = PARAMETERS.len();

/// All parameters, in the order of [`Values`].
pub(crate) const PARAMETERS: [Parameter; 14] = [
    normal("eta", "", 0.70, 0.06, "isentropic efficiency, total to total, at middle speed and flow"),
    normal("eta_speed", "", 0.0, 0.08, "its change per unit of relative speed"),
    normal("eta_speed_2", "", -0.10, 0.12, "its curvature over relative speed"),
    normal("eta_flow", "", 0.0, 0.12, "its change per unit of the logarithm of the flow coefficient"),
    normal("eta_flow_2", "", -0.5, 0.3, "its curvature over the logarithm of the flow coefficient"),
    log_normal(
        "h",
        "",
        1.0,
        0.5,
        "heat transfer inside the housing, over Appendix A's law on the declared area",
    ),
    normal("alpha_A", "", 0.1, 0.1, "share of the internal area before compression"),
    log_normal("capacity", "", 1.0, 0.5, "heat capacity of the housing, over the declared one"),
    log_normal("loss", "W/K", 2.0, 1.0, "conductance from the housing to oil, turbine and engine bay"),
    normal("surroundings", "K", 345.0, 25.0, "temperature of the surroundings of the housing"),
    normal("housing_start", "K", 0.0, 20.0, "housing minus the mean of T1 and T2, at the start"),
    log_normal("probe", "mm", 2.5, 0.6, "diameter of the T2 probe's tip (eqs. 11-12)"),
    normal("t2_offset", "K", 0.0, 1.0, "constant offset of T2 minus that of T1"),
    log_normal("noise", "K", 0.4, 0.8, "residual beyond noise and model, one standard deviation"),
];

/// Values of all parameters, in the order of [`PARAMETERS`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Values(pub(crate) [f64; COUNT]);

impl Parameter {
    /// Value at this number of prior standard deviations above the middle.
    pub fn at(&self, standard: f64) -> f64 {
        match self.spread {
            Spread::Normal => self.middle + self.width * standard,
            Spread::LogNormal => self.middle * (self.width * standard).exp(),
        }
    }
}

impl Values {
    /// From standard normal numbers, the coordinates of the sampler.
    pub fn of_standard(standard: &[f64; COUNT]) -> Self {
        Values(std::array::from_fn(|i| PARAMETERS[i].at(standard[i])))
    }

    /// Replaces the value of one parameter; unchanged for an unknown name.
    pub(crate) fn with(mut self, name: &str, value: f64) -> Self {
        if let Some(place) = PARAMETERS.iter().position(|parameter| parameter.name == name) {
            self.0[place] = value;
        }
        self
    }
}
