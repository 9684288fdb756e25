//! Converts a diagnosed machine into the virtual lab of a campaign.

use crate::SessionError;
use mapper_gap::twin::{Found, TwinError};
use mapper_physics::effect::{Effect, EffectParameter};
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
pub struct Twin<'a> {
    /// The identified machine.
    pub found: &'a Found,
    /// File of its diagnosis.
    pub source: &'a Path,
    /// Lag of P3 behind its command assumed by the diagnosis, s.
    pub p3_lag_s: f64,
}

/// A campaign's text with its backend replaced by a virtual lab of the identified machine.
///
/// # Errors
/// [`TwinError::Effect`] if an effect is not in the library.
pub fn twin_campaign(
    campaign_text: &str,
    twin: &Twin<'_>,
    catalogue: &[Arc<dyn Effect>],
) -> Result<String, SessionError> {
    Ok(with_backend(campaign_text, &backend(twin, catalogue)?))
}

/// The backend block.
fn backend(twin: &Twin<'_>, catalogue: &[Arc<dyn Effect>]) -> Result<String, TwinError> {
    let mut text = format!(
        "# The machine as found in {}; its covariance is there.\nbackend:\n  virtual_lab:\n    start: settled\n",
        twin.source.display()
    );
    // As in the diagnosis: P3 follows with its declared lag, the valve without lag.
    text += &format!(
        "    actuators:\n      turbine_inlet_pressure: {{lag: {} s, slew: 1000 bar/s}}\n      valve: {{lag: 0 s, slew: 1000 1/s}}\n",
        twin.p3_lag_s
    );
    if !twin.found.effects.is_empty() {
        text += "    effects:\n";
    }
    for effect in &twin.found.effects {
        let known = catalogue.iter().find(|known| known.info().id == effect.id.as_str());
        let known = known.ok_or_else(|| TwinError::Effect(effect.id.clone()))?;
        let value = |(parameter, value): (&EffectParameter, &f64)| match parameter.unit.as_ref() {
            "1" | "kg/kg" => format!("{value}"),
            unit => format!("\"{value} {unit}\""),
        };
        let parameters = &known.info().parameters;
        let values: Vec<String> = parameters.iter().zip(&effect.values).map(value).collect();
        text += &match (parameters.as_slice(), values.as_slice()) {
            ([_], [value]) => format!("      {}: {value}\n", effect.id),
            _ => {
                let named: Vec<String> =
                    parameters.iter().zip(values).map(|(p, value)| format!("{}: {value}", p.name)).collect();
                format!("      {}: {{{}}}\n", effect.id, named.join(", "))
            }
        };
    }
    text += "    deviations:\n";
    for tolerance in twin.found.tolerances.iter().filter(|t| DEVIATIONS.contains(&t.name.as_str())) {
        text += &format!("      {}: {:.4} %\n", tolerance.name, 100.0 * tolerance.value);
    }
    let offsets: Vec<String> = twin
        .found
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
