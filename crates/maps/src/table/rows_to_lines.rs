//! Groups rows of a table into speed lines.

use crate::assemble::{line, move_to_speed};
use crate::table::quantity;
use mapper_core::{
    CommonErrors, CompressorMap, IdentifiedPoint, ImportError, ImportRemark, Method, PoorFit, ReferenceState,
    StepKind, SurgeFoundBy, SurgeMark, Verdict, Warning,
};
use mapper_numerics::statistics::range;
use mapper_physics::compressor_map::closed_form_map::{MIN_TOP_SPEED_RPM, max_flow_kg_s};
use std::ops::RangeInclusive;

/// Maximum number of points. Bound: memory; a map has some hundred.
pub const MAX_POINTS: usize = 100_000;

/// Minimum pressure ratio of a compressor's map, far beyond choke. Bound: half the inlet pressure is that of a choked pipe.
const MIN_PRESSURE_RATIO: f64 = 0.5;

/// Maximum relative difference of speed within a line. Bound: it varies by 1 %, and lines of maps are at least 5 % apart.
const MAX_LINE_SPEED_DIFFERENCE_RATIO: f64 = 0.015;
/// Range of a corrected speed, rpm. Bound: no wheel turns outside it; relative speeds are below 1.
const SPEED_RANGE_RPM: RangeInclusive<f64> = 1.0..=2e6;
/// Maximum corrected flow, kg/s. Bound: ten times that of the largest compressors.
const MAX_FLOW_KG_S: f64 = 1e4;
/// Maximum pressure ratio of a stage or a whole machine. Bound: the largest have about forty.
pub(crate) const MAX_PRESSURE_RATIO: f64 = 50.0;
/// Range of an efficiency. Bound: apparent ones of hot or idle machines are far from 0 to 1; percentages are larger.
pub(crate) const ETA_RANGE: RangeInclusive<f64> = -5.0..=1.5;

/// The four numbers that every map has for a point.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Line of the file, from 1.
    pub at: usize,
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, fraction.
    pub eta: Option<f64>,
}

impl Row {
    /// Refuses values that are impossible for a compressor.
    pub fn check(&self) -> Result<(), ImportError> {
        let positive = "a number above 0";
        for (quantity, value, good, needed) in [
            (
                "corrected speed",
                self.speed_corrected_rpm,
                SPEED_RANGE_RPM.contains(&self.speed_corrected_rpm),
                "between 1 and 2e6 rpm",
            ),
            (
                "corrected flow",
                self.flow_corrected_kg_s,
                self.flow_corrected_kg_s > 0.0 && self.flow_corrected_kg_s < MAX_FLOW_KG_S,
                positive,
            ),
            (
                "pressure ratio",
                self.pressure_ratio,
                self.pressure_ratio > 0.0 && self.pressure_ratio < MAX_PRESSURE_RATIO,
                "above 0, below 50",
            ),
            (
                "efficiency",
                self.eta.unwrap_or(0.5),
                self.eta.is_none_or(|eta| ETA_RANGE.contains(&eta)),
                "a fraction (0.72), not a percentage; leave the cell of a missing value empty",
            ),
        ] {
            if !(value.is_finite() && good) {
                return Err(ImportError::Value { line: self.at, quantity, value, needed });
            }
        }
        let limit_kg_s = max_flow_kg_s(self.speed_corrected_rpm);
        if self.flow_corrected_kg_s > limit_kg_s && self.pressure_ratio < MIN_PRESSURE_RATIO {
            return Err(ImportError::Exchanged {
                line: self.at,
                flow_corrected_kg_s: self.flow_corrected_kg_s,
                pressure_ratio: self.pressure_ratio,
            });
        }
        if self.flow_corrected_kg_s > limit_kg_s {
            return Err(ImportError::Flow {
                line: self.at,
                flow_corrected_kg_s: self.flow_corrected_kg_s,
                speed_corrected_rpm: self.speed_corrected_rpm,
                limit_kg_s,
            });
        }
        Ok(())
    }

    /// A point with only the values of its row. Physical values are those at the reference state.
    pub fn point(&self, reference: ReferenceState, step: usize) -> IdentifiedPoint {
        let impossible = self.eta.filter(|eta| *eta > 1.0).map(|eta| Warning::PoorFit(PoorFit::Eta { eta }));
        IdentifiedPoint {
            step,
            kind: StepKind::Point,
            target: None,
            speed_rpm: self.speed_corrected_rpm,
            valve_opening_ratio: f64::NAN,
            flow_kg_s: self.flow_corrected_kg_s,
            flow_corrected_kg_s: self.flow_corrected_kg_s,
            speed_corrected_rpm: self.speed_corrected_rpm,
            pressure_ratio: self.pressure_ratio,
            t1_k: reference.t_ref_k,
            p1_pa: reference.p_ref_pa,
            eta: self.eta,
            eta_low: None,
            eta_high: None,
            eta_allowance: None,
            eta_uncertainty: None,
            h_w_m2k: None,
            h_low_w_m2k: None,
            h_high_w_m2k: None,
            h_uncertainty: None,
            common: CommonErrors::default(),
            method: Method::Imported,
            verdict: if impossible.is_none() && self.eta.is_some() {
                Verdict::Good
            } else {
                Verdict::Unusable
            },
            warnings: impossible.into_iter().collect(),
            window: None,
            residual_rms_k: None,
            dt2_k: None,
            dtc_k: None,
        }
    }
}

/// A map of rows with only four numbers.
pub fn map_of_rows(
    machine: String,
    rows: &[Row],
    found: Option<ReferenceState>,
    given: Option<ReferenceState>,
) -> Result<CompressorMap, ImportError> {
    let reference = quantity::resolve_reference(found, given)?;
    if rows.is_empty() {
        return Err(ImportError::Empty);
    }
    let fastest_rpm = rows.iter().map(|row| row.speed_corrected_rpm).fold(0.0, f64::max);
    if fastest_rpm < MIN_TOP_SPEED_RPM {
        return Err(ImportError::Slow { speed_corrected_rpm: fastest_rpm });
    }
    let mut points: Vec<IdentifiedPoint> =
        rows.iter().enumerate().map(|(step, row)| row.point(reference, step)).collect();
    points.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let lines = points
        .chunk_by(|a, b| {
            b.speed_corrected_rpm <= a.speed_corrected_rpm * (1.0 + MAX_LINE_SPEED_DIFFERENCE_RATIO)
        })
        .map(|members| {
            let speeds_rpm = || members.iter().map(|point| point.speed_corrected_rpm);
            let (low, high) = range(speeds_rpm());
            // Rounding may move the mean of equal numbers away from them.
            let mean = if low == high { low } else { speeds_rpm().sum::<f64>() / members.len() as f64 };
            line(mean, members.iter().map(|point| move_to_speed(point, mean)).collect())
        })
        .collect();
    Ok(CompressorMap {
        machine,
        reference,
        method: Method::Imported,
        efficiency: None,
        gas: None,
        wheel_diameter_m: None,
        lines,
        surge: Vec::new(),
        fitted: None,
    })
}

/// Gives the points of a surge line without speeds those of the lines that end at their pressure ratios. Points that no line is near are left out.
pub(crate) fn add_surge_speeds(rows: &[Row], surge: &mut Vec<Row>) -> Option<ImportRemark> {
    let points = surge.iter().filter(|row| row.speed_corrected_rpm.is_nan()).count();
    if points == 0 {
        return None;
    }
    let mut by_speed = rows.to_vec();
    by_speed.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let lines = by_speed.chunk_by(|a, b| {
        b.speed_corrected_rpm <= a.speed_corrected_rpm * (1.0 + MAX_LINE_SPEED_DIFFERENCE_RATIO)
    });
    let end = |line: &[Row]| {
        line.iter().min_by(|a, b| a.flow_corrected_kg_s.total_cmp(&b.flow_corrected_kg_s)).copied()
    };
    let ends: Vec<Row> = lines.filter_map(end).collect();
    let speed_rpm = |ratio: f64| {
        let after = ends.iter().position(|end| end.pressure_ratio >= ratio).unwrap_or(ends.len());
        let after = after.clamp(1, ends.len().checked_sub(1).filter(|last| *last > 0)?);
        let (a, b) = (ends.get(after - 1)?, ends.get(after)?);
        let share = (ratio - a.pressure_ratio) / (b.pressure_ratio - a.pressure_ratio);
        let near = -MAX_BEYOND..=1.0 + MAX_BEYOND;
        near.contains(&share)
            .then_some(a.speed_corrected_rpm + share * (b.speed_corrected_rpm - a.speed_corrected_rpm))
    };
    let rises = ends.windows(2).all(|pair| pair[1].pressure_ratio > pair[0].pressure_ratio);
    for row in surge.iter_mut().filter(|row| row.speed_corrected_rpm.is_nan()) {
        row.speed_corrected_rpm = speed_rpm(row.pressure_ratio).filter(|_| rises).unwrap_or(f64::NAN);
    }
    let before = surge.len();
    surge.retain(|row| row.speed_corrected_rpm.is_finite());
    Some(ImportRemark::SurgeSpeeds { points, left_out: before - surge.len() })
}

/// Distance of a point of the surge line beyond the outermost line, over the distance of the next two. Bound: further out is another map.
const MAX_BEYOND: f64 = 0.5;

/// The surge line of a file, without standard errors.
pub(crate) fn surge_marks(map: &CompressorMap, rows: &[Row]) -> Vec<SurgeMark> {
    let mark = |row: &Row| {
        let difference = |speed_rpm: f64| (speed_rpm - row.speed_corrected_rpm).abs();
        let line = map
            .lines
            .iter()
            .min_by(|a, b| difference(a.speed_corrected_rpm).total_cmp(&difference(b.speed_corrected_rpm)));
        let points = line.iter().flat_map(|line| &line.points);
        let closest = points.map(|point| point.flow_corrected_kg_s).min_by(f64::total_cmp);
        SurgeMark {
            target_speed_rpm: row.speed_corrected_rpm,
            speed_corrected_rpm: row.speed_corrected_rpm,
            flow_corrected_kg_s: row.flow_corrected_kg_s,
            flow_standard_error_kg_s: 0.0,
            flow_common_standard_error_kg_s: 0.0,
            pressure_ratio: row.pressure_ratio,
            pressure_ratio_standard_error: 0.0,
            closest_flow_corrected_kg_s: closest.unwrap_or(row.flow_corrected_kg_s),
            closest_end_s: 0.0,
            found_by: SurgeFoundBy::File,
            steps: 0,
            soft: None,
        }
    };
    let mut marks: Vec<SurgeMark> = rows.iter().map(mark).collect();
    marks.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    marks
}

/// Minimum change of speed that is reported. Bound: speed control and the rounding of a file leave less.
const MIN_REPORTED_SHIFT_RATIO: f64 = 0.005;

/// A remark if points were moved to the speed of their line.
pub fn shift_remark(map: &CompressorMap) -> Option<ImportRemark> {
    let shifts = map.lines.iter().flat_map(|line| line.points.iter().map(move |point| (line, point)));
    let ratios: Vec<f64> = shifts
        .filter_map(|(line, point)| Some(point.shift?.speed_corrected_rpm.abs() / line.speed_corrected_rpm))
        .filter(|ratio| *ratio >= MIN_REPORTED_SHIFT_RATIO)
        .collect();
    let max_ratio = ratios.iter().copied().max_by(f64::total_cmp)?;
    Some(ImportRemark::MovedToLineSpeed { points: ratios.len(), max_ratio })
}

/// Refuses a file with too many rows.
pub fn check_point_count(count: usize, at: usize) -> Result<(), ImportError> {
    if count >= MAX_POINTS {
        return Err(ImportError::TooMany { line: at, limit: MAX_POINTS });
    }
    Ok(())
}
