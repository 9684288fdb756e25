//! Converts the efficiencies of a map to another definition.

use mapper_core::{CompressorMap, EfficiencyDefinition, EstimateUncertainty, MapPoint, ReferenceState};
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::laws::compression::efficiency_by;

/// Converts the efficiencies of a map from the definition `from` to `to`, for equal temperatures of dry air from the map's reference
/// state. Intervals and standard errors keep their ratio to the efficiency; a fitted surface is dropped.
pub fn convert_efficiency(
    mut map: CompressorMap,
    from: EfficiencyDefinition,
    to: EfficiencyDefinition,
) -> CompressorMap {
    if from != to {
        let ReferenceState { t_ref_k, p_ref_pa } = map.reference;
        let air = Air::new(Gas::air(), 0.0).with_efficiency(from);
        for point in map.lines.iter_mut().flat_map(|line| &mut line.points) {
            if let Some(eta) = point.eta.filter(|eta| *eta > 0.0 && point.pressure_ratio > 1.0) {
                let air = air.between(p_ref_pa, point.pressure_ratio * p_ref_pa);
                scale(point, efficiency_by(to, eta, point.pressure_ratio, t_ref_k, air) / eta);
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
