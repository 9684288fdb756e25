//! Observations of a map fit: the measured points, each at its own speed, and the effect of errors common to all of them at a place of the fit.
//!
//! A fit follows such an error, so the scatter of the points about the fit does not show it. Its effect at a place is therefore a weighted
//! mean of its effect at the surrounding points.

use mapper_core::{CommonErrors, CompressorMap, MapPoint, SurgeMark, Verdict};
use mapper_physics::compressor_map::closed_form_map::head_ratio;

/// Why a map could not be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum MapFitError {
    #[error("the map has {0} speed line(s) with points; a fit over speed needs at least 2")]
    TooFewLines(usize),
    /// `points` have flow and pressure ratio, `with_eta` an efficiency too.
    #[error(
        "the map has {points} points and {with_eta} efficiencies; a fit needs at least 8 and 6, preferably 5 or more on each line"
    )]
    TooFewPoints { points: usize, with_eta: usize },
    #[error("the map has {points} points on {lines} lines; a fit takes at most {max_points} on {max_lines}")]
    TooMany { points: usize, lines: usize, max_points: usize, max_lines: usize },
    #[error(
        "on the line at {speed_corrected_rpm} rpm no pressure ratio is above 1; a fit needs lines on which the machine compresses"
    )]
    NoCompression { speed_corrected_rpm: f64 },
    #[error(
        "a line at {speed_corrected_rpm} rpm is outside the range of the fit; give a speed between {lowest_rpm} and {highest_rpm} rpm"
    )]
    Speed { speed_corrected_rpm: f64, lowest_rpm: f64, highest_rpm: f64 },
    #[error(
        "the fit did not converge: its equations became singular; look for points far from their line, and for lines with equal speeds"
    )]
    Singular,
}

/// Maximum pressure ratio of a point. Bound: several stages; a larger one is a mistake.
const MAX_PRESSURE_RATIO: f64 = 50.0;
/// Minimum PR - 1 of a line. Bound: 10 Pa of 100 kPa, below the resolution of any sensor.
const MIN_PRESSURE_RISE: f64 = 1e-4;
/// Relative difference of speed within one line. Bound: stands hold a speed within 1 %; a fit over speed needs two.
const SAME_LINE_RATIO: f64 = 1e-3;
/// Efficiencies that are fitted. Bound: apparent efficiencies and choked points included.
const USABLE_ETA: std::ops::RangeInclusive<f64> = -1.0..=1.5;
/// Minimum number of points. Bound: a line has six parameters of its shape, two of them over speed.
const MIN_POINTS: usize = 8;
/// Minimum number of points with an efficiency. Bound: the work coefficient has six terms.
const MIN_POINTS_WITH_ETA: usize = 6;

/// Maximum number of points of a fit. Bound: effort; several times those of the largest measured maps.
const MAX_POINTS: usize = 2000;
/// Maximum number of lines of a fit. Bound: as for the points.
const MAX_LINES: usize = 60;
/// Maximum relative difference between the speeds of a surge mark and its line. Bound: less than half of the distance of lines.
const MAX_MARK_SPEED_DIFFERENCE_RATIO: f64 = 0.03;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation {
    /// Index of the line in [`Observations::lines`].
    pub line: usize,
    /// Corrected speed over the nominal speed of the fit.
    pub speed_ratio: f64,
    pub flow_kg_s: f64,
    pub pressure_ratio: f64,
    pub eta: Option<f64>,
    /// Independent standard error of the efficiency, fraction; 0 if unknown.
    pub eta_error: f64,
    /// Whether it is a surge mark, which gives the end of the line without an efficiency.
    pub is_mark: bool,
    /// Units of the distance: the line's maximum flow, kg/s, and maximum pressure ratio minus 1.
    pub flow_scale_kg_s: f64,
    pub ratio_scale: f64,
}

impl Observation {
    /// Flow over speed.
    pub(crate) fn flow(&self) -> f64 {
        self.flow_kg_s / self.speed_ratio
    }

    /// Isentropic head over the square of speed.
    pub(crate) fn head(&self) -> f64 {
        head_ratio(self.pressure_ratio) / (self.speed_ratio * self.speed_ratio)
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Observations {
    /// Unit of speed ratios, rpm.
    pub nominal_speed_rpm: f64,
    pub lines_rpm: Vec<f64>,
    pub points: Vec<Observation>,
    /// Errors common to all points, which the residuals do not show.
    pub common: CommonErrorField,
}

impl Observations {
    pub(crate) fn of(map: &CompressorMap) -> Result<Self, MapFitError> {
        let usable = |p: &&MapPoint| {
            let p = &p.identified;
            [p.flow_corrected_kg_s, p.pressure_ratio, p.speed_corrected_rpm]
                .iter()
                .all(|v| v.is_finite() && *v > 0.0)
                && p.pressure_ratio < MAX_PRESSURE_RATIO
        };
        let mut lines: Vec<(f64, Vec<&MapPoint>)> = map
            .lines
            .iter()
            .map(|line| (line.speed_corrected_rpm, line.points.iter().filter(usable).collect::<Vec<_>>()))
            .filter(|(speed, points)| speed.is_finite() && *speed > 0.0 && !points.is_empty())
            .collect();
        lines.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count: usize = lines.iter().map(|(_, points)| points.len()).sum();
        if lines.len() > MAX_LINES || count > MAX_POINTS {
            return Err(MapFitError::TooMany {
                points: count,
                lines: lines.len(),
                max_points: MAX_POINTS,
                max_lines: MAX_LINES,
            });
        }
        let nominal_speed_rpm = lines.get(lines.len() / 2).map_or(1.0, |line| line.0);
        let (mut points, mut common) = (Vec::with_capacity(count), CommonErrorField::default());
        for (index, (speed_corrected_rpm, members)) in lines.iter().enumerate() {
            let largest =
                |value: fn(&MapPoint) -> f64| members.iter().map(|p| value(p)).fold(f64::MIN, f64::max);
            let flow_scale_kg_s = largest(|p| p.identified.flow_corrected_kg_s);
            let ratio_scale = largest(|p| p.identified.pressure_ratio) - 1.0;
            if ratio_scale <= MIN_PRESSURE_RISE {
                return Err(MapFitError::NoCompression { speed_corrected_rpm: *speed_corrected_rpm });
            }
            for point in members {
                let own = observation(point, index, nominal_speed_rpm, flow_scale_kg_s, ratio_scale);
                common.add(own.speed_ratio, own.flow_kg_s / flow_scale_kg_s, point);
                points.push(own);
            }
            let on_line = |mark: &&SurgeMark| {
                (mark.speed_corrected_rpm / speed_corrected_rpm - 1.0).abs() < MAX_MARK_SPEED_DIFFERENCE_RATIO
                    && mark.flow_corrected_kg_s > 0.0
                    && mark.pressure_ratio > 1.0
            };
            points.extend(map.surge.iter().filter(on_line).map(|mark| Observation {
                line: index,
                speed_ratio: mark.speed_corrected_rpm / nominal_speed_rpm,
                flow_kg_s: mark.flow_corrected_kg_s,
                pressure_ratio: mark.pressure_ratio,
                eta: None,
                eta_error: 0.0,
                is_mark: true,
                flow_scale_kg_s,
                ratio_scale,
            }));
        }
        let lines_rpm = lines.iter().map(|line| line.0).collect();
        let all = Observations { nominal_speed_rpm, lines_rpm, points, common };
        all.check_sufficient()?;
        Ok(all)
    }

    pub(crate) fn without_line(&self, line: usize) -> Result<Self, MapFitError> {
        let mut lines_rpm = self.lines_rpm.clone();
        lines_rpm.remove(line);
        let points = self
            .points
            .iter()
            .filter(|p| p.line != line)
            .map(|p| Observation { line: if p.line > line { p.line - 1 } else { p.line }, ..*p });
        let rest = Observations {
            nominal_speed_rpm: self.nominal_speed_rpm,
            lines_rpm,
            points: points.collect(),
            common: self.common.clone(),
        };
        rest.check_sufficient()?;
        Ok(rest)
    }

    fn check_sufficient(&self) -> Result<(), MapFitError> {
        let distinct =
            1 + self.lines_rpm.windows(2).filter(|w| w[1] > w[0] * (1.0 + SAME_LINE_RATIO)).count();
        if self.lines_rpm.len() < 2 || distinct < 2 {
            return Err(MapFitError::TooFewLines(distinct.min(self.lines_rpm.len())));
        }
        let with_eta = self.points.iter().filter(|p| p.eta.is_some()).count();
        if self.points.len() < MIN_POINTS || with_eta < MIN_POINTS_WITH_ETA {
            return Err(MapFitError::TooFewPoints { points: self.points.len(), with_eta });
        }
        Ok(())
    }
}

fn observation(
    point: &MapPoint,
    line: usize,
    nominal_speed_rpm: f64,
    flow_scale_kg_s: f64,
    ratio_scale: f64,
) -> Observation {
    let p = &point.identified;
    let eta = point.eta.filter(|eta| p.verdict != Verdict::Unusable && USABLE_ETA.contains(eta));
    let eta_error = p.eta_own_standard_error().unwrap_or(0.0);
    Observation {
        line,
        speed_ratio: p.speed_corrected_rpm / nominal_speed_rpm,
        flow_kg_s: p.flow_corrected_kg_s,
        pressure_ratio: p.pressure_ratio,
        eta,
        is_mark: false,
        eta_error: if eta_error.is_finite() { eta_error.clamp(0.0, 1.0) } else { 1.0 },
        flow_scale_kg_s,
        ratio_scale,
    }
}

/// Distance of half weight, in units of the nominal speed and of the line's maximum flow. Bound: the distance of neighbouring points.
const HALF_WEIGHT_DISTANCE_RATIO: f64 = 0.1;

#[derive(Debug, Clone, Default)]
pub(crate) struct CommonErrorField {
    points: Vec<Entry>,
}

#[derive(Debug, Clone)]
struct Entry {
    speed_ratio: f64,
    flow_ratio: f64,
    common: CommonErrors,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PlaceCommonErrors {
    /// Of efficiency, fraction.
    pub eta_standard_error: f64,
    /// Of corrected flow, ratio.
    pub flow_standard_error_ratio: f64,
    pub pressure_ratio_standard_error: f64,
}

impl CommonErrorField {
    /// Adds a point's errors; `flow_ratio` is its flow over the line's maximum.
    pub(crate) fn add(&mut self, speed_ratio: f64, flow_ratio: f64, point: &MapPoint) {
        let common = point.identified.common.clone();
        if common != CommonErrors::default() {
            self.points.push(Entry { speed_ratio, flow_ratio, common });
        }
    }

    /// Errors at a place: mean over the points with weights that fall with the square of the distance.
    pub(crate) fn at(&self, speed_ratio: f64, flow_ratio: f64) -> PlaceCommonErrors {
        let error_count = self.points.iter().map(|point| point.common.eta_changes.len()).max().unwrap_or(0);
        let mut eta = vec![0.0; error_count];
        let (mut all, mut with_eta) = (0.0, 0.0);
        let mut errors = PlaceCommonErrors::default();
        for Entry { speed_ratio: speed, flow_ratio: flow, common } in &self.points {
            let square = ((speed_ratio - speed).powi(2) + (flow_ratio - flow).powi(2))
                / (HALF_WEIGHT_DISTANCE_RATIO * HALF_WEIGHT_DISTANCE_RATIO);
            let weight = 1.0 / (1.0 + square * square);
            all += weight;
            errors.flow_standard_error_ratio += weight * common.flow_corrected_standard_error_ratio;
            errors.pressure_ratio_standard_error += weight * common.pressure_ratio_standard_error;
            if !common.eta_changes.is_empty() {
                with_eta += weight;
                for (sum, change) in eta.iter_mut().zip(&common.eta_changes) {
                    *sum += weight * change;
                }
            }
        }
        if all > 0.0 {
            errors.flow_standard_error_ratio /= all;
            errors.pressure_ratio_standard_error /= all;
        }
        if with_eta > 0.0 {
            errors.eta_standard_error = eta.iter().map(|sum| (sum / with_eta).powi(2)).sum::<f64>().sqrt();
        }
        errors
    }
}
