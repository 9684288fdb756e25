//! `identification:`

use crate::elements::evaluation::settle_bands::SettleBandsElement;
use crate::elements::evaluation::window::WindowFile;
use mapper_core::{ALPHA_AREA_SIGMA_RATIO, JointSettings, Method, SettleBands, WindowRule};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the identification.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Identification {
    /// Method.
    pub method: Method,
    /// Part of each step that is evaluated.
    pub window: WindowRule,
    /// Assumed share of the internal area before compression, alpha_A, 0..1.
    pub alpha_area_ratio: f64,
    /// Uncertainty of that share, one standard deviation.
    pub alpha_area_sigma_ratio: f64,
    /// Criterion for a settled point.
    pub settle_bands: SettleBands,
    /// Parameters of the joint method.
    pub joint: JointSettings,
}

/// Method that identifies efficiency and heat-transfer coefficient.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IdentificationFile {
    /// `joint`, the default, fits all points together; `dynamic` identifies both from the transient of each step alone, as in the paper; `steady` is conventional mapping.
    #[schemars(with = "Option<MethodName>")]
    method: Option<Method>,
    /// Part of the step that is evaluated: `auto`, the default, begins when speed, flow and pressure ratio have settled; or `start` and `end` after the jump.
    #[schemars(example = &"auto")]
    window: Option<WindowFile>,
    /// Assumed share of the internal area before compression, a plain number from 0 to 1; the machine's if none is given.
    #[schemars(range(min = 0, max = 1), example = 0.0)]
    alpha_area: Option<f64>,
    /// Uncertainty of the assumed share, one standard deviation, a plain number; 0.15 if none is given. `dynamic` cannot identify the share, so its intervals contain this uncertainty; 0 treats the assumed share as exact.
    #[schemars(range(min = 0, max = 1), example = 0.15)]
    alpha_area_sigma: Option<f64>,
    /// Variations within which a point counts as settled.
    #[serde(default, deserialize_with = "SettleBandsElement::deserialize")]
    #[schemars(with = "SettleBandsElement")]
    stabilisation: SettleBands,
    /// Parameters that `joint` identifies or keeps at their declared values; by default it identifies all.
    #[serde(default)]
    joint: JointSettings,
}

/// The methods that a campaign may choose.
#[derive(JsonSchema)]
#[serde(rename_all = "snake_case")]
#[expect(dead_code, reason = "only its schema is used: `Method` has a further variant for imported maps")]
enum MethodName {
    Dynamic,
    Joint,
    Steady,
}

impl IdentificationFile {
    /// With the machine's own alpha_A if the file does not give it.
    pub(crate) fn identification(self, alpha_area_ratio: f64) -> Identification {
        Identification {
            method: self.method.unwrap_or(Method::Joint),
            window: self.window.map_or(WindowRule::Auto, WindowRule::from),
            alpha_area_ratio: self.alpha_area.unwrap_or(alpha_area_ratio),
            alpha_area_sigma_ratio: self.alpha_area_sigma.unwrap_or(ALPHA_AREA_SIGMA_RATIO),
            settle_bands: self.stabilisation,
            joint: self.joint,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::Choice;

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<IdentificationFile>(text).unwrap().identification(0.2);
        let plain = Identification {
            method: Method::Joint,
            window: WindowRule::Auto,
            alpha_area_ratio: 0.2,
            alpha_area_sigma_ratio: 0.15,
            settle_bands: SettleBands::default(),
            joint: JointSettings::default(),
        };
        assert_eq!(read("{}"), plain);
        let joint = JointSettings { probe: Choice::Fixed, ..plain.joint };
        let written = Identification {
            method: Method::Dynamic,
            alpha_area_ratio: 0.0,
            alpha_area_sigma_ratio: 0.0,
            joint,
            ..plain
        };
        assert_eq!(
            read("{method: dynamic, alpha_area: 0, alpha_area_sigma: 0, joint: {probe: fixed}}"),
            written
        );
    }
}
