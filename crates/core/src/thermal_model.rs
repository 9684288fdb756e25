//! What all points of a campaign share: how gas and compressor housing exchange heat, and what the sensors add.

use crate::{Channel, EstimateUncertainty, InletConvection};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a number of the thermal model came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Found from the recording.
    Fitted,
    /// Taken as declared; the recording was not asked.
    Assumed,
    /// The recording says no more about it than was declared beforehand.
    NotIdentifiable,
}

/// A number with what is known of its error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SharedValue {
    /// The value; `None` where the recording cannot tell it from others.
    pub value: Option<f64>,
    /// Its standard errors by origin, unit of the value.
    pub uncertainty: EstimateUncertainty,
    /// Where it comes from.
    pub origin: Origin,
}

impl SharedValue {
    /// A value that was taken as declared, without error.
    pub fn assumed(value: f64) -> Self {
        SharedValue {
            value: Some(value),
            uncertainty: EstimateUncertainty::default(),
            origin: Origin::Assumed,
        }
    }

    /// The 95 % interval, where there is a value.
    pub fn interval_95(&self) -> Option<(f64, f64)> {
        self.value
            .map(|value| crate::confidence_interval_95(value, self.uncertainty.combined_standard_error()))
    }
}

/// The convection law `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14` of the compressor's inner walls (Burke et al., eq. 9),
/// fitted over all points. Reynolds number `4 m/(pi D mu)`; properties at the temperature of compression without heat
/// transfer, `mu_skin` at that of the housing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ConvectionLaw {
    /// Characteristic length D, m.
    pub diameter_m: f64,
    /// Coefficient a. Its error is that of `ln a` at [`reynolds_reference`](Self::reynolds_reference), times a.
    pub coefficient: SharedValue,
    /// Exponent b.
    pub exponent: SharedValue,
    /// Reynolds number at which coefficient and exponent are uncorrelated: the mean of the points' logarithms.
    pub reynolds_reference: f64,
    /// Smallest and largest Reynolds number of the points: beyond lies extrapolation.
    pub reynolds_range: (f64, f64),
    /// Root mean square of the single points' deviation from the law, ratio.
    pub deviation_ratio: f64,
}

/// Two shared numbers that the recording hardly tells apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Entangled {
    /// Symbol of one.
    pub first: String,
    /// Symbol of the other.
    pub second: String,
    /// Correlation of their estimates, -1..1.
    pub correlation: f64,
}

/// One point of a profile: a number held at a value, all others fitted again.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ProfilePoint {
    /// The value, unit of the number.
    pub value: f64,
    /// Sum of squared residuals in standard deviations, minus that of the best point of the profile: below 3.84 the
    /// recording allows the value at 95 %.
    pub square: f64,
}

/// What the heat-transfer coefficient before the wheel was taken to follow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FoundInlet {
    /// What it follows in the numbers that stand beside this.
    pub convection: InletConvection,
    /// Diameter of the inlet that its own law takes, m.
    pub diameter_m: f64,
    /// `Assumed` where it was declared and the recording was not asked, `Fitted` where the recording tells,
    /// `NotIdentifiable` where it does not: then the intervals contain what the other would have given.
    pub origin: Origin,
    /// Probability that it is so, 0..1, from the recording and that what is declared holds more often than not; 1 where
    /// the recording was not asked.
    pub probability: f64,
    /// alpha_A as the other reading has it; `None` where it was not tried, or alpha_A is not sought.
    pub alpha_area_otherwise_ratio: Option<f64>,
}

/// Result of a joint identification that belongs to no single point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThermalModel {
    /// The convection law; `None` where each point has its own coefficient.
    pub convection: Option<ConvectionLaw>,
    /// Internal area A_c that the coefficients refer to, m2.
    pub internal_area_m2: f64,
    /// Share of the internal area before compression, alpha_A.
    pub alpha_area_ratio: SharedValue,
    /// How much worse everything else fits with alpha_A held at a value; empty where it was not fitted.
    #[serde(default)]
    pub alpha_area_profile: Vec<ProfilePoint>,
    /// What h before the wheel follows; `None` where it makes no difference, since no area lies there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inlet: Option<FoundInlet>,
    /// Tip diameter of the T2 probe (eqs. 11-12), m; 0 is an ideal probe.
    pub probe_diameter_m: SharedValue,
    /// Factor on the coefficient where the metal is hotter than the gas it touches.
    pub direction_factor: SharedValue,
    /// Offsets of readings (reading less true value), by channel, K or Pa.
    pub offsets: BTreeMap<Channel, SharedValue>,
    /// Numbers that can hardly be told apart (correlation beyond 0.95 in size).
    pub entangled: Vec<Entangled>,
    /// What speaks against the model, one sentence each; empty where nothing does.
    pub doubts: Vec<String>,
}
