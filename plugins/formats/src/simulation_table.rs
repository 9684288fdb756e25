//! A rectangular table for simulation programs: flow, pressure ratio and efficiency over corrected speed and
//! beta, positive and finite everywhere.
//!
//! The fitted surface extends to pressure ratios below 1, with efficiency 0 or negative; such programs divide by it. The
//! table therefore ends on the choke side at the efficiency [`MIN_ETA`]. Between the fit's nodes the table is
//! linear in distance along the line.

use mapper_core::{CompressorMap, ExportError, FittedLine, FittedMap};

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
    /// Speeds of the extrapolated lines, rpm.
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
