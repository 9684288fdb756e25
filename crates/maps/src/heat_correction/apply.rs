//! Subtracts the heat from the apparent efficiencies of a map.

use super::error::HeatCorrectionError;
use super::estimate::estimate_heat;
use super::work::{air_of, isentropic_work_j_kg, work_points};
use mapper_core::{
    CompressorMap, EstimateUncertainty, HeatCorrected, MapPoint, Method, Verdict, Warning,
    confidence_interval_95, standard_error_of,
};
use serde::Serialize;

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
