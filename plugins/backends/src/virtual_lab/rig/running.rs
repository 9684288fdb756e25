//! The running rig of the virtual lab, with the precursors of surge.

use crate::virtual_lab::effects_file::NAME;
use crate::virtual_lab::rig::actuator::{Actuator, ActuatorDynamics};
use crate::virtual_lab::rig::drift::Weather;
use mapper_physics::gas::air;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::{Model, Outputs, State};
use mapper_physics::simulation::simulate::{
    DEFAULT_RELATIVE_TOLERANCE, ModelEvent, SimulationError, Simulator, Watch,
};
use mapper_physics::simulation::steady;
use mapper_physics::simulation::steady::Inputs;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Failure to find a steady state.
pub type StructureError = Box<dyn std::error::Error + Send + Sync>;

/// A running machine: the lab's interface to its equations.
pub trait RunningMachine: std::fmt::Debug + Send {
    /// State as the rig's sensors define it.
    fn state(&self) -> State;

    /// Resets the step size; called after a jump of the inputs.
    fn restart(&mut self);

    /// Continues with other machine parameters.
    fn change_params(&mut self, params: Params);

    /// Runs to `end_s`, with samples and events on the way, as [`Simulator::run_to`] does.
    fn run_to(
        &mut self,
        end_s: f64,
        inputs: &LabInputs,
        sample_times_s: &mut dyn Iterator<Item = f64>,
        on_sample: &mut dyn FnMut(f64, &State, &Outputs),
        on_event: &mut dyn FnMut(ModelEvent),
    ) -> Result<(), SimulationError>;
}

/// Equations of a machine.
pub trait Structure: std::fmt::Debug + Send + Sync {
    /// Name of a lab with these equations in campaigns.
    fn name(&self) -> &'static str;

    /// A machine that starts at `state` at `t_s`.
    fn start(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine>;

    /// A machine in steady state under `boundary`.
    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError>;
}

/// The lumped model of Burke et al.
#[derive(Debug)]
pub struct Lumped;

impl Structure for Lumped {
    fn name(&self) -> &'static str {
        NAME
    }

    fn start(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine> {
        Box::new(Simulator::new(model, t_s, state, DEFAULT_RELATIVE_TOLERANCE, watch))
    }

    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError> {
        let steady_state = steady::settle_under(model, boundary)?;
        Ok(self.start(model, t_s, steady_state.state, watch))
    }
}

impl RunningMachine for Simulator {
    fn state(&self) -> State {
        Simulator::state(self)
    }

    fn restart(&mut self) {
        Simulator::restart(self);
    }

    fn change_params(&mut self, params: Params) {
        Simulator::change_params(self, params);
    }

    fn run_to(
        &mut self,
        end_s: f64,
        inputs: &LabInputs,
        sample_times_s: &mut dyn Iterator<Item = f64>,
        on_sample: &mut dyn FnMut(f64, &State, &Outputs),
        on_event: &mut dyn FnMut(ModelEvent),
    ) -> Result<(), SimulationError> {
        Simulator::run_to(self, end_s, inputs, sample_times_s, on_sample, on_event)
    }
}

/// Minimum ratio of air supply to P4 while the model runs: the model divides by the turbine's flow.
pub const MIN_EXPANSION_RATIO: f64 = 1.0005;

/// The conditions of the cell, and the actuators.
#[derive(Debug, Clone)]
pub struct LabInputs {
    /// T1, P1, P4 and the ambient temperature.
    pub cell: BoundaryConditions,
    /// Slow fluctuations of the boundary conditions.
    pub weather: Weather,
    /// Turbine inlet pressure, Pa.
    pub p3: Actuator,
    /// Turbine inlet temperature, K.
    pub t3: Actuator,
    /// Valve opening.
    pub valve: Actuator,
    /// Oil temperature, K.
    pub oil: Actuator,
    /// The heater follows more air late: fall of T3, K/Pa of P3 above the P3 that it has followed, and that P3.
    pub sag: Option<(f64, Actuator)>,
}

impl LabInputs {
    /// Constant inputs at `boundary`.
    pub fn constant(boundary: &BoundaryConditions) -> Self {
        let at_rest = |value: f64| Actuator::at_rest(ActuatorDynamics::AT_ONCE, value);
        LabInputs {
            cell: *boundary,
            weather: Weather::default(),
            p3: at_rest(boundary.p3_pa),
            t3: at_rest(boundary.t3_k),
            valve: at_rest(boundary.valve_opening_ratio),
            oil: at_rest(boundary.oil_temperature_k),
            sag: None,
        }
    }

    /// Commands a P3, Pa.
    pub fn set_p3(&mut self, now_s: f64, p3_pa: f64) {
        self.p3.set(now_s, p3_pa);
        self.sag.iter_mut().for_each(|(_, followed)| followed.set(now_s, p3_pa));
    }

    fn actuators(&self) -> impl Iterator<Item = &Actuator> {
        let all = [&self.p3, &self.t3, &self.valve, &self.oil].into_iter();
        all.chain(self.sag.iter().map(|(_, followed)| followed))
    }
}

impl Inputs for LabInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let p3_pa = self.p3.value(t_s);
        let sag_k = |(k_per_pa, followed): &(f64, Actuator)| k_per_pa * (p3_pa - followed.value(t_s));
        let mut boundary = BoundaryConditions {
            p3_pa,
            t3_k: self.t3.value(t_s) - self.sag.as_ref().map_or(0.0, sag_k),
            valve_opening_ratio: self.valve.value(t_s),
            oil_temperature_k: self.oil.value(t_s),
            ..self.cell
        };
        if !self.weather.is_calm() {
            boundary = self.weather.add_to(boundary, t_s);
        }
        boundary.p3_pa = boundary.p3_pa.max(boundary.p4_pa * MIN_EXPANSION_RATIO);
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.actuators().map(|actuator| actuator.next_kink_s(t_s)).fold(f64::INFINITY, f64::min)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.weather.is_calm() && self.actuators().all(|actuator| actuator.has_arrived(t_s))
    }
}

// Fluctuations of flow and pressures before surge: they grow as the operating point approaches the surge line.
// Compressor, outlet duct and volume are a Helmholtz resonator whose damping is the slope of the speed line (E. M. Greitzer,
// "Surge and rotating stall in axial flow compressors, part I", J. Eng. Power 98 (1976) 190-198). Near the zero-slope point
// that slope goes to zero in proportion to the distance in flow, and a resonator that turbulence excites has a variance in
// inverse proportion to its damping. Sampled at some 10 Hz, this appears as aliased noise of growing size. Such growth
// before surge was measured on turbochargers, e.g. by J. Galindo et al., Exp. Thermal Fluid Sci. 30 (2006) 449-462.

/// Growth of the fluctuation; a size of 0 means none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurgePrecursor {
    /// Surge margin (flow over surge flow, minus one) at which flow and pressures begin to fluctuate, ratio, > 0.
    pub onset_margin_ratio: f64,
    /// Root mean square of the flow fluctuation at half that margin, ratio of the flow.
    pub size_ratio: f64,
    /// Exponent of the growth: the variance is proportional to the `-growth`th power of the margin; 1 by theory.
    pub growth: f64,
}

impl SurgePrecursor {
    /// No precursor.
    pub const NONE: SurgePrecursor =
        SurgePrecursor { onset_margin_ratio: 0.25, size_ratio: 0.0, growth: 1.0 };
    /// The default of a campaign.
    pub const USUAL: SurgePrecursor = SurgePrecursor { size_ratio: 3e-3, ..SurgePrecursor::NONE };

    /// Root mean square of the flow fluctuation, ratio: at most `max_rms_ratio`, at which the fluctuation saturates.
    fn rms_ratio(&self, margin_ratio: f64, max_rms_ratio: f64) -> f64 {
        if margin_ratio >= self.onset_margin_ratio {
            return 0.0;
        }
        // The fluctuation at the onset is part of the sensors' noise.
        let growth = |margin_ratio: f64| (self.onset_margin_ratio / margin_ratio).powf(self.growth) - 1.0;
        let variance = growth(margin_ratio.max(1e-4)) / growth(0.5 * self.onset_margin_ratio);
        (self.size_ratio * variance.max(0.0).sqrt()).min(max_rms_ratio)
    }
}

/// Length of the outlet duct between wheel and volume, m: that of a gas stand.
const DUCT_LENGTH_M: f64 = 0.5;
/// Damping ratio of the resonator at the onset: slope of the speed line and of the valve's resistance, over twice
/// the resonator's impedance.
const DAMPING_AT_ONSET_RATIO: f64 = 0.13;

/// Frequency of the Helmholtz resonator of outlet duct and volume, rad/s.
fn helmholtz_rad_s(params: &Params, gas_k: f64) -> f64 {
    let area_m2 = 0.25 * std::f64::consts::PI * params.compressor.outlet_diameter_m.powi(2);
    let sound_m_s = (air::HEAT_CAPACITY_RATIO * air::GAS_CONSTANT_J_KGK * gas_k).sqrt();
    sound_m_s * (area_m2 / (DUCT_LENGTH_M * params.outlet.volume_m3)).sqrt()
}

/// Relative fluctuations of the readings at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Swing {
    /// Fluctuation of the compressor's flow.
    pub(crate) flow_ratio: f64,
    /// Fluctuation of P2: smaller than that of the flow, because the volume damps it.
    pub(crate) p2_ratio: f64,
    /// Fluctuation of P1.
    pub(crate) p1_ratio: f64,
}

/// Swing of P2 over that of the flow.
pub(crate) const P2_SHARE: f64 = 0.2;
/// Swing of P1 over that of the flow: the inlet duct is open.
const P1_SHARE: f64 = 0.01;

/// The resonator, with its own random numbers, so that readings away from surge do not depend on it.
#[derive(Debug)]
pub(crate) struct Resonator {
    settings: SurgePrecursor,
    random: Pcg64,
    /// Flow and pressure, each of unit variance.
    swing: [f64; 2],
}

impl Resonator {
    pub(crate) fn new(settings: SurgePrecursor, seed: u64) -> Self {
        let mut random =
            Pcg64::seed_from_u64(seed.wrapping_mul(0x8CB9_2BA7_2F3D_8DD7) ^ 0x2545_F491_4F6C_DD1D);
        let swing = [StandardNormal.sample(&mut random), StandardNormal.sample(&mut random)];
        Resonator { settings, random, swing }
    }

    /// The swing at the next sample; `margin_ratio` is the surge margin.
    pub(crate) fn next(
        &mut self,
        margin_ratio: f64,
        sample_s: f64,
        params: &Params,
        gas_k: f64,
        max_rms_ratio: f64,
    ) -> Swing {
        let rms_ratio = self.settings.rms_ratio(margin_ratio, max_rms_ratio);
        if rms_ratio <= 0.0 {
            return Swing::default();
        }
        let angular_rad_s = helmholtz_rad_s(params, gas_k);
        let damping_ratio =
            DAMPING_AT_ONSET_RATIO * (margin_ratio / self.settings.onset_margin_ratio).max(1e-3);
        let memory_ratio = (-damping_ratio * angular_rad_s * sample_s).exp();
        let innovation_ratio = (1.0 - memory_ratio * memory_ratio).sqrt();
        let (sin, cos) = (angular_rad_s * sample_s).sin_cos();
        let kicks: [f64; 2] =
            [StandardNormal.sample(&mut self.random), StandardNormal.sample(&mut self.random)];
        let [flow, pressure] = self.swing;
        self.swing = [
            memory_ratio * (cos * flow - sin * pressure) + innovation_ratio * kicks[0],
            memory_ratio * (sin * flow + cos * pressure) + innovation_ratio * kicks[1],
        ];
        let [flow, pressure] = self.swing.map(|swing| rms_ratio * swing);
        Swing { flow_ratio: flow, p2_ratio: P2_SHARE * pressure, p1_ratio: -P1_SHARE * flow }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Root mean square of flow and P2 over many samples at one margin.
    fn rms(margin_ratio: f64) -> [f64; 2] {
        let mut resonator = Resonator::new(SurgePrecursor::USUAL, 3);
        let mut sums = [0.0; 2];
        for _ in 0..40_000 {
            let swing = resonator.next(margin_ratio, 0.1, &Params::default(), 350.0, 0.04);
            sums[0] += swing.flow_ratio.powi(2);
            sums[1] += swing.p2_ratio.powi(2);
        }
        sums.map(|sum: f64| (sum / 40_000.0).sqrt())
    }

    #[test]
    fn the_variance_grows_as_the_damping_falls_and_none_is_beyond_the_onset() {
        assert_eq!(rms(0.25), [0.0, 0.0]);
        // 40 000 samples, at 2 % of margin some 20 000 independent ones: the root mean square is accurate to 0.5 %.
        for (margin_ratio, expected) in [(0.125, 3e-3), (0.05, 6e-3), (0.025, 9e-3)] {
            let [flow, p2] = rms(margin_ratio);
            assert!((flow / expected - 1.0).abs() < 0.03, "{margin_ratio}: {flow} {expected}");
            assert!((p2 / (P2_SHARE * expected) - 1.0).abs() < 0.03, "{margin_ratio}: {p2}");
        }
        assert!(rms(0.0)[0] < 0.045, "it limits itself");
    }

    #[test]
    fn the_resonator_has_the_frequency_of_duct_and_volume() {
        // Speed of sound 375 m/s at 350 K, 9.62 cm2 of duct, 0.5 m, 0.78 l: 375/(2 pi) sqrt(9.62e-4/3.9e-4) = 93.7 Hz.
        let hz = helmholtz_rad_s(&Params::default(), 350.0) / (2.0 * std::f64::consts::PI);
        assert!((hz / 93.7 - 1.0).abs() < 0.01, "{hz}");
    }
}
