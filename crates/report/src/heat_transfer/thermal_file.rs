//! The thermal model of the machine for other programs: convection law, alpha_A, heat capacities, conductances.

use crate::heat_transfer::thermal_model::inlet_text;
use mapper_core::{Origin, SharedValue, ThermalModel, one_line};
use mapper_physics::laws::housing::{bearing_conductance_w_k, compressor_capacity_j_k, turbine_capacity_j_k};
use mapper_physics::machine::params::Params;
use serde_json::json;
use std::fmt::Write;

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
}

impl ThermalExport<'_> {
    /// One JSON object; keys carry units, and declared values that the recording did not give are marked `declared`.
    ///
    /// # Errors
    /// That of serde_json; numbers and texts never fail.
    pub fn json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let (params, compressor) = (self.params, &self.params.compressor);
        let mut file = json!({
            "machine": self.machine,
            "identified": self.found,
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
                "t2_probe_diameter_m": params.t2_probe_diameter_m,
            },
        });
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

    /// The same as lines `name value unit # source`.
    pub fn text(&self) -> String {
        let (params, compressor) = (self.params, &self.params.compressor);
        let mut text = format!(
            "# thermal model of {}\n# Nu = a Re^b Pr^(1/3) (mu/mu_wall)^0.14, Re = 4 m/(pi D mu), over the compressor's inner walls\n",
            one_line(self.machine)
        );
        let law = self.found.and_then(|identified| identified.convection.as_ref());
        let mut shared = |name: &str, unit: &str, identified: Option<&SharedValue>, declared: f64| {
            let (value, origin) = match identified.and_then(|shared| Some((shared.value?, shared))) {
                Some((value, shared)) => {
                    let (low, high) = shared.interval_95().unwrap_or((value, value));
                    let origin = match shared.origin {
                        Origin::Fitted => "identified",
                        Origin::Assumed => "declared",
                        Origin::NotIdentifiable => "declared; not identifiable from the recording",
                    };
                    (value, format!("{origin}, 95 % {low:.6} to {high:.6}"))
                }
                None => (declared, "declared".to_owned()),
            };
            let _ = writeln!(text, "{name} {value} {unit} # {origin}");
        };
        shared("nusselt_coefficient", "1", law.map(|l| &l.coefficient), compressor.nusselt_coefficient);
        shared("nusselt_exponent", "1", law.map(|l| &l.exponent), compressor.nusselt_exponent);
        shared("alpha_area", "1", self.found.map(|f| &f.alpha_area_ratio), compressor.alpha_area_ratio);
        shared("t2_probe_diameter", "m", self.found.map(|f| &f.probe_diameter_m), params.t2_probe_diameter_m);
        shared("heating_cooling_ratio", "1", self.found.map(|f| &f.heating_cooling_ratio), 1.0);
        if let Some(inlet) = self.found.and_then(|identified| identified.inlet) {
            let _ =
                writeln!(text, "inlet_diameter {} m # declared\n# {}", inlet.diameter_m, inlet_text(&inlet));
        }
        for (name, value, unit) in [
            ("diameter", law.map_or(compressor.outlet_diameter_m, |l| l.diameter_m), "m"),
            ("internal_area", compressor.internal_area_m2, "m2"),
            ("external_area", compressor.external_area_m2, "m2"),
            ("compressor_housing_capacity", compressor_capacity_j_k(params, CAPACITY_AT_K), "J/K"),
            ("turbine_housing_capacity", turbine_capacity_j_k(params, CAPACITY_AT_K), "J/K"),
            ("housing_to_bearing_conductance", bearing_conductance_w_k(&params.bearing), "W/K"),
            ("bearing_to_oil_conductance", params.bearing.oil_conductance_w_k, "W/K"),
        ] {
            let _ = writeln!(text, "{name} {value} {unit} # declared");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_and_text_tell_the_same_and_a_name_breaks_nothing() {
        let params = Params::default();
        let export = ThermalExport { machine: "a\nb 7", params: &params, found: None };
        let value: serde_json::Value = serde_json::from_slice(&export.json().unwrap()).unwrap();
        // Appendix A: 2 k A / L = 2 * 47.5 * 7e-4 / 45e-3 = 1.478 W/K; 0.93 kg * 945 J/(kg K) at 350 K.
        let declared = |name: &str| value["declared"][name].as_f64().unwrap();
        assert!((declared("housing_to_bearing_conductance_w_k") - 1.4778).abs() < 1e-4);
        assert!((declared("compressor_housing_capacity_j_k") - 878.85).abs() < 1e-9);
        let text = export.text();
        assert!(
            text.contains("nusselt_exponent 1.13 1 # declared\n")
                && text.starts_with("# thermal model of a b 7\n")
        );
        assert!(text.lines().all(|line| line.starts_with('#') || line.split(' ').count() >= 5));
    }
}
