//! What the points of a campaign share, for people.

use mapper_core::{Origin, SharedValue, ThermalModel};
use std::fmt::Write;

/// The thermal model as lines of text, one for each number.
pub fn thermal_text(thermal: &ThermalModel) -> String {
    let mut text = String::from("\nshared by all points (+/- 95 %):\n");
    let mut line = |name: &str, value: &SharedValue, scale: f64, unit: &str, decimals: usize| {
        let half = 1.96 * scale * value.uncertainty.combined_standard_error();
        let _ = match (value.value, value.origin) {
            (Some(number), Origin::Assumed) => {
                writeln!(text, "  {name:<34} {:.decimals$} {unit} (assumed)", scale * number)
            }
            (Some(number), _) => {
                writeln!(text, "  {name:<34} {:.decimals$} +/- {half:.decimals$} {unit}", scale * number)
            }
            (None, _) => {
                writeln!(text, "  {name:<34} the recording cannot tell (+/- {half:.decimals$} {unit})")
            }
        };
    };
    if let Some(law) = &thermal.convection {
        line("Nusselt coefficient", &law.coefficient, 1.0, "", 6);
        line("Nusselt exponent", &law.exponent, 1.0, "", 4);
    }
    line("alpha_A", &thermal.alpha_area_ratio, 1.0, "", 3);
    line("T2 probe diameter", &thermal.probe_diameter_m, 1e3, "mm", 2);
    line("direction factor of h", &thermal.direction_factor, 1.0, "", 3);
    for (channel, offset) in &thermal.offsets {
        let decimals = if channel.unit() == "Pa" { 0 } else { 2 };
        line(&format!("offset of {channel}"), offset, 1.0, channel.unit(), decimals);
    }
    if let Some(law) = &thermal.convection {
        let _ = writeln!(
            text,
            "  the law holds from Re {:.0} to {:.0}; single points lie {:.1} % off it",
            law.reynolds_range.0,
            law.reynolds_range.1,
            100.0 * law.deviation_ratio
        );
    }
    // Values that the recording allows at 95 %, by the profile: three and more of them are no answer.
    let allowed: Vec<f64> = thermal
        .alpha_area_profile
        .iter()
        .filter(|point| point.square < 3.84)
        .map(|point| point.value)
        .collect();
    if let [first, _, .., last] = allowed.as_slice()
        && last - first > 0.15
    {
        let _ = writeln!(
            text,
            "  the profile of alpha_A is flat: {first:.1} to {last:.1} fit the recording equally well"
        );
    }
    for pair in &thermal.entangled {
        let _ = writeln!(
            text,
            "  {} and {} can hardly be told apart (correlation {:+.2})",
            pair.first, pair.second, pair.correlation
        );
    }
    for doubt in &thermal.doubts {
        let _ = writeln!(text, "  doubt: {doubt}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Entangled, ProfilePoint};

    /// What the recording cannot tell reaches people and programs.
    #[test]
    fn what_can_not_be_told_apart_is_said() {
        let unknown =
            SharedValue { value: None, origin: Origin::NotIdentifiable, ..SharedValue::assumed(0.0) };
        let thermal = ThermalModel {
            convection: None,
            internal_area_m2: 29e-3,
            alpha_area_ratio: unknown,
            alpha_area_profile: [(0.0, 0.0), (0.1, 0.5), (0.2, 1.1), (0.3, 9.0)]
                .map(|(value, square)| ProfilePoint { value, square })
                .to_vec(),
            inlet: None,
            probe_diameter_m: SharedValue::assumed(0.0),
            direction_factor: SharedValue::assumed(1.0),
            offsets: std::collections::BTreeMap::new(),
            entangled: vec![Entangled {
                first: "alpha_A".to_owned(),
                second: "direction factor".to_owned(),
                correlation: 0.97,
            }],
            doubts: Vec::new(),
        };
        let text = thermal_text(&thermal);
        assert!(text.contains("the recording cannot tell"), "{text}");
        assert!(text.contains("flat: 0.0 to 0.2"), "{text}");
        assert!(text.contains("alpha_A and direction factor can hardly be told apart"), "{text}");
        let json = serde_json::to_value(&thermal).unwrap_or_default();
        assert_eq!(json["alpha_area_profile"][3]["value"], 0.3);
        assert_eq!(json["entangled"][0]["correlation"], 0.97);
        assert_eq!(json["alpha_area_ratio"]["value"], serde_json::Value::Null);
    }
}
