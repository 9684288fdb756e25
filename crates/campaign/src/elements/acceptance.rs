//! `acceptance:` and `drift:`, what is judged during and after a run.

use crate::elements::output::SensorSymbol;
use crate::si_values::value_or;
use crate::units::{Duration, Fraction, Quantity};
use mapper_core::{ACCEPTANCE_WINDOW_S, AcceptanceCriteria, Channel, OnDrift};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum AcceptanceFile {
    Preset(AcceptancePreset),
    Own(OwnCriteria),
}

#[derive(Debug, Deserialize, JsonSchema)]
pub(crate) enum AcceptancePreset {
    #[serde(rename = "PTC 10")]
    Ptc10,
}

/// Criteria of another code.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OwnCriteria {
    /// Name of the code.
    #[schemars(example = &"SAE J1826")]
    name: String,
    /// Edition and clause of the values.
    source: String,
    /// Window at the end of each step in which the criteria are judged; 20 s if none is given.
    #[schemars(extend("x-above" = "0 s"))]
    window: Option<Quantity<Duration>>,
    /// Permitted fluctuation of each channel: highest minus lowest reading, relative to the mean; temperatures and pressures absolute.
    #[serde(default)]
    #[schemars(with = "BTreeMap<SensorSymbol, Fluctuation>")]
    fluctuation: BTreeMap<Channel, Fluctuation>,
    /// Permitted losses in the energy balance, relative to the turbine power.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"5 %")]
    heat_balance: Option<Quantity<Fraction>>,
}

/// Permitted fluctuation of a channel.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
struct Fluctuation(
    #[schemars(extend("x-above" = "0 %", "x-max" = "100 %"), example = &"0.5 %")] Quantity<Fraction>,
);

impl From<AcceptanceFile> for AcceptanceCriteria {
    fn from(file: AcceptanceFile) -> Self {
        match file {
            AcceptanceFile::Preset(AcceptancePreset::Ptc10) => AcceptanceCriteria::ptc_10(),
            AcceptanceFile::Own(own) => AcceptanceCriteria {
                name: own.name,
                source: own.source,
                window_s: value_or(own.window, ACCEPTANCE_WINDOW_S),
                fluctuation_ratio: own
                    .fluctuation
                    .into_iter()
                    .map(|(at, ratio)| (at, ratio.0.value))
                    .collect(),
                heat_balance_ratio: own.heat_balance.map(|ratio| ratio.value),
            },
        }
    }
}

/// Reaction to drift.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriftFile {
    /// `hold` ends the run in its safe state; `zero` also requests a zero of the sensors; `continue` notes the drift and continues the run.
    #[schemars(example = &"hold")]
    pub(crate) on_drift: OnDrift,
}
