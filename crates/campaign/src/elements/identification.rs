//! `identification:` with its `window` and `stabilisation`.

use crate::checking::Check;
use crate::si_values::element;
use crate::units::{Duration, Fraction, Kind, Quantity};
use mapper_core::{ALPHA_AREA_SIGMA_RATIO, JointSettings, Method, SettleBands, WindowRule};
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

element! {
    /// Variations over the window within which a point counts as settled.
    pub(crate) SettleBandsElement for SettleBands {
        /// Shaft speed; 1.5 % if none is given.
        speed => speed_ratio: Quantity<Fraction> [extend("x-above" = "0 %", "x-max" = "100 %"), example = &"1.5 %"];
        /// Compressor flow; 0.8 % if none is given.
        flow => flow_ratio: Quantity<Fraction> [extend("x-above" = "0 %", "x-max" = "100 %"), example = &"0.8 %"];
        /// Pressure ratio; 2 % if none is given.
        pressure_ratio => pressure_ratio_ratio: Quantity<Fraction> [extend("x-above" = "0 %", "x-max" = "100 %"), example = &"2 %"];
    }
}

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum WindowFile {
    Named(NamedWindow),
    Fixed(FixedWindow),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedWindow {
    Auto,
}

/// Part of the step, in time after the jump.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FixedWindow {
    /// Start, after the jump.
    #[schemars(extend("x-min" = "0 s"))]
    start: Quantity<Duration>,
    /// End, after the jump.
    #[schemars(extend("x-above" = "0 s"), example = &"110 s")]
    end: Quantity<Duration>,
}

impl From<WindowFile> for WindowRule {
    fn from(file: WindowFile) -> Self {
        match file {
            WindowFile::Named(NamedWindow::Auto) => WindowRule::Auto,
            WindowFile::Fixed(FixedWindow { start, end }) => {
                WindowRule::Fixed { start_s: start.value, end_s: end.value }
            }
        }
    }
}

/// Checks that a window begins before it ends, and ends within the dwell.
pub(crate) fn check(check: &mut Check<'_>) {
    let end_path = steps!["identification", "window", "end"];
    let start = check.quantity(Kind::Duration, &steps!["identification", "window", "start"]);
    let end = check.quantity(Kind::Duration, &end_path);
    let dwell = check.quantity(Kind::Duration, &steps!["timing", "dwell"]);
    if let (Some((start_s, start)), Some((end_s, end))) = (start, end)
        && start_s >= end_s
    {
        let message = format!("the window ends at `{end}`, not after its start at `{start}`");
        check.note(FindingKind::Conflict, &end_path, message, "`end` must be after `start`");
    }
    if let (Some((end_s, end)), Some((dwell_s, dwell))) = (end, dwell)
        && end_s > dwell_s
    {
        let message = format!("the window ends at `{end}`, beyond the dwell of `{dwell}`");
        let remedy = "end it earlier, or lengthen `timing.dwell`";
        check.note(FindingKind::Conflict, &end_path, message, remedy);
    }
}

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
    stabilisation: Option<SettleBandsElement>,
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
        let mut settle_bands = SettleBands::default();
        self.stabilisation.unwrap_or_default().apply(&mut settle_bands);
        Identification {
            method: self.method.unwrap_or(Method::Joint),
            window: self.window.map_or(WindowRule::Auto, WindowRule::from),
            alpha_area_ratio: self.alpha_area.unwrap_or(alpha_area_ratio),
            alpha_area_sigma_ratio: self.alpha_area_sigma.unwrap_or(ALPHA_AREA_SIGMA_RATIO),
            settle_bands,
            joint: self.joint,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::any;
    use mapper_core::Choice;

    #[test]
    fn what_is_left_out_keeps_its_default() {
        let default = SettleBands::default();
        let read = |text| {
            let mut bands = default;
            any::<SettleBandsElement>(text).map(|element| element.apply(&mut bands)).map(|()| bands)
        };
        assert_eq!(read("{}").unwrap(), default);
        assert_eq!(read("{flow: 3 %}").unwrap(), SettleBands { flow_ratio: 0.03, ..default });
        assert!(read("{flow: 3}").is_err() && read("{fow: 3 %}").is_err());
    }

    #[test]
    fn both_forms() {
        let read = |text| crate::testing::any::<WindowFile>(text).map(WindowRule::from);
        assert_eq!(read("auto").unwrap(), WindowRule::Auto);
        let fixed = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
        assert_eq!(read("{start: 10 s, end: 110 s}").unwrap(), fixed);
        assert!(read("manual").is_err() && read("{start: 10 s}").is_err());
    }

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
