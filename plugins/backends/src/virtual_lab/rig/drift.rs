//! Drift of the machine and its sensors, and their tolerances.

use crate::virtual_lab::effects_file::SettingProblem;
use crate::virtual_lab::sensors::offset_kind;
use mapper_core::{BackendError, Channel, Dimension, ModelTolerances, ReferenceState};
use mapper_physics::compressor_map::closed_form_map::{CharacteristicPoint, CompressorCharacteristic};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::rig::effect::Rig;
use mapper_yaml::units::{Kind, Quantity};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde::Deserialize;
use std::sync::Arc;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    amplitude: f64,
    angular_hz: f64,
    phase: f64,
}

impl Wave {
    fn at(&self, t_s: f64) -> f64 {
        self.amplitude * (self.angular_hz * t_s + self.phase).sin()
    }
}

/// Waves of each uncommanded boundary condition, and of the supplies of two commanded ones.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weather {
    t1_k: Vec<Wave>,
    p1_pa: Vec<Wave>,
    t3_k: Vec<Wave>,
    p4_pa: Vec<Wave>,
    oil_k: Vec<Wave>,
    ambient_k: Vec<Wave>,
    /// Rise of P4 with P3, Pa/Pa: flow resistance of the exhaust.
    p4_by_p3_ratio: f64,
}

/// P3 at which the exhaust's resistance is part of the nominal P4, Pa.
const P3_WITHOUT_RISE_PA: f64 = 150e3;

impl Weather {
    /// Draws the fluctuations of a day from `seed`: inlet and cell within about 1 K over a quarter of an hour and more, oil 2 K, turbine inlet 1 K over
    /// minutes, P1 and P4 some ten to hundred pascal, and an exhaust resistance of up to 8 Pa per kPa of P3.
    pub fn draw(seed: u64) -> Self {
        // A separate random stream: the odd multipliers differ from those of noise and offsets.
        let mut random =
            Pcg64::seed_from_u64(seed.wrapping_mul(0xBF58_476D_1CE4_E5B9) ^ 0x94D0_49BB_1331_11EB);
        let mut waves = |amplitude: f64, [shortest_s, longest_s]: [f64; 2]| {
            (0..2)
                .map(|_| {
                    let period_s = shortest_s * (longest_s / shortest_s).powf(random.random());
                    Wave {
                        amplitude: amplitude * random.random_range(0.3..0.8),
                        angular_hz: 2.0 * std::f64::consts::PI / period_s,
                        phase: random.random_range(0.0..2.0 * std::f64::consts::PI),
                    }
                })
                .collect()
        };
        Weather {
            t1_k: waves(1.0, [900.0, 3600.0]),
            p1_pa: waves(10.0, [200.0, 2000.0]),
            t3_k: waves(1.0, [150.0, 600.0]),
            p4_pa: waves(40.0, [100.0, 1000.0]),
            oil_k: waves(2.0, [600.0, 2000.0]),
            ambient_k: waves(0.3, [900.0, 3600.0]),
            p4_by_p3_ratio: random.random_range(0.0..8e-3),
        }
    }

    /// Whether all values are constant.
    pub fn is_calm(&self) -> bool {
        *self == Weather::default()
    }

    /// Adds the fluctuations at `t_s` to `boundary`.
    pub fn add_to(&self, boundary: BoundaryConditions, t_s: f64) -> BoundaryConditions {
        let sum = |waves: &[Wave]| waves.iter().map(|wave| wave.at(t_s)).sum::<f64>();
        BoundaryConditions {
            t1_k: boundary.t1_k + sum(&self.t1_k),
            p1_pa: boundary.p1_pa + sum(&self.p1_pa),
            t3_k: boundary.t3_k + sum(&self.t3_k),
            p4_pa: boundary.p4_pa
                + sum(&self.p4_pa)
                + self.p4_by_p3_ratio * (boundary.p3_pa - P3_WITHOUT_RISE_PA),
            oil_temperature_k: boundary.oil_temperature_k + sum(&self.oil_k),
            ambient_temperature_k: boundary.ambient_temperature_k + sum(&self.ambient_k),
            ..boundary
        }
    }
}

/// The drifting quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriftTarget {
    /// A sensor's reading; for a flow meter, its gain.
    Sensor(Channel),
    /// Relative efficiency of the compressor, and 0.6 times that change of its flow.
    Fouling,
    /// Bearing power loss c omega^2: c, W s^2/rad^2.
    BearingFriction,
}

/// A drift: a step, or a steady unlimited change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabDrift {
    /// The drifting quantity.
    pub target: DriftTarget,
    /// Step, or change over [`LabDrift::over_s`]; K, Pa, rpm, ratio or W s^2/rad^2.
    pub change: f64,
    /// Duration of the change, s; `None` is a step.
    pub over_s: Option<f64>,
    /// Start in run time, s; negative before the run.
    pub from_s: f64,
}

/// Change of the map's flow by fouling, as a share of its change of efficiency.
const FOULING_FLOW_SHARE: f64 = 0.6;
/// Interval between updates of a drifting machine, s.
pub const MACHINE_UPDATE_S: f64 = 5.0;

impl LabDrift {
    /// The change at a time.
    pub fn at(&self, t_s: f64) -> f64 {
        match self.over_s {
            None if t_s < self.from_s => 0.0,
            None => self.change,
            Some(over_s) => self.change * ((t_s - self.from_s) / over_s).max(0.0),
        }
    }

    /// Whether the machine itself drifts.
    pub fn is_machine(&self) -> bool {
        !matches!(self.target, DriftTarget::Sensor(_))
    }
}

pub fn drifted_reading(drifts: &[LabDrift], channel: Channel, t_s: f64, reading: f64) -> f64 {
    let own = drifts.iter().filter(|drift| drift.target == DriftTarget::Sensor(channel));
    own.fold(reading, |reading, drift| match channel.info().dimension {
        Dimension::MassFlow => reading * (1.0 + drift.at(t_s)),
        _ => reading + drift.at(t_s),
    })
}

pub fn drifted_machine(drifts: &[LabDrift], mut params: Params, t_s: f64) -> Params {
    for drift in drifts {
        let change = drift.at(t_s);
        match drift.target {
            DriftTarget::Fouling => {
                params.compressor.efficiency_scale_ratio *= 1.0 + change;
                params.compressor.flow_scale_ratio *= 1.0 + FOULING_FLOW_SHARE * change;
            }
            DriftTarget::BearingFriction => params.bearing_friction_w_s2 += change,
            DriftTarget::Sensor(_) => {}
        }
    }
    params
}

/// One entry: `{cause: T2, change: 0.5 K, over: 4 h, from: 10 min}`, or without `over` a step.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriftFile {
    /// A channel, `fouling` or `bearing_friction`.
    cause: String,
    /// Size of the change, with its unit.
    change: String,
    /// Duration of the change; it continues at this rate afterwards. Default: a step.
    #[serde(default)]
    over: Option<Quantity<mapper_yaml::units::Duration>>,
    /// Start; default 0, negative for a drift that began before the run.
    #[serde(default)]
    from: Option<Quantity<mapper_yaml::units::Duration>>,
}

/// Drifts with their units resolved.
pub(crate) fn read_drifts(files: &[DriftFile]) -> Result<Vec<LabDrift>, BackendError> {
    files.iter().enumerate().map(|(index, file)| read_one(index, file)).collect()
}

fn read_one(index: usize, file: &DriftFile) -> Result<LabDrift, BackendError> {
    let key = |key: &str| format!("drift[{index}].{key}");
    let target = match file.cause.as_str() {
        "fouling" => DriftTarget::Fouling,
        "bearing_friction" => DriftTarget::BearingFriction,
        name => match serde_json::from_value::<Channel>(serde_json::json!(name)) {
            Ok(channel) if !is_command(channel) => DriftTarget::Sensor(channel),
            _ => return Err(SettingProblem::UnknownDrift { cause: name.to_owned() }.at(key("cause"))),
        },
    };
    let change = parse_change(target, &file.change).map_err(|problem| problem.at(key("change")))?;
    let over_s = file.over.map(|over| over.value);
    if let Some(over_s) = over_s.filter(|over_s| *over_s <= 0.0) {
        return Err(SettingProblem::NoDuration { over_s }.at(key("over")));
    }
    Ok(LabDrift { target, change, over_s, from_s: file.from.map_or(0.0, |from| from.value) })
}

fn is_command(channel: Channel) -> bool {
    matches!(channel, Channel::P3Command | Channel::T3Command | Channel::ValveCommand | Channel::TOilCommand)
}

/// Maximum relative change: a larger one would be physically impossible for the machine or its air supply.
const MAX_CHANGE_RATIO: f64 = 0.3;

fn parse_change(target: DriftTarget, text: &str) -> Result<f64, SettingProblem> {
    const FRICTION: &str = "W s2/rad2";
    let kind = match target {
        DriftTarget::Sensor(channel) if channel.info().dimension == Dimension::MassFlow => Kind::Fraction,
        DriftTarget::Sensor(channel) => offset_kind(channel),
        DriftTarget::Fouling => Kind::Fraction,
        DriftTarget::BearingFriction => {
            let number = text.trim().strip_suffix(FRICTION).map(|number| number.trim().parse());
            return match number {
                Some(Ok(value)) if f64::is_finite(value) => Ok(value),
                _ => Err(SettingProblem::NotInUnit { text: text.to_owned(), unit: FRICTION.to_owned() }),
            };
        }
    };
    let value =
        mapper_yaml::units::parse(kind, text).map_err(|source| SettingProblem::Quantity { kind, source })?;
    if kind == Kind::Fraction && value.abs() > MAX_CHANGE_RATIO {
        return Err(SettingProblem::DriftTooLarge { text: text.to_owned(), limit_ratio: MAX_CHANGE_RATIO });
    }
    Ok(value)
}

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

    #[test]
    fn weather_is_slow_small_and_repeatable() {
        let nominal = BoundaryConditions { p3_pa: 150e3, ..Default::default() };
        assert_eq!(Weather::default().add_to(nominal, 100.0), nominal);
        assert!(Weather::default().is_calm() && !Weather::draw(1).is_calm());
        assert_eq!(Weather::draw(3), Weather::draw(3));
        assert_ne!(Weather::draw(3), Weather::draw(4));
        for seed in 0..50 {
            let weather = Weather::draw(seed);
            for i in 0..40 {
                let t_s = f64::from(i) * 50.0;
                let (now, soon) = (weather.add_to(nominal, t_s), weather.add_to(nominal, t_s + 1.0));
                // Two waves of at most 0.8 of the amplitude.
                assert!((now.t1_k - nominal.t1_k).abs() <= 1.6 && (now.t3_k - nominal.t3_k).abs() <= 1.6);
                // The fastest wave of T3 has 150 s: 2 pi/150 of its amplitude in a second, twice.
                assert!((soon.t3_k - now.t3_k).abs() <= 1.6 * 2.0 * std::f64::consts::PI / 150.0);
            }
        }
    }

    #[test]
    fn a_drift_continues_at_its_rate_and_a_step_stays() {
        let ramp = LabDrift {
            target: DriftTarget::Sensor(Channel::T2),
            change: 0.5,
            over_s: Some(4.0 * 3600.0),
            from_s: 600.0,
        };
        assert_eq!([ramp.at(0.0), ramp.at(600.0)], [0.0, 0.0]);
        // 0.125 K per hour, also after the four hours.
        assert!((ramp.at(600.0 + 8.0 * 3600.0) - 1.0).abs() < 1e-12);
        let step = LabDrift { over_s: None, ..ramp };
        assert_eq!([step.at(599.9), step.at(600.0), step.at(1e6)], [0.0, 0.5, 0.5]);
    }

    #[test]
    fn flow_meters_drift_in_gain_and_machines_in_their_parameters() {
        let drift = |target| LabDrift { target, change: -0.02, over_s: None, from_s: 0.0 };
        let drifts = [drift(DriftTarget::Sensor(Channel::CompressorFlow)), drift(DriftTarget::Fouling)];
        assert!((drifted_reading(&drifts, Channel::CompressorFlow, 1.0, 0.1) - 0.098).abs() < 1e-15);
        assert_eq!(drifted_reading(&drifts, Channel::T2, 1.0, 400.0), 400.0);
        let params = Params::default();
        let now = drifted_machine(&drifts, params, 1.0).compressor;
        assert!((now.efficiency_scale_ratio / params.compressor.efficiency_scale_ratio - 0.98).abs() < 1e-12);
        assert!((now.flow_scale_ratio / params.compressor.flow_scale_ratio - 0.988).abs() < 1e-12);
    }
}

#[cfg(test)]
mod tolerances_tests {
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
