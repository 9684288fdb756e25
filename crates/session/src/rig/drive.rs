//! Drives a rig, with the guards that it lacks.

use crate::SessionError;
use crate::recording::identification_config::identification;
use mapper_campaign::{Campaign, DEFAULT_MAX_AGE_S};
use mapper_core::{
    Backend, Channel, Clock, GuardName, PlanStep, Reaction, RigDescription, RunEnding, SampleBatch, Trip,
    UnpacedClock, is_reading,
};
use mapper_identify::{ValveCheck, ValveState};
use mapper_numerics::statistics::median;
use mapper_physics::laws::thermocouple;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::settled::speed_response;
use mapper_physics::simulation::model::Model;
use mapper_runner::{
    AvoidedSpeedWatch, BatchWatch, CommandedState, Guard, Operator, Protection, REQUIRED_CHANNELS,
    ReadingBounds, RigWatch, RunError, RunObserver, Runner, SignalWatch, SilenceWatch, SoakSource,
    SpeedControl, SpeedControlLimits, StandMotion, StartCheck, StepSource, SurgeWatch, UnguardedChannel,
};
use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;

/// Runs the steps on the rig, after the soak if the campaign has one; `model`, the nominal machine, tunes the speed loop.
/// The rig is safe after an error.
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
pub fn drive_paced(
    campaign: &Campaign,
    model: &Model,
    steps: &mut dyn StepSource,
    backend: &mut dyn Backend,
    observer: &mut dyn RunObserver,
    pace: Pace<'_>,
) -> Result<RunEnding, RunError> {
    let rig = backend.describe();
    let mut guards = make_guards(campaign, &rig, pace.auxiliary_channels);
    guards.extend(valve_watch(campaign, model, &rig));
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

/// Makes the guards of a run: default ones only if the rig delivers their signal; declared and required ones always; these trip without it.
pub fn make_guards(
    campaign: &Campaign,
    rig: &RigDescription,
    auxiliary_channels: &[UnguardedChannel],
) -> Vec<Box<dyn Guard>> {
    let set = campaign.guard_set();
    let guarded: Vec<Channel> = set.signals.iter().map(|spec| spec.channel).collect();
    let mut guards: Vec<Box<dyn Guard>> = vec![Box::new(BatchWatch::default())];
    for spec in set.signals {
        let required = campaign.guards.is_some() || rig.needs_guarded.contains(&spec.name);
        if required || rig.channels.contains(&spec.channel) {
            guards.push(Box::new(SignalWatch::new(spec)));
        }
    }
    if !campaign.limits.avoid.is_empty() {
        guards.push(Box::new(AvoidedSpeedWatch::new(campaign.limits.avoid)));
    }
    guards.extend(set.surge.map(|spec| Box::new(SurgeWatch::new(spec)) as Box<dyn Guard>));
    if rig.controls {
        let mut watched = auxiliary_channels.to_vec();
        let is_new = |channel: &&Channel| {
            !guarded.contains(channel) && !auxiliary_channels.iter().any(|other| other.channel == **channel)
        };
        let required = REQUIRED_CHANNELS.iter().filter(|channel| rig.channels.contains(channel));
        watched.extend(required.filter(is_new).map(|channel| UnguardedChannel {
            source: rig.backend.clone(),
            channel: *channel,
            age_s: max_age_s(campaign, rig),
            frozen: None,
        }));
        for one in watched.iter_mut().filter(|one| one.channel == Channel::CompressorFlow) {
            one.frozen = set.frozen_flow;
        }
        guards.push(Box::new(SilenceWatch::new(watched)));
        guards.push(Box::new(RigWatch::default()));
        guards.push(Box::new(StartCheck::new(rig.channels.clone())));
    }
    guards
}

/// The guard of the valve, if the rig drives it.
fn valve_watch(campaign: &Campaign, model: &Model, rig: &RigDescription) -> Option<Box<dyn Guard>> {
    let reaction = campaign.guard_set().valve.filter(|_| rig.controls)?;
    let check = ValveCheck::new(identification(campaign), model.clone(), campaign.tolerances);
    Some(Box::new(ValveWatch::new(check, reaction, campaign.rig_actuators().valve.follow_s())))
}

/// Number of samples that a source may miss before it counts as silent.
const MAX_MISSED_SAMPLES: f64 = 3.0;

/// Age after which a channel of this source is silent, s.
pub(crate) fn max_age_s(campaign: &Campaign, source: &RigDescription) -> f64 {
    let age_s = campaign.guard_set().signals.first().map_or(DEFAULT_MAX_AGE_S, |guard| guard.age_s);
    age_s.max(MAX_MISSED_SAMPLES / source.sample_rate_hz.max(1e-3))
}

pub fn check_guards(campaign: &Campaign, rig: &RigDescription) -> Result<(), SessionError> {
    let set = campaign.guard_set();
    let missing: Vec<GuardName> =
        rig.needs_guarded.iter().copied().filter(|name| !set.ends_on(*name)).collect();
    if !missing.is_empty() {
        let names = missing.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        return Err(SessionError::MissingGuards { backend: rig.backend.clone(), guards: names });
    }
    let is_required = |name: &GuardName| campaign.guards.is_some() || rig.needs_guarded.contains(name);
    let without_channel: Vec<String> = set
        .signals
        .iter()
        .filter(|spec| is_required(&spec.name) && !rig.channels.contains(&spec.channel))
        .map(|spec| format!("{} (guard `{}`)", spec.channel, spec.name))
        .collect();
    if without_channel.is_empty() {
        return Ok(());
    }
    Err(SessionError::GuardWithoutChannel {
        backend: rig.backend.clone(),
        channels: without_channel.join(", "),
    })
}

/// Time over which the readings are judged, s. Judgement: twenty samples at 10 Hz, and short enough to name a valve within seconds.
const JUDGED_S: f64 = 2.0;
/// Time for the plenum and the sensors to follow the valve, s. Judgement: ten times the filling time of a usual plenum.
const SENSORS_S: f64 = 1.0;
/// Largest number of samples that are kept. Bound: the memory; a rig at 1 kHz fills it in two seconds.
const MAX_SAMPLES: usize = 2000;

type Row = [f64; ValveCheck::CHANNELS.len()];

/// Judges the valve once after each of its commands, when it has had its declared time.
struct ValveWatch {
    check: ValveCheck,
    reaction: Reaction,
    /// Time after a command until the valve is judged first, s.
    wait_s: f64,
    recent: VecDeque<(f64, Row)>,
    /// Time of the command that was judged last, s.
    judged_s: Option<f64>,
    /// Whether the valve stood still then.
    stands_still: bool,
}

impl ValveWatch {
    /// `follow_s`: declared time in which the valve follows the end of a command.
    fn new(check: ValveCheck, reaction: Reaction, follow_s: f64) -> Self {
        ValveWatch {
            check,
            reaction,
            wait_s: follow_s + SENSORS_S + JUDGED_S,
            recent: VecDeque::new(),
            judged_s: None,
            stands_still: false,
        }
    }

    fn add(&mut self, batch: &SampleBatch) {
        let columns = ValveCheck::CHANNELS.map(|channel| (channel, batch.column(channel)));
        for (index, t_s) in batch.t_s.iter().enumerate() {
            let reading = |(channel, column): (Channel, Option<&[f64]>)| {
                let value = column.and_then(|values| values.get(index)).copied();
                value.filter(|value| is_reading(channel, *value)).unwrap_or(f64::NAN)
            };
            self.recent.push_back((*t_s, columns.map(reading)));
        }
        let Some((last_s, _)) = self.recent.back().copied() else { return };
        while self
            .recent
            .front()
            .is_some_and(|(t_s, _)| *t_s < last_s - JUDGED_S || self.recent.len() > MAX_SAMPLES)
        {
            self.recent.pop_front();
        }
    }

    /// Medians of the earlier or the later half of the readings.
    fn half(&self, is_later: bool) -> Row {
        let (first, last) = (self.recent.front(), self.recent.back());
        let middle_s = first.zip(last).map_or(0.0, |((first_s, _), (last_s, _))| 0.5 * (first_s + last_s));
        std::array::from_fn(|channel| {
            let rows = self.recent.iter().filter(|(t_s, _)| (*t_s > middle_s) == is_later);
            median(rows.map(|(_, row)| row[channel]).filter(|value| value.is_finite())).unwrap_or(f64::NAN)
        })
    }
}

impl Guard for ValveWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Option<Trip> {
        self.add(batch);
        let (command_ratio, since_s) = state.valve.filter(|_| state.running)?;
        if self.judged_s == Some(since_s) || now_s < since_s + self.wait_s {
            return None;
        }
        let size = (self.recent.len() / 2, 0.5 * JUDGED_S);
        let opening_ratio =
            match self.check.judge(command_ratio, [false, true].map(|is_later| self.half(is_later)), size) {
                ValveState::Unknown => return None,
                ValveState::Follows => None,
                ValveState::StandsStill { opening_ratio } => Some(opening_ratio),
            };
        self.judged_s = Some(since_s);
        let stood_still = std::mem::replace(&mut self.stands_still, opening_ratio.is_some());
        opening_ratio.filter(|_| !stood_still).map(|opening_ratio| Trip {
            t_s: now_s,
            guard: GuardName::Valve,
            reaction: self.reaction,
            reason: format!(
                "the back-pressure valve does not follow: {:.0} % of its area commanded {:.0} s ago, flow and pressures are those of {:.0} %; \
                 check its positioner",
                100.0 * command_ratio,
                now_s - since_s,
                100.0 * opening_ratio
            ),
        })
    }
}
