//! A map with its heat taken off.

use super::error::HeatCorrectionError;
use super::estimate::estimate;
use super::work::{air_of, isentropic_work_j_kg, work_points};
use mapper_core::{
    CompressorMap, EstimateUncertainty, HeatCorrected, MapPoint, Method, Verdict, Warning,
    confidence_interval_95, standard_error_of,
};
use serde::Serialize;

/// Standard error of a heat that the map shows, over the heat: on the virtual lab it is up to twice what slow lines really take up,
/// if their work grows for other reasons too.
const HEAT_ERROR_RATIO: f64 = 0.5;
/// Standard error of every efficiency from the premise that one heat holds for the whole map: on the virtual lab at 500 degC fast
/// lines lose 1.4 points by heat to the housing, which the method does not see.
const PREMISE_ERROR: f64 = 0.01;
/// Above this a corrected efficiency is none.
const HIGHEST_EFFICIENCY: f64 = 0.95;

/// What the correction did to a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CorrectedLine {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Points with an efficiency before.
    pub points: usize,
    /// Points without one after it: it would have been above 95 %.
    pub lost: usize,
    /// Mean apparent efficiency of the points that kept one, fraction.
    pub eta_apparent: f64,
    /// Mean corrected efficiency of the same, fraction.
    pub eta: f64,
}

/// What was done to a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeatCorrection {
    /// Heat to the gas that was taken off, at the map's reference state, W.
    pub heat_w: f64,
    /// What the map shows, W: negative if slow lines take less work than fast ones; `None` if the heat was given.
    pub heat_shown_w: Option<f64>,
    /// Standard error of that from the scatter of lines alone, W.
    pub heat_standard_error_w: Option<f64>,
    /// Scatter of the work coefficients about their common curve, ratio.
    pub scatter_ratio: Option<f64>,
    /// Points that the heat was found from.
    pub points_used: usize,
    /// Line by line.
    pub lines: Vec<CorrectedLine>,
}

/// Takes the heat that a map shows, or the one that is given (W at the map's reference state), off its apparent efficiencies. What was
/// fitted through the map before is dropped.
///
/// # Errors
/// [`HeatCorrectionError`]: the map holds no heat, or too little to find it.
pub fn correct_for_heat(
    mut map: CompressorMap,
    given_w: Option<f64>,
) -> Result<(CompressorMap, HeatCorrection), HeatCorrectionError> {
    if matches!(map.method, Method::Dynamic | Method::Joint | Method::Corrected) {
        return Err(HeatCorrectionError::Adiabatic { method: map.method });
    }
    let used = work_points(&map);
    let found = match given_w {
        Some(heat_w) if !(heat_w.is_finite() && heat_w >= 0.0) => {
            return Err(HeatCorrectionError::Heat { heat_w });
        }
        Some(_) => None,
        None => Some(estimate(&used)?),
    };
    // Slow lines that take less work than fast ones have no heat to take off.
    let heat_w = given_w.or(found.map(|found| found.heat_w.max(0.0))).unwrap_or(0.0);
    let scatter_w = found.map_or(0.0, |found| found.standard_error_w);
    let heat_error_w = scatter_w.hypot(HEAT_ERROR_RATIO * heat_w);
    let (reference, air) = (map.reference, air_of(&map));
    let shared = map
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
            let compresses = point.pressure_ratio > 1.0 && flow_kg_s > 0.0;
            let Some(apparent) = point.eta.filter(|eta| *eta > 0.0 && compresses) else { continue };
            points += 1;
            let work_j_kg = isentropic_work_j_kg(reference, point.pressure_ratio, air);
            match without_heat(apparent, work_j_kg, heat_w / flow_kg_s) {
                Some(eta) => {
                    // d eta/d heat, times the heat's error.
                    let change = eta * eta / work_j_kg * heat_error_w / flow_kg_s;
                    put(point, apparent, eta, change, shared);
                    before += apparent;
                    after += eta;
                }
                None => {
                    lost += 1;
                    lose(point, heat_w);
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
        heat_shown_w: found.map(|found| found.heat_w),
        heat_standard_error_w: found.map(|found| found.standard_error_w),
        scatter_ratio: found.map(|found| found.scatter_ratio),
        points_used: used.len(),
        lines,
    };
    Ok((map, correction))
}

/// Efficiency when a specific heat counts as work no more; `None` if it would be none.
fn without_heat(apparent: f64, isentropic_work_j_kg: f64, heat_j_kg: f64) -> Option<f64> {
    let work_j_kg = isentropic_work_j_kg / apparent - heat_j_kg;
    let eta = isentropic_work_j_kg / work_j_kg;
    (work_j_kg > 0.0 && eta <= HIGHEST_EFFICIENCY.max(apparent)).then_some(eta)
}

fn put(point: &mut MapPoint, apparent: f64, eta: f64, heat_change: f64, shared: usize) {
    let identified = &mut point.identified;
    let own =
        identified.eta_low.zip(identified.eta_high).map_or(0.0, |(low, high)| standard_error_of(low, high));
    let uncertainty = identified.eta_uncertainty.unwrap_or_default();
    let added = heat_change.hypot(PREMISE_ERROR);
    identified.eta_uncertainty = Some(EstimateUncertainty {
        bias_standard_error: uncertainty.bias_standard_error.hypot(added),
        ..uncertainty
    });
    let (low, high) = confidence_interval_95(eta, own.hypot(added));
    // Entry k of every point is error k of the map: the errors shared from here on follow all others.
    identified.common.eta_changes.resize(shared, 0.0);
    identified.common.eta_changes.extend([heat_change, PREMISE_ERROR]);
    (identified.eta_low, identified.eta_high) = (Some(low), Some(high));
    identified.eta = Some(eta);
    point.eta = Some(eta);
    identified.verdict = identified.verdict.doubted();
    let corrected = HeatCorrected::Corrected { apparent_eta: apparent };
    identified.warnings.push(Warning::HeatCorrected(corrected));
}

fn lose(point: &mut MapPoint, heat_w: f64) {
    let identified = &mut point.identified;
    (identified.eta, identified.eta_low, identified.eta_high, point.eta) = (None, None, None, None);
    identified.eta_uncertainty = None;
    identified.verdict = Verdict::Unusable;
    identified.warnings.push(Warning::HeatCorrected(HeatCorrected::TooMuchHeat { heat_w }));
}
