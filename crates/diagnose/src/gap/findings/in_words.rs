//! Effect sizes as text in engineering terms.

use mapper_core::unit_factors::{CM2_PER_M2, G_PER_KG, MM_PER_M, PERCENT};
use mapper_core::with_unit;
use mapper_physics::laws::turbine::at_150_krpm;
use mapper_physics::rig::effect::EffectParameter;

/// A parameter value as text: "+5 %" for a factor of 1.05, "370 W at 150 krpm" for friction.
pub(crate) fn size(parameter: &EffectParameter, value: f64) -> String {
    match parameter.unit.as_ref() {
        "1" if parameter.neutral == 1.0 => {
            format!("{}{} %", sign(value - 1.0), figures(PERCENT * (value - 1.0).abs()))
        }
        "1" => format!("{} %", figures(PERCENT * value)),
        "m" => format!("{} mm", figures(MM_PER_M * value)),
        "kg/kg" => format!("{} g/kg", figures(G_PER_KG * value)),
        "m2" => format!("{} cm2 of black surface", figures(CM2_PER_M2 * value)),
        "W s2/rad2" => at_150_krpm(value),
        unit => with_unit(figures(value), unit),
    }
}

fn sign(value: f64) -> &'static str {
    if value < 0.0 { "-" } else { "+" }
}

/// Three figures, without trailing zeros.
fn figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (2 - value.abs().log10().floor() as i32).max(0);
    let text = format!("{value:.*}", decimals as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_by_hand() {
        let parameter = |unit: &'static str, neutral: f64| EffectParameter {
            name: "x".into(),
            unit: unit.into(),
            low: 0.0,
            high: 2.0,
            neutral,
            typical_step: 0.1,
        };
        for (unit, neutral, value, expected) in [
            ("1", 1.0, 1.05, "+5 %"),
            ("1", 1.0, 0.9367, "-6.33 %"),
            ("1", 0.0, 0.12, "12 %"),
            ("m", 0.0, 1.5e-3, "1.5 mm"),
            ("W s2/rad2", 0.0, 1.49e-6, "370 W at 150 krpm"),
            ("m2", 0.0, 4e-3, "40 cm2 of black surface"),
            ("kg/kg", 0.0, 0.012, "12 g/kg"),
            ("Pa", 0.0, -310.0, "-310 Pa"),
        ] {
            assert_eq!(size(&parameter(unit, neutral), value), expected);
        }
    }
}
