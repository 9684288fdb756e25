//! Corrects the apparent efficiencies of a hot map for heat, estimated from the map alone (after Sirakov and Casey).
//!
//! M. Sirakov and M. Casey, "Evaluation of heat transfer effects on turbocharger performance" (ASME GT2011-45887; J. Turbomach.
//! 135(2) 021011, 2013): by Euler's equation the work coefficient of a wheel is one function of the flow coefficient at its exit at
//! all speeds. Heat counts as work and raises slow lines above that curve, since work falls with the square of speed and flow with speed.
//! The estimate is the heat that makes all lines one curve.
//!
//! Here the curve is `a + b phi2 + k/phi1` (Euler with slip and backsweep; disc friction and recirculation) and the heat is in watts at
//! the map's reference state. Robust least squares of relative residuals estimates all of them together. Limits of the
//! method (docs/reference/maps.md): work that grows at low speed for other reasons counts as heat, and heat that fast lines lose to the
//! housing is ignored. The standard errors allow for both with round numbers: half the heat, and one point of efficiency.

use mapper_core::{
    CompressorMap, EstimateUncertainty, HeatCorrected, MapPoint, Method, ReferenceState, Verdict, Warning,
    confidence_interval_95, standard_error_of,
};
use mapper_numerics::statistics::mean;
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::laws::compression::isentropic_rise_ratio;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Why a map cannot be corrected for heat.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum HeatCorrectionError {
    #[error("the map was identified by the {0} method: its efficiencies already exclude heat")]
    Adiabatic(Method),
    #[error(
        "{points} points on {lines} speed lines have an efficiency and lie outside choke; estimating the heat takes at least 8 points on 3 lines; measure more, \
         or state the heat"
    )]
    TooFew { points: usize, lines: usize },
    #[error(
        "the fastest line turns at {ratio:.2} times the speed of the slowest; below 1.5 the heat cannot be distinguished from the wheel's work; state the heat"
    )]
    OneSpeed { ratio: f64 },
    #[error("flows and speeds of the map do not separate heat from work; state the heat")]
    Singular,
    #[error("a heat of {heat_w} W cannot be subtracted; it must be finite and not negative")]
    Heat { heat_w: f64 },
}

/// Unit of the speed ratio, rpm. Bound: the estimate does not depend on it, nor on the wheel's diameter.
const UNIT_SPEED_RPM: f64 = 100_000.0;
/// Share of the stage's temperature rise up to the wheel's exit. Source: the degree of reaction of radial wheels (Casey and Robinson,
/// Radial Flow Turbocompressors, 2021).
const REACTION: f64 = 0.6;
/// Density over temperature along the wheel. Source: 1/(n - 1) of a polytrope with n = 1.5.
const DENSITY_EXPONENT: f64 = 2.0;
/// Minimum efficiency of a point on the choke side, over the best of its line. Bound: below, inlet choking determines the work.
const MIN_EFFICIENCY_OF_BEST_RATIO: f64 = 0.85;

/// Work and flow coefficients of a point at the map's reference state.
#[derive(Debug, Clone, Copy)]
pub struct WorkPoint {
    /// Speed line of the map.
    pub line: usize,
    /// Corrected speed of the line over [`UNIT_SPEED_RPM`].
    pub speed_ratio: f64,
    /// Corrected flow, kg/s.
    pub flow_kg_s: f64,
    /// Apparent specific work over the square of speed, J/kg.
    pub work_coefficient: f64,
    /// Inlet flow over the speed ratio, kg/s.
    pub inlet_flow: f64,
    /// The same with the density at the wheel's exit, kg/s.
    pub exit_flow: f64,
}

impl WorkPoint {
    /// Increase of the work coefficient per watt of heat, J/(kg W).
    pub fn work_coefficient_per_watt(&self) -> f64 {
        1.0 / (self.flow_kg_s * self.speed_ratio * self.speed_ratio)
    }
}

/// Dry air with the map's definition of efficiency; by enthalpy if the map does not name one.
pub fn air_of(map: &CompressorMap) -> Air {
    Air::new(Gas::air(), 0.0).with_efficiency(map.efficiency.unwrap_or_default())
}

/// Isentropic specific work from the reference temperature, J/kg.
pub fn isentropic_work_j_kg(reference: ReferenceState, pressure_ratio: f64, air: Air) -> f64 {
    let (t_k, p_pa) = (reference.t_ref_k, reference.p_ref_pa);
    let air = air.between(p_pa, pressure_ratio * p_pa);
    air.heat_capacity_j_kgk(t_k) * t_k * isentropic_rise_ratio(pressure_ratio, t_k, air)
}

/// The points with an efficiency that lie outside choke.
pub fn work_points(map: &CompressorMap) -> Vec<WorkPoint> {
    let (reference, air) = (map.reference, air_of(map));
    let mut points = Vec::new();
    for (index, line) in map.lines.iter().enumerate() {
        let usable = || {
            line.points.iter().filter_map(|point| {
                let eta = point.eta.filter(|eta| *eta > 0.0)?;
                (point.pressure_ratio > 1.0 && point.flow_corrected_kg_s > 0.0).then_some((point, eta))
            })
        };
        let best = usable().max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((best, best_eta)) = best else { continue };
        for (point, eta) in usable() {
            let flow_kg_s = point.flow_corrected_kg_s;
            if flow_kg_s > best.flow_corrected_kg_s && eta < MIN_EFFICIENCY_OF_BEST_RATIO * best_eta {
                continue;
            }
            let speed_ratio = line.speed_corrected_rpm / UNIT_SPEED_RPM;
            let work_j_kg = isentropic_work_j_kg(reference, point.pressure_ratio, air) / eta;
            let t_k = reference.t_ref_k;
            let rise_ratio = work_j_kg / (air.heat_capacity_j_kgk(t_k) * t_k);
            let inlet_flow = flow_kg_s / speed_ratio;
            points.push(WorkPoint {
                line: index,
                speed_ratio,
                flow_kg_s,
                work_coefficient: work_j_kg / (speed_ratio * speed_ratio),
                inlet_flow,
                exit_flow: inlet_flow / (1.0 + REACTION * rise_ratio).powf(DENSITY_EXPONENT),
            });
        }
    }
    points
}

/// Median absolute value of a standard normal distribution. Source: its quantile at 0.75.
const MEDIAN_OF_SIZE: f64 = 0.6745;
/// Minimum scatter, ratio. Bound: exact points keep weights.
const MIN_SCATTER: f64 = 1e-9;

/// Robust standard deviations beyond which a residual loses weight (Huber). Source: Huber, Robust Statistics (1981).
const HUBER_THRESHOLD: f64 = 1.5;
/// Rounds of reweighting. Bound: weights converge in a few.
const ROUNDS: usize = 8;
/// Minimum number of points. Bound: four parameters.
const MIN_POINTS: usize = 8;
/// Minimum number of lines. Bound: a trend over speed needs three.
const MIN_LINES: usize = 3;
/// Minimum ratio of the line speeds. Bound: heat falls with the cube of speed, by three over it.
const MIN_SPEED_RATIO: f64 = 1.5;
/// Minimum ratio of smallest to largest singular value of a determined fit. Bound: its square is above rounding of f64.
const MIN_SINGULAR_VALUE_RATIO: f64 = 1e-5;

/// The heat of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatEstimate {
    /// Heat to the gas at the reference state, W; negative if slow lines take less work than fast ones.
    pub heat_w: f64,
    /// Its standard error by leaving each line out in turn, W.
    pub standard_error_w: f64,
    /// Robust scatter of the work coefficients about the curve, ratio.
    pub scatter_ratio: f64,
}

/// Estimates the heat of a map from its work coefficients.
pub fn estimate_heat(points: &[WorkPoint]) -> Result<HeatEstimate, HeatCorrectionError> {
    let mut lines: Vec<usize> = points.iter().map(|point| point.line).collect();
    lines.dedup();
    if points.len() < MIN_POINTS || lines.len() < MIN_LINES {
        return Err(HeatCorrectionError::TooFew { points: points.len(), lines: lines.len() });
    }
    let speeds = || points.iter().map(|point| point.speed_ratio);
    let ratio = speeds().fold(0.0, f64::max) / speeds().fold(f64::INFINITY, f64::min);
    if ratio < MIN_SPEED_RATIO {
        return Err(HeatCorrectionError::OneSpeed { ratio });
    }
    let (heat_w, scatter_ratio) = fit_heat(points).ok_or(HeatCorrectionError::Singular)?;
    // Points of a line share errors (speed, day), so whole lines are left out.
    let without = |line: &usize| {
        let others: Vec<WorkPoint> = points.iter().filter(|point| point.line != *line).copied().collect();
        fit_heat(&others).map(|(heat_w, _)| heat_w)
    };
    let left_out: Vec<f64> = lines.iter().filter_map(without).collect();
    if left_out.len() < MIN_LINES {
        return Err(HeatCorrectionError::Singular);
    }
    let count = left_out.len() as f64;
    let mean_w = mean(&left_out).ok_or(HeatCorrectionError::Singular)?;
    let spread = left_out.iter().map(|heat_w| (heat_w - mean_w).powi(2)).sum::<f64>();
    Ok(HeatEstimate { heat_w, standard_error_w: ((count - 1.0) / count * spread).sqrt(), scatter_ratio })
}

/// Fits the heat, W, and the scatter about the curve, ratio.
fn fit_heat(points: &[WorkPoint]) -> Option<(f64, f64)> {
    // Relative residuals: every row over its own work coefficient.
    let mut rows = DMatrix::from_fn(points.len(), 4, |row, column| {
        let point = &points[row];
        let value = match column {
            0 => 1.0,
            1 => point.exit_flow,
            2 => 1.0 / point.inlet_flow,
            _ => point.work_coefficient_per_watt(),
        };
        value / point.work_coefficient
    });
    // Columns are scaled to equal size, so that the rank does not depend on units.
    let sizes: Vec<f64> = (0..4).map(|column| rows.column(column).norm()).collect();
    for (column, size) in sizes.iter().enumerate() {
        if *size <= 0.0 || !size.is_finite() {
            return None;
        }
        rows.column_mut(column).scale_mut(1.0 / size);
    }
    let mut weights = vec![1.0; points.len()];
    let mut estimate = None;
    for _ in 0..ROUNDS {
        let root = |row: usize| f64::sqrt(weights[row]);
        let weighted = DMatrix::from_fn(points.len(), 4, |row, column| root(row) * rows[(row, column)]);
        let right = DVector::from_fn(points.len(), |row, _| root(row));
        let svd = weighted.svd(true, true);
        if svd.singular_values.min() < MIN_SINGULAR_VALUE_RATIO * svd.singular_values.max() {
            return None;
        }
        let solution = svd.solve(&right, 0.0).ok()?;
        let residuals = &rows * &solution - DVector::from_element(points.len(), 1.0);
        let mut sorted: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        let scatter = (sorted.get(sorted.len() / 2)? / MEDIAN_OF_SIZE).max(MIN_SCATTER);
        for (weight, residual) in weights.iter_mut().zip(residuals.iter()) {
            *weight = (HUBER_THRESHOLD * scatter / residual.abs().max(f64::MIN_POSITIVE)).min(1.0);
        }
        estimate = Some((solution[3] / sizes[3], scatter));
    }
    estimate.filter(|(heat_w, _)| heat_w.is_finite())
}

/// Standard error of an estimated heat over the heat. Calibrated: `benches/heat_correction.py`; on the virtual lab the estimate is up to
/// twice the true heat of slow lines if their work grows for other reasons too.
const HEAT_STANDARD_ERROR_RATIO: f64 = 0.5;
/// Standard error of every efficiency from the assumption of one heat for the whole map, fraction. Calibrated:
/// `benches/heat_correction.py`; on the virtual lab at 500 degC fast lines lose 1.4 points by heat to the housing, which the method
/// ignores.
const MODEL_STANDARD_ERROR: f64 = 0.01;
/// Maximum credible corrected efficiency, fraction. Bound: no compressor reaches it.
const MAX_EFFICIENCY: f64 = 0.95;

/// Effect of the correction on a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CorrectedLine {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Points with an efficiency before the correction.
    pub points: usize,
    /// Points whose corrected efficiency would be above 95 %: they have none.
    pub lost: usize,
    /// Mean apparent efficiency of the other points, fraction.
    pub eta_apparent: f64,
    /// Mean corrected efficiency of the same points, fraction.
    pub eta: f64,
}

/// Heat correction of a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeatCorrection {
    /// Subtracted heat to the gas, at the map's reference state, W.
    pub heat_w: f64,
    /// Estimated heat, W: negative if slow lines take less work than fast ones; `None` if the heat was given.
    pub heat_shown_w: Option<f64>,
    /// Standard error of the estimate from the scatter of lines alone, W.
    pub heat_standard_error_w: Option<f64>,
    /// Scatter of the work coefficients about their common curve, ratio.
    pub scatter_ratio: Option<f64>,
    /// Points that the estimate used.
    pub points_used: usize,
    /// Effect on each line.
    pub lines: Vec<CorrectedLine>,
}

/// Subtracts the heat that the map shows, or `given_w` (W at the map's reference state), from the apparent efficiencies. A fitted
/// surface is dropped.
///
/// # Errors
/// [`HeatCorrectionError`] if the efficiencies contain no heat, or the map is too small to estimate it.
pub fn correct_for_heat(
    mut map: CompressorMap,
    given_w: Option<f64>,
) -> Result<(CompressorMap, HeatCorrection), HeatCorrectionError> {
    if matches!(map.method, Method::Dynamic | Method::Joint | Method::Corrected) {
        return Err(HeatCorrectionError::Adiabatic(map.method));
    }
    let points = work_points(&map);
    let estimate = match given_w {
        Some(heat_w) if !(heat_w.is_finite() && heat_w >= 0.0) => {
            return Err(HeatCorrectionError::Heat { heat_w });
        }
        Some(_) => None,
        None => Some(estimate_heat(&points)?),
    };
    // A negative estimate means that slow lines take less work than fast ones: there is no heat to subtract.
    let heat_w = given_w.or(estimate.map(|estimate| estimate.heat_w.max(0.0))).unwrap_or(0.0);
    let scatter_w = estimate.map_or(0.0, |estimate| estimate.standard_error_w);
    let heat_error_w = scatter_w.hypot(HEAT_STANDARD_ERROR_RATIO * heat_w);
    let (reference, air) = (map.reference, air_of(&map));
    let shared_errors = map
        .lines
        .iter()
        .flat_map(|line| &line.points)
        .map(|point| point.identified.common.eta_changes.len())
        .max()
        .unwrap_or(0);
    let mut lines = Vec::new();
    for line in &mut map.lines {
        let (mut before, mut after, mut points, mut lost) = (0.0, 0.0, 0, 0);
        for point in &mut line.points {
            let flow_kg_s = point.flow_corrected_kg_s;
            let is_compressing = point.pressure_ratio > 1.0 && flow_kg_s > 0.0;
            let Some(apparent) = point.eta.filter(|eta| *eta > 0.0 && is_compressing) else { continue };
            points += 1;
            let work_j_kg = isentropic_work_j_kg(reference, point.pressure_ratio, air);
            match efficiency_without_heat(apparent, work_j_kg, heat_w / flow_kg_s) {
                Some(eta) => {
                    // Derivative of eta by heat, times the heat's error.
                    let change = eta * eta / work_j_kg * heat_error_w / flow_kg_s;
                    set_efficiency(point, apparent, eta, change, shared_errors);
                    before += apparent;
                    after += eta;
                }
                None => {
                    lost += 1;
                    drop_efficiency(point, heat_w);
                }
            }
        }
        let kept = points - lost;
        if kept > 0 {
            lines.push(CorrectedLine {
                speed_corrected_rpm: line.speed_corrected_rpm,
                points,
                lost,
                eta_apparent: before / kept as f64,
                eta: after / kept as f64,
            });
        }
    }
    map.fitted = None;
    let correction = HeatCorrection {
        heat_w,
        heat_shown_w: estimate.map(|estimate| estimate.heat_w),
        heat_standard_error_w: estimate.map(|estimate| estimate.standard_error_w),
        scatter_ratio: estimate.map(|estimate| estimate.scatter_ratio),
        points_used: points.len(),
        lines,
    };
    Ok((map, correction))
}

/// Efficiency after a specific heat is subtracted from the work; `None` if it is not credible.
fn efficiency_without_heat(apparent: f64, isentropic_work_j_kg: f64, heat_j_kg: f64) -> Option<f64> {
    let work_j_kg = isentropic_work_j_kg / apparent - heat_j_kg;
    let eta = isentropic_work_j_kg / work_j_kg;
    (work_j_kg > 0.0 && eta <= MAX_EFFICIENCY.max(apparent)).then_some(eta)
}

fn set_efficiency(point: &mut MapPoint, apparent: f64, eta: f64, heat_change: f64, shared_errors: usize) {
    let identified = &mut point.identified;
    let before =
        identified.eta_low.zip(identified.eta_high).map_or(0.0, |(low, high)| standard_error_of(low, high));
    let uncertainty = identified.eta_uncertainty.unwrap_or_default();
    let added = heat_change.hypot(MODEL_STANDARD_ERROR);
    identified.eta_uncertainty = Some(EstimateUncertainty {
        bias_standard_error: uncertainty.bias_standard_error.hypot(added),
        ..uncertainty
    });
    let (low, high) = confidence_interval_95(eta, before.hypot(added));
    // Entry k of every point belongs to error k of the map, so the new errors follow the entries of all points.
    identified.common.eta_changes.resize(shared_errors, 0.0);
    identified.common.eta_changes.extend([heat_change, MODEL_STANDARD_ERROR]);
    (identified.eta_low, identified.eta_high) = (Some(low), Some(high));
    identified.eta = Some(eta);
    point.eta = Some(eta);
    identified.verdict = identified.verdict.doubted();
    let corrected = HeatCorrected::Corrected { apparent_eta: apparent };
    identified.warnings.push(Warning::HeatCorrected(corrected));
}

fn drop_efficiency(point: &mut MapPoint, heat_w: f64) {
    let identified = &mut point.identified;
    (identified.eta, identified.eta_low, identified.eta_high, point.eta) = (None, None, None, None);
    identified.eta_uncertainty = None;
    identified.verdict = Verdict::Unusable;
    identified.warnings.push(Warning::HeatCorrected(HeatCorrected::TooMuchHeat { heat_w }));
}
