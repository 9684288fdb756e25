//! Settings of the virtual lab, and the file with them.

use crate::virtual_lab::effects_file::{
    EffectValues, FaultFile, SettingProblem, apply_effects, check_range, read_elements,
};
use crate::virtual_lab::rig::actuator::{Actuator, ActuatorDynamics};
use crate::virtual_lab::rig::drift::{DriftFile, LabDrift, Weather, draw_tolerances, read_drifts};
use crate::virtual_lab::rig::running::{Lumped, Structure, SurgePrecursor};
use crate::virtual_lab::sensors::{Draws, LabElements, SecondOrder, SensorErrors, draw, offset_kind};
use mapper_core::{ActuatorMotion, BackendError, Channel};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::rig::backend_plugin::NominalRig;
use mapper_physics::rig::effect::Rig;
use mapper_physics::rig::instruments::Instruments;
use mapper_physics::simulation::model::Model;
use mapper_yaml::units::{
    Conductance, Dimension, Duration, Fraction, Frequency, Length, Pressure, PressureRate, Quantity,
    RatioRate, Speed, TemperatureDifference, TemperatureRate,
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The keys below `virtual_lab`. All are optional.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct SettingsFile {
    /// Name of the simulated rig, so that rig locks can be rehearsed; default none.
    rig: Option<String>,
    /// Samples per second; default 10 Hz.
    sample_rate: Option<Quantity<Frequency>>,
    /// Rate of fast samples of P1 and P2; default none.
    fast_rate: Option<Quantity<Frequency>>,
    /// `standstill` (cold, the default) or `settled` (in steady state at the first setpoints).
    start: Start,
    /// `declared` (the default) or `none`.
    noise: NoiseName,
    /// `drawn` from the declared uncertainty (the default), or `none`.
    offsets: OffsetsName,
    /// Offsets of single channels, in their units, instead of drawn ones.
    offset_of: BTreeMap<Channel, String>,
    /// Effects of the true machine that the declared one does not have.
    effects: BTreeMap<String, EffectValues>,
    /// Offset, slow or stuck sensors of a redundant channel.
    faults: Vec<FaultFile>,
    /// Drifts at run time.
    drift: Vec<DriftFile>,
    /// `calm` (the default) or `wandering`.
    weather: WeatherName,
    /// `drawn` from the campaign's tolerances, or `none` (the default).
    tolerances: TolerancesName,
    /// Seed of the tolerances, so that a machine stays the same under other noise; default: the campaign's.
    tolerances_seed: Option<u64>,
    /// Deviations of the machine within its tolerances, in place of a draw.
    deviations: DeviationsFile,
    /// Dynamics of the actuators.
    actuators: ActuatorsFile,
    /// Fall of T3 when P3 rises by 100 kPa at once, which goes as T3 follows; none by default.
    heater_sag: Option<Quantity<TemperatureDifference>>,
    /// Loss of P1 at a compressor flow of 0.1 kg/s, with the square of the flow; none by default.
    inlet_loss: Option<Quantity<Pressure>>,
    /// Differences of the true machine from the declared one.
    machine: MachineFile,
    /// Shaft speed at which the lab cuts its own air; default 1.1 times the campaign's limit.
    trip_speed: Option<Quantity<Speed>>,
    /// Swing of the flow in surge; default 8 %.
    surge_swing: Option<Quantity<Fraction>>,
    /// Fluctuations of flow and pressures before surge.
    surge_precursor: PrecursorFile,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct PrecursorFile {
    /// Surge margin at which it begins; default 25 %.
    onset: Option<Quantity<Fraction>>,
    /// Root mean square of the flow fluctuation at half that margin; default 0.3 %.
    size: Option<Quantity<Fraction>>,
    /// Exponent by which the variance grows with the inverse of the margin; default 1.
    growth: Option<f64>,
}

/// Declares keys of two values, the default first.
macro_rules! choices {
    ($($name:ident $usual:ident $other:ident,)*) => {$(
        #[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum $name {
            #[default]
            $usual,
            $other,
        }
    )*};
}

choices! {
    NoiseName Declared None,
    OffsetsName Drawn None,
    WeatherName Calm Wandering,
    TolerancesName None Drawn,
}

/// Deviations of the machine, as found by a diagnosis.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct DeviationsFile {
    flow_meter_gain: Option<Quantity<Fraction>>,
    flow_map: Option<Quantity<Fraction>>,
    compressor_efficiency: Option<Quantity<Fraction>>,
    turbine_efficiency: Option<Quantity<Fraction>>,
    valve_area: Option<Quantity<Fraction>>,
    convection: Option<Quantity<Fraction>>,
    external_convection: Option<Quantity<Fraction>>,
    oil_conductance: Option<Quantity<Fraction>>,
}

impl DeviationsFile {
    /// Applies the deviations to a rig.
    fn apply(&self, rig: &mut Rig) -> Result<(), BackendError> {
        let scale = |key: &str, deviation: &Option<Quantity<Fraction>>| {
            let ratio = deviation.as_ref().map_or(0.0, |deviation| deviation.value);
            check_range(100.0 * ratio, "%", -90.0..=900.0)
                .map_err(|problem| problem.at(format!("deviations.{key}")))?;
            Ok::<f64, BackendError>(1.0 + ratio)
        };
        let params = &mut rig.model.params;
        rig.instruments.path_mut(Channel::CompressorFlow).gain_ratio *=
            scale("flow_meter_gain", &self.flow_meter_gain)?;
        params.compressor.flow_scale_ratio *= scale("flow_map", &self.flow_map)?;
        params.compressor.efficiency_scale_ratio *=
            scale("compressor_efficiency", &self.compressor_efficiency)?;
        params.turbine.peak_efficiency *= scale("turbine_efficiency", &self.turbine_efficiency)?;
        params.outlet.valve_area_m2 *= scale("valve_area", &self.valve_area)?;
        params.compressor.nusselt_coefficient *= scale("convection", &self.convection)?;
        params.external_convection_ratio *= scale("external_convection", &self.external_convection)?;
        params.bearing.oil_conductance_w_k *= scale("oil_conductance", &self.oil_conductance)?;
        Ok(())
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ActuatorsFile {
    turbine_inlet_pressure: ActuatorFile<PressureRate>,
    turbine_inlet_temperature: ActuatorFile<TemperatureRate>,
    valve: ActuatorFile<RatioRate>,
    /// Play of the valve's drive, opening; the declared one by default.
    valve_play: Option<Quantity<Fraction>>,
    /// Change of the commanded opening below which the valve does not move; the declared one by default.
    valve_dead_band: Option<Quantity<Fraction>>,
    oil_temperature: ActuatorFile<TemperatureRate>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default, bound(deserialize = ""))]
struct ActuatorFile<Rate: Dimension> {
    lag: Option<Quantity<Duration>>,
    slew: Option<Quantity<Rate>>,
    dead_time: Option<Quantity<Duration>>,
}

impl<Rate: Dimension> Default for ActuatorFile<Rate> {
    fn default() -> Self {
        ActuatorFile { lag: None, slew: None, dead_time: None }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct MachineFile {
    /// True share of the internal area before compression, alpha_A.
    alpha_area: Option<f64>,
    /// True diameter of the T2 probe.
    probe_diameter: Option<Quantity<Length>>,
    /// True conductance to the oil.
    oil_conductance: Option<Quantity<Conductance>>,
}

/// Reads a campaign's settings for the virtual lab.
pub fn read_settings(
    settings: &serde_json::Value,
    nominal: &NominalRig,
) -> Result<LabSettings, BackendError> {
    let file: SettingsFile = match settings {
        serde_json::Value::Null => SettingsFile::default(),
        settings => serde_path_to_error::deserialize(settings).map_err(|error| {
            let path = error.path().to_string();
            SettingProblem::Form(error.into_inner()).at(path.trim_start_matches('.'))
        })?,
    };
    let params = &nominal.model.params;
    let model = Model { params: apply_true_params(*params, &file.machine)?, ..nominal.model.clone() };
    let sample_rate_hz = file.sample_rate.map_or(10.0, |rate| rate.value);
    check_range(sample_rate_hz, "Hz", 0.1..=1000.0).map_err(|problem| problem.at("sample_rate"))?;
    let fast_rate_hz = file.fast_rate.map(|rate| rate.value);
    check_range(fast_rate_hz.unwrap_or(1e3), "Hz", 100.0..=10e3)
        .map_err(|problem| problem.at("fast_rate"))?;
    let heater_sag_k = file.heater_sag.map_or(0.0, |sag| sag.value);
    check_range(heater_sag_k, "K", 0.0..=200.0).map_err(|problem| problem.at("heater_sag"))?;
    let inlet_loss_pa = file.inlet_loss.map_or(0.0, |loss| loss.value);
    check_range(inlet_loss_pa, "Pa", 0.0..=20e3).map_err(|problem| problem.at("inlet_loss"))?;
    let surge_swing_ratio = file.surge_swing.map_or(0.08, |swing| swing.value);
    check_range(100.0 * surge_swing_ratio, "%", 0.0..=100.0).map_err(|problem| problem.at("surge_swing"))?;
    let mut rig = Rig::new(model);
    if file.tolerances == TolerancesName::Drawn {
        draw_tolerances(&mut rig, &nominal.tolerances, file.tolerances_seed.unwrap_or(nominal.seed));
    }
    file.deviations.apply(&mut rig)?;
    apply_effects(&mut rig, &file.effects, nominal)?;
    let (actuators, declared) = (&file.actuators, &nominal.actuators);
    let draws = Draws {
        seed: nominal.seed,
        noise_ratio: if file.noise == NoiseName::Declared { 1.0 } else { 0.0 },
        drawn: file.offsets == OffsetsName::Drawn,
    };
    let offset_of = parse_offsets(&file)?;
    let mut lab = LabSettings {
        model: rig.model.clone(),
        instruments: Instruments::default(),
        weather: match file.weather {
            WeatherName::Calm => Weather::default(),
            WeatherName::Wandering => Weather::draw(nominal.seed),
        },
        cell: nominal.boundary,
        rig: file.rig.clone(),
        sample_rate_hz,
        fast_rate_hz,
        start: file.start,
        p3_actuator: actuators.turbine_inlet_pressure.dynamics("turbine_inlet_pressure", &declared.p3)?,
        t3_actuator: actuators
            .turbine_inlet_temperature
            .dynamics("turbine_inlet_temperature", &declared.t3)?,
        valve_actuator: ActuatorDynamics {
            play: actuators.opening("valve_play", actuators.valve_play, declared.valve_play_ratio)?,
            dead_band: actuators.opening(
                "valve_dead_band",
                actuators.valve_dead_band,
                declared.valve_dead_band_ratio,
            )?,
            ..actuators.valve.dynamics("valve", &declared.valve)?
        },
        heater_sag_k,
        inlet_loss_pa,
        oil_actuator: actuators.oil_temperature.dynamics("oil_temperature", &OIL_MOTION)?,
        sensors: draw_sensors(&offset_of, nominal, &draws),
        redundant: read_elements(&file.faults, nominal, &draws, &offset_of)?,
        uneven_at_rest: match file.offsets {
            OffsetsName::Drawn => draw_nonuniformity(nominal),
            OffsetsName::None => BTreeMap::new(),
        },
        drifts: read_drifts(&file.drift)?,
        static_tap_pipe_diameters_m: nominal.static_tap_pipe_diameters_m.clone(),
        trip_speed_rpm: file.trip_speed.map_or(1.1 * nominal.speed_max_rpm, |speed| speed.value),
        structure: Arc::new(Lumped),
        second_order: BTreeMap::new(),
        surge_swing_ratio,
        surge_precursor: file.surge_precursor.precursor()?,
        seed: nominal.seed,
    };
    lab.take(rig);
    Ok(lab)
}

impl<Rate: Dimension> ActuatorFile<Rate> {
    /// The dynamics of the settings, and the declared ones where they say nothing.
    fn dynamics(&self, name: &str, declared: &ActuatorMotion) -> Result<ActuatorDynamics, BackendError> {
        let lag_s = self.lag.map_or(declared.lag_s, |lag| lag.value);
        let dead_time_s = self.dead_time.map_or(declared.dead_time_s, |dead_time| dead_time.value);
        let slew_per_s = self.slew.as_ref().map_or(declared.rate_per_s, |slew| slew.value);
        check_range(dead_time_s, "s", 0.0..=600.0)
            .map_err(|problem| problem.at(format!("actuators.{name}.dead_time")))?;
        check_range(lag_s, "s", 0.0..=3600.0)
            .map_err(|problem| problem.at(format!("actuators.{name}.lag")))?;
        if slew_per_s <= 0.0 {
            let problem = SettingProblem::NotPositive { value: slew_per_s, unit: rate_unit::<Rate>() };
            return Err(problem.at(format!("actuators.{name}.slew")));
        }
        Ok(ActuatorDynamics { dead_time_s, ..ActuatorDynamics::new(lag_s, slew_per_s) })
    }
}

impl ActuatorsFile {
    /// A part of the valve's opening: play or dead band.
    fn opening(
        &self,
        key: &str,
        given: Option<Quantity<Fraction>>,
        declared_ratio: f64,
    ) -> Result<f64, BackendError> {
        let ratio = given.map_or(declared_ratio, |given| given.value);
        check_range(100.0 * ratio, "%", 0.0..=50.0)
            .map_err(|problem| problem.at(format!("actuators.{key}")))?;
        Ok(ratio)
    }
}

/// Motion of the oil's temperature. Judgement: heaters of oil take half a minute.
const OIL_MOTION: ActuatorMotion = ActuatorMotion { lag_s: 30.0, rate_per_s: 1.0, dead_time_s: 0.0 };

impl PrecursorFile {
    fn precursor(&self) -> Result<SurgePrecursor, BackendError> {
        let usual = SurgePrecursor::USUAL;
        let onset_margin_ratio = self.onset.map_or(usual.onset_margin_ratio, |onset| onset.value);
        let size_ratio = self.size.map_or(usual.size_ratio, |size| size.value);
        let growth = self.growth.unwrap_or(usual.growth);
        for (key, value, unit, range) in [
            ("onset", 100.0 * onset_margin_ratio, "%", 0.1..=50.0),
            ("size", 100.0 * size_ratio, "%", 0.0..=10.0),
            ("growth", growth, "", 0.2..=4.0),
        ] {
            check_range(value, unit, range)
                .map_err(|problem| problem.at(format!("surge_precursor.{key}")))?;
        }
        Ok(SurgePrecursor { onset_margin_ratio, size_ratio, growth })
    }
}

fn apply_true_params(mut params: Params, file: &MachineFile) -> Result<Params, BackendError> {
    if let Some(alpha) = file.alpha_area {
        check_range(alpha, "", 0.0..=1.0).map_err(|problem| problem.at("machine.alpha_area"))?;
        params.compressor.alpha_area_ratio = alpha;
    }
    if let Some(diameter) = file.probe_diameter {
        check_range(1e3 * diameter.value, "mm", 0.0..=20.0)
            .map_err(|problem| problem.at("machine.probe_diameter"))?;
        params.t2_probe_diameter_m = diameter.value;
    }
    if let Some(conductance) = file.oil_conductance {
        if conductance.value < 0.0 {
            let problem = SettingProblem::Negative { value: conductance.value, unit: "W/K" };
            return Err(problem.at("machine.oil_conductance"));
        }
        params.bearing.oil_conductance_w_k = conductance.value;
    }
    Ok(params)
}

/// Offsets of single channels, in their units.
fn parse_offsets(file: &SettingsFile) -> Result<BTreeMap<Channel, f64>, BackendError> {
    let parse = |(channel, text): (&Channel, &String)| {
        let kind = offset_kind(*channel);
        let offset = mapper_yaml::units::parse(kind, text)
            .map_err(|source| SettingProblem::Quantity { kind, source }.at(format!("offset_of.{channel}")))?;
        Ok((*channel, offset))
    };
    file.offset_of.iter().map(parse).collect()
}

fn draw_sensors(
    offset_of: &BTreeMap<Channel, f64>,
    nominal: &NominalRig,
    draws: &Draws,
) -> BTreeMap<Channel, SensorErrors> {
    let declared = nominal.sensors.iter();
    let mut sensors: BTreeMap<Channel, SensorErrors> = declared
        .map(|(channel, declared)| (*channel, draws.errors(*channel, declared, *channel as u64)))
        .collect();
    for (channel, offset) in offset_of {
        sensors.entry(*channel).or_default().offset = *offset;
    }
    sensors
}

/// Draws errors at rest from the declared non-uniformity of the soak; empty without a declaration.
fn draw_nonuniformity(nominal: &NominalRig) -> BTreeMap<Channel, f64> {
    let Some(soak) = nominal.soak else { return BTreeMap::new() };
    // A separate stream from that of the offsets.
    let seed = nominal.seed ^ 0x6A09_E667_F3BC_C908;
    let drawn = |channel: Channel, sigma: f64| (channel, sigma * draw(seed, channel as u64).0);
    let temperatures = [Channel::T1, Channel::T2, Channel::Tc, Channel::TOil];
    let temperatures = temperatures.map(|channel| drawn(channel, soak.temperature_sigma_k));
    let pressures = [Channel::P1, Channel::P2].map(|channel| drawn(channel, soak.pressure_sigma_pa));
    temperatures.into_iter().chain(pressures).collect()
}

/// The storage unit of a rate.
fn rate_unit<Rate: Dimension>() -> &'static str {
    Rate::KIND.units().first().map_or("", |unit| unit.symbol())
}

/// State of the machine when the lab is armed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At rest and at ambient temperature.
    #[default]
    Standstill,
    /// Settled at the first setpoints.
    Settled,
}

/// All settings of a virtual lab.
#[derive(Debug, Clone)]
pub struct LabSettings {
    /// The true machine; it may differ from the declared one.
    pub model: Model,
    /// Lags, gains and offsets before the sensors' own errors; [`LabSettings::p3_actuator`] has the lag of P3.
    pub instruments: Instruments,
    /// Wander of cell and supplies.
    pub weather: Weather,
    /// T1, P1, P4 and ambient temperature are constant except for the weather; the other values are the state at arming.
    pub cell: BoundaryConditions,
    /// Name of the simulated rig, which two runs cannot share at once; `None`: each run has its own.
    pub rig: Option<String>,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Rate of fast samples of P1 and P2, Hz; `None` for none.
    pub fast_rate_hz: Option<f64>,
    /// State at arming.
    pub start: Start,
    /// Turbine inlet pressure, Pa.
    pub p3_actuator: ActuatorDynamics,
    /// Turbine inlet temperature, K.
    pub t3_actuator: ActuatorDynamics,
    /// Valve opening.
    pub valve_actuator: ActuatorDynamics,
    /// Oil temperature, K.
    pub oil_actuator: ActuatorDynamics,
    /// Fall of T3 when P3 rises at once by [`LabSettings::SAG_JUMP_PA`], K.
    pub heater_sag_k: f64,
    /// Loss of P1 at [`LabSettings::LOSS_FLOW_KG_S`], Pa.
    pub inlet_loss_pa: f64,
    /// Errors of the sensors; channels without an entry are ideal.
    pub sensors: BTreeMap<Channel, SensorErrors>,
    /// Channels with redundant sensors, which replace the one in `sensors`.
    pub redundant: BTreeMap<Channel, LabElements>,
    /// Offset of the sensors' true temperatures at rest, in the channel's unit: no rig is perfectly uniform.
    pub uneven_at_rest: BTreeMap<Channel, f64>,
    /// Drifts at run time.
    pub drifts: Vec<LabDrift>,
    /// Pressures with a wall tap, with the inner diameter of the pipe, m; the others are total.
    pub static_tap_pipe_diameters_m: BTreeMap<Channel, f64>,
    /// Shaft speed at which the lab cuts the air by itself, rpm.
    pub trip_speed_rpm: f64,
    /// The equations of the machine.
    pub structure: Arc<dyn Structure>,
    /// Sensors with a second-order response before their own lag; none in the nominal lab.
    pub second_order: BTreeMap<Channel, SecondOrder>,
    /// Fluctuation of flow and outlet pressure beyond the surge line, ratio of their values.
    pub surge_swing_ratio: f64,
    /// Fluctuation of flow and pressures before the surge line.
    pub surge_precursor: SurgePrecursor,
    /// Seed of all noise.
    pub seed: u64,
}

impl LabSettings {
    /// Rise of P3 of the stated sag, Pa, and compressor flow of the stated loss, kg/s. Source: definition.
    pub const SAG_JUMP_PA: f64 = 100e3;
    /// See [`LabSettings::SAG_JUMP_PA`].
    pub const LOSS_FLOW_KG_S: f64 = 0.1;

    /// The sag of T3 at rest at a P3, Pa: it goes with the lag of T3.
    pub(crate) fn sag_at_rest(&self, p3_pa: f64) -> Option<(f64, Actuator)> {
        let followed = ActuatorDynamics::new(self.t3_actuator.lag_s, f64::INFINITY);
        (self.heater_sag_k > 0.0)
            .then(|| (self.heater_sag_k / Self::SAG_JUMP_PA, Actuator::at_rest(followed, p3_pa)))
    }

    /// Takes machine and instruments from a rig; the additional motion of P3 and valve goes to their actuators.
    pub fn take(&mut self, rig: Rig) {
        let slower_s = rig.instruments.p3_lag_s - mapper_physics::rig::instruments::NOMINAL_P3_LAG_S;
        self.p3_actuator.lag_s = (self.p3_actuator.lag_s + slower_s).max(0.0);
        self.valve_actuator.lag_s += rig.instruments.valve.lag_s;
        self.valve_actuator.play += rig.instruments.valve.play_ratio;
        self.model = rig.model;
        self.instruments = rig.instruments;
    }

    /// A lab without sensor errors and actuator lag: the model itself.
    pub fn ideal(model: Model, cell: BoundaryConditions) -> Self {
        let at_once = ActuatorDynamics::AT_ONCE;
        LabSettings {
            model,
            instruments: Instruments::default(),
            weather: Weather::default(),
            cell,
            rig: None,
            sample_rate_hz: 10.0,
            fast_rate_hz: None,
            start: Start::Settled,
            p3_actuator: at_once,
            t3_actuator: at_once,
            valve_actuator: at_once,
            oil_actuator: at_once,
            heater_sag_k: 0.0,
            inlet_loss_pa: 0.0,
            sensors: BTreeMap::new(),
            redundant: BTreeMap::new(),
            uneven_at_rest: BTreeMap::new(),
            drifts: Vec::new(),
            static_tap_pipe_diameters_m: BTreeMap::new(),
            trip_speed_rpm: f64::INFINITY,
            structure: Arc::new(Lumped),
            second_order: BTreeMap::new(),
            surge_swing_ratio: 0.0,
            surge_precursor: SurgePrecursor::NONE,
            seed: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{DeclaredUncertainty, ModelTolerances, RigActuators};
    use mapper_physics::machine::params::BoundaryConditions;
    use mapper_physics::simulation::model::{State, rad_s_of_rpm};
    use serde_json::json;

    fn nominal() -> NominalRig {
        let declared = DeclaredUncertainty { noise_sigma: 0.1, offset_sigma: 0.25, gain_sigma_ratio: 0.0 };
        NominalRig {
            model: Model::nominal(),
            boundary: BoundaryConditions::default(),
            actuators: RigActuators::default(),
            speed_max_rpm: 180e3,
            sensors: [(Channel::T1, declared), (Channel::T2, declared)].into(),
            redundant: BTreeMap::new(),
            static_tap_pipe_diameters_m: BTreeMap::new(),
            soak: None,
            tolerances: ModelTolerances::default(),
            effects: mapper_effects::catalogue(),
            read_effect: |path| {
                let script = std::fs::read_to_string(path)?;
                Ok(std::sync::Arc::new(mapper_effects::ScriptEffect::new(&script, path)?))
            },
            seed: 5,
        }
    }

    #[test]
    fn effects_are_applied_by_their_ids_and_values_with_units() {
        let settings = json!({
            "start": "settled", "weather": "wandering",
            "effects": {
                "area_split": 0.12, "tip_diameter": "1.5 mm", "inner_node": {"phi": 0.35, "G": "15 W/K"},
                "bearing_friction": "1.5e-6 W s2/rad2", "flowmeter_lag": "2 s", "actuator_lag": "1.1 s", "t2_offset": "-1 K",
            },
        });
        let lab = read_settings(&settings, &nominal()).unwrap();
        let params = lab.model.params;
        assert_eq!((params.compressor.alpha_area_ratio, params.t2_probe_diameter_m), (0.12, 1.5e-3));
        let inner = (params.compressor.inner_capacity_ratio, params.compressor.inner_conductance_w_k);
        assert_eq!((inner, params.bearing_friction_w_s2), ((0.35, 15.0), 1.5e-6));
        assert_eq!(lab.instruments.path(Channel::CompressorFlow).lag_s, 2.0);
        assert_eq!(lab.instruments.path(Channel::T2).offset, -1.0);
        assert!((lab.p3_actuator.lag_s - 1.1).abs() < 1e-12);
        assert!(!lab.weather.is_calm());
    }

    /// 1.5e-6 (110e3 pi/30)^2 = 199.04 W leave the shaft.
    #[test]
    fn an_effect_in_rhai_is_named_by_its_file() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/effects/bearing_friction.rhai");
        let lab = read_settings(&json!({"effects": {file: {"c": "1.5e-6 W s2/rad2"}}}), &nominal()).unwrap();
        let state = State::new(rad_s_of_rpm(110e3), 155e3, 340.0, 500.0, 370.0);
        let balance_w = |model: &Model| {
            let model = model.prepare(&BoundaryConditions { p3_pa: 165e3, ..BoundaryConditions::default() });
            model.shaft_balance_w(&model.evaluate(&state))
        };
        let (without_w, with_w) = (balance_w(&nominal().model), balance_w(&lab.model));
        assert!((without_w - with_w - 199.04).abs() < 0.01, "{without_w} {with_w}");
    }

    #[test]
    fn settings_change_the_lab_from_the_declared_rig() {
        let settings = json!({
            "sample_rate": "20 Hz", "start": "settled", "noise": "none", "offset_of": {"T2": "0.3 K"},
            "actuators": {"turbine_inlet_pressure": {"lag": "0.5 s", "slew": "20 kPa/s"}},
            "machine": {"alpha_area": 0.2, "probe_diameter": "1.5 mm"},
        });
        let lab = read_settings(&settings, &nominal()).unwrap();
        assert_eq!(lab.sample_rate_hz, 20.0);
        assert_eq!(lab.p3_actuator, ActuatorDynamics::new(0.5, 20e3));
        assert_eq!(lab.model.params.compressor.alpha_area_ratio, 0.2);
        assert_eq!(lab.model.params.t2_probe_diameter_m, 1.5e-3);
        assert_eq!(lab.sensors[&Channel::T2].offset, 0.3);
        assert_eq!(lab.sensors[&Channel::T2].white_sigma, 0.0);
    }

    #[test]
    fn drifts_have_units_and_may_begin_before_the_run() {
        let settings = json!({"drift": [
            {"cause": "T2", "change": "0.5 K", "over": "4 h"},
            {"cause": "m_c", "change": "1 %", "over": "10 h", "from": "-10 h"},
            {"cause": "P2", "change": "400 Pa", "from": "25 min"},
            {"cause": "fouling", "change": "-2 %", "over": "1 h"},
            {"cause": "bearing_friction", "change": "1e-7 W s2/rad2", "over": "1 h"},
        ]});
        let drifts = read_settings(&settings, &nominal()).unwrap().drifts;
        let at_the_start: Vec<f64> = drifts.iter().map(|drift| drift.at(0.0)).collect();
        assert_eq!(at_the_start, [0.0, 0.01, 0.0, 0.0, 0.0]);
        let after_an_hour: Vec<f64> = drifts.iter().map(|drift| drift.at(3600.0)).collect();
        for (drift, expected) in after_an_hour.iter().zip([0.125, 0.011, 400.0, -0.02, 1e-7]) {
            assert!((drift - expected).abs() < 1e-9 * expected.abs(), "{drift} {expected}");
        }
    }

    #[test]
    fn drawn_offsets_have_the_declared_scatter_for_each_seed_and_channel() {
        let offsets: Vec<f64> = (0..2000)
            .map(|seed| {
                let lab = read_settings(&json!({}), &NominalRig { seed, ..nominal() }).unwrap();
                assert_ne!(lab.sensors[&Channel::T1].offset, lab.sensors[&Channel::T2].offset);
                lab.sensors[&Channel::T2].offset
            })
            .collect();
        let rms = (offsets.iter().map(|offset| offset * offset).sum::<f64>() / 2000.0).sqrt();
        // A standard deviation from 2000 draws is accurate to 1.6 %.
        assert!((rms / 0.25 - 1.0).abs() < 0.06, "{rms}");
    }

    #[test]
    fn an_error_contains_its_key() {
        for (settings, expected) in [
            (json!({"sampel_rate": "10 Hz"}), "`sampel_rate`"),
            (json!({"actuators": {"valve": {"lag": "1 K"}}}), "actuators.valve.lag"),
            (json!({"sample_rate": "10"}), "has no unit"),
            (json!({"sample_rate": "0 Hz"}), "sample_rate"),
            (json!({"surge_precursor": {"onset": "80 %"}}), "surge_precursor.onset"),
            (json!({"surge_precursor": {"growth": "1 K"}}), "surge_precursor.growth"),
            (json!({"machine": {"alpha_area": 2}}), "machine.alpha_area"),
            (json!({"offset_of": {"T2": "1 kPa"}}), "offset_of.T2"),
            (json!({"actuators": {"valve": {"slew": "0 1/s"}}}), "actuators.valve.slew"),
            (json!({"drift": [{"cause": "T9", "change": "1 K"}]}), "drift[0].cause"),
            (json!({"drift": [{"cause": "T2", "change": "1 kPa"}]}), "drift[0].change"),
            (json!({"drift": [{"cause": "T2", "change": "1 K", "over": "0 s"}]}), "`over`"),
            (json!({"drift": [{"cause": "fouling", "change": "-150 %"}]}), "30 %"),
            (json!({"effects": {"area_spilt": 0.1}}), "area_split"),
            (json!({"effects": {"area_split": 2.0}}), "is not between 0 and 0.6"),
            (json!({"effects": {"tip_diameter": 1.5}}), "effects.tip_diameter"),
            (json!({"effects": {"inner_node": {"phi": 0.3}}}), "G: a value in W/K"),
            (json!({"effects": {"inner_node": {"psi": 0.3}}}), "effects.inner_node.psi"),
        ] {
            let error = read_settings(&settings, &nominal()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
