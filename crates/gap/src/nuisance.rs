//! What may be off without being an effect: declared offsets and tolerances, the start, clocks. Each is fitted again,
//! with its declared size as prior, in every hypothesis.

use crate::shape::{SHAPE_SUM, SHAPES};
use mapper_core::{Channel, Dimension};
use mapper_observe::channels::{self, DRIVERS};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::effect::Rig;

/// What the model predicts and a sensor reads, in the order of the residuals.
pub const OUTPUTS: [Channel; 9] = {
    let [n, p2, m_c, m_t, t2, tc, tt, t4] = channels::OUTPUTS;
    [n, m_c, p2, t2, tc, m_t, t4, tt, Channel::P3]
};

/// One thing that may be off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NuisanceKind {
    /// Fixed offset of a sensor.
    Offset(Channel),
    /// Offset that all sensors of a dimension have in common which were compared at rest.
    CommonOffset(Dimension),
    /// Gain of the compressor's flow meter.
    FlowMeterGain,
    /// One quantity of machine, cell or start.
    Perturbation(Perturbation),
    /// Drop of the gas temperature through the turbine against the power at the shaft.
    TurbineDrop,
    /// One smooth deviation of the efficiency map.
    Shape(usize),
    /// Clock of one output, by its place in [`OUTPUTS`].
    Delay(usize),
}

impl std::fmt::Display for NuisanceKind {
    /// As it stands in files and is told to people.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            NuisanceKind::Offset(channel) => write!(f, "offset of {channel}"),
            NuisanceKind::CommonOffset(Dimension::Pressure) => f.write_str("common offset of the pressures"),
            NuisanceKind::CommonOffset(_) => f.write_str("common offset of the temperatures"),
            NuisanceKind::FlowMeterGain => f.write_str("flow_meter_gain"),
            NuisanceKind::Perturbation(Perturbation::Flow) => f.write_str("flow_map"),
            NuisanceKind::Perturbation(Perturbation::Efficiency) => f.write_str("compressor_efficiency"),
            NuisanceKind::Perturbation(Perturbation::TurbineEfficiency) => f.write_str("turbine_efficiency"),
            NuisanceKind::Perturbation(Perturbation::ValveArea) => f.write_str("valve_area"),
            NuisanceKind::Perturbation(Perturbation::CompressorConvection) => f.write_str("convection"),
            NuisanceKind::Perturbation(Perturbation::ExternalConvection) => {
                f.write_str("external_convection")
            }
            NuisanceKind::Perturbation(Perturbation::OilConductance) => f.write_str("oil_conductance"),
            NuisanceKind::Perturbation(knob) => write!(f, "{knob:?}"),
            NuisanceKind::TurbineDrop => f.write_str("turbine_drop"),
            NuisanceKind::Shape(i) => write!(f, "efficiency_shape {i}"),
            NuisanceKind::Delay(output) => write!(f, "delay of {}", OUTPUTS[*output]),
        }
    }
}

/// One thing that may be off, and by how much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nuisance {
    /// What.
    pub kind: NuisanceKind,
    /// Where it is if nothing is known of this recording, in the unit of what it changes: 0 for the nominal rig, what an earlier
    /// recording says of this one otherwise.
    pub centre: f64,
    /// One sigma, in the unit of what it changes.
    pub sigma: f64,
}

impl Nuisance {
    /// What stands in the rig, so many sigmas from the centre.
    pub fn value(&self, sigmas: f64) -> f64 {
        self.centre + sigmas * self.sigma
    }
}

/// The gas behind a turbine swirls and is not mixed, and what the shaft gets is less than what the gas gives by what
/// bearings take: T4 tells the turbine's work within this, and no more.
const TURBINE_DROP_RATIO: f64 = 0.03;
/// Clocks of one rig agree within a fraction of a sample, s.
const DELAY_SIGMA_S: f64 = 0.02;

/// All nuisances of a rig; those with nothing declared are left out.
pub fn nuisances(declared: &Declared) -> Vec<Nuisance> {
    use NuisanceKind as K;
    let t = &declared.tolerances;
    let knob = |knob: Perturbation| (K::Perturbation(knob), knob.tolerance(t));
    let mut all: Vec<(NuisanceKind, f64)> = vec![
        (K::FlowMeterGain, declared.of(Channel::CompressorFlow).gain_sigma_ratio),
        knob(Perturbation::Flow),
        knob(Perturbation::Efficiency),
        knob(Perturbation::TurbineEfficiency),
        (K::TurbineDrop, TURBINE_DROP_RATIO),
        knob(Perturbation::ValveArea),
        knob(Perturbation::CompressorConvection),
        knob(Perturbation::ExternalConvection),
        knob(Perturbation::OilConductance),
        knob(Perturbation::Ambient),
        knob(Perturbation::StartTc),
        knob(Perturbation::StartTt),
    ];
    // Together they have the declared size.
    all.extend((0..SHAPES).map(|i| (K::Shape(i), t.efficiency_shape_ratio / SHAPE_SUM)));
    let sensors = DRIVERS.iter().chain(OUTPUTS.iter().filter(|channel| !DRIVERS.contains(channel)));
    all.extend(sensors.map(|channel| (K::Offset(*channel), declared.offset_sigma(*channel))));
    all.extend(declared.common_offsets.iter().filter_map(|common| {
        Some((K::CommonOffset(common.channels.first()?.info().dimension), common.sigma))
    }));
    all.extend((0..OUTPUTS.len()).map(|i| (K::Delay(i), DELAY_SIGMA_S)));
    all.into_iter()
        .filter(|(_, sigma)| *sigma > 0.0)
        .map(|(kind, sigma)| Nuisance { kind, centre: 0.0, sigma })
        .collect()
}

/// What is not part of a rig but of how it is driven.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Circumstances {
    /// What is added to the ambient temperature and to the start, in the unit of each.
    pub knobs: Vec<(Perturbation, f64)>,
    /// Drop of temperature through the turbine larger by, ratio.
    pub t4_drop_ratio: f64,
    /// Coefficients of the efficiency map's shape.
    pub shape: [f64; SHAPES],
    /// Clocks late by, s.
    pub delay_s: [f64; OUTPUTS.len()],
}

/// Puts one nuisance of size `value` (in the unit of what it changes) into a rig.
pub fn apply(
    declared: &Declared,
    kind: NuisanceKind,
    value: f64,
    rig: &mut Rig,
    circumstances: &mut Circumstances,
) {
    use NuisanceKind as K;
    match kind {
        K::CommonOffset(dimension) => {
            let all = declared.common_offsets.iter().flat_map(|common| &common.channels);
            for channel in all.filter(|channel| channel.info().dimension == dimension) {
                rig.instruments.path_mut(*channel).offset += value;
            }
        }
        K::Offset(channel) => rig.instruments.path_mut(channel).offset += value,
        K::FlowMeterGain => rig.instruments.path_mut(Channel::CompressorFlow).gain_ratio *= 1.0 + value,
        // The cell's temperature is read too high by it, so that the model is driven with less.
        K::Perturbation(Perturbation::Ambient) => circumstances.knobs.push((Perturbation::Ambient, -value)),
        K::Perturbation(knob @ (Perturbation::StartTc | Perturbation::StartTt)) => {
            circumstances.knobs.push((knob, value))
        }
        K::Perturbation(knob) => knob.turn(&mut rig.model.params, value),
        K::TurbineDrop => circumstances.t4_drop_ratio += value,
        K::Shape(i) => circumstances.shape[i] += value,
        K::Delay(i) => circumstances.delay_s[i] += value,
    }
}
