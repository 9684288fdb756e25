//! Commissioning of a stand: a few small steps through the runner of every run, which show how its actuators move.

use crate::SessionError;
use crate::plan::planning::hash_inputs;
use mapper_campaign::Campaign;
use mapper_core::{
    ActuatorMotion, OperatingPoint, Plan, PlanFigures, PlanStep, Predicted, Recording, RigActuators,
    StepKind, Timing,
};
use mapper_observe::{MeasuredValue, measure_actuators};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::operating_point::transition_forecast::{Stand, forecast_transition};
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::SteadyState;

/// Speed of the steps relative to the limit. Judgement: half the energy of the limit, and enough flow for its meter.
const SPEED_RATIO: f64 = 0.6;
/// Lowest speed of a step relative to its usual one. Bound: a third of its pressure above ambient; a larger change shows no more.
const LOW_SPEED_RATIO: f64 = 0.5;
/// Speed between them, as a share of the way. Judgement: a change of P3 so small that its rate does not limit it, next to large ones.
const MIDDLE_SHARE: f64 = 0.7;
/// Change of the opening, relative. Bound: more than the play of a broken drive, and less than the distance from choke to surge.
const OPENING_CHANGE_RATIO: f64 = 0.3;
/// Size and number of small steps of the opening, which find the dead band. Judgement: a positioner resolves a quarter of a per cent.
const STAIR_RATIO: f64 = 0.0025;
const STAIRS: usize = 10;
/// Change of T3, K. Judgement: sixty times the noise of a thermocouple, and no shock for a turbine.
const T3_CHANGE_K: f64 = 30.0;
/// Durations of the steps of P3, valve, small valve steps and T3, s. Bound: several lags of slow actuators; a step ends later if P3 has not arrived.
const P3_S: f64 = 60.0;
const VALVE_S: f64 = 25.0;
const STAIR_S: f64 = 8.0;
const T3_S: f64 = 120.0;
/// Longest warm-up, s. Bound: the shaft has its speed; housings that warm further change no actuator.
const WARM_UP_S: f64 = 120.0;
/// Rate of commands that jump, unit of the actuator per second. Bound: far beyond any actuator.
const AT_ONCE_PER_S: f64 = 1e9;
/// Deviation of the speed that ends a commissioning, ratio. Source: the guard's band of a run without control of the speed.
const OPEN_LOOP_BAND_RATIO: f64 = 0.25;

/// The steps of a commissioning with their campaign: its limits and guards, no zero, surge search or speed control, commands that jump.
#[derive(Debug)]
pub struct Commissioning {
    /// The campaign under which the steps run.
    pub campaign: Campaign,
    /// The steps.
    pub plan: Plan,
    declared: RigActuators,
}

/// A step: its point, T3 below that of the campaign, K, and duration, s.
type Stage = (OperatingPoint, f64, f64);

impl Commissioning {
    /// Plans the steps at the point nearest to 60 % of the limit of speed from which all are within the limits, with declared or ideal actuators.
    pub fn new(campaign: &Campaign, model: &Model) -> Result<Self, SessionError> {
        let declared = campaign.rig_actuators();
        let jumping = |motion: ActuatorMotion| ActuatorMotion { rate_per_s: AT_ONCE_PER_S, ..motion };
        let actuators = RigActuators {
            p3: jumping(declared.p3),
            valve: jumping(declared.valve),
            t3: jumping(declared.t3),
            ..declared
        };
        let mut guards = campaign.guards.clone();
        if let Some(band) = guards.as_mut().and_then(|set| set.speed.as_mut()) {
            band.band_ratio = band.band_ratio.max(OPEN_LOOP_BAND_RATIO);
        }
        let variant = Campaign {
            zero: None,
            sequence: None,
            repeats: None,
            surge_search: None,
            speed_control: None,
            on_drift: None,
            actuators: Some(actuators),
            guards,
            timing: Timing {
                warm_up_s: campaign.timing.warm_up_s.min(WARM_UP_S),
                cool_down_s: 0.0,
                ..campaign.timing
            },
            ..campaign.clone()
        };
        let usual_rpm = SPEED_RATIO * campaign.limits.speed_max_rpm;
        let distance = |point: &OperatingPoint| {
            let (speed, opening) = (point.speed_rpm / usual_rpm, point.valve_opening_ratio);
            speed.ln().abs() + 0.5 * opening.ln().abs()
        };
        let mut bases = campaign.points.clone();
        bases.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut refused = None;
        for base in bases {
            match plan_steps(&variant, &declared, model, base) {
                Ok(steps) => {
                    let plan = plan_of_steps(campaign, model, steps)?;
                    return Ok(Commissioning { campaign: variant, plan, declared });
                }
                Err(reason) => refused = refused.or(Some(reason)),
            }
        }
        let reason = refused.unwrap_or_else(|| "the campaign has no points".to_owned());
        Err(SessionError::Preflight(format!(
            "no point of the campaign allows the small steps of a commissioning; the best one fails: {reason}"
        )))
    }

    /// The actuators in the recording of these steps, next to the declared ones.
    pub fn measure(&self, recording: &Recording) -> Vec<MeasuredValue> {
        let pipe = (self.campaign.boundary.p1_pa, self.campaign.machine.params.outlet.volume_m3);
        measure_actuators(recording, &self.declared, pipe)
    }
}

/// The stages about a point: P3 between two speeds and one between, the valve, small steps of the valve, T3, and the low speed to stop from.
fn stages(campaign: &Campaign, base: OperatingPoint) -> Vec<Stage> {
    let low_rpm = LOW_SPEED_RATIO * base.speed_rpm;
    let slowest_rpm = campaign.points.iter().map(|point| point.speed_rpm).fold(base.speed_rpm, f64::min);
    let low_rpm = low_rpm.max(slowest_rpm);
    let at_speed = |speed_rpm: f64| OperatingPoint { speed_rpm, ..base };
    let at_opening =
        |more: f64| OperatingPoint { valve_opening_ratio: base.valve_opening_ratio + more, ..base };
    let (low, middle) = (at_speed(low_rpm), at_speed(low_rpm + MIDDLE_SHARE * (base.speed_rpm - low_rpm)));
    let change = OPENING_CHANGE_RATIO * base.valve_opening_ratio;
    let (half, open) = (at_opening(0.5 * change), at_opening(change));
    let mut stages: Vec<Stage> =
        [base, low, base, middle, base, low, base].map(|point| (point, 0.0, P3_S)).to_vec();
    stages.extend([open, base, half, open, half, base, open].map(|point| (point, 0.0, VALVE_S)));
    let stair = |index: usize| at_opening(change + STAIR_RATIO * index as f64);
    stages.extend((1..=STAIRS).map(|index| (stair(index), 0.0, STAIR_S)));
    stages.push((base, 0.0, VALVE_S));
    if !campaign.follow_outlet.turbine_inlet {
        stages.extend([(base, T3_CHANGE_K, T3_S), (base, 0.0, T3_S)]);
    }
    stages.push((low, 0.0, VALVE_S));
    stages
}

fn plan_steps(
    campaign: &Campaign,
    declared: &RigActuators,
    model: &Model,
    base: OperatingPoint,
) -> Result<Vec<PlanStep>, String> {
    let mut steps: Vec<PlanStep> = Vec::new();
    let mut before: Option<(OperatingPoint, SteadyState)> = None;
    let mut start_s = campaign.timing.warm_up_s;
    for (point, colder_k, dwell_s) in stages(campaign, base) {
        let t3_k = campaign.boundary.t3_k - colder_k;
        let boundary = BoundaryConditions { t3_k, ..campaign.boundary };
        let target = reach(model, point, &boundary, campaign.follow_outlet, &campaign.limits)
            .map_err(|obstacles| format!("{point} {}", describe_obstacles(&obstacles)))?;
        let mut transition = None;
        if let Some((from, start)) = &before {
            // The stand may be as fast as its commands, or as declared.
            for actuators in [*declared, campaign.rig_actuators()] {
                let stand = Stand { limits: &campaign.limits, actuators: &actuators };
                let jump = forecast_transition(model, start.state, (start, &target), stand, dwell_s)
                    .map_err(|error| error.to_string())?;
                if let Some(violation) = jump.violations.first() {
                    let reason = mapper_planner::Rejection::from(*violation);
                    return Err(format!("the jump from {from} to {point}: {reason}"));
                }
                if campaign.limits.t2_max_k.is_some_and(|limit_k| jump.step.highest_t2_k > limit_k) {
                    return Err(format!("the jump from {from} to {point} exceeds the limit of T2"));
                }
                transition = Some(jump.transition);
            }
        }
        let outputs = &target.outputs;
        steps.push(PlanStep {
            index: steps.len(),
            kind: StepKind::Repeat,
            from: before.map(|(from, _)| from),
            to: point,
            p3_pa: target.boundary.p3_pa,
            t3_k: target.boundary.t3_k,
            oil_temperature_k: target.boundary.oil_temperature_k,
            dwell_s,
            start_s,
            transition,
            predicted: Predicted::settled(outputs.flow_kg_s, outputs.pressure_ratio, outputs.t2_k, dwell_s),
        });
        start_s += dwell_s;
        before = Some((point, target));
    }
    Ok(steps)
}

fn plan_of_steps(campaign: &Campaign, model: &Model, steps: Vec<PlanStep>) -> Result<Plan, SessionError> {
    let mut plan = Plan {
        campaign: campaign.name.clone(),
        objective: "commissioning".to_owned(),
        seed: campaign.seed,
        made_from: hash_inputs(campaign, model)?,
        warm_up_s: steps.first().map_or(0.0, |step| step.start_s),
        cool_down_s: 0.0,
        steps,
        surge_search_s: 0.0,
        figures: PlanFigures::default(),
        remarks: Vec::new(),
    };
    plan.figures.minutes = plan.duration_s() / 60.0;
    plan.remarks.extend(plan.avoided_crossing());
    Ok(plan)
}
