//! The identified heat transfer of a machine, and the models of h before the wheel.

use crate::{Channel, EstimateUncertainty, ModelDoubt};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Origin of a parameter of the thermal model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Estimated from the recording.
    Fitted,
    /// The declared value; the recording was not used.
    Assumed,
    /// The recording adds no information to the declared value.
    NotIdentifiable,
}

/// A parameter with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SharedValue {
    /// The value; `None` if the recording cannot distinguish it from other parameters.
    pub value: Option<f64>,
    /// Standard errors by origin, unit of the value.
    pub uncertainty: EstimateUncertainty,
    /// Origin.
    pub origin: Origin,
}

impl SharedValue {
    /// A declared value without error.
    pub fn assumed(value: f64) -> Self {
        SharedValue {
            value: Some(value),
            uncertainty: EstimateUncertainty::default(),
            origin: Origin::Assumed,
        }
    }

    /// The 95 % interval, if there is a value.
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
    /// Reynolds number at which coefficient and exponent are uncorrelated: the geometric mean of the points.
    pub reynolds_reference: f64,
    /// Smallest and largest Reynolds number of the points: values outside are an extrapolation.
    pub reynolds_range: (f64, f64),
    /// Root mean square of the deviations of the points from the law, ratio.
    pub deviation_ratio: f64,
}

impl ConvectionLaw {
    /// `a Re^b` at [`reynolds_reference`](Self::reynolds_reference), where its error is uncorrelated with that of the exponent. `None` without a
    /// coefficient or an exponent.
    pub fn nusselt_at_reference(&self) -> Option<SharedValue> {
        let by_coefficient = self.reynolds_reference.powf(self.exponent.value?);
        let EstimateUncertainty { noise_standard_error, bias_standard_error } = self.coefficient.uncertainty;
        Some(SharedValue {
            value: Some(self.coefficient.value? * by_coefficient),
            uncertainty: EstimateUncertainty {
                noise_standard_error: noise_standard_error * by_coefficient,
                bias_standard_error: bias_standard_error * by_coefficient,
            },
            origin: self.coefficient.origin,
        })
    }

    /// Standard error of `ln a`, which is that of the law at a Reynolds number of 1, far outside of the points; and its correlation with the
    /// exponent.
    pub fn ln_coefficient_error(&self) -> Option<(f64, f64)> {
        let at_reference = self.coefficient.uncertainty.combined_standard_error() / self.coefficient.value?;
        let by_exponent = self.reynolds_reference.ln() * self.exponent.uncertainty.combined_standard_error();
        let standard_error = at_reference.hypot(by_exponent);
        Some((standard_error, if standard_error > 0.0 { -by_exponent / standard_error } else { 0.0 }))
    }

    /// The 95 % interval of the coefficient a.
    pub fn coefficient_interval_95(&self) -> Option<(f64, f64)> {
        let half = crate::half_width_95(self.ln_coefficient_error()?.0);
        let value = self.coefficient.value?;
        Some((value * (-half).exp(), value * half.exp()))
    }
}

/// Two shared parameters that are hardly distinguishable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CorrelatedPair {
    /// Symbol of the first parameter.
    pub first: String,
    /// Symbol of the second parameter.
    pub second: String,
    /// Correlation of their estimates, -1..1.
    pub correlation: f64,
}

/// The assumed model of the heat-transfer coefficient before the wheel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IdentifiedInlet {
    /// The model used for the other parameters of this result.
    pub convection: InletConvection,
    /// Diameter of the inlet in its own law, m.
    pub diameter_m: f64,
    /// `Assumed` if it was declared and the recording was not used, `Fitted` if the recording determines it,
    /// `NotIdentifiable` if it does not: then the intervals contain the results of the other model.
    pub origin: Origin,
    /// Probability of this model, 0..1, from the recording and a prior that favours the declared one; 1 if
    /// the recording was not used.
    pub probability: f64,
    /// alpha_A with the other model; `None` if it was not tried, or alpha_A is not estimated.
    pub alpha_area_otherwise_ratio: Option<f64>,
}

/// The compressor housing as its heat balance shows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IdentifiedHousing {
    /// Heat capacity over the declared one.
    pub capacity_ratio: SharedValue,
    /// Share of the heat capacity in an inner wall, or another part, with its own temperature; `None` if the housing is one node.
    pub inner_capacity_ratio: Option<SharedValue>,
    /// Conductance between that part and the one with the thermocouple, W/K.
    pub inner_conductance_w_k: Option<SharedValue>,
    /// Share of the part with the thermocouple in the area that the gas touches; `None` if the housing is one node, or an inner wall has
    /// all of the area.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outer_area_ratio: Option<SharedValue>,
    /// Share of a third part in the capacity that the second does not have; `None` if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub third_capacity_ratio: Option<SharedValue>,
    /// Conductance between the third part and that with the thermocouple, W/K.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub third_conductance_w_k: Option<SharedValue>,
    /// Conductance between housing and gas before the wheel that does not follow the law of h, W/K.
    pub inlet_conductance_w_k: SharedValue,
    /// Time constant of the thermocouple on the housing, s.
    pub tc_lag_s: SharedValue,
    /// Heat from another source than gas, bearing, turbine and cell, at 330 K, W.
    pub other_heat_w: SharedValue,
    /// Its part in proportion to the housing temperature, W/K.
    pub other_heat_w_k: SharedValue,
    /// Spread of the heat that the balances of single steps do not have, one standard deviation, W.
    pub step_heat_w: f64,
}

/// Results of a joint identification that concern all points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThermalModel {
    /// The convection law; `None` if each point has its own coefficient.
    pub convection: Option<ConvectionLaw>,
    /// Internal area A_c that the coefficients refer to, m2.
    pub internal_area_m2: f64,
    /// Share of the internal area before compression, alpha_A.
    pub alpha_area_ratio: SharedValue,
    /// Model of h before the wheel; `None` if no area lies before the wheel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inlet: Option<IdentifiedInlet>,
    /// Tip diameter of the T2 probe (eqs. 11-12), m; 0 is an ideal probe.
    pub probe_diameter_m: SharedValue,
    /// Factor on the coefficient if the metal is hotter than the gas it touches.
    #[serde(alias = "direction_factor")]
    pub heating_cooling_ratio: SharedValue,
    /// The housing by its heat balance; `None` if the balance was not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub housing: Option<IdentifiedHousing>,
    /// Offsets of readings (reading minus true value), by channel, K or Pa.
    pub offsets: BTreeMap<Channel, SharedValue>,
    /// Parameters that are nearly indistinguishable (absolute correlation above 0.95).
    pub entangled: Vec<CorrelatedPair>,
    /// Evidence against the model; empty if there is none.
    #[serde(serialize_with = "crate::json_messages::serialize", deserialize_with = "with_values")]
    pub doubts: Vec<ModelDoubt>,
}

/// Doubts of older files are sentences without values, and are dropped.
fn with_values<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<ModelDoubt>, D::Error> {
    let stored = Vec::<Value>::deserialize(deserializer)?;
    Ok(stored.into_iter().filter_map(|doubt| serde_json::from_value(doubt).ok()).collect())
}

/// Model of the heat-transfer coefficient upstream of the wheel. It matters only if part of the internal area lies upstream (alpha_A above 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::enums::flatten_to_names)]
pub enum InletConvection {
    /// The same coefficient upstream and downstream of the wheel, as in eqs. 1 and 3 of Burke et al.
    #[default]
    Shared,
    /// A separate coefficient, from the Nusselt law of the outlet with diameter and temperature of the inlet (their Appendix A).
    Own,
}

impl InletConvection {
    /// The other model.
    pub fn other(self) -> Self {
        match self {
            InletConvection::Shared => InletConvection::Own,
            InletConvection::Own => InletConvection::Shared,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two independent errors of plus and minus one standard deviation, at the reference and of the exponent: their law at Re = 1 has the stated
    /// spread and correlation.
    #[test]
    fn the_coefficient_has_the_error_of_an_extrapolation_to_one() {
        let with_error = |value: f64, standard_error: f64| SharedValue {
            uncertainty: EstimateUncertainty {
                noise_standard_error: standard_error,
                bias_standard_error: 0.0,
            },
            origin: Origin::Fitted,
            ..SharedValue::assumed(value)
        };
        let law = ConvectionLaw {
            diameter_m: 0.035,
            coefficient: with_error(0.004, 0.02 * 0.004),
            exponent: with_error(1.13, 0.01),
            reynolds_reference: 1.3e5,
            reynolds_range: (5e4, 3e5),
            deviation_ratio: 0.0,
        };
        let (standard_error, correlation) = law.ln_coefficient_error().unwrap();
        let draws = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(nusselt, exponent)| {
            (0.02 * nusselt - 0.01 * exponent * law.reynolds_reference.ln(), 0.01 * exponent)
        });
        let mean = |of: fn(&(f64, f64)) -> f64| draws.iter().map(of).sum::<f64>() / 4.0;
        let spread = mean(|(a, _)| a * a).sqrt();
        assert!((spread / standard_error - 1.0).abs() < 1e-9, "{spread} {standard_error}");
        let found = mean(|(a, b)| a * b) / spread / mean(|(_, b)| b * b).sqrt();
        assert!((found - correlation).abs() < 1e-9, "{found} {correlation}");
        let at_reference = law.nusselt_at_reference().unwrap();
        let relative = at_reference.uncertainty.combined_standard_error() / at_reference.value.unwrap();
        assert!((relative - 0.02).abs() < 1e-12);
    }
}
