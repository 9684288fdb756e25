//! Where the gap of an effect may show: more than one place is right where neighbours share a balance.

use mapper_physics::effect::Submodel::{self, *};

/// Places that count as right for each effect of the catalogue.
const PLACES: &[(&str, &[Submodel])] = &[
    ("area_split", &[CompressorGas, CompressorHousing]),
    ("tip_diameter", &[T2Probe]),
    ("stem_conduction", &[T2Probe]),
    ("recovery", &[T2Probe]),
    ("t2_offset", &[T2Probe]),
    ("t1_offset", &[T1Probe, CompressorGas]),
    ("tc_offset", &[TcProbe, CompressorHousing]),
    ("p2_offset", &[P2Sensor, Outlet]),
    ("directional_htc", &[CompressorGas, CompressorHousing]),
    ("htc_scale", &[CompressorGas, CompressorHousing]),
    ("inner_node", &[CompressorHousing, CompressorGas]),
    ("oil_scale", &[CompressorHousing, TurbineHousing]),
    ("ventilation", &[TurbineHousing, CompressorHousing]),
    ("turbine_radiation", &[TurbineHousing, CompressorHousing]),
    ("recirculation", &[CompressorFlow, CompressorGas]),
    ("bearing_friction", &[Shaft]),
    ("turbine_efficiency", &[Shaft]),
    ("efficiency_scale", &[CompressorGas, Shaft]),
    ("flow_map_scale", &[CompressorFlow]),
    ("valve_area", &[Outlet]),
    ("actuator_lag", &[Actuator]),
    ("flowmeter_lag", &[FlowMeter]),
    ("flowmeter_gain", &[FlowMeter, CompressorFlow]),
    ("humidity", &[CompressorFlow, CompressorGas]),
    ("inlet_preheat", &[CompressorGas, CompressorHousing]),
];

/// Whether `submodel` is a right place for the effect of `id`.
pub(crate) fn is_right(id: &str, submodel: &str) -> bool {
    let places = PLACES.iter().find(|(effect, _)| *effect == id).map_or(&[][..], |(_, places)| places);
    places.iter().any(|place| place.name() == submodel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_a_place_and_its_own_submodel_is_one() {
        for effect in mapper_effects::catalogue() {
            let info = effect.info();
            assert!(is_right(&info.id, info.submodel.name()), "{}", info.id);
        }
        assert_eq!(PLACES.len(), mapper_effects::catalogue().len());
    }
}
