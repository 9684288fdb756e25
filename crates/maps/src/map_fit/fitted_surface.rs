//! The fitted map for its users: values and standard errors at any place, and a table with marks of extrapolation.

use crate::map_fit::MapFitError;
use crate::map_fit::observations::Observations;
use crate::map_fit::problem::PARAMETER_STEP;
use crate::map_fit::solution::Solution;
use crate::map_fit::speed_lines::{
    ANGLE_RANGE_RAD, DIFFERENCE_STEP_RAD, FlowFrame, LineShape, MIN_ANGLE_RAD, MIN_SQUARE_SLOPE, PARAMETERS,
    Parameters, Scales, SpeedSpline, WORK, count_crossings, nearest, normal,
};
use mapper_core::{FittedLine, FittedMap, FittedNode};
use mapper_numerics::root::bisect;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Minimum flow of a line as a unit, kg/s. Bound: excludes division by zero.
pub(crate) const MIN_FLOW_KG_S: f64 = 1e-12;
/// Minimum PR - 1 of a line as a unit. Bound: excludes division by zero.
pub(crate) const MIN_RATIO_RANGE: f64 = 1e-6;
/// Relative difference of equal speeds. Bound: rounding.
const SPEED_ROUNDING_RATIO: f64 = 1e-9;

/// Minimum and maximum speed of a fit, over the slowest and the fastest measured speed. Bound: beyond, the errors are larger than the
/// map.
const SPEED_RANGE_RATIO: (f64, f64) = (0.1, 1.3);

/// A fitted surface.
#[derive(Debug, Clone)]
pub struct MapFit {
    pub(crate) data: Observations,
    pub(crate) solution: Solution,
    /// Fits without an outermost line, by that line, as far as they were needed.
    pub(crate) without_line: BTreeMap<usize, MapFit>,
}

/// The place on a fitted line nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestPlace {
    /// Distance in units of the line's scales (flow, pressure ratio minus 1), not negative.
    pub distance_ratio: f64,
    /// Efficiency of the line at the nearest place, fraction.
    pub eta: f64,
    /// One standard error of the line there, across it, in units of the line's scales.
    pub distance_standard_error_ratio: f64,
    /// One standard error of the efficiency without the errors common to all points, fraction.
    pub eta_standard_error: f64,
}

impl MapFit {
    /// Nearest place of the line at `speed_corrected_rpm` to a flow (kg/s) and pressure ratio; distances are measured
    /// in `flow_scale_kg_s` and `ratio_scale`, both above 0.
    pub fn nearest(
        &self,
        speed_corrected_rpm: f64,
        flow_corrected_kg_s: f64,
        pressure_ratio: f64,
        flow_scale_kg_s: f64,
        ratio_scale: f64,
    ) -> NearestPlace {
        let speed_ratio = self.speed_ratio(speed_corrected_rpm);
        let scales = Scales { flow_kg_s: flow_scale_kg_s, ratio: ratio_scale };
        let point = (flow_corrected_kg_s, pressure_ratio);
        let foot = nearest(&self.shape(speed_corrected_rpm), speed_ratio, point, scales, None);
        let (x, y) = (
            (foot.place.flow_kg_s - point.0) / scales.flow_kg_s,
            (foot.place.pressure_ratio - point.1) / scales.ratio,
        );
        let error = LineErrors::new(&self.solution, speed_ratio).at(foot.angle_rad, scales);
        NearestPlace {
            distance_ratio: x.hypot(y),
            eta: self.limit_efficiency(foot.place.eta, self.is_outside(speed_ratio)),
            distance_standard_error_ratio: error.distance_ratio,
            eta_standard_error: error.eta,
        }
    }

    pub(crate) fn speed_ratio(&self, speed_corrected_rpm: f64) -> f64 {
        speed_corrected_rpm / self.data.nominal_speed_rpm
    }

    pub(crate) fn shape(&self, speed_corrected_rpm: f64) -> LineShape {
        self.solution.shape(self.speed_ratio(speed_corrected_rpm))
    }

    pub(crate) fn is_outside(&self, speed_ratio: f64) -> bool {
        self.solution.splines.shape.outside(speed_ratio) > SPEED_ROUNDING_RATIO
    }

    /// The efficiency; in extrapolation at most the best measured one.
    fn limit_efficiency(&self, eta: f64, extrapolated: bool) -> f64 {
        if extrapolated { eta.min(self.solution.best_eta) } else { eta }
    }

    fn speed_bounds_rpm(&self) -> (f64, f64) {
        let (first, last) = (self.data.lines_rpm.first(), self.data.lines_rpm.last());
        (
            SPEED_RANGE_RATIO.0 * first.copied().unwrap_or(1.0),
            SPEED_RANGE_RATIO.1 * last.copied().unwrap_or(1.0),
        )
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaceError {
    /// Across the line, in units of the line's scales.
    pub distance_ratio: f64,
    /// The part of it along the axis of flow, not negative.
    pub flow_part_ratio: f64,
    /// The part of it along the axis of pressure ratio, not negative.
    pub pressure_part_ratio: f64,
    /// Of efficiency at the nearest place, fraction.
    pub eta: f64,
}

pub(crate) struct LineErrors {
    frame: FlowFrame,
    parameters: Parameters,
    covariance: DMatrix<f64>,
    speed_ratio: f64,
}

impl LineErrors {
    pub(crate) fn new(solution: &Solution, speed_ratio: f64) -> Self {
        LineErrors {
            frame: solution.frame,
            parameters: solution.parameters(speed_ratio),
            covariance: solution.covariance(speed_ratio),
            speed_ratio,
        }
    }

    pub(crate) fn at(&self, angle_rad: f64, scales: Scales) -> PlaceError {
        let at = |shape: &LineShape, angle: f64| {
            let place = shape.physical(angle, self.speed_ratio);
            [place.flow_kg_s / scales.flow_kg_s, place.pressure_ratio / scales.ratio, place.eta]
        };
        let shape = LineShape::new(&self.parameters, self.frame);
        let (here, next) = (at(&shape, angle_rad), at(&shape, angle_rad + DIFFERENCE_STEP_RAD));
        let slope: [f64; 3] = std::array::from_fn(|i| (next[i] - here[i]) / DIFFERENCE_STEP_RAD);
        let (nx, ny) = normal(&slope);
        let length = (slope[0].powi(2) + slope[1].powi(2)).max(MIN_SQUARE_SLOPE);
        let place = shape.at(angle_rad);
        let work_terms = shape.work_terms(place.flow_at_nominal_kg_s, place.head);
        let (mut across, mut eta) = (DVector::zeros(PARAMETERS), DVector::zeros(PARAMETERS));
        for q in 0..PARAMETERS {
            if q >= WORK {
                // The work parameters affect efficiency only.
                eta[q] = -here[2] * work_terms[q - WORK];
                continue;
            }
            let mut moved = self.parameters;
            moved[q] += PARAMETER_STEP;
            let there = at(&LineShape::new(&moved, self.frame), angle_rad);
            let d: [f64; 3] = std::array::from_fn(|i| (there[i] - here[i]) / PARAMETER_STEP);
            across[q] = d[0] * nx + d[1] * ny;
            // The nearest place moves along the line as the line moves.
            eta[q] = d[2] - slope[2] * (d[0] * slope[0] + d[1] * slope[1]) / length;
        }
        let error = |gradient: &DVector<f64>| gradient.dot(&(&self.covariance * gradient)).max(0.0).sqrt();
        let distance = error(&across);
        PlaceError {
            distance_ratio: distance,
            flow_part_ratio: distance * nx.abs(),
            pressure_part_ratio: distance * ny.abs(),
            eta: error(&eta),
        }
    }
}

/// Ridge of the smoothed ends. Bound: keeps the matrix regular, far below any weight.
const RIDGE: f64 = 1e-9;
/// Minimum angle of a surge-side end, rad. Bound: a line has a length.
const MIN_SURGE_RAD: f64 = 0.2;
/// Share of the pressure rise by which a line ends below a pressure ratio of 1. Bound: the vertical part is then complete.
const LOWEST_SHARE: f64 = 0.15;
/// Minimum of this lowest pressure ratio. Bound: engine models ask for no lower one.
const MIN_LOWEST_RATIO: f64 = 0.9;
/// Distance beyond the last point that is not an extrapolation, rad. Bound: about 1 % of a line.
const ANGLE_TOLERANCE_RAD: f64 = 0.02;

/// Steps along a line for the placement of nodes at equal distances. Bound: six steps for each of the usual 40 nodes.
const WALK_STEPS: usize = 240;
/// Default further speeds of a table: two over the slowest measured speed, one over the fastest. Bound: engine models need idle, and a
/// margin above the fastest line.
const DEFAULT_SPEED_RATIOS: (f64, f64, f64) = (0.4, 0.7, 1.05);

/// Contents of a table of the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct MapFitOptions {
    /// Corrected speeds of further lines, rpm; the measured lines are always included. `None` adds two below
    /// and one above, all extrapolated.
    pub further_speeds_rpm: Option<Vec<f64>>,
    /// Nodes on each line, 5 to 400.
    pub nodes: usize,
    /// Whether to estimate the error at unmeasured lines by leaving each line out in turn.
    pub leave_one_out: bool,
}

impl Default for MapFitOptions {
    fn default() -> Self {
        MapFitOptions { further_speeds_rpm: None, nodes: 41, leave_one_out: true }
    }
}

pub(crate) fn table(fit: &MapFit, options: &MapFitOptions) -> Result<FittedMap, MapFitError> {
    let (lowest_rpm, highest_rpm) = fit.speed_bounds_rpm();
    let measured = &fit.data.lines_rpm;
    let (first, last) = (lowest_rpm / SPEED_RANGE_RATIO.0, highest_rpm / SPEED_RANGE_RATIO.1);
    let further = match &options.further_speeds_rpm {
        Some(speeds) => speeds.clone(),
        None => vec![
            DEFAULT_SPEED_RATIOS.0 * first,
            DEFAULT_SPEED_RATIOS.1 * first,
            DEFAULT_SPEED_RATIOS.2 * last,
        ],
    };
    for speed in &further {
        if !(*speed >= lowest_rpm && *speed <= highest_rpm) {
            return Err(MapFitError::Speed { speed_corrected_rpm: *speed, lowest_rpm, highest_rpm });
        }
    }
    let mut speeds: Vec<(f64, bool)> = measured.iter().map(|speed| (*speed, true)).collect();
    speeds.extend(further.iter().map(|speed| (*speed, false)));
    speeds.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
    // A further speed equal to a measured one counts as measured, and equal lines are merged.
    speeds.dedup_by(|b, a| b.0 <= a.0 * (1.0 + SPEED_ROUNDING_RATIO));
    let nodes = options.nodes.clamp(5, 400);
    let ends = LineEndAngles::new(fit);
    let lines: Vec<FittedLine> = speeds
        .into_iter()
        .map(|(speed_corrected_rpm, measured)| FittedLine {
            speed_corrected_rpm,
            measured,
            nodes: line_nodes(fit, &ends, speed_corrected_rpm, nodes),
        })
        .collect();
    Ok(FittedMap {
        beta_ratio: (0..nodes).map(|i| i as f64 / (nodes - 1) as f64).collect(),
        crossings: count_crossings(&lines),
        lines,
        distance_rms_ratio: fit.solution.rms[0],
        eta_rms: fit.solution.rms[1],
        line_scatter_ratio: fit.solution.line_scatter[0],
        left_out: Vec::new(),
    })
}

/// End angles of the lines over speed, rad.
struct LineEndAngles {
    /// Spline of the smooth surge-side end, with its knot values.
    spline: SpeedSpline,
    surge: DVector<f64>,
    measured: Vec<MeasuredEnds>,
}

struct MeasuredEnds {
    speed_ratio: f64,
    /// Smallest and largest angle with a measured point.
    points: (f64, f64),
    /// Largest angle, surge marks included.
    surge: f64,
}

/// Smoothing of the surge-side ends: variance of an end over that of its roughness. Bound: an end is known to a twentieth of its
/// roughness, 0.06^2.
const END_SMOOTHING: f64 = 0.004;

impl LineEndAngles {
    fn new(fit: &MapFit) -> Self {
        let mut measured: Vec<MeasuredEnds> = fit
            .data
            .lines_rpm
            .iter()
            .map(|speed| MeasuredEnds {
                speed_ratio: fit.speed_ratio(*speed),
                points: (f64::INFINITY, f64::NEG_INFINITY),
                surge: f64::NEG_INFINITY,
            })
            .collect();
        for (point, angle) in fit.data.points.iter().zip(&fit.solution.angles_rad) {
            let line = &mut measured[point.line];
            line.surge = line.surge.max(*angle);
            if !point.is_mark {
                line.points = (line.points.0.min(*angle), line.points.1.max(*angle));
            }
        }
        let spline = fit.solution.splines.shape.clone();
        let rows: Vec<DVector<f64>> = measured.iter().map(|line| spline.row(line.speed_ratio)).collect();
        let basis = DMatrix::from_fn(rows.len(), spline.len(), |i, k| rows[i][k]);
        let ends = DVector::from_iterator(measured.len(), measured.iter().map(|line| line.surge));
        let mean = ends.mean();
        let square = basis.tr_mul(&basis)
            + &spline.penalty * END_SMOOTHING
            + DMatrix::identity(spline.len(), spline.len()) * RIDGE;
        let deviation = square
            .cholesky()
            .map(|factor| factor.solve(&basis.tr_mul(&ends.add_scalar(-mean))))
            .unwrap_or_else(|| DVector::zeros(spline.len()));
        LineEndAngles { spline, surge: deviation.add_scalar(mean), measured }
    }

    /// Surge-side end: smooth over speed, so that a line without points there ends like its neighbours, and never before the last
    /// measured point.
    fn surge_rad(&self, speed_ratio: f64) -> f64 {
        let smooth = |speed: f64| self.spline.row(speed).dot(&self.surge);
        let (Some(first), Some(last)) = (self.measured.first(), self.measured.last()) else {
            return smooth(speed_ratio).clamp(MIN_SURGE_RAD, ANGLE_RANGE_RAD.1);
        };
        // Beyond the measured speeds the end keeps the distance from the smooth end that it has at the outermost line.
        let at = speed_ratio.clamp(first.speed_ratio, last.speed_ratio);
        let measured = self.between(at, |line| line.surge).unwrap_or(f64::NEG_INFINITY);
        let over = (measured - smooth(at)).max(0.0);
        (smooth(speed_ratio) + over).clamp(MIN_SURGE_RAD, ANGLE_RANGE_RAD.1)
    }

    /// Range of angles with measured points; `None` outside the measured speeds.
    fn supported(&self, speed_ratio: f64) -> Option<(f64, f64)> {
        let low = self.between(speed_ratio, |line| line.points.0)?;
        Some((low, self.between(speed_ratio, |line| line.points.1)?))
    }

    /// A value of the measured lines, linear between neighbours; `None` outside the measured speeds.
    fn between(&self, speed_ratio: f64, value: impl Fn(&MeasuredEnds) -> f64) -> Option<f64> {
        let slack = SPEED_ROUNDING_RATIO;
        let after = self.measured.partition_point(|line| line.speed_ratio < speed_ratio - slack);
        let upper = self.measured.get(after)?;
        if upper.speed_ratio <= speed_ratio + slack {
            return Some(value(upper));
        }
        let lower = self.measured.get(after.checked_sub(1)?)?;
        let share = (speed_ratio - lower.speed_ratio) / (upper.speed_ratio - lower.speed_ratio);
        Some(value(lower) + share * (value(upper) - value(lower)))
    }
}

fn line_nodes(fit: &MapFit, ends: &LineEndAngles, speed_corrected_rpm: f64, count: usize) -> Vec<FittedNode> {
    let speed_ratio = fit.speed_ratio(speed_corrected_rpm);
    let shape = fit.solution.shape(speed_ratio);
    let surge = ends.surge_rad(speed_ratio);
    let choke = choke_end(&shape, speed_ratio, surge);
    let walk: Vec<f64> =
        (0..=WALK_STEPS).map(|i| choke + (surge - choke) * i as f64 / WALK_STEPS as f64).collect();
    let places: Vec<(f64, f64)> = walk
        .iter()
        .map(|angle| {
            let place = shape.physical(*angle, speed_ratio);
            (place.flow_kg_s, place.pressure_ratio)
        })
        .collect();
    let max = |value: fn(&(f64, f64)) -> f64| places.iter().map(value).fold(f64::MIN, f64::max);
    let scales = Scales {
        flow_kg_s: max(|p| p.0).max(MIN_FLOW_KG_S),
        ratio: (max(|p| p.1) - 1.0).max(MIN_RATIO_RANGE),
    };
    let mut length = vec![0.0];
    for pair in places.windows(2) {
        let step = ((pair[1].0 - pair[0].0) / scales.flow_kg_s).hypot((pair[1].1 - pair[0].1) / scales.ratio);
        length.push(length[length.len() - 1] + step);
    }
    let total = length[WALK_STEPS];
    let errors = LineErrors::new(&fit.solution, speed_ratio);
    let supported = ends.supported(speed_ratio);
    let mut largest_kg_s = f64::INFINITY;
    (0..count)
        .map(|i| {
            let wanted = total * i as f64 / (count - 1) as f64;
            let after = length.partition_point(|l| *l < wanted).clamp(1, WALK_STEPS);
            let gap = length[after] - length[after - 1];
            let share = if gap > 0.0 { ((wanted - length[after - 1]) / gap).clamp(0.0, 1.0) } else { 0.0 };
            let angle = walk[after - 1] + share * (walk[after] - walk[after - 1]);
            let place = shape.physical(angle, speed_ratio);
            let error = errors.at(angle, scales);
            let is_beyond = supported.is_none_or(|(low, high)| {
                angle < low - ANGLE_TOLERANCE_RAD || angle > high + ANGLE_TOLERANCE_RAD
            });
            let eta = fit.limit_efficiency(place.eta, is_beyond);
            // There it does not compress, whatever was measured.
            let extrapolated = is_beyond || place.pressure_ratio <= 1.0 || eta <= 0.0;
            let common = fit.data.common.at(speed_ratio, place.flow_kg_s / scales.flow_kg_s);
            let work = shape.at(angle).work * speed_ratio * speed_ratio;
            // On the vertical part the correction of the radius may turn back by a permille.
            largest_kg_s = place.flow_kg_s.min(largest_kg_s);
            FittedNode {
                flow_corrected_kg_s: largest_kg_s,
                pressure_ratio: place.pressure_ratio,
                eta,
                work_ratio: if eta < place.eta { work * place.eta / eta } else { work },
                flow_standard_error_kg_s: error.flow_part_ratio * scales.flow_kg_s,
                pressure_ratio_standard_error: error.pressure_part_ratio * scales.ratio,
                eta_standard_error: error.eta.hypot(common.eta_standard_error),
                eta_common_standard_error: common.eta_standard_error,
                flow_common_standard_error_kg_s: common.flow_standard_error_ratio * place.flow_kg_s,
                pressure_ratio_common_standard_error: common.pressure_ratio_standard_error,
                extrapolated,
            }
        })
        .collect()
}

/// Angle of the lowest pressure ratio of the line.
fn choke_end(shape: &LineShape, speed_ratio: f64, surge_rad: f64) -> f64 {
    let ratio = |angle: f64| shape.physical(angle, speed_ratio).pressure_ratio;
    let top = ratio(surge_rad.min(std::f64::consts::FRAC_PI_2)).max(ratio(surge_rad));
    // Below 1 by a share of the line's pressure rise.
    let wanted = (1.0 - LOWEST_SHARE * (top - 1.0)).clamp(MIN_LOWEST_RATIO, 1.0);
    if ratio(MIN_ANGLE_RAD) > wanted {
        return MIN_ANGLE_RAD;
    }
    bisect(MIN_ANGLE_RAD, surge_rad.min(std::f64::consts::FRAC_PI_2), 0.0, |angle| ratio(angle) < wanted).1
}
