//! Settings of an identification, from a campaign or a channel map, and warnings about calibrations.

use mapper_campaign::campaign::{CalibrationRule, Date};
use mapper_campaign::{
    CalibrationWarning, Campaign, default_contact_sigma_ratio, default_gain_sigma_ratio,
    internal_area_sigma_ratio,
};
use mapper_core::{
    ALPHA_AREA_SIGMA_RATIO, Channel, DeclaredUncertainty, IdentifiedPoint, Method, ModelTolerances,
    Recording, ReferenceState, Verdict, WindowRule,
};
use mapper_identify::{Allowance, Housing, IdentifyConfig, PressureTap};
use mapper_numerics::statistics::range;
use mapper_observe::declared_uncertainties;
use mapper_physics::gas::air::Air;
use mapper_physics::rig::sensor_fault::ExactReadings;
use mapper_recording::{AmbientPressure, ChannelMap, MachineConstants};
use std::collections::BTreeMap;

pub(crate) fn expected_rest(campaign: &Campaign) -> ExactReadings {
    ExactReadings { pressure_pa: campaign.boundary.p1_pa, temperature_k: campaign.boundary.t1_k }
}

/// Identification settings for the recordings of this campaign.
pub fn identification(campaign: &Campaign) -> IdentifyConfig {
    let settings = &campaign.identification;
    let tap = |channel: Channel| {
        let sensor = campaign.sensors.get(&channel);
        match sensor.and_then(|sensor| sensor.static_tap_pipe_diameter_m) {
            Some(pipe_diameter_m) => PressureTap::Static { pipe_diameter_m },
            None => PressureTap::Total,
        }
    };
    IdentifyConfig {
        method: settings.method,
        window: settings.window,
        settle_bands: settings.settle_bands,
        alpha_area_ratio: settings.alpha_area_ratio,
        alpha_area_sigma_ratio: settings.alpha_area_sigma_ratio,
        inlet_convection: campaign.machine.params.compressor.inlet_convection,
        inlet_diameter_m: campaign.machine.params.compressor.inlet_diameter_m,
        outlet_diameter_m: campaign.machine.params.compressor.outlet_diameter_m,
        probe_diameter_m: campaign.machine.params.t2_probe_diameter_m,
        housing: Housing::of(&campaign.machine.params),
        joint: settings.joint,
        internal_area_m2: campaign.machine.params.compressor.internal_area_m2,
        internal_area_sigma_ratio: internal_area_sigma_ratio(&campaign.machine.assumed),
        air: campaign.machine.params.compressor.air(),
        wheel_diameter_m: campaign
            .machine
            .wheel_is_declared
            .then_some(campaign.machine.params.compressor.wheel_diameter_m),
        turbine_gas: campaign.machine.params.turbine.gas,
        turbine: campaign.machine.params.turbine,
        shaft_inertia_kgm2: campaign.machine.params.shaft_inertia_kgm2,
        humidity_sigma_kg_kg: campaign.report.humidity_sigma_kg_kg(&campaign.boundary),
        reference: campaign.reference,
        actuators: Some(campaign.rig_actuators()),
        opening_is_area: true,
        barometer_pa: campaign.report.barometer_pa,
        housing_contact_sigma_ratio: campaign
            .sensors
            .get(&Channel::Tc)
            .and_then(|sensor| sensor.contact_sigma_ratio)
            .unwrap_or_else(default_contact_sigma_ratio),
        inlet_tap: tap(Channel::P1),
        outlet_tap: tap(Channel::P2),
        turbine_inlet_tap: tap(Channel::P3),
        declared: declared(campaign, &ChannelMap::native()),
        allowance: Allowance::from(&campaign.tolerances),
        ..IdentifyConfig::default()
    }
}

pub(crate) fn declared_conditions(campaign: &Campaign) -> BTreeMap<Channel, f64> {
    let (boundary, follows) = (&campaign.boundary, &campaign.follow_outlet);
    let mut conditions = BTreeMap::from([
        (Channel::P1, boundary.p1_pa),
        (Channel::T1, boundary.t1_k),
        (Channel::TAmb, boundary.ambient_temperature_k),
    ]);
    if !follows.turbine_inlet {
        conditions.insert(Channel::T3, boundary.t3_k);
    }
    if !follows.oil {
        conditions.insert(Channel::TOil, boundary.oil_temperature_k);
    }
    conditions
}

/// Declared uncertainty of the sensors in a recording that is read with this channel map.
pub fn declared(campaign: &Campaign, map: &ChannelMap) -> BTreeMap<Channel, DeclaredUncertainty> {
    let sensors = campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect();
    let mut declared = declared_uncertainties(&sensors, &campaign.tolerances, &map.sensors);
    for (channel, sensor) in &campaign.sensors {
        if let Some(declared) = declared.get_mut(channel).filter(|_| !sensor.gain_is_declared) {
            add_default_gain(*channel, declared);
        }
    }
    declared
}

/// Standard uncertainty of a thermometer at 100 degC, K: tolerance class A of IEC 60751, 0.35 K, as the limits of a rectangular distribution.
const THERMOMETER_K: f64 = 0.2;

/// Standard uncertainty of a thermocouple at 600 degC, K: tolerance class 1 of type K (IEC 60584-1), 0.4 %, as the limits of a rectangular
/// distribution.
const THERMOCOUPLE_K: f64 = 1.4;

pub(crate) fn assumed_sensors() -> BTreeMap<Channel, DeclaredUncertainty> {
    let offset = |offset_sigma| DeclaredUncertainty { offset_sigma, ..DeclaredUncertainty::default() };
    let gain = |gain_sigma_ratio| DeclaredUncertainty { gain_sigma_ratio, ..DeclaredUncertainty::default() };
    let flow_ratio = ModelTolerances::default().flow_meter_gain_ratio;
    BTreeMap::from([
        (Channel::T1, offset(THERMOMETER_K)),
        (Channel::T2, offset(THERMOMETER_K)),
        (Channel::P1, gain(default_gain_sigma_ratio(Channel::P1))),
        (Channel::P2, gain(default_gain_sigma_ratio(Channel::P1))),
        (Channel::CompressorFlow, gain(flow_ratio)),
        (Channel::T3, offset(THERMOCOUPLE_K)),
        (Channel::T4, offset(THERMOCOUPLE_K)),
        (Channel::P3, gain(default_gain_sigma_ratio(Channel::P1))),
        (Channel::P4, gain(default_gain_sigma_ratio(Channel::P1))),
        (Channel::TurbineFlow, gain(flow_ratio)),
    ])
}

fn add_default_gain(channel: Channel, declared: &mut DeclaredUncertainty) {
    if declared.gain_sigma_ratio == 0.0 {
        declared.gain_sigma_ratio = default_gain_sigma_ratio(channel);
    }
}

/// Adds the uncertainty of the ambient pressure to which gauge pressures are added.
fn with_barometer(mut config: IdentifyConfig, map: &ChannelMap) -> IdentifyConfig {
    let Some(AmbientPressure::Constant(barometer)) = &map.ambient_pressure else { return config };
    let gauge: Vec<Channel> =
        [Channel::P1, Channel::P2].into_iter().filter(|channel| map.is_gauge(*channel)).collect();
    match gauge.as_slice() {
        [_, _] => config.barometer_sigma_pa = barometer.sigma_pa,
        [gauge_channel] => {
            let declared = config.declared.entry(*gauge_channel).or_default();
            declared.offset_sigma = declared.offset_sigma.hypot(barometer.sigma_pa);
        }
        _ => {}
    }
    config
}

/// Same as [`identification`], for a recording that is read with this channel map. The map overrides the campaign for sensors, noise and window.
pub fn identification_with(campaign: &Campaign, map: &ChannelMap) -> IdentifyConfig {
    let identification = identification(campaign);
    let config = IdentifyConfig {
        declared: declared(campaign, map),
        opening_is_area: *map == ChannelMap::native(),
        noise_colour: map.noise_colour.unwrap_or(identification.noise_colour),
        window: map.window.map_or(identification.window, |window| WindowRule::Fixed {
            start_s: window.start_s,
            end_s: window.end_s,
        }),
        ..identification
    };
    with_barometer(config, map)
}

/// Identification settings for a recording that has a channel map but no campaign. A pipe diameter in the map always means a static tap.
pub(crate) fn identification_of(machine: &MachineConstants, map: &ChannelMap) -> IdentifyConfig {
    let defaults = IdentifyConfig::default();
    let tap = |diameter_m: Option<f64>| {
        diameter_m.map_or(PressureTap::Total, |pipe_diameter_m| PressureTap::Static { pipe_diameter_m })
    };
    let (inlet_m, outlet_m) = (machine.compressor_inlet_diameter_m, machine.compressor_outlet_diameter_m);
    let mut declared = map.sensors.clone();
    declared.iter_mut().for_each(|(channel, declared)| add_default_gain(*channel, declared));
    let config = IdentifyConfig {
        method: Method::Joint,
        alpha_area_ratio: machine.alpha_area_ratio,
        alpha_area_sigma_ratio: ALPHA_AREA_SIGMA_RATIO,
        internal_area_m2: machine.compressor_internal_area_m2,
        housing: Housing::of_internal_area(machine.compressor_internal_area_m2),
        probe_diameter_m: machine.t2_probe_diameter_m,
        housing_contact_sigma_ratio: default_contact_sigma_ratio(),
        inlet_tap: tap(inlet_m),
        outlet_tap: tap(outlet_m),
        inlet_diameter_m: inlet_m.unwrap_or(defaults.inlet_diameter_m),
        outlet_diameter_m: outlet_m.unwrap_or(defaults.outlet_diameter_m),
        reference: map.reference.unwrap_or(ReferenceState::SAE),
        air: Air::DRY,
        window: map.window.map_or_else(WindowRule::default, |window| WindowRule::Fixed {
            start_s: window.start_s,
            end_s: window.end_s,
        }),
        declared,
        noise_colour: map.noise_colour.unwrap_or_default(),
        ..defaults
    };
    with_barometer(config, map)
}

/// Adds the defects of the sensors' calibrations to each point. If the campaign requires calibrations, the point is unusable.
pub(crate) fn warn_about_calibrations(
    points: &mut [IdentifiedPoint],
    recording: &Recording,
    campaign: &Campaign,
    day: Option<Date>,
) {
    for point in points {
        let Some(step) = recording.steps.iter().find(|step| step.index == point.step) else { continue };
        let readings = |channel: Channel| {
            let values = recording.series.get(&channel)?.slice(step.start_s, step.end_s).1;
            let (low, high) = range(values.iter().copied().filter(|value| value.is_finite()));
            (low <= high).then_some((low, high))
        };
        for CalibrationWarning { warning, .. } in campaign.calibration_warnings(day, readings) {
            match campaign.calibration {
                CalibrationRule::Optional => point.warnings.push(warning),
                CalibrationRule::Required => {
                    point.warnings.insert(0, warning);
                    point.verdict = Verdict::Unusable;
                }
            }
        }
    }
}
