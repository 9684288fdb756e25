//! The parameters that the points of a campaign share, as text.

use crate::point_results::warning_text::model_doubt_text;
use mapper_core::{IdentifiedInlet, InletConvection, Origin, SharedValue, ThermalModel, half_width_95};
use std::fmt::Write;

/// The thermal model as lines of text, one for each number.
pub fn thermal_text(thermal: &ThermalModel) -> String {
    let mut text = String::from("\nshared by all points (+/- 95 %):\n");
    let mut line = |name: &str, value: &SharedValue, scale: f64, unit: &str, decimals: usize| {
        let half = half_width_95(scale * value.uncertainty.combined_standard_error());
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        // Rounded to zero, a number has no sign.
        let rounded = |number: f64| {
            let unsigned = (scale * number).abs() < 0.5 * 0.1f64.powi(decimals as i32);
            if unsigned { 0.0 } else { scale * number }
        };
        let _ = match (value.value, value.origin) {
            (Some(number), Origin::Assumed) => {
                writeln!(text, "  {name:<34} {:.decimals$}{unit} (assumed)", rounded(number))
            }
            (Some(number), _) => {
                writeln!(text, "  {name:<34} {:.decimals$} +/- {half:.decimals$}{unit}", rounded(number))
            }
            (None, _) => {
                writeln!(
                    text,
                    "  {name:<34} not identifiable from the recording (+/- {half:.decimals$}{unit})"
                )
            }
        };
    };
    if let Some(law) = &thermal.convection {
        line("Nusselt coefficient", &law.coefficient, 1.0, "", 6);
        line("Nusselt exponent", &law.exponent, 1.0, "", 4);
    }
    line("alpha_A", &thermal.alpha_area_ratio, 1.0, "", 3);
    line("T2 probe diameter", &thermal.probe_diameter_m, 1e3, "mm", 2);
    line("heating/cooling ratio of h", &thermal.heating_cooling_ratio, 1.0, "", 3);
    for (channel, offset) in &thermal.offsets {
        let decimals = if channel.unit() == "Pa" { 0 } else { 2 };
        line(&format!("offset of {channel}"), offset, 1.0, channel.unit(), decimals);
    }
    if let Some(law) = &thermal.convection {
        let _ = writeln!(
            text,
            "  fitted from Re {:.0} to {:.0}; single points deviate by {:.1} %",
            law.reynolds_range.0,
            law.reynolds_range.1,
            100.0 * law.deviation_ratio
        );
    }
    if let Some(inlet) = &thermal.inlet {
        let _ = writeln!(text, "  {}", inlet_text(inlet));
    }
    for pair in &thermal.entangled {
        let _ = writeln!(
            text,
            "  {} and {} are barely distinguishable (correlation {:+.2})",
            pair.first, pair.second, pair.correlation
        );
    }
    for doubt in &thermal.doubts {
        let _ = writeln!(text, "  doubt: {}", model_doubt_text(doubt));
    }
    text
}

/// The relation for h before the wheel, and whether the recording determines it, as one line without its end.
pub(crate) fn inlet_text(inlet: &IdentifiedInlet) -> String {
    let law_name = |convection: InletConvection| match convection {
        InletConvection::Shared => "that behind it".to_owned(),
        InletConvection::Own => format!("the same law at the inlet's {:.1} mm", 1e3 * inlet.diameter_m),
    };
    let law = law_name(inlet.convection);
    match (inlet.origin, inlet.alpha_area_otherwise_ratio) {
        (Origin::Assumed, _) => format!("h before the wheel: {law} (declared)"),
        (Origin::Fitted, _) => {
            format!("h before the wheel: {law}, says the recording (probability {:.2})", inlet.probability)
        }
        (Origin::NotIdentifiable, None) => format!(
            "h before the wheel: {law}; the recording does not distinguish it from {} (probability {:.2}): the intervals contain both",
            law_name(inlet.convection.other()),
            inlet.probability
        ),
        (Origin::NotIdentifiable, Some(alpha)) => format!(
            "h before the wheel: {law}; the recording does not distinguish it from {}, with which alpha_A would be {alpha:.3} (probability {:.2}): the intervals contain both",
            law_name(inlet.convection.other()),
            inlet.probability
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::CorrelatedPair;

    #[test]
    fn the_correlation_of_h_before_the_wheel_and_its_evidence_are_reported() {
        let open = IdentifiedInlet {
            convection: InletConvection::Shared,
            diameter_m: 0.04,
            origin: Origin::NotIdentifiable,
            probability: 0.67,
            alpha_area_otherwise_ratio: Some(0.2069),
        };
        let text = inlet_text(&open);
        assert!(text.contains("inlet's 40.0 mm") && text.contains("0.207"), "{text}");
        assert!(text.contains("the intervals contain both"), "{text}");
        let fitted = IdentifiedInlet { convection: InletConvection::Own, origin: Origin::Fitted, ..open };
        assert!(
            inlet_text(&fitted)
                .ends_with("the same law at the inlet's 40.0 mm, says the recording (probability 0.67)")
        );
        assert!(inlet_text(&IdentifiedInlet { origin: Origin::Assumed, ..open }).ends_with("(declared)"));
    }

    /// Parameters that the recording cannot determine are reported in text and in files.
    #[test]
    fn parameters_that_are_not_identifiable_are_reported() {
        let unknown =
            SharedValue { value: None, origin: Origin::NotIdentifiable, ..SharedValue::assumed(0.0) };
        let thermal = ThermalModel {
            convection: None,
            internal_area_m2: 29e-3,
            alpha_area_ratio: unknown,
            inlet: None,
            probe_diameter_m: SharedValue::assumed(0.0),
            heating_cooling_ratio: SharedValue::assumed(1.0),
            offsets: std::collections::BTreeMap::new(),
            entangled: vec![CorrelatedPair {
                first: "alpha_A".to_owned(),
                second: "heating/cooling ratio".to_owned(),
                correlation: 0.97,
            }],
            doubts: Vec::new(),
        };
        let text = thermal_text(&thermal);
        assert!(!text.contains("before the wheel"), "what makes no difference is not reported: {text}");
        assert!(text.contains("not identifiable from the recording"), "{text}");
        assert!(text.contains("alpha_A and heating/cooling ratio are barely distinguishable"), "{text}");
        let json = serde_json::to_value(&thermal).unwrap_or_default();
        assert_eq!(json["entangled"][0]["correlation"], 0.97);
        assert_eq!(json["alpha_area_ratio"]["value"], serde_json::Value::Null);
    }
}
