//! `mapper gap apply`: the machine that a diagnosis found, as the virtual lab of a campaign.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::{output, registry};
use clap::Args;
use mapper_gap::twin::Found;
use mapper_session::write_new;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Write a campaign whose virtual lab is the machine that a diagnosis found: its effects, and by how much it is off
#[derive(Debug, Args)]
pub struct Apply {
    /// Campaign that was diagnosed (YAML)
    pub campaign: PathBuf,
    /// Diagnosis, as `mapper gap diagnose --json` prints it
    pub diagnosis: PathBuf,
    /// New campaign file (YAML): `plan`, `run` and `nightly` take it as any other
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// What is read of a diagnosis.
#[derive(Debug, Deserialize)]
struct Diagnosis {
    found: Option<Found>,
}

/// Largest diagnosis that is read, bytes.
const LARGEST_BYTES: u64 = 64 << 20;

/// What a diagnosis found.
pub fn found_in(path: &Path) -> Result<Found, Failure> {
    let bad = |message: String| Failure::new(Code::BadInput, format!("{}: {message}", path.display()));
    let length = std::fs::metadata(path).map_err(|error| bad(error.to_string()))?.len();
    if length > LARGEST_BYTES {
        return Err(bad(format!("{length} bytes are no diagnosis")));
    }
    let text = std::fs::read_to_string(path).map_err(|error| bad(error.to_string()))?;
    let diagnosis: Diagnosis =
        serde_json::from_str(&text).map_err(|error| bad(format!("not a diagnosis: {error}")))?;
    diagnosis.found.ok_or_else(|| {
        bad("it does not hold what was found; make it with mapper gap diagnose --json".to_owned())
    })
}

/// Deviations that the virtual lab takes.
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

impl Apply {
    /// Writes the campaign.
    pub fn run(&self) -> Result<(), Failure> {
        // What is not a campaign is not changed into one.
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let text = std::fs::read_to_string(&self.campaign)
            .map_err(|error| Failure::new(Code::Failure, format!("{}: {error}", self.campaign.display())))?;
        let found = found_in(&self.diagnosis)?;
        let written = with_backend(&text, &self.backend(&found, campaign.tolerances.actuator_lag_s)?);
        write_new(&self.out, written.as_bytes())?;
        mapper_campaign::load(&self.out).map_err(Failure::of_campaign)?;
        output::print(&format!("campaign with the machine as found in {}\n", self.out.display()))
    }

    /// The block of the backend.
    fn backend(&self, found: &Found, p3_lag_s: f64) -> Result<String, Failure> {
        let catalogue = registry::registry().effects;
        let mut text = format!(
            "# The machine as found in {}; its covariance stands there.\nbackend:\n  virtual_lab:\n    start: settled\n",
            self.diagnosis.display()
        );
        // As the diagnosis takes them: P3 behind its declared lag, the valve at once.
        text += &format!(
            "    actuators:\n      turbine_inlet_pressure: {{lag: {p3_lag_s} s, slew: 1000 bar/s}}\n      valve: {{lag: 0 s, slew: 1000 1/s}}\n"
        );
        if !found.effects.is_empty() {
            text += "    effects:\n";
        }
        for effect in &found.effects {
            let unknown =
                || Failure::new(Code::BadInput, format!("effect `{}` is not in the catalogue", effect.id));
            let known =
                catalogue.iter().find(|known| known.info().id == effect.id.as_str()).ok_or_else(unknown)?;
            let value = |(parameter, value): (&mapper_physics::effect::EffectParameter, &f64)| match parameter
                .unit
                .as_ref()
            {
                "1" | "kg/kg" => format!("{value}"),
                unit => format!("\"{value} {unit}\""),
            };
            let parameters = &known.info().parameters;
            let values: Vec<String> = parameters.iter().zip(&effect.values).map(value).collect();
            text += &match (parameters.as_slice(), values.as_slice()) {
                ([_], [value]) => format!("      {}: {value}\n", effect.id),
                _ => {
                    let named: Vec<String> = parameters
                        .iter()
                        .zip(values)
                        .map(|(p, value)| format!("{}: {value}", p.name))
                        .collect();
                    format!("      {}: {{{}}}\n", effect.id, named.join(", "))
                }
            };
        }
        text += "    deviations:\n";
        for tolerance in found.tolerances.iter().filter(|t| DEVIATIONS.contains(&t.name.as_str())) {
            text += &format!("      {}: {:.4} %\n", tolerance.name, 100.0 * tolerance.value);
        }
        let offsets: Vec<String> = found
            .tolerances
            .iter()
            .filter_map(|t| {
                let channel = t.name.strip_prefix("offset of ")?;
                let unit = if channel.starts_with('P') { "Pa" } else { "K" };
                Some(format!("{channel}: {:.4} {unit}", t.value))
            })
            .collect();
        text += &format!("    offset_of: {{{}}}\n", offsets.join(", "));
        Ok(text)
    }
}

/// A campaign's text with its backend's block replaced.
fn with_backend(text: &str, block: &str) -> String {
    let mut written = String::new();
    let mut inside = false;
    // Comments and empty lines before a key belong to it.
    let mut held = String::new();
    for line in text.lines() {
        let top_level = line.chars().next().is_some_and(|c| !c.is_whitespace() && c != '#');
        if top_level {
            written += &std::mem::take(&mut held);
            inside = line.starts_with("backend:");
            if inside {
                written += block;
            }
        }
        if inside {
            let loose = line.trim().is_empty() || line.starts_with('#');
            if loose {
                held += line;
                held.push('\n');
            } else {
                held.clear();
            }
        } else {
            written += line;
            written.push('\n');
        }
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_block_of_the_backend_is_replaced() {
        let text = "a: 1\nbackend:\n  rig: {x: 1}\n  # inner\n\n  more: 2\n\n# of c\nc: 3\n";
        assert_eq!(with_backend(text, "backend: {}\n"), "a: 1\nbackend: {}\n\n# of c\nc: 3\n");
    }
}
