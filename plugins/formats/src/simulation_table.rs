//! Tables of simulation programs with their headings.
//!
//! The fitted surface extends to pressure ratios below 1, with efficiency 0 or negative; such programs divide by it. The
//! table therefore ends on the choke side at the efficiency [`MIN_ETA`]. Between the fit's nodes the table is
//! linear in distance along the line.

use mapper_core::{CompressorMap, ExportError, FittedLine, FittedMap, MapUnits, Method, one_line};
use mapper_maps::table::DEFINITION_PREFIX;
use std::fmt::Write;

/// Efficiency at which the table ends on the choke side, fraction.
pub(crate) const MIN_ETA: f64 = 0.1;
/// Columns over beta.
const COLUMNS: usize = 25;

pub(crate) struct SimulationTable {
    pub speeds_rpm: Vec<f64>,
    /// 0 at the choke end, 1 at the surge end.
    pub beta: Vec<f64>,
    /// `[speed][beta]`.
    pub flow_kg_s: Vec<Vec<f64>>,
    pub pressure_ratio: Vec<Vec<f64>>,
    pub eta: Vec<Vec<f64>>,
    pub extrapolated_rpm: Vec<f64>,
}

impl SimulationTable {
    pub(crate) fn of(map: &CompressorMap, format: &'static str) -> Result<Self, ExportError> {
        let fitted = map.fitted.as_ref().ok_or(ExportError::NeedsFit { format })?;
        let lines: Vec<(&FittedLine, usize)> =
            fitted.lines.iter().filter_map(|line| Some((line, first_node(line)?))).collect();
        if lines.len() < 2 {
            return Err(ExportError::NeedsFit { format });
        }
        let beta: Vec<f64> = (0..COLUMNS).map(|i| i as f64 / (COLUMNS - 1) as f64).collect();
        let table = |value: fn(&FittedLine, usize) -> f64| -> Vec<Vec<f64>> {
            let row = |(line, first): &(&FittedLine, usize)| {
                beta.iter().map(|b| at(line, *first, *b, value)).collect::<Vec<f64>>()
            };
            lines.iter().map(row).collect()
        };
        Ok(SimulationTable {
            speeds_rpm: lines.iter().map(|(line, _)| line.speed_corrected_rpm).collect(),
            flow_kg_s: table(|line, i| line.nodes[i].flow_corrected_kg_s),
            pressure_ratio: table(|line, i| line.nodes[i].pressure_ratio),
            eta: table(|line, i| line.nodes[i].eta),
            extrapolated_rpm: extrapolated_speeds(fitted),
            beta,
        })
    }

    /// The table's limits and extrapolated range, as comment lines that begin with `mark`.
    pub(crate) fn remarks(&self, mark: &str) -> String {
        let mut text = format!(
            "{mark} total to total; efficiency is isentropic, a fraction; the table ends on the choke side where it falls to {MIN_ETA}\n"
        );
        if !self.extrapolated_rpm.is_empty() {
            let speeds: Vec<String> = self.extrapolated_rpm.iter().map(f64::to_string).collect();
            text += &format!(
                "{mark} lines beyond the measured speeds (extrapolated), rpm: {}\n",
                speeds.join(", ")
            );
        }
        text
    }
}

/// First node from the choke side with the minimum efficiency and a pressure ratio above 1.
fn first_node(line: &FittedLine) -> Option<usize> {
    let good = |i: &usize| line.nodes[*i].eta >= MIN_ETA && line.nodes[*i].pressure_ratio > 1.0;
    let last = (0..line.nodes.len()).rev().take_while(good).last()?;
    (last + 1 < line.nodes.len()).then_some(last)
}

fn at(line: &FittedLine, first: usize, beta: f64, value: fn(&FittedLine, usize) -> f64) -> f64 {
    let last = line.nodes.len() - 1;
    let place = first as f64 + beta * (last - first) as f64;
    let below = (place.floor() as usize).min(last - 1);
    let share = place - below as f64;
    value(line, below) + share * (value(line, below + 1) - value(line, below))
}

fn extrapolated_speeds(fitted: &FittedMap) -> Vec<f64> {
    let measured: Vec<f64> =
        fitted.lines.iter().filter(|line| line.measured).map(|line| line.speed_corrected_rpm).collect();
    let (Some(first), Some(last)) = (measured.first(), measured.last()) else { return Vec::new() };
    let outside = |speed: &f64| speed < first || speed > last;
    fitted.lines.iter().map(|line| line.speed_corrected_rpm).filter(outside).collect()
}

/// Numbers in a row, each as the shortest text that reads back to the same number, with at least nine significant digits.
pub(crate) fn joined(values: &[f64], separator: &str) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(separator)
}

/// Start of the comment that names the gas.
pub(crate) const GAS_PREFIX: &str = "compressed gas: ";

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
