//! The sealed answer of a case: its causes, and efficiency and heat transfer at each point.

use crate::blind::cases::case::Case;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// The answer of one case, in the form that `score.py` reads as NAME.truth.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Name of the case.
    pub name: String,
    /// Strength of each cause: a number, an object with one number per parameter, or a sentence for an outside cause.
    pub effects: Map<String, Value>,
    /// Length of each cause's signature in the presence of the others, in sigmas, on a recording of the same campaign.
    #[serde(default)]
    pub sigmas: BTreeMap<String, f64>,
    /// The points, in order of their steps.
    pub points: Vec<TruthPoint>,
}

/// One point at the end of its step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TruthPoint {
    /// Valve opening relative to the nominal area.
    pub valve: f64,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Efficiency, fraction.
    pub eta: f64,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h: f64,
}

impl Truth {
    pub(crate) fn new(case: &Case, points: Vec<TruthPoint>) -> Self {
        let effects = case
            .causes
            .iter()
            .map(|cause| {
                let info = cause.effect.info();
                let value = match (info.parameters.as_slice(), cause.values.as_slice()) {
                    ([parameter], [value]) if info.id.starts_with("X_") => {
                        json!(format!(
                            "{}: {} = {value} {}",
                            info.description, parameter.name, parameter.unit
                        ))
                    }
                    ([_], [value]) => json!(value),
                    (parameters, values) => parameters
                        .iter()
                        .zip(values)
                        .map(|(parameter, value)| (parameter.name.to_string(), json!(value)))
                        .collect::<Map<String, Value>>()
                        .into(),
                };
                (info.id.to_string(), value)
            })
            .collect();
        let ids = case.causes.iter().map(|cause| cause.effect.info().id.to_string());
        let sigmas = ids.zip(case.sigmas.iter().copied()).collect();
        Truth { name: case.name.clone(), effects, sigmas, points }
    }
}
