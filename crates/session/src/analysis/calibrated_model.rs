//! The calibrated model in files: a campaign whose virtual lab is the machine as found, a diagnosis, and a sealed forecast.

use crate::SessionError;
use crate::recording::files::{FORECAST_FORMAT, json_text, read_at_most, write_new};
use mapper_diagnose::gap::{CalibratedModelError, Expected, Found};
use mapper_physics::rig::effect::{Effect, EffectParameter};
use mapper_planner::sha256_hex;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::Arc;

/// Deviations that the virtual lab supports.
const DEVIATIONS: [&str; 8] = [
    "flow_meter_gain",
    "flow_map",
    "compressor_efficiency",
    "turbine_efficiency",
    "valve_area",
    "convection",
    "external_convection",
    "oil_conductance",
];

/// Settings of the virtual lab.
pub struct CalibratedModel<'a> {
    /// The identified machine.
    pub found: &'a Found,
    /// File of its diagnosis.
    pub source: &'a Path,
    /// Lag of P3 behind its command assumed by the diagnosis, s.
    pub p3_lag_s: f64,
}

/// A campaign's text with its backend replaced by a virtual lab of the identified machine.
pub fn calibrated_model_campaign(
    campaign_text: &str,
    calibrated: &CalibratedModel<'_>,
    catalogue: &[Arc<dyn Effect>],
) -> Result<String, SessionError> {
    Ok(with_backend(campaign_text, &backend(calibrated, catalogue)?))
}

fn backend(calibrated: &CalibratedModel<'_>, catalogue: &[Arc<dyn Effect>]) -> Result<String, SessionError> {
    let mut effects = Map::new();
    for effect in &calibrated.found.effects {
        let known = catalogue.iter().find(|known| known.info().id == effect.id.as_str());
        let known = known.ok_or_else(|| CalibratedModelError::Effect(effect.id.clone()))?;
        let value = |(parameter, value): (&EffectParameter, &f64)| match parameter.unit.as_ref() {
            "1" | "kg/kg" => (parameter.name.to_string(), json!(value)),
            unit => (parameter.name.to_string(), json!(format!("{value} {unit}"))),
        };
        let parameters = &known.info().parameters;
        let mut values: Map<String, Value> = parameters.iter().zip(&effect.values).map(value).collect();
        let single = parameters.first().filter(|_| parameters.len() == 1);
        let single = single.and_then(|parameter| values.remove(parameter.name.as_ref()));
        effects.insert(effect.id.clone(), single.unwrap_or(Value::Object(values)));
    }
    let tolerances = &calibrated.found.tolerances;
    let deviations = tolerances.iter().filter(|t| DEVIATIONS.contains(&t.name.as_str()));
    let deviations = deviations.map(|t| (t.name.clone(), json!(format!("{:.4} %", 100.0 * t.value))));
    let offsets = tolerances.iter().filter_map(|t| {
        let channel = t.offset_of()?;
        Some((channel.to_string(), json!(format!("{:.4} {}", t.value, channel.unit()))))
    });
    let lab = json!({
        "start": "settled",
        // As in the diagnosis: P3 follows with its declared lag, the valve without lag.
        "actuators": {
            "turbine_inlet_pressure": {"lag": format!("{} s", calibrated.p3_lag_s), "slew": "1000 bar/s"},
            "valve": {"lag": "0 s", "slew": "1000 1/s"},
        },
        "effects": effects,
        "deviations": deviations.collect::<Map<_, _>>(),
        "offset_of": offsets.collect::<Map<_, _>>(),
    });
    let block = serde_yaml::to_string(&json!({"backend": {"virtual_lab": lab}}))?;
    Ok(format!(
        "# The machine diagnosed in {}, which has the covariance.\n{block}",
        calibrated.source.display()
    ))
}

fn with_backend(text: &str, block: &str) -> String {
    let mut written = String::new();
    let mut inside = false;
    // Comments and empty lines before a key belong to it.
    let mut held_lines = String::new();
    for line in text.lines() {
        let top_level = line.chars().next().is_some_and(|c| !c.is_whitespace() && c != '#');
        if top_level {
            written += &std::mem::take(&mut held_lines);
            inside = line.starts_with("backend:");
            if inside {
                written += block;
            }
        }
        if inside {
            let is_blank_or_comment = line.trim().is_empty() || line.starts_with('#');
            if is_blank_or_comment {
                held_lines += line;
                held_lines.push('\n');
            } else {
                held_lines.clear();
            }
        } else {
            written += line;
            written.push('\n');
        }
    }
    written
}

/// Maximum size of a diagnosis or prediction file, bytes.
const FILE_MAX_BYTES: u64 = 64 << 20;

/// A prediction of the next recording, made before that recording is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedForecast {
    /// Version of the keys; 0 in files that have no number, whose keys are those of version 1.
    #[serde(default)]
    pub format_version: u32,
    /// Name of the campaign.
    pub campaign: String,
    /// The identified machine, with its covariance.
    pub found: Found,
    /// Expected values at the ends of the planned steps, with the half-width of the 95 % interval.
    pub steps: Vec<Expected>,
}

impl SealedForecast {
    /// The forecast of a campaign's steps.
    pub fn new(campaign: String, found: Found, steps: Vec<Expected>) -> SealedForecast {
        SealedForecast { format_version: FORECAST_FORMAT, campaign, found, steps }
    }

    /// Writes a new file and returns its SHA-256.
    pub fn write(&self, path: &Path) -> Result<String, SessionError> {
        let text = json_text(self)?;
        write_new(path, text.as_bytes())?;
        Ok(sha256_hex(&text))
    }

    /// Reads a prediction and its SHA-256. `wanted`: the required hash, in digits of either case.
    pub fn read(path: &Path, wanted: Option<&str>) -> Result<(SealedForecast, String), SessionError> {
        let text = text_of(path)?;
        let seal = sha256_hex(&text);
        if let Some(wanted) = wanted.filter(|wanted| !wanted.eq_ignore_ascii_case(&seal)) {
            let why = format!("its SHA-256 is {seal}, not {wanted}: it is not the forecast that was sealed");
            return Err(wrong(path, why));
        }
        let forecast: SealedForecast =
            serde_json::from_str(&text).map_err(|error| wrong(path, format!("not a forecast: {error}")))?;
        check_format(path, forecast.format_version, FORECAST_FORMAT)?;
        Ok((forecast, seal))
    }
}

pub(crate) fn check_format(path: &Path, found: u32, known: u32) -> Result<(), SessionError> {
    let why =
        || format!("its format_version is {found}, and this program knows {known}: use a newer program");
    if found <= known { Ok(()) } else { Err(wrong(path, why())) }
}

pub(crate) fn text_of(path: &Path) -> Result<String, SessionError> {
    let bytes = read_at_most(path, FILE_MAX_BYTES)?;
    String::from_utf8(bytes).map_err(|_| wrong(path, "it is not UTF-8".to_owned()))
}

pub(crate) fn wrong(path: &Path, why: String) -> SessionError {
    SessionError::CalibratedModelFile { path: path.to_owned(), why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_diagnose::gap::{FoundEffect, FoundTolerance};

    /// Every effect of the library, and tolerances of both kinds, arrive in the campaign as numbers or values with units.
    #[test]
    fn a_machine_becomes_the_settings_of_the_virtual_lab() {
        let catalogue = mapper_effects::catalogue();
        let effect = |effect: &Arc<dyn Effect>| {
            let values = effect.info().parameters.iter().map(|parameter| parameter.high);
            FoundEffect { id: effect.info().id.to_string(), values: values.collect() }
        };
        let tolerance =
            |(name, value): (&str, f64)| FoundTolerance { name: name.to_owned(), value, sigma: 1.0 };
        let found = Found {
            effects: catalogue.iter().map(effect).collect(),
            tolerances: [("valve_area", -0.02), ("offset of T1", 0.25), ("offset of P2", -40.0)]
                .map(tolerance)
                .into(),
            covariance: Vec::new(),
            doubt: None,
        };
        let calibrated = CalibratedModel { found: &found, source: Path::new("first.json"), p3_lag_s: 0.4 };
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../campaigns/grid18.yaml"));
        let text =
            calibrated_model_campaign(&std::fs::read_to_string(path).unwrap(), &calibrated, &catalogue)
                .unwrap();
        let campaign = mapper_campaign::check(&text, path, &mapper_campaign::read_text).unwrap();
        let lab = campaign.backend.settings;
        assert_eq!(lab["deviations"], json!({"valve_area": "-2.0000 %"}));
        assert_eq!(lab["offset_of"], json!({"T1": "0.2500 K", "P2": "-40.0000 Pa"}));
        assert_eq!(lab["actuators"]["turbine_inlet_pressure"]["lag"], "0.4 s");
        for effect in catalogue {
            let written = &lab["effects"][effect.info().id.as_ref()];
            for parameter in &effect.info().parameters {
                let value = if effect.info().parameters.len() == 1 {
                    written
                } else {
                    &written[parameter.name.as_ref()]
                };
                let number = value.as_f64().or_else(|| value.as_str()?.split(' ').next()?.parse().ok());
                assert_eq!(number, Some(parameter.high), "{text}");
            }
        }
    }

    #[test]
    fn only_the_block_of_the_backend_is_replaced() {
        let text = "a: 1\nbackend:\n  rig: {x: 1}\n  # inner\n\n  more: 2\n\n# of c\nc: 3\n";
        assert_eq!(with_backend(text, "backend: {}\n"), "a: 1\nbackend: {}\n\n# of c\nc: 3\n");
    }
}
