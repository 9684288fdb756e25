//! Normal deviations of a fault-free machine: parameters and a map within declared tolerances.

use mapper_core::{ModelTolerances, ReferenceState};
use mapper_physics::compressor_map::closed_form_map::{CharacteristicPoint, CompressorCharacteristic};
use mapper_physics::rig::effect::Rig;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::sync::Arc;

/// Applies a draw of `seed` from the tolerances to a rig.
pub fn draw_tolerances(rig: &mut Rig, tolerances: &ModelTolerances, seed: u64) {
    let mut random = Pcg64::seed_from_u64(seed.wrapping_mul(0xD6E8_FEB8_6659_FD93) ^ 0xA076_1D64_78BD_642F);
    let mut scale = |sigma_ratio: f64| {
        let normal: f64 = StandardNormal.sample(&mut random);
        1.0 + sigma_ratio * normal
    };
    let params = &mut rig.model.params;
    params.compressor.flow_scale_ratio *= scale(tolerances.flow_map_ratio);
    params.compressor.efficiency_scale_ratio *= scale(tolerances.compressor_efficiency_ratio);
    params.turbine.peak_efficiency *= scale(tolerances.turbine_efficiency_ratio);
    params.outlet.valve_area_m2 *= scale(tolerances.valve_area_ratio);
    params.compressor.nusselt_coefficient *= scale(tolerances.convection_ratio);
    // A wide tolerance must not reverse the heat flow.
    params.external_convection_ratio *= scale(tolerances.external_convection_ratio).max(0.1);
    params.bearing.oil_conductance_w_k *= scale(tolerances.oil_conductance_ratio).max(0.1);
    if tolerances.efficiency_shape_ratio > 0.0 {
        let map = rig.model.map.clone();
        rig.model.map = Arc::new(UnevenMap::new(map, tolerances.efficiency_shape_ratio, &mut random));
    }
}

/// Waves of the error over the map.
const WAVES: usize = 4;

/// A map with a smooth efficiency error.
#[derive(Debug)]
struct UnevenMap {
    map: Arc<dyn CompressorCharacteristic>,
    /// Amplitude, phase, and angles per 100 krpm and per length of a speed line.
    waves: [[f64; 4]; WAVES],
}

impl UnevenMap {
    /// An error with a standard deviation of `sigma_ratio` over all draws, and about one period over the map.
    fn new(map: Arc<dyn CompressorCharacteristic>, sigma_ratio: f64, random: &mut Pcg64) -> Self {
        let amplitude = sigma_ratio * (2.0 / WAVES as f64).sqrt();
        let full_turn = 2.0 * std::f64::consts::PI;
        let waves = std::array::from_fn(|_| {
            [
                amplitude,
                random.random_range(0.0..full_turn),
                full_turn * random.random_range(-0.7..0.7),
                full_turn * random.random_range(-0.7..0.7),
            ]
        });
        UnevenMap { map, waves }
    }

    fn error_ratio(&self, speed_corrected_rpm: f64, surge_position_ratio: f64) -> f64 {
        let position = surge_position_ratio.clamp(-0.5, 1.5);
        let wave = |[amplitude, phase, by_speed, by_position]: [f64; 4]| {
            amplitude * (phase + by_speed * speed_corrected_rpm * 1e-5 + by_position * position).sin()
        };
        self.waves.map(wave).iter().sum()
    }
}

impl CompressorCharacteristic for UnevenMap {
    fn reference(&self) -> ReferenceState {
        self.map.reference()
    }

    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        self.evaluate_scaled(speed_corrected_rpm, pressure_ratio, 1.0)
    }

    fn evaluate_scaled(
        &self,
        speed_corrected_rpm: f64,
        pressure_ratio: f64,
        flow_scale_ratio: f64,
    ) -> CharacteristicPoint {
        let point = self.map.evaluate_scaled(speed_corrected_rpm, pressure_ratio, flow_scale_ratio);
        let error_ratio = self.error_ratio(speed_corrected_rpm, point.surge_position_ratio);
        CharacteristicPoint { efficiency: point.efficiency * (1.0 + error_ratio), ..point }
    }

    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        self.map.surge_point(speed_corrected_rpm)
    }

    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.map.choke_flow_corrected_kg_s(speed_corrected_rpm)
    }

    fn fingerprint(&self) -> String {
        format!("{}, efficiency uneven by {:?}", self.map.fingerprint(), self.waves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_physics::simulation::model::Model;

    #[test]
    fn draws_have_the_declared_scatter() {
        let tolerances = ModelTolerances::default();
        let nominal = Rig::new(Model::nominal());
        let (mut efficiency, mut shape) = (0.0, 0.0);
        for seed in 0..2000 {
            let mut rig = nominal.clone();
            draw_tolerances(&mut rig, &tolerances, seed);
            efficiency += (rig.model.params.compressor.efficiency_scale_ratio - 1.0).powi(2);
            let point = |rig: &Rig| rig.model.map.evaluate(100e3, 1.8).efficiency;
            shape += (point(&rig) / point(&nominal) - 1.0).powi(2);
        }
        // A standard deviation from 2000 draws is accurate to 1.6 %.
        let [efficiency, shape] = [efficiency, shape].map(|sum: f64| (sum / 2000.0).sqrt());
        assert!((efficiency / 0.005 - 1.0).abs() < 0.07, "{efficiency}");
        assert!((shape / 0.003 - 1.0).abs() < 0.07, "{shape}");
    }
}
