//! Compares two turbine maps: each measured point of the second with the surface of the first.

use crate::compare::excludes_zero;
use crate::turbine::turbine_fit::{TurbineFit, TurbineFitError};
use mapper_core::{TurbineMap, TurbineMapPoint};
use mapper_numerics::statistics::{mean, rms};
use serde::Serialize;

/// A point of the second map compared with the first. Differences: second minus first.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TurbinePointComparison {
    /// The point.
    pub point: TurbineMapPoint,
    /// Difference of flow, fraction of the first's.
    pub flow_difference_ratio: f64,
    /// Its standard error, both maps together.
    pub flow_standard_error_ratio: f64,
    /// Difference of efficiency, fraction.
    pub efficiency_difference: Option<f64>,
    /// Its standard error.
    pub efficiency_standard_error: Option<f64>,
}

/// Comparison of two turbine maps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TurbineComparison {
    /// Points of the second map within the first.
    pub points: Vec<TurbinePointComparison>,
    /// Number of points outside the first map.
    pub not_compared: usize,
    /// Mean difference of flow, fraction; `None` without common places.
    pub flow_difference_mean_ratio: Option<f64>,
    /// Root mean square of the difference of flow.
    pub flow_difference_rms_ratio: Option<f64>,
    /// Mean difference of efficiency, fraction.
    pub efficiency_difference_mean: Option<f64>,
    /// Root mean square of the difference of efficiency.
    pub efficiency_difference_rms: Option<f64>,
    /// Share of points whose flow differs beyond its 95 % interval.
    pub flow_differs_ratio: f64,
    /// Share of points whose efficiency differs beyond its 95 % interval.
    pub efficiency_differs_ratio: f64,
}

/// Compares two maps.
pub fn compare_turbines(
    first: &TurbineMap,
    second: &TurbineMap,
) -> Result<TurbineComparison, TurbineFitError> {
    let fit = TurbineFit::new(first)?;
    let places = second.points.iter().map(|point| {
        (point, fit.at(point.vane_position, point.speed_parameter_rpm_sqrt_k, point.expansion_ratio))
    });
    let (outside, inside): (Vec<_>, Vec<_>) = places.partition(|(_, place)| place.extrapolated);
    let points: Vec<TurbinePointComparison> = inside
        .into_iter()
        .map(|(point, place)| {
            // The standard error is that of a measurement, so it includes the scatter of the second map.
            let (flow_standard_error_ratio, efficiency_standard_error) = fit.standard_errors(point);
            let flow = point.flow_parameter_kg_sqrt_k_s_kpa / place.flow_parameter_kg_sqrt_k_s_kpa;
            TurbinePointComparison {
                point: *point,
                flow_difference_ratio: flow - 1.0,
                flow_standard_error_ratio,
                efficiency_difference: point.efficiency.zip(place.efficiency).map(|(own, first)| own - first),
                efficiency_standard_error,
            }
        })
        .collect();
    let flows = || points.iter().map(|point| point.flow_difference_ratio);
    let efficiencies = || points.iter().filter_map(|point| point.efficiency_difference);
    let share = |pairs: Vec<(f64, f64)>| {
        let differs = |(difference, error): &&(f64, f64)| excludes_zero(*difference, *error);
        pairs.iter().filter(differs).count() as f64 / pairs.len().max(1) as f64
    };
    let flow_pairs = points.iter().map(|p| (p.flow_difference_ratio, p.flow_standard_error_ratio)).collect();
    let efficiency_pairs =
        points.iter().filter_map(|p| p.efficiency_difference.zip(p.efficiency_standard_error)).collect();
    Ok(TurbineComparison {
        not_compared: outside.len(),
        flow_difference_mean_ratio: mean(flows()),
        flow_difference_rms_ratio: rms(flows()),
        efficiency_difference_mean: mean(efficiencies()),
        efficiency_difference_rms: rms(efficiencies()),
        flow_differs_ratio: share(flow_pairs),
        efficiency_differs_ratio: share(efficiency_pairs),
        points,
    })
}
