//! Converts the efficiencies of a map to another definition.

use mapper_core::{CompressorMap, EfficiencyDefinition, EstimateUncertainty, MapPoint};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::efficiency_by;

/// Converts the efficiencies of a map from the definition `from` to `to`, for equal temperatures of dry air at the map's reference
/// temperature. Intervals and standard errors keep their ratio to the efficiency; a fitted surface is dropped.
pub fn convert_efficiency(
    mut map: CompressorMap,
    from: EfficiencyDefinition,
    to: EfficiencyDefinition,
) -> CompressorMap {
    if from != to {
        let t1_k = map.reference.t_ref_k;
        let air = Air { efficiency: from, ..Air::DRY };
        for point in map.lines.iter_mut().flat_map(|line| &mut line.points) {
            if let Some(eta) = point.eta.filter(|eta| *eta > 0.0 && point.pressure_ratio > 1.0) {
                scale(point, efficiency_by(to, eta, point.pressure_ratio, t1_k, air) / eta);
            }
        }
        map.fitted = None;
    }
    map.efficiency = Some(to);
    map
}

fn scale(point: &mut MapPoint, ratio: f64) {
    let identified = &mut point.identified;
    let values = [&mut point.eta, &mut identified.eta, &mut identified.eta_low, &mut identified.eta_high];
    values.into_iter().flatten().for_each(|value| *value *= ratio);
    identified.eta_uncertainty = identified.eta_uncertainty.map(|uncertainty| EstimateUncertainty {
        noise_standard_error: ratio * uncertainty.noise_standard_error,
        bias_standard_error: ratio * uncertainty.bias_standard_error,
    });
    identified.common.eta_changes.iter_mut().for_each(|change| *change *= ratio);
}
