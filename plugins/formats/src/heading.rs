//! Headings of written files: columns with their units, and what the map refers to.

use mapper_core::{CompressorMap, MapUnits, Method, one_line};
use mapper_maps::table::DEFINITION_PREFIX;
use std::fmt::Write;

/// Start of the comment that names the gas.
pub(crate) const GAS_PREFIX: &str = "compressed gas: ";

/// Comment lines that begin with `mark`.
pub(crate) fn heading(map: &CompressorMap, mark: &str) -> String {
    let (t_ref_k, p_ref_pa) = (map.reference.t_ref_k, map.reference.p_ref_pa);
    let mut text = format!(
        "{mark} compressor map of {}\n\
         {mark} reference state of corrected flow and speed: {t_ref_k} K, {p_ref_pa} Pa\n",
        if map.machine.is_empty() { "unnamed machine".to_owned() } else { one_line(&map.machine) },
    );
    if let Some(definition) = map.efficiency {
        let _ = writeln!(text, "{mark} {DEFINITION_PREFIX}{definition} ({})", definition.description());
    }
    if let Some(gas) = &map.gas {
        let _ = writeln!(text, "{mark} {GAS_PREFIX}{}", one_line(gas));
    }
    text
}

pub(crate) fn efficiency_name(method: Method) -> &'static str {
    match method {
        Method::Steady => "apparent: heat transfer not removed",
        Method::Dynamic | Method::Joint | Method::Corrected => "adiabatic: heat transfer removed",
        Method::Imported => "as in the map file",
    }
}

/// The shortest text that reads back to the same number.
pub(crate) fn number(value: f64) -> String {
    value.to_string()
}

/// As [`number`]; empty for none.
pub(crate) fn digits(value: Option<f64>) -> String {
    value.map(number).unwrap_or_default()
}

/// A speed in the displayed unit, without needless digits.
pub(crate) fn speed(speed_rpm: f64, units: &MapUnits) -> String {
    label(speed_rpm * units.speed_of_one_rpm)
}

/// Text of an efficiency (fraction) in %, without needless digits.
pub(crate) fn percent(eta: f64) -> String {
    label(100.0 * eta)
}

fn label(value: f64) -> String {
    let text = format!("{value:.1}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
