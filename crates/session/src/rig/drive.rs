//! Starts the runner with steps, a rig and observers. No other module does, so that every run has the same guards.

use crate::rig::guards::make_guards;
use mapper_campaign::Campaign;
use mapper_core::{Backend, Channel, Clock, PlanStep, RunEnding, UnpacedClock};
use mapper_physics::laws::thermocouple;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::speed_response::speed_response;
use mapper_physics::simulation::model::Model;
use mapper_runner::{
    Operator, Protection, ReadingBounds, RunError, RunObserver, Runner, SoakSource, SpeedControl,
    SpeedControlLimits, StandMotion, StepSource, UnguardedChannel,
};
use std::sync::atomic::AtomicBool;

/// Runs the steps on the rig, after the soak if the campaign has one. The campaign defines guards and speed loop; `model` is the nominal
/// machine, which tunes the loop.
///
/// # Errors
/// [`RunError`] if rig, steps or observer fail; the rig is safe then.
pub fn drive(
    campaign: &Campaign,
    model: &Model,
    steps: &mut dyn StepSource,
    backend: &mut dyn Backend,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<RunEnding, RunError> {
    let pace = Pace {
        clock: &mut UnpacedClock,
        each_sample: false,
        stop,
        stop_after_step: &NEVER_SET,
        operator: None,
        auxiliary_channels: &[],
    };
    drive_paced(campaign, model, steps, backend, observer, pace)
}

static NEVER_SET: AtomicBool = AtomicBool::new(false);

/// Pace and stop flags of a run.
pub struct Pace<'a> {
    /// Clock that the run follows.
    pub clock: &'a mut dyn Clock,
    /// Polls each sample separately. Needed if the rig runs in real time or is paced.
    pub each_sample: bool,
    /// Set by the caller to stop at once.
    pub stop: &'a AtomicBool,
    /// Set by the caller to stop at the end of the step.
    pub stop_after_step: &'a AtomicBool,
    /// Other operator requests.
    pub operator: Option<&'a Operator>,
    /// Channels of auxiliary instruments; a guard watches that their data arrive.
    pub auxiliary_channels: &'a [UnguardedChannel],
}

/// Same as [`drive`], at a given pace.
///
/// # Errors
/// As [`drive`].
pub fn drive_paced(
    campaign: &Campaign,
    model: &Model,
    steps: &mut dyn StepSource,
    backend: &mut dyn Backend,
    observer: &mut dyn RunObserver,
    pace: Pace<'_>,
) -> Result<RunEnding, RunError> {
    let rig = backend.describe();
    let guards = make_guards(campaign, &rig, pace.auxiliary_channels);
    let mut with_soak;
    let steps: &mut dyn StepSource = match campaign.zero {
        None => steps,
        Some(soak) => {
            with_soak = SoakSource::new(steps, soak);
            &mut with_soak
        }
    };
    let protection = Protection {
        safe: campaign.safe_state.unwrap_or(rig.safe),
        p3_min_pa: campaign.limits.p3_min_pa,
        stand: Some(StandMotion {
            actuators: campaign.rig_actuators(),
            overshoot_ratio: campaign.limits.overshoot_ratio(),
            speed_max_rpm: campaign.limits.speed_max_rpm,
            avoid: campaign.limits.avoid,
        }),
        accepts: rig.accepts,
        speed: campaign.guard_set().speed.filter(|_| rig.controls),
        readings: rig.controls.then(|| reading_bounds(campaign)),
        stop_after_step: pace.stop_after_step,
        each_sample: pace.each_sample || !rig.simulated_time,
        operator: pace.operator,
    };
    Runner {
        steps,
        speed: speed_control(campaign, model),
        backend,
        clock: pace.clock,
        guards,
        observer,
        stop: pace.stop,
    }
    .run_under(&protection)
}

/// Allowed positive error of the P3 reading, in declared standard deviations.
const P3_ERROR_SIGMAS: f64 = 4.0;

/// Largest and smallest mass flux in the outlet pipe, for the shortest and the longest lag of the T2 probe: the speed of sound (347 m/s) at
/// 400 kPa, and a fiftieth of it at 100 kPa, both at 300 K.
const MAX_MASS_FLUX_KG_M2S: f64 = 4.65 * 347.0;
const MIN_MASS_FLUX_KG_M2S: f64 = 1.16 * 347.0 / 50.0;
const PROBE_TEMPERATURE_K: f64 = 300.0;

/// Bounds of plausible readings from the declared machine and sensors. Without a declared wheel diameter, speed and pressure are not bounded.
fn reading_bounds(campaign: &Campaign) -> ReadingBounds {
    let (machine, compressor) = (&campaign.machine, &campaign.machine.params.compressor);
    let area_m2 = 0.25 * std::f64::consts::PI * compressor.outlet_diameter_m.powi(2);
    let redundant_sensors = |channel| {
        let redundant = campaign.sensors.get(&channel).and_then(|sensor| sensor.redundant.as_ref());
        redundant.map(|redundant| redundant.elements.as_slice()).unwrap_or_default()
    };
    let tips_m = redundant_sensors(Channel::T2).iter().map(|declared| declared.probe_diameter_m);
    let tips_m = tips_m.chain([machine.params.t2_probe_diameter_m]);
    let lag_s = |flux_kg_m2s: f64, tip_m: f64| {
        let flow_kg_s = flux_kg_m2s * area_m2;
        thermocouple::time_constant_s(tip_m, compressor.outlet_diameter_m, flow_kg_s, PROBE_TEMPERATURE_K)
    };
    let noise_k = |channel| {
        let channel_sensor = campaign.sensors.get(&channel).map(|sensor| sensor.declared);
        let single_sensors = redundant_sensors(channel).iter().map(|declared| declared.declared);
        channel_sensor
            .into_iter()
            .chain(single_sensors)
            .map(|declared| declared.noise_sigma)
            .fold(0.0, f64::max)
    };
    let (min_tip_m, max_tip_m) =
        tips_m.fold((f64::INFINITY, 0.0_f64), |(low, high), tip_m| (tip_m.min(low), tip_m.max(high)));
    ReadingBounds {
        wheel_diameter_m: machine.wheel_is_declared.then_some(compressor.wheel_diameter_m),
        t2_lag_s: (lag_s(MAX_MASS_FLUX_KG_M2S, min_tip_m), lag_s(MIN_MASS_FLUX_KG_M2S, max_tip_m)),
        noise_k: [Channel::T2, Channel::Tc, Channel::Tt].map(noise_k),
    }
}

/// The speed loop that the campaign asks for.
fn speed_control<'a>(campaign: &'a Campaign, model: &'a Model) -> Option<SpeedControl<'a>> {
    let sensor = campaign.sensors.get(&Channel::P3).map(|sensor| sensor.declared).unwrap_or_default();
    let high_pa = campaign.limits.p3_max_pa;
    let sigma_pa = sensor.noise_sigma.hypot(sensor.offset_sigma).hypot(sensor.gain_sigma_ratio * high_pa);
    let limits = SpeedControlLimits {
        p3_min_pa: campaign.limits.p3_min_pa,
        p3_max_pa: high_pa - P3_ERROR_SIGMAS * sigma_pa,
        p3_slew_max_pa_s: campaign.actuators.map(|actuators| actuators.p3.rate_per_s),
        speed_max_rpm: campaign.limits.speed_max_rpm,
    };
    let response_at = move |step: &PlanStep| {
        let boundary = BoundaryConditions {
            t3_k: step.t3_k,
            oil_temperature_k: step.oil_temperature_k,
            valve_opening_ratio: step.to.valve_opening_ratio,
            ..campaign.boundary
        };
        speed_response(model, step.to.speed_rpm, &boundary, &campaign.rig_actuators().p3)
    };
    Some(SpeedControl::new(campaign.speed_control?, limits, Box::new(response_at)))
}

/// Soak time before the plan begins, s.
pub fn soak_s(campaign: &Campaign) -> f64 {
    campaign.zero.map_or(0.0, |zero| zero.duration_s)
}
