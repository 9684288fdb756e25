//! The parameters that the points of a campaign share, for people and for other programs.

use crate::document::{Describe, Document};
use crate::formatting::{Message, significant_digits};
use mapper_core::{
    ConvectionLaw, IdentifiedInlet, InletConvection, Origin, SharedValue, ThermalModel, TurbineHousing,
    half_width_95,
};
use mapper_physics::gas::air::viscosity_pa_s;
use mapper_physics::laws::convection::coefficient_w_m2k;
use mapper_physics::laws::housing::{bearing_conductance_w_k, compressor_capacity_j_k, turbine_capacity_j_k};
use mapper_physics::machine::params::Params;
use serde::Serialize;
use serde_json::json;

impl Describe for ThermalModel {
    fn document(&self) -> Document {
        let mut rows: Vec<(String, String)> = Vec::new();
        let mut row = |name: &str, value: &SharedValue, scale: f64, unit: &str, decimals: usize| {
            rows.push((name.to_owned(), shared_value(value, scale, unit, decimals)));
        };
        if let Some(law) = &self.convection {
            if let Some(at_reference) = law.nusselt_at_reference() {
                row("a Re^b at the reference", &at_reference, 1.0, "", 1);
            }
            row("Nusselt exponent b", &law.exponent, 1.0, "", 4);
        }
        row("alpha_A", &self.alpha_area_ratio, 1.0, "", 3);
        row("T2 probe diameter", &self.probe_diameter_m, 1e3, "mm", 2);
        row("heating/cooling ratio of h", &self.heating_cooling_ratio, 1.0, "", 3);
        if let Some(housing) = &self.housing {
            row("preheating in the inlet", &housing.inlet_conductance_w_k, 1.0, "W/K", 2);
            row("heat capacity of the housing over the declared one", &housing.capacity_ratio, 1.0, "", 3);
            if let Some((share, conductance)) =
                housing.inner_capacity_ratio.as_ref().zip(housing.inner_conductance_w_k.as_ref())
            {
                let part = if housing.outer_area_ratio.is_some() { "second part" } else { "inner wall" };
                row(&format!("{part}: share of the heat capacity"), share, 1.0, "", 3);
                row(&format!("{part}: conductance to the rest"), conductance, 1.0, "W/K", 1);
            }
            if let Some(share) = &housing.outer_area_ratio {
                row("part with Tc: share of the area that the gas touches", share, 1.0, "", 3);
            }
            if let Some((share, conductance)) =
                housing.third_capacity_ratio.as_ref().zip(housing.third_conductance_w_k.as_ref())
            {
                row("third part: share of the capacity outside the second", share, 1.0, "", 3);
                row("third part: conductance to the part with Tc", conductance, 1.0, "W/K", 1);
            }
            row("lag of Tc", &housing.tc_lag_s, 1.0, "s", 2);
            row("heat from another source at 330 K", &housing.other_heat_w, 1.0, "W", 1);
            row("heat from another source by Tc", &housing.other_heat_w_k, 1.0, "W/K", 2);
        }
        for (channel, offset) in &self.offsets {
            let decimals = if channel.unit() == "Pa" { 0 } else { 2 };
            row(&format!("offset of {channel}"), offset, 1.0, channel.unit(), decimals);
        }
        let mut document = Document::default();
        document.facts("", rows);
        if let Some(law) = &self.convection {
            document.text(format!(
                "Nu = a Re^b Pr^(1/3) (mu/mu_wall)^0.14 with a = {}, fitted from Re {:.0} to {:.0}, reference {:.0}; single points deviate by {:.1} %",
                law.coefficient.value.map_or_else(|| "-".to_owned(), |a| significant_digits(a, 4)),
                law.reynolds_range.0,
                law.reynolds_range.1,
                law.reynolds_reference,
                100.0 * law.deviation_ratio
            ));
        }
        document.text(self.inlet.as_ref().map(inlet_text).unwrap_or_default());
        for pair in &self.entangled {
            document.text(format!(
                "{} and {} are barely distinguishable (correlation {:+.2})",
                pair.first, pair.second, pair.correlation
            ));
        }
        self.doubts.iter().for_each(|doubt| document.text(format!("doubt: {}", doubt.message())));
        document
    }
}

fn shared_value(value: &SharedValue, scale: f64, unit: &str, decimals: usize) -> String {
    let half = half_width_95(scale * value.uncertainty.combined_standard_error());
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    // Rounded to zero, a number has no sign.
    let rounded = |number: f64| {
        let unsigned = (scale * number).abs() < 0.5 * 0.1f64.powi(decimals as i32);
        if unsigned { 0.0 } else { scale * number }
    };
    match (value.value, value.origin) {
        (Some(number), Origin::Assumed) => format!("{:.decimals$}{unit} (assumed)", rounded(number)),
        (Some(number), _) => format!("{:.decimals$} +/- {half:.decimals$}{unit}", rounded(number)),
        (None, _) => format!("not identifiable from the recording (+/- {half:.decimals$}{unit})"),
    }
}

fn inlet_text(inlet: &IdentifiedInlet) -> String {
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

/// Temperature at which the housings' heat capacities are given, K.
const CAPACITY_AT_K: f64 = 350.0;

/// The reported data of a machine.
#[derive(Debug, Clone, Copy)]
pub struct ThermalExport<'a> {
    /// Name of the machine.
    pub machine: &'a str,
    /// Declared geometry, masses and conductances.
    pub params: &'a Params,
    /// Result of a joint identification; `None` reports the declared values instead.
    pub found: Option<&'a ThermalModel>,
    /// The identified balance of the turbine housing.
    pub turbine_housing: Option<&'a TurbineHousing>,
}

/// The convection law where it is known best, with all that is needed to draw from it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct AtReference {
    /// Reynolds number at which coefficient and exponent are uncorrelated.
    reynolds: f64,
    /// Temperature of gas and wall for which h is given, K.
    temperature_k: f64,
    /// h there, with its 95 % interval, W/(m2 K).
    h_w_m2k: [f64; 3],
    /// `a Re^b` there, with its 95 % interval.
    nusselt: [f64; 3],
    /// Exponent b, with its 95 % interval.
    exponent: [f64; 3],
    /// Correlation of `ln h` there with the exponent.
    correlation: f64,
    /// Coefficient a, the law at Re = 1, with its 95 % interval.
    coefficient: [f64; 3],
    /// Correlation of `ln a` with the exponent.
    coefficient_correlation: f64,
}

impl AtReference {
    fn new(law: &ConvectionLaw) -> Option<Self> {
        let with_interval = |shared: &SharedValue| {
            let (low, high) = shared.interval_95()?;
            Some([shared.value?, low, high])
        };
        let nusselt = with_interval(&law.nusselt_at_reference()?)?;
        let exponent = with_interval(&law.exponent)?;
        let (low, high) = law.coefficient_interval_95()?;
        let coefficient = law.coefficient.value?;
        let viscosity_pa_s = viscosity_pa_s(CAPACITY_AT_K);
        let flow_kg_s =
            0.25 * std::f64::consts::PI * law.diameter_m * viscosity_pa_s * law.reynolds_reference;
        let h_w_m2k = coefficient_w_m2k(
            coefficient,
            exponent[0],
            law.diameter_m,
            flow_kg_s,
            CAPACITY_AT_K,
            CAPACITY_AT_K,
        );
        Some(AtReference {
            reynolds: law.reynolds_reference,
            temperature_k: CAPACITY_AT_K,
            h_w_m2k: nusselt.map(|value| h_w_m2k * value / nusselt[0]),
            nusselt,
            exponent,
            correlation: 0.0,
            coefficient: [coefficient, low, high],
            coefficient_correlation: law.ln_coefficient_error()?.1,
        })
    }
}

impl ThermalExport<'_> {
    /// One JSON object; keys carry units, and declared values that the recording did not give are marked `declared`.
    pub fn json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let (params, compressor) = (self.params, &self.params.compressor);
        let mut file = json!({
            "machine": self.machine,
            "identified": self.found,
            "turbine_housing": self.turbine_housing,
            "declared": {
                "nusselt_law": "Nu = a Re^b Pr^(1/3) (mu/mu_wall)^0.14, Re = 4 m/(pi D mu)",
                "nusselt_coefficient": compressor.nusselt_coefficient,
                "nusselt_exponent": compressor.nusselt_exponent,
                "diameter_m": compressor.outlet_diameter_m,
                "alpha_area_ratio": compressor.alpha_area_ratio,
                "internal_area_m2": compressor.internal_area_m2,
                "external_area_m2": compressor.external_area_m2,
                "emissivity_ratio": compressor.emissivity_ratio,
                "compressor_housing_capacity_j_k": compressor_capacity_j_k(params, CAPACITY_AT_K),
                "turbine_housing_capacity_j_k": turbine_capacity_j_k(params, CAPACITY_AT_K),
                "capacity_at_k": CAPACITY_AT_K,
                "housing_to_bearing_conductance_w_k": bearing_conductance_w_k(&params.bearing),
                "bearing_to_oil_conductance_w_k": params.bearing.oil_conductance_w_k,
                "friction_heat_at_100_krpm_w": params.bearing.friction_heat_w,
                "t2_probe_diameter_m": params.t2_probe_diameter_m,
            },
        });
        if let Some(at) = self.found.and_then(|found| AtReference::new(found.convection.as_ref()?)) {
            file["convection_at_reference"] = json!(at);
        }
        if compressor.alpha_area_ratio > 0.0
            && let Some(declared) = file["declared"].as_object_mut()
        {
            declared.insert("inlet_convection".to_owned(), json!(compressor.inlet_convection));
            declared.insert("inlet_diameter_m".to_owned(), json!(compressor.inlet_diameter_m));
        }
        let mut bytes = serde_json::to_vec_pretty(&file)?;
        bytes.push(b'\n');
        Ok(bytes)
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
            housing: None,
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
        let text = thermal.document().to_string();
        assert!(!text.contains("before the wheel"), "what makes no difference is not reported: {text}");
        assert!(text.contains("not identifiable from the recording"), "{text}");
        assert!(text.contains("alpha_A and heating/cooling ratio are barely distinguishable"), "{text}");
        let json = serde_json::to_value(&thermal).unwrap_or_default();
        assert_eq!(json["entangled"][0]["correlation"], 0.97);
        assert_eq!(json["alpha_area_ratio"]["value"], serde_json::Value::Null);
    }

    /// A law that is known to 2 % at Re 130 000 and whose exponent is known to 0.01 is known to 12 % at Re = 1: the interval of h there is 4 %
    /// wide to either side, that of the coefficient a factor of 1.26 (exp(1.96 sqrt(0.02^2 + (11.8 0.01)^2))).
    #[test]
    fn the_law_is_exported_where_it_is_known() {
        let shared = |value: f64, noise_standard_error: f64| SharedValue {
            uncertainty: mapper_core::EstimateUncertainty { noise_standard_error, bias_standard_error: 0.0 },
            origin: Origin::Fitted,
            ..SharedValue::assumed(value)
        };
        let law = ConvectionLaw {
            diameter_m: 0.035,
            coefficient: shared(0.004, 0.02 * 0.004),
            exponent: shared(1.13, 0.01),
            reynolds_reference: 1.3e5,
            reynolds_range: (5e4, 3e5),
            deviation_ratio: 0.003,
        };
        let at = AtReference::new(&law).unwrap();
        assert!((at.h_w_m2k[2] / at.h_w_m2k[0] - 1.0392).abs() < 1e-3, "{at:?}");
        assert!((at.coefficient[2] / at.coefficient[0] - 1.264).abs() < 5e-3, "{at:?}");
        assert!(at.coefficient_correlation < -0.98, "{at:?}");
        // Appendix A: Nu = 0.004 Re^1.13 Pr^(1/3), air at 350 K has 0.030 W/(m K) and Pr 0.70.
        let by_hand = 0.004 * 1.3e5f64.powf(1.13) * 0.70f64.cbrt() * 0.030 / 0.035;
        assert!((at.h_w_m2k[0] / by_hand - 1.0).abs() < 0.02, "{} {by_hand}", at.h_w_m2k[0]);
    }

    #[test]
    fn declared_values_are_exported_with_those_that_follow_from_them() {
        let params = Params::default();
        let export = ThermalExport { machine: "a\nb 7", params: &params, found: None, turbine_housing: None };
        let value: serde_json::Value = serde_json::from_slice(&export.json().unwrap()).unwrap();
        // Appendix A: 2 k A / L = 2 * 47.5 * 7e-4 / 45e-3 = 1.478 W/K; 0.93 kg * 945 J/(kg K) at 350 K.
        let declared = |name: &str| value["declared"][name].as_f64().unwrap();
        assert!((declared("housing_to_bearing_conductance_w_k") - 1.4778).abs() < 1e-4);
        assert!((declared("compressor_housing_capacity_j_k") - 878.85).abs() < 1e-9);
    }
}
