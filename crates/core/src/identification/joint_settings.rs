//! Parameters that a joint identification estimates, and their prior assumptions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether a shared parameter keeps its declared value or is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::flatten_to_names)]
pub enum Choice {
    /// As declared.
    Fixed,
    /// Estimated together with the points.
    #[default]
    Fitted,
}

/// The shared parameters of the joint method.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-removed" = { "direction": "write `heating_cooling_ratio: fixed` or `heating_cooling_ratio: fitted`" }))]
pub struct JointSettings {
    /// Share of the internal area before compression.
    pub alpha_area: Choice,
    /// Diameter of the T2 probe; `fixed` takes that of `sensors.T2.probe_diameter`.
    pub probe: Choice,
    /// Factor on the heat-transfer coefficient if the metal is hotter than the gas; 1 if `fixed`.
    pub heating_cooling_ratio: Choice,
    /// Whether the heat-transfer coefficient upstream of the wheel equals that downstream or follows the inlet's own diameter; as in
    /// `machine.geometry` if `fixed`.
    pub inlet_h: Choice,
    /// Offsets of the sensors, with their declared uncertainty as prior.
    pub offsets: Choice,
}

impl JointSettings {
    /// Keys of the parameters that are taken as declared.
    pub fn held_fixed(&self) -> Vec<String> {
        let parameters = [
            ("alpha_area", self.alpha_area),
            ("probe", self.probe),
            ("heating_cooling_ratio", self.heating_cooling_ratio),
            ("inlet_h", self.inlet_h),
            ("offsets", self.offsets),
        ];
        let fixed = parameters.into_iter().filter(|(_, choice)| *choice == Choice::Fixed);
        fixed.map(|(key, _)| key.to_owned()).collect()
    }
}

/// Default uncertainty of the assumed alpha_A, one standard deviation: if it has not been
/// measured, a tenth to a quarter of the area may lie before the wheel.
pub const ALPHA_AREA_SIGMA_RATIO: f64 = 0.15;
