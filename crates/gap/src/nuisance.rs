//! What may be off without being an effect: declared offsets and tolerances, the start, clocks. Each is fitted again,
//! with its declared size as prior, in every hypothesis.

use crate::declared::Declared;
use crate::shape::{SHAPE_SUM, SHAPES};
use mapper_core::Channel;
use mapper_physics::effect::Rig;

/// What the model predicts and a sensor reads, in the order of the residuals.
pub const OUTPUTS: [Channel; 9] = [
    Channel::ShaftSpeed,
    Channel::CompressorFlow,
    Channel::P2,
    Channel::T2,
    Channel::Tc,
    Channel::TurbineFlow,
    Channel::T4,
    Channel::Tt,
    Channel::P3,
];

/// Recorded boundary conditions that drive the model, and have an offset.
pub const DRIVERS: [Channel; 6] =
    [Channel::T1, Channel::P1, Channel::P3, Channel::T3, Channel::P4, Channel::TOil];

/// One thing that may be off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NuisanceKind {
    /// Fixed offset of a sensor.
    Offset(Channel),
    /// Gain of the compressor's flow meter.
    FlowMeterGain,
    /// Flow of the compressor map.
    FlowMap,
    /// Efficiency of the compressor map.
    CompressorEfficiency,
    /// Efficiency of the turbine.
    TurbineEfficiency,
    /// Drop of the gas temperature through the turbine against the power at the shaft.
    TurbineDrop,
    /// Area of the valve.
    ValveArea,
    /// Convection inside the compressor housing.
    Convection,
    /// Convection to the cell.
    ExternalConvection,
    /// Conductance to the oil.
    OilConductance,
    /// One smooth deviation of the efficiency map.
    Shape(usize),
    /// Ambient temperature.
    Ambient,
    /// Compressor housing at the start, against rest.
    StartTc,
    /// Turbine housing at the start, against rest.
    StartTt,
    /// Clock of one output, by its place in [`OUTPUTS`].
    Delay(usize),
}

/// One thing that may be off, and by how much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nuisance {
    /// What.
    pub kind: NuisanceKind,
    /// One sigma, in the unit of what it changes.
    pub sigma: f64,
}

/// Ambient temperature is measured somewhere in the cell, not at each wall, K.
const AMBIENT_SIGMA_K: f64 = 1.0;
/// The gas behind a turbine swirls and is not mixed, and what the shaft gets is less than what the gas gives by what
/// bearings take: T4 tells the turbine's work within this, and no more.
const TURBINE_DROP_RATIO: f64 = 0.03;
/// The rig may not have rested before the recording, K.
const START_SIGMA_K: f64 = 5.0;
/// Clocks of one rig agree within a fraction of a sample, s.
const DELAY_SIGMA_S: f64 = 0.02;

/// All nuisances of a rig; those with nothing declared are left out.
pub fn nuisances(declared: &Declared) -> Vec<Nuisance> {
    use NuisanceKind as K;
    let t = &declared.tolerances;
    let mut all: Vec<(NuisanceKind, f64)> = vec![
        (K::FlowMeterGain, t.flow_meter_gain_ratio),
        (K::FlowMap, t.flow_map_ratio),
        (K::CompressorEfficiency, t.compressor_efficiency_ratio),
        (K::TurbineEfficiency, t.turbine_efficiency_ratio),
        (K::TurbineDrop, TURBINE_DROP_RATIO),
        (K::ValveArea, t.valve_area_ratio),
        (K::Convection, t.convection_ratio),
        (K::ExternalConvection, t.external_convection_ratio),
        (K::OilConductance, t.oil_conductance_ratio),
        (K::Ambient, AMBIENT_SIGMA_K),
        (K::StartTc, START_SIGMA_K),
        (K::StartTt, START_SIGMA_K),
    ];
    // Together they have the declared size.
    all.extend((0..SHAPES).map(|i| (K::Shape(i), t.efficiency_shape_ratio / SHAPE_SUM)));
    let sensors = DRIVERS.iter().chain(OUTPUTS.iter().filter(|channel| !DRIVERS.contains(channel)));
    all.extend(sensors.map(|channel| (K::Offset(*channel), declared.offset_sigma(*channel))));
    all.extend((0..OUTPUTS.len()).map(|i| (K::Delay(i), DELAY_SIGMA_S)));
    all.into_iter().filter(|(_, sigma)| *sigma > 0.0).map(|(kind, sigma)| Nuisance { kind, sigma }).collect()
}

/// What is not part of a rig but of how it is driven.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Circumstances {
    /// Ambient temperature too high by, K.
    pub ambient_k: f64,
    /// Compressor housing above rest at the start, K.
    pub start_tc_k: f64,
    /// Turbine housing above rest at the start, K.
    pub start_tt_k: f64,
    /// Drop of temperature through the turbine larger by, ratio.
    pub t4_drop_ratio: f64,
    /// Coefficients of the efficiency map's shape.
    pub shape: [f64; SHAPES],
    /// Clocks late by, s.
    pub delay_s: [f64; OUTPUTS.len()],
}

/// Puts one nuisance of size `value` (in the unit of what it changes) into a rig.
pub fn apply(kind: NuisanceKind, value: f64, rig: &mut Rig, circumstances: &mut Circumstances) {
    use NuisanceKind as K;
    let params = &mut rig.model.params;
    match kind {
        K::Offset(channel) => rig.instruments.path_mut(channel).offset += value,
        K::FlowMeterGain => rig.instruments.path_mut(Channel::CompressorFlow).gain_ratio *= 1.0 + value,
        K::FlowMap => params.compressor.flow_scale_ratio *= 1.0 + value,
        K::CompressorEfficiency => params.compressor.efficiency_scale_ratio *= 1.0 + value,
        K::TurbineEfficiency => params.turbine.peak_efficiency *= 1.0 + value,
        K::TurbineDrop => circumstances.t4_drop_ratio += value,
        K::ValveArea => params.outlet.valve_area_m2 *= 1.0 + value,
        K::Convection => params.compressor.nusselt_coefficient *= 1.0 + value,
        K::ExternalConvection => params.external_convection_ratio *= 1.0 + value,
        K::OilConductance => params.bearing.oil_conductance_w_k *= 1.0 + value,
        K::Shape(i) => circumstances.shape[i] += value,
        K::Ambient => circumstances.ambient_k += value,
        K::StartTc => circumstances.start_tc_k += value,
        K::StartTt => circumstances.start_tt_k += value,
        K::Delay(i) => circumstances.delay_s[i] += value,
    }
}
