//! Quantities that the fit adds besides causes, and the shapes of their change in time.

use mapper_core::unit_factors::RPM_PER_KRPM;
use mapper_core::{Channel, Dimension, ReferenceState};
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_observe::averages::{self, INPUT_CHANNELS};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::compressor_map::closed_form_map::{CharacteristicPoint, CompressorCharacteristic};
use mapper_physics::rig::effect::Rig;
use mapper_physics::rig::instruments::{ChannelPath, ValveMotion};
use std::sync::Arc;

/// Outputs of the model that sensors measure, in the order of the residuals.
pub(crate) const OUTPUTS: [Channel; 9] = {
    let [n, p2, m_c, m_t, t2, tc, tt, t4] = averages::OUTPUTS;
    [n, m_c, p2, t2, tc, m_t, t4, tt, Channel::P3]
};

/// Start of the name of an offset; the channel follows.
pub(crate) const OFFSET_PREFIX: &str = "offset of ";

/// Kind of nuisance parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NuisanceKind {
    Offset(Channel),
    /// Common offset of all sensors of one dimension that were compared at rest.
    CommonOffset(Dimension),
    Gain(Channel),
    Perturbation(Perturbation),
    /// Gas temperature drop through the turbine relative to the shaft power.
    TurbineDrop,
    Shape(usize),
    /// Clock error of one output, by its index in [`OUTPUTS`].
    Delay(usize),
    ValveLag,
    /// Share of the valve's commanded motion that it does not make.
    ValveStroke,
    /// A part of an output that the model's equations miss in every step: the output's index in [`OUTPUTS`], and the part's.
    Structure(usize, usize),
}

impl NuisanceKind {
    /// Whether it is the initial metal temperature.
    pub(crate) fn is_start(self) -> bool {
        matches!(self, NuisanceKind::Perturbation(Perturbation::StartTc | Perturbation::StartTt))
    }

    /// Whether it is a tolerance of the rig: initial metal state and clock errors are none, and a deviation of one corner of the map is plausible.
    pub(crate) fn is_of_rig(self) -> bool {
        use NuisanceKind as K;
        !matches!(self, K::Delay(_) | K::ValveLag | K::Shape(_) | K::Structure(..)) && !self.is_start()
    }
}

impl std::fmt::Display for NuisanceKind {
    /// Name in files and messages.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            NuisanceKind::Offset(channel) => write!(f, "{OFFSET_PREFIX}{channel}"),
            NuisanceKind::CommonOffset(Dimension::Pressure) => f.write_str("common offset of the pressures"),
            NuisanceKind::CommonOffset(_) => f.write_str("common offset of the temperatures"),
            NuisanceKind::Gain(Channel::CompressorFlow) => f.write_str("flow_meter_gain"),
            NuisanceKind::Gain(channel) => write!(f, "gain of {channel}"),
            NuisanceKind::Perturbation(Perturbation::Flow) => f.write_str("flow_map"),
            NuisanceKind::Perturbation(Perturbation::Efficiency) => f.write_str("compressor_efficiency"),
            NuisanceKind::Perturbation(Perturbation::TurbineEfficiency) => f.write_str("turbine_efficiency"),
            NuisanceKind::Perturbation(Perturbation::ValveArea) => f.write_str("valve_area"),
            NuisanceKind::Perturbation(Perturbation::CompressorConvection) => f.write_str("convection"),
            NuisanceKind::Perturbation(Perturbation::ExternalConvection) => {
                f.write_str("external_convection")
            }
            NuisanceKind::Perturbation(Perturbation::OilConductance) => f.write_str("oil_conductance"),
            NuisanceKind::Perturbation(perturbation) => write!(f, "{perturbation:?}"),
            NuisanceKind::TurbineDrop => f.write_str("turbine_drop"),
            NuisanceKind::Shape(i) => write!(f, "efficiency_shape {i}"),
            NuisanceKind::Delay(output) => write!(f, "delay of {}", OUTPUTS[*output]),
            NuisanceKind::ValveLag => f.write_str("valve_lag"),
            NuisanceKind::ValveStroke => f.write_str("valve_stroke"),
            NuisanceKind::Structure(output, part) => write!(f, "structure of {} {part}", OUTPUTS[*output]),
        }
    }
}

/// A nuisance parameter with its prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nuisance {
    pub kind: NuisanceKind,
    /// Prior mean, in the unit of the changed quantity: 0 for the nominal rig, or the value from an earlier recording of this rig.
    pub centre: f64,
    /// One sigma, in the unit of the changed quantity.
    pub sigma: f64,
}

impl Nuisance {
    /// Physical value at so many sigmas from the centre.
    pub fn value(&self, sigmas: f64) -> f64 {
        self.centre + sigmas * self.sigma
    }
}

/// Uncertainty of the turbine drop. Swirling, unmixed gas behind the turbine and bearing losses limit how well T4 gives the turbine's work. Judgement: a few per cent are
/// reported for probes close behind the wheel.
const TURBINE_DROP_RATIO: f64 = 0.03;
/// Uncertainty of the delay of a sensor, s. Bound: clocks of one rig agree within a fraction of a sample.
const DELAY_SIGMA_S: f64 = 0.02;

/// Error of the lag of the valve, s. Bound: a tenth of a sample interval, to which samples show the lag of what moves within one.
const VALVE_LAG_SIGMA_S: f64 = 0.01;
/// Error of the stroke of the valve, as a share of its commanded motion. Source: data sheets of positioners, linear within 0.5 to 1 % of the stroke.
const VALVE_STROKE_SIGMA_RATIO: f64 = 0.005;

/// Length of a jump, s. Bound: ten times the usual lag of P3 behind its command (0.3 s), after which 5e-5 of the jump is left.
pub(crate) const JUMP_S: f64 = 3.0;
/// Time constants of the outputs after a jump, s. Bound: a step, and the ranges of probe, gas, housing and turbine housing.
pub(crate) const RESPONSES_S: [f64; 5] = [f64::INFINITY, 5.0, 20.0, 60.0, 200.0];

/// Declared share of an output's variation that the model's equations may miss.
pub(crate) fn structure_ratio(declared: &Declared, output: usize) -> f64 {
    declared.tolerances.structure.of(OUTPUTS[output])
}

/// The resulting error of the time of an output's fast changes, s.
pub(crate) fn structure_delay_s(declared: &Declared, output: usize) -> f64 {
    structure_ratio(declared, output) * JUMP_S
}

/// All nuisances of a rig; undeclared ones are omitted.
pub(crate) fn nuisances(declared: &Declared) -> Vec<Nuisance> {
    use NuisanceKind as K;
    let t = &declared.tolerances;
    let perturbation =
        |perturbation: Perturbation| (K::Perturbation(perturbation), perturbation.tolerance(t));
    let mut all: Vec<(NuisanceKind, f64)> = vec![
        perturbation(Perturbation::Flow),
        perturbation(Perturbation::Efficiency),
        perturbation(Perturbation::TurbineEfficiency),
        (K::TurbineDrop, TURBINE_DROP_RATIO),
        perturbation(Perturbation::ValveArea),
        perturbation(Perturbation::CompressorConvection),
        perturbation(Perturbation::ExternalConvection),
        perturbation(Perturbation::OilConductance),
        perturbation(Perturbation::Ambient),
        perturbation(Perturbation::StartTc),
        perturbation(Perturbation::StartTt),
    ];
    // Each has the declared size, although the root mean square of all is then 1.7 of it: a deviation of one corner of the map is plausible.
    all.extend((0..SHAPES).map(|i| (K::Shape(i), t.efficiency_shape_ratio)));
    let sensors =
        INPUT_CHANNELS.iter().chain(OUTPUTS.iter().filter(|channel| !INPUT_CHANNELS.contains(channel)));
    all.extend(sensors.clone().map(|channel| (K::Offset(*channel), declared.offset_sigma(*channel))));
    all.extend(sensors.map(|channel| (K::Gain(*channel), declared.of(*channel).gain_sigma_ratio)));
    all.extend(declared.common_offsets.iter().filter_map(|common| {
        Some((K::CommonOffset(common.channels.first()?.info().dimension), common.sigma))
    }));
    all.extend(
        (0..OUTPUTS.len()).map(|i| (K::Delay(i), DELAY_SIGMA_S.hypot(structure_delay_s(declared, i)))),
    );
    all.extend([(K::ValveLag, VALVE_LAG_SIGMA_S), (K::ValveStroke, VALVE_STROKE_SIGMA_RATIO)]);
    let parts = (0..OUTPUTS.len()).flat_map(|i| (0..RESPONSES_S.len()).map(move |part| (i, part)));
    all.extend(parts.map(|(i, part)| (K::Structure(i, part), structure_ratio(declared, i))));
    all.into_iter()
        .filter(|(_, sigma)| *sigma > 0.0)
        .map(|(kind, sigma)| Nuisance { kind, centre: 0.0, sigma })
        .collect()
}

/// Operating circumstances that are not part of the rig.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Circumstances {
    /// Perturbations of the ambient temperature and the start, each in its unit.
    pub perturbations: Vec<(Perturbation, f64)>,
    /// Errors of the sensors of [`INPUT_CHANNELS`], in their order: without them, the inputs are those of the machine.
    pub paths: [ChannelPath; INPUT_CHANNELS.len()],
    /// Motion of the valve in addition to the declared one.
    pub valve: ValveMotion,
    /// Relative increase of the temperature drop through the turbine.
    pub t4_drop_ratio: f64,
    /// Coefficients of the efficiency map's shape.
    pub shape: [f64; SHAPES],
    pub delay_s: [f64; OUTPUTS.len()],
    /// Missed share of each output's parts.
    pub missed_ratio: [[f64; RESPONSES_S.len()]; OUTPUTS.len()],
}

/// Applies one nuisance of size `value` (in the unit of the changed quantity) to a rig.
pub(crate) fn apply(
    declared: &Declared,
    kind: NuisanceKind,
    value: f64,
    rig: &mut Rig,
    circumstances: &mut Circumstances,
) {
    use NuisanceKind as K;
    match kind {
        K::CommonOffset(dimension) => {
            let sharing = declared.common_offsets.iter().flat_map(|common| &common.channels);
            for channel in sharing.filter(|channel| channel.info().dimension == dimension) {
                rig.instruments.path_mut(*channel).offset += value;
            }
        }
        K::Offset(channel) => rig.instruments.path_mut(channel).offset += value,
        K::Gain(channel) => {
            let path = rig.instruments.path_mut(channel);
            path.gain_ratio *= 1.0 + value;
            path.offset += value * declared.rest().gain_error(channel, 0.0);
        }
        // The cell sensor reads too high by this amount, so the model is driven with less.
        K::Perturbation(Perturbation::Ambient) => {
            circumstances.perturbations.push((Perturbation::Ambient, -value))
        }
        K::Perturbation(perturbation @ (Perturbation::StartTc | Perturbation::StartTt)) => {
            circumstances.perturbations.push((perturbation, value))
        }
        K::Perturbation(perturbation) => perturbation.adjust_machine(&mut rig.model.params, value),
        K::TurbineDrop => circumstances.t4_drop_ratio += value,
        K::Shape(i) => circumstances.shape[i] += value,
        K::ValveLag => rig.instruments.valve.lag_s += value,
        K::ValveStroke => rig.instruments.valve.stuck_ratio += value,
        K::Delay(i) => circumstances.delay_s[i] += value,
        K::Structure(output, part) => circumstances.missed_ratio[output][part] += value,
    }
}

/// Effects with their values: indices of the candidates, and one value per parameter.
pub(crate) type EffectValues = Vec<(usize, Vec<f64>)>;

/// A hypothesis: values of all nuisances and effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Nuisances, in their sigmas.
    pub nuisances: Vec<f64>,
    pub effects: EffectValues,
}

/// Names of a hypothesis' effects, by index, in order.
pub(crate) fn members(hypothesis: &Hypothesis) -> Vec<usize> {
    let mut members: Vec<usize> = hypothesis.effects.iter().map(|(index, _)| *index).collect();
    members.sort_unstable();
    members
}

/// History of a cause that acts from the step with this index on.
pub(crate) fn from_step(first: usize) -> TimeHistory {
    TimeHistory { onset: first as f64, shape: Shape::Step }
}

/// History of a cause that grows evenly from step to step: absent before the step with this index, at full size in the last of `steps`.
pub(crate) fn growing_from(first: usize, steps: usize) -> TimeHistory {
    TimeHistory { onset: first as f64 - 1.0, shape: Shape::Ramp((steps - first) as f64) }
}

/// The step with which a cause begins; `None` if it acts throughout.
pub(crate) fn onset_step(history: TimeHistory) -> Option<usize> {
    let first = if let Shape::Ramp(_) = history.shape { history.onset + 1.0 } else { history.onset };
    first.is_finite().then_some(first as usize)
}

/// Number of bumps over corrected speed. Bound: from 50 to 150 krpm, the speeds of a map.
const SPEEDS: usize = 6;
/// Centre of the first bump over corrected speed, 100 krpm. Bound: the lowest speed of a map.
const FIRST_SPEED: f64 = 0.5;
/// Width and spacing of the bumps over corrected speed, 100 krpm. Bound: the distance of the speed lines of a map.
const SPEED_WIDTH: f64 = 0.2;
/// Unit of the above, rpm. Source: a definition.
const SPEED_UNIT_RPM: f64 = 100.0 * RPM_PER_KRPM;
/// Distance from the first bump, in widths, beyond which all are negligible. Bound: e^-200, and no ratio may overflow.
const MAX_WIDTHS: f64 = 20.0;
/// Number of bumps between the surge line (0) and choke (1), each as wide as their distance. Bound: a speed line is measured at some five points.
const WAYS: usize = 3;

/// Number of basis functions.
pub(crate) const SHAPES: usize = SPEEDS * WAYS;

/// A map whose efficiency is multiplied by `1 + sum c_i phi_i(speed, place on the speed line)`.
#[derive(Debug, Clone)]
pub(crate) struct ShapedMap {
    /// The declared map.
    pub inner: Arc<dyn CompressorCharacteristic>,
    /// Coefficients of the basis, ratios.
    pub coefficients: [f64; SHAPES],
}

/// Gaussian bumps, a fifth of the speed range and a third of a speed line wide: deviations differ from point to point, smooth in between.
fn basis(speed_corrected_rpm: f64, surge_position_ratio: f64) -> [f64; SHAPES] {
    let speed = speed_corrected_rpm / SPEED_UNIT_RPM;
    let position = surge_position_ratio.clamp(0.0, 1.0);
    let way = (1.0 - position * position).sqrt();
    let over_speed: [f64; SPEEDS] = bumps((speed - FIRST_SPEED) / SPEED_WIDTH);
    let over_way: [f64; WAYS] = bumps(way * WAYS as f64 - 0.5);
    std::array::from_fn(|i| over_speed[i / WAYS] * over_way[i % WAYS])
}

/// `exp(-(x - i)^2 / 2)` for i = 0, 1, ..., each from the one before: exponentials would dominate the time of a diagnosis.
fn bumps<const N: usize>(widths_from_first: f64) -> [f64; N] {
    let x = widths_from_first.clamp(-MAX_WIDTHS, MAX_WIDTHS);
    let (mut bump, mut ratio) = ((-0.5 * x * x).exp(), (x - 0.5).exp());
    std::array::from_fn(|_| {
        let here = bump;
        bump *= ratio;
        ratio *= std::f64::consts::E.recip();
        here
    })
}

impl CompressorCharacteristic for ShapedMap {
    fn reference(&self) -> ReferenceState {
        self.inner.reference()
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
        let mut point = self.inner.evaluate_scaled(speed_corrected_rpm, pressure_ratio, flow_scale_ratio);
        let shapes = basis(speed_corrected_rpm, point.surge_position_ratio);
        let change: f64 = self.coefficients.iter().zip(shapes).map(|(c, phi)| c * phi).sum();
        point.efficiency *= 1.0 + change;
        point
    }

    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        self.inner.surge_point(speed_corrected_rpm)
    }

    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.inner.choke_flow_corrected_kg_s(speed_corrected_rpm)
    }

    fn fingerprint(&self) -> String {
        format!("{}, efficiency shaped by {:?}", self.inner.fingerprint(), self.coefficients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_begins_with_its_step_and_is_whole_in_the_last() {
        let shares = |history: TimeHistory| [0.0, 1.0, 2.0, 3.0, 4.0].map(|step| history.at(step));
        assert_eq!(shares(from_step(3)), [0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(shares(growing_from(1, 5)), [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(
            [from_step(3), growing_from(1, 5), TimeHistory::THROUGHOUT].map(onset_step),
            [Some(3), Some(1), None]
        );
    }
}

#[cfg(test)]
mod shape_tests {
    use super::*;

    #[test]
    fn bumps_are_gaussians_one_width_apart() {
        for x in [-3.0, -0.4, 0.0, 1.3, 5.0, 8.5] {
            for (i, bump) in bumps::<6>(x).into_iter().enumerate() {
                let expected = f64::exp(-0.5 * (x - i as f64).powi(2));
                // Tolerance: about ten roundings.
                assert!((bump - expected).abs() <= 1e-14 * expected, "{x} {i}: {bump:e} {expected:e}");
            }
        }
        assert!(bumps::<6>(1e9).into_iter().all(|bump| bump < 1e-40));
    }
}
