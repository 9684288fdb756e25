//! A compressor map from a table: speed lines of corrected speed, flow, pressure ratio and efficiency.
//!
//! Each line has two ends and a shape between them over the coordinate x of the closed form (0 at the choke end, 1 at the
//! surge end), so that lines of different speed can be blended at equal x. Beyond the outermost lines similarity applies:
//! flow in proportion to speed, isentropic head to its square. This extrapolation is only for the run-up of a machine.

use crate::compressor_map::closed_form_map::{
    CharacteristicPoint, CompressorCharacteristic, MAX_SPEED_RPM, MIN_TOP_SPEED_RPM, head_ratio as head,
    max_flow_kg_s, pressure_ratio_of_head,
};
use mapper_core::{ReferenceState, with_unit};

/// A row of a map file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapRow {
    /// Corrected speed, rpm, > 0.
    pub speed_corrected_rpm: f64,
    /// Corrected flow, kg/s, > 0.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio, > 0.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, total to total, fraction.
    pub efficiency: f64,
}

/// Reason why a table is not a map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum MapError {
    /// `row` counts from 1, without the header.
    #[error(
        "row {row} of the map: {quantity} = {} has no physical meaning (it must be {needed})",
        with_unit(value, unit)
    )]
    Value { row: usize, quantity: &'static str, value: f64, unit: &'static str, needed: &'static str },
    #[error("the map has {lines} speed line(s); at least 2 are needed")]
    TooFewLines { lines: usize },
    #[error(
        "the speed line at {speed_corrected_rpm} rpm has {points} usable point(s) between choke and its highest pressure ratio; at least 3 are needed"
    )]
    TooFewPoints { speed_corrected_rpm: f64, points: usize },
    #[error(
        "the speed line at {speed_corrected_rpm} rpm ends on the surge side at a pressure ratio of {pressure_ratio}, below that of the next slower line ({slower_pressure_ratio}): the lines cross"
    )]
    Crossing { speed_corrected_rpm: f64, pressure_ratio: f64, slower_pressure_ratio: f64 },
    #[error(
        "the fastest speed line turns at {} only: no turbocharger is that slow; if the table has krpm, add the unit to its heading (`speed [krpm]`)",
        with_unit(speed_corrected_rpm, "rpm")
    )]
    Slow { speed_corrected_rpm: f64 },
    #[error(
        "row {row} of the map: no turbocharger turns at {} (2e6 rpm at most); if the table has rpm, its heading must not say krpm",
        with_unit(speed_corrected_rpm, "rpm")
    )]
    Fast { row: usize, speed_corrected_rpm: f64 },
    #[error(
        "row {row} of the map: no compressor passes {} at {} ({} at most); if the table has g/s, kg/h or lb/min, add the unit to its heading (`flow [g/s]`)",
        with_unit(flow_corrected_kg_s, "kg/s"),
        with_unit(speed_corrected_rpm, "rpm"),
        with_unit(format_args!("{limit_kg_s:.2}"), "kg/s")
    )]
    Flow { row: usize, flow_corrected_kg_s: f64, speed_corrected_rpm: f64, limit_kg_s: f64 },
}

/// A stored speed line.
#[derive(Debug, Clone)]
pub struct Line {
    /// Mean corrected speed of its points, rpm.
    pub speed_corrected_rpm: f64,
    /// Pressure ratio at the choke end.
    pub choke_pressure_ratio: f64,
    /// Pressure ratio at the surge end.
    pub surge_pressure_ratio: f64,
    /// At least two, x rising from 0 to 1.
    pub nodes: Vec<Node>,
}

/// A node of a speed line.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// Pressure ratio minus that of the choke end, over the span of the line: 0 at the choke end, 1 at the surge end.
    pub x: f64,
    /// Corrected flow, kg/s.
    pub flow_kg_s: f64,
    /// Isentropic efficiency, total to total, fraction.
    pub efficiency: f64,
}

/// A map from a table.
#[derive(Debug, Clone)]
pub struct TabulatedMap {
    reference: ReferenceState,
    lines: Vec<Line>,
    fingerprint: String,
}

/// Minimum efficiency of a blend, equal to the closed form's.
const MIN_EFFICIENCY: f64 = 0.2;
/// Maximum relative difference of speed within a line.
const MAX_LINE_SPEED_DIFFERENCE_RATIO: f64 = 0.01;

impl TabulatedMap {
    /// Builds a map from rows in any order, at `reference`.
    ///
    /// Points on the surge side of a line's highest pressure ratio are skipped, because there flow is not a function of
    /// pressure ratio.
    pub fn new(rows: &[MapRow], reference: ReferenceState) -> Result<Self, MapError> {
        for (index, row) in rows.iter().enumerate() {
            let positive = "finite and above 0";
            for (quantity, value, unit, is_valid, needed) in [
                ("speed", row.speed_corrected_rpm, "rpm", row.speed_corrected_rpm > 0.0, positive),
                ("flow", row.flow_corrected_kg_s, "kg/s", row.flow_corrected_kg_s > 0.0, positive),
                ("pressure ratio", row.pressure_ratio, "1", row.pressure_ratio > 0.0, positive),
                (
                    "efficiency",
                    row.efficiency,
                    "1",
                    row.efficiency > 0.0 && row.efficiency <= 1.0,
                    "a fraction above 0, at most 1",
                ),
            ] {
                if !(value.is_finite() && is_valid) {
                    return Err(MapError::Value { row: index + 1, quantity, value, unit, needed });
                }
            }
        }
        if let Some((index, row)) =
            rows.iter().enumerate().find(|(_, row)| row.speed_corrected_rpm > MAX_SPEED_RPM)
        {
            return Err(MapError::Fast { row: index + 1, speed_corrected_rpm: row.speed_corrected_rpm });
        }
        let fastest_rpm = rows.iter().map(|row| row.speed_corrected_rpm).fold(0.0, f64::max);
        if !rows.is_empty() && fastest_rpm < MIN_TOP_SPEED_RPM {
            return Err(MapError::Slow { speed_corrected_rpm: fastest_rpm });
        }
        for (index, row) in rows.iter().enumerate() {
            let MapRow { flow_corrected_kg_s, speed_corrected_rpm, .. } = *row;
            let limit_kg_s = max_flow_kg_s(speed_corrected_rpm);
            if flow_corrected_kg_s > limit_kg_s {
                return Err(MapError::Flow {
                    row: index + 1,
                    flow_corrected_kg_s,
                    speed_corrected_rpm,
                    limit_kg_s,
                });
            }
        }
        let mut sorted = rows.to_vec();
        sorted.sort_by(|a, b| {
            a.speed_corrected_rpm
                .total_cmp(&b.speed_corrected_rpm)
                .then(b.flow_corrected_kg_s.total_cmp(&a.flow_corrected_kg_s))
        });
        let lines: Vec<Line> = sorted
            .chunk_by(|a, b| {
                b.speed_corrected_rpm <= a.speed_corrected_rpm * (1.0 + MAX_LINE_SPEED_DIFFERENCE_RATIO)
            })
            .map(Line::new)
            .collect::<Result<_, _>>()?;
        if lines.len() < 2 {
            return Err(MapError::TooFewLines { lines: lines.len() });
        }
        for pair in lines.windows(2) {
            if pair[1].surge_pressure_ratio <= pair[0].surge_pressure_ratio {
                return Err(MapError::Crossing {
                    speed_corrected_rpm: pair[1].speed_corrected_rpm,
                    pressure_ratio: pair[1].surge_pressure_ratio,
                    slower_pressure_ratio: pair[0].surge_pressure_ratio,
                });
            }
        }
        let fingerprint = format!("table {reference} {sorted:?}");
        Ok(TabulatedMap { reference, lines, fingerprint })
    }

    /// The speed lines in order of speed: at least two.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Corrected speeds of the lines, rpm, rising.
    pub fn speeds_corrected_rpm(&self) -> Vec<f64> {
        self.lines.iter().map(|line| line.speed_corrected_rpm).collect()
    }

    /// The two lines to blend and the weight of the upper one; beyond the outermost line, that line alone.
    fn neighbours(&self, speed_corrected_rpm: f64) -> (&Line, &Line, f64) {
        let after = self.lines.partition_point(|line| line.speed_corrected_rpm <= speed_corrected_rpm);
        let last = self.lines.len() - 1;
        let (low, high) = match after {
            0 => (0, 0),
            after if after > last => (last, last),
            after => (after - 1, after),
        };
        let (low, high) = (&self.lines[low], &self.lines[high]);
        let span_rpm = high.speed_corrected_rpm - low.speed_corrected_rpm;
        let share =
            if span_rpm > 0.0 { (speed_corrected_rpm - low.speed_corrected_rpm) / span_rpm } else { 0.0 };
        (low, high, share)
    }

    /// Speed over that of the scaled line; 1 between the outermost lines.
    fn similarity_ratio(&self, speed_corrected_rpm: f64) -> f64 {
        let first = self.lines.first().map_or(1.0, |line| line.speed_corrected_rpm);
        let last = self.lines.last().map_or(1.0, |line| line.speed_corrected_rpm);
        speed_corrected_rpm / speed_corrected_rpm.clamp(first, last)
    }

    /// Pressure ratios at the choke end and the surge end.
    fn ends(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        let (low, high, share) = self.neighbours(speed_corrected_rpm);
        let ratio = self.similarity_ratio(speed_corrected_rpm);
        let blend =
            |a: f64, b: f64| pressure_ratio_of_head((head(a) + (head(b) - head(a)) * share) * ratio * ratio);
        (
            blend(low.choke_pressure_ratio, high.choke_pressure_ratio),
            blend(low.surge_pressure_ratio, high.surge_pressure_ratio),
        )
    }

    /// The node at `x` of the line at a corrected speed.
    fn blend(&self, speed_corrected_rpm: f64, x: f64) -> Node {
        let (low, high, share) = self.neighbours(speed_corrected_rpm);
        let (a, b) = (low.at(x), high.at(x));
        let ratio = self.similarity_ratio(speed_corrected_rpm);
        Node {
            x,
            flow_kg_s: (a.flow_kg_s + (b.flow_kg_s - a.flow_kg_s) * share) * ratio,
            efficiency: a.efficiency + (b.efficiency - a.efficiency) * share,
        }
    }
}

impl Line {
    /// A line from its rows in order of falling flow.
    fn new(rows: &[MapRow]) -> Result<Self, MapError> {
        let speed_corrected_rpm =
            rows.iter().map(|row| row.speed_corrected_rpm).sum::<f64>() / rows.len() as f64;
        // From choke towards surge the pressure ratio must rise; other points are skipped.
        let mut rising: Vec<&MapRow> = Vec::new();
        for row in rows {
            if rising.last().is_none_or(|last| {
                row.pressure_ratio > last.pressure_ratio && row.flow_corrected_kg_s < last.flow_corrected_kg_s
            }) {
                rising.push(row);
            }
        }
        let too_few = MapError::TooFewPoints { speed_corrected_rpm, points: rising.len() };
        let (Some(choke), Some(surge)) = (rising.first(), rising.last()) else {
            return Err(too_few);
        };
        if rising.len() < 3 {
            return Err(too_few);
        }
        let (choke_pressure_ratio, surge_pressure_ratio) = (choke.pressure_ratio, surge.pressure_ratio);
        let nodes = rising
            .iter()
            .map(|row| Node {
                x: (row.pressure_ratio - choke_pressure_ratio)
                    / (surge_pressure_ratio - choke_pressure_ratio),
                flow_kg_s: row.flow_corrected_kg_s,
                efficiency: row.efficiency,
            })
            .collect();
        Ok(Line { speed_corrected_rpm, choke_pressure_ratio, surge_pressure_ratio, nodes })
    }

    /// Linear interpolation between the nodes, constant beyond both ends.
    fn at(&self, x: f64) -> Node {
        let after = self.nodes.partition_point(|node| node.x <= x).clamp(1, self.nodes.len() - 1);
        let (a, b) = (self.nodes[after - 1], self.nodes[after]);
        let share = ((x - a.x) / (b.x - a.x)).clamp(0.0, 1.0);
        Node {
            x,
            flow_kg_s: a.flow_kg_s + (b.flow_kg_s - a.flow_kg_s) * share,
            efficiency: a.efficiency + (b.efficiency - a.efficiency) * share,
        }
    }
}

impl CompressorCharacteristic for TabulatedMap {
    fn reference(&self) -> ReferenceState {
        self.reference
    }

    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        let (choke_pr, surge_pr) = self.ends(speed_corrected_rpm);
        let x = (pressure_ratio - choke_pr) / (surge_pr - choke_pr);
        let node = self.blend(speed_corrected_rpm, x);
        // Beyond the surge line the flow falls as in the closed form.
        let beyond = (x - 1.0).max(0.0);
        CharacteristicPoint {
            flow_corrected_kg_s: node.flow_kg_s * (1.0 - 2.0 * beyond),
            efficiency: node.efficiency.max(MIN_EFFICIENCY),
            surge_position_ratio: x,
        }
    }

    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        (self.blend(speed_corrected_rpm, 1.0).flow_kg_s, self.ends(speed_corrected_rpm).1)
    }

    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.blend(speed_corrected_rpm, 0.0).flow_kg_s
    }

    fn fingerprint(&self) -> String {
        self.fingerprint.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compressor_map::closed_form_map::ClosedFormMap;
    use proptest::prelude::*;

    /// The closed form, sampled like a user's table.
    fn sampled(speeds: &[f64]) -> TabulatedMap {
        let map = ClosedFormMap { wheel_diameter_m: 0.052 };
        let mut rows = Vec::new();
        for &speed in speeds {
            let (_, surge_pr) = map.surge_point(speed);
            let choke_pr = 1.0 + 0.15 * (surge_pr - 1.0);
            for i in 0..=20 {
                let pressure_ratio = choke_pr + (surge_pr - choke_pr) * f64::from(i) / 20.0;
                let point = map.evaluate(speed, pressure_ratio);
                rows.push(MapRow {
                    speed_corrected_rpm: speed,
                    flow_corrected_kg_s: point.flow_corrected_kg_s,
                    pressure_ratio,
                    efficiency: point.efficiency,
                });
            }
        }
        TabulatedMap::new(&rows, ReferenceState::SAE).unwrap()
    }

    #[test]
    fn the_table_gives_its_own_nodes_back_and_follows_the_closed_form_between_lines() {
        let speeds: Vec<f64> = (0..=11).map(|i| 50e3 + 10e3 * f64::from(i)).collect();
        let (table, exact) = (sampled(&speeds), ClosedFormMap { wheel_diameter_m: 0.052 });
        for (speed, tolerance) in [(90e3, 1e-9), (95e3, 0.01)] {
            let (_, surge_pr) = exact.surge_point(speed);
            let choke_pr = 1.0 + 0.15 * (surge_pr - 1.0);
            // Nodes at every twentieth; the last before surge is steep, so a straight line is 1 % off there.
            for i in 1..19 {
                let pr = choke_pr + (surge_pr - choke_pr) * f64::from(i) / 20.0;
                let (a, b) = (table.evaluate(speed, pr), exact.evaluate(speed, pr));
                assert!(
                    (a.flow_corrected_kg_s / b.flow_corrected_kg_s - 1.0).abs() < tolerance,
                    "{speed} {pr}"
                );
                assert!((a.efficiency - b.efficiency).abs() < tolerance, "{speed} {pr}");
            }
        }
    }

    #[test]
    fn krpm_and_g_s_that_nobody_named_are_no_map() {
        let row = |speed_corrected_rpm, flow_corrected_kg_s| MapRow {
            speed_corrected_rpm,
            flow_corrected_kg_s,
            pressure_ratio: 1.5,
            efficiency: 0.7,
        };
        let refused = |row: MapRow| TabulatedMap::new(&[row], ReferenceState::SAE).unwrap_err();
        assert!(matches!(refused(row(170.0, 0.1)), MapError::Slow { .. }));
        assert!(matches!(refused(row(150e3, 100.0)), MapError::Flow { row: 1, .. }));
        // A locomotive's: 20 kg/s at 20 krpm.
        assert!(matches!(
            refused(row(20e3, 20.0)),
            MapError::TooFewLines { .. } | MapError::TooFewPoints { .. }
        ));
        assert!(matches!(TabulatedMap::new(&[], ReferenceState::SAE), Err(MapError::TooFewLines { .. })));
    }

    proptest! {
        /// More pressure, less flow; more speed, more flow at the same place on the line.
        #[test]
        fn flow_is_monotone_also_beyond_the_table(speed in 20e3..200e3f64, pr in 1.0..4.0f64, step in 1e-4..0.5f64) {
            let map = sampled(&[50e3, 80e3, 110e3, 140e3]);
            let here = map.evaluate(speed, pr).flow_corrected_kg_s;
            prop_assert!(map.evaluate(speed, pr + step).flow_corrected_kg_s <= here + 1e-15);
        }
    }
}
