//! Plans a campaign: by the planner, or by the steps of its script.

use crate::SessionError;
use crate::recording::files::read_at_most;
use crate::recording::identification_config::{declared, expected_rest, identification};
use crate::recording::journal::both_known_and_differ;
use crate::rig::observers::{append_samples, config_for_single_steps, retain_last_two_steps};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::SequenceSource;
use mapper_core::{
    Channel, IdentifiedPoint, Method, OperatingPoint, Plan, PlanInputHashes, PlanRemark, PlanStep, Predicted,
    Recording, RigDescription, SampleBatch, Series, SetpointRanges, Soak, StepMarker, step_number,
};
use mapper_identify::{
    IdentifyConfig, PressureTap, ZeroSettings, expected, expected_after_zero, expected_steady,
    expected_together, identify_each,
};
use mapper_numerics::statistics::{mean, standard_deviation};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::hold_speed;
use mapper_physics::simulation::model::Model;
use mapper_planner::{
    ForecastRow, MethodResult, MethodResults, PlanRequest, PredictedMethod, make_plan, sha256_hex,
};
use mapper_recording::ChannelMap;
use mapper_runner::surge::{SurgeErrors, SurgeMarks};
use mapper_runner::{HoldConditions, StepSource, StepSourceError, SurgeSearch, surge};
use mapper_sequence::{EndCondition, Script, SequenceRequest, SequenceRunner, SettleWatch, StepResult};
use std::collections::BTreeMap;
use std::path::Path;

/// The nominal model of a campaign.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, SessionError> {
    Ok(mapper_campaign::nominal_model(campaign)?)
}

/// The plan of a campaign with a grid, including the time of a subsequent surge search.
pub fn plan(campaign: &Campaign, model: &Model) -> Result<Plan, SessionError> {
    plan_of(campaign, &PlanInputs::of(campaign)?.request(campaign, model))
}

/// Same as [`plan`], for a request that was already made from the campaign.
pub fn plan_of(campaign: &Campaign, request: &PlanRequest<'_>) -> Result<Plan, SessionError> {
    let mut plan = make_plan(request)?;
    plan.remarks.extend(zero_remark(campaign));
    plan.remarks.extend(plan.avoided_crossing());
    add_surge_search(campaign, request.model, &mut plan);
    Ok(plan)
}

pub(crate) fn order_points(campaign: &Campaign, model: &Model) -> Result<Vec<OperatingPoint>, SessionError> {
    let inputs = PlanInputs::of(campaign)?;
    let request = PlanRequest { method: None, ..inputs.request(campaign, model) };
    Ok(make_plan(&request)?.steps.into_iter().map(|step| step.to).collect())
}

pub(crate) fn hash_inputs(campaign: &Campaign, model: &Model) -> Result<PlanInputHashes, SessionError> {
    let Some(script) = &campaign.sequence else {
        return Ok(mapper_planner::hash_inputs(&PlanInputs::of(campaign)?.request(campaign, model)));
    };
    let without_script = Campaign { sequence: None, repeats: None, ..campaign.clone() };
    let script_sha256 = Some(sha256_hex(&script.text));
    Ok(PlanInputHashes { script_sha256, ..hash_inputs(&without_script, model)? })
}

/// Data that a plan request borrows in addition to campaign and model.
#[derive(Debug)]
pub struct PlanInputs {
    canonical: String,
    method: Option<Box<dyn PredictedMethod>>,
}

impl PlanInputs {
    /// Inputs of a campaign.
    pub fn of(campaign: &Campaign) -> Result<Self, SessionError> {
        Ok(PlanInputs { canonical: serde_json::to_string(campaign)?, method: predicted_method(campaign) })
    }

    /// The plan request for `campaign`, from which these inputs were made.
    pub fn request<'a>(&'a self, campaign: &'a Campaign, model: &'a Model) -> PlanRequest<'a> {
        let transient = matches!(campaign.identification.method, Method::Joint | Method::Dynamic);
        PlanRequest {
            campaign_name: &campaign.name,
            campaign_canonical: &self.canonical,
            model,
            boundary: campaign.boundary,
            follow_outlet: campaign.follow_outlet,
            points: &campaign.points,
            order: campaign.order,
            timing: campaign.timing,
            window: campaign.identification.window,
            settle_bands: campaign.identification.settle_bands,
            limits: campaign.limits,
            actuators: campaign.rig_actuators(),
            appended: None,
            repeats: campaign.repeats,
            return_to_first: campaign.return_to_first && transient,
            method: self.method.as_deref(),
            effort: 1.0,
            seed: campaign.seed,
        }
    }
}

fn predicted_method(campaign: &Campaign) -> Option<Box<dyn PredictedMethod>> {
    let config = identification_after_zero(campaign);
    let scope = match campaign.identification.method {
        Method::Joint => Scope::AllSteps,
        Method::Dynamic => Scope::EachStep,
        Method::Steady => Scope::Settled,
        Method::Corrected | Method::Imported => return None,
    };
    Some(Box::new(Forecaster::of(config, scope)))
}

fn identification_after_zero(campaign: &Campaign) -> IdentifyConfig {
    let config = identification(campaign);
    match campaign.zero {
        Some(soak) => {
            expected_after_zero(config, &ZeroSettings::from(soak), soak.duration_s, expected_rest(campaign))
        }
        None => config,
    }
}

/// Channels whose offsets dominate the error of efficiency.
const CHANNELS: [Channel; 5] = [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2];
/// Duration ratio of the longer soak to the planned one.
const LONGER_RATIO: f64 = 2.0;
/// Minimum relative reduction of an offset by a longer soak that is reported.
const MIN_REDUCTION_RATIO: f64 = 0.3;

fn zero_remark(campaign: &Campaign) -> Option<PlanRemark> {
    let soak = campaign.zero?;
    let left_after = |soak_s: f64| -> BTreeMap<Channel, f64> {
        let settings = ZeroSettings::from(soak);
        let expected_sigma =
            expected_after_zero(identification(campaign), &settings, soak_s, expected_rest(campaign))
                .declared;
        CHANNELS
            .into_iter()
            .filter_map(|channel| Some((channel, expected_sigma.get(&channel)?.offset_sigma)))
            .collect()
    };
    let longer_soak_s = LONGER_RATIO * soak.duration_s;
    let (offset_sigmas, mut longer_offset_sigmas) = (left_after(soak.duration_s), left_after(longer_soak_s));
    longer_offset_sigmas.retain(|channel, longer| {
        offset_sigmas
            .get(channel)
            .is_some_and(|expected_sigma| *longer < (1.0 - MIN_REDUCTION_RATIO) * expected_sigma)
    });
    (!offset_sigmas.is_empty()).then_some(PlanRemark::OffsetsAfterSoak {
        soak_s: soak.duration_s,
        offset_sigmas,
        longer_soak_s,
        longer_offset_sigmas,
    })
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Each step separately (`dynamic`).
    EachStep,
    /// All steps together (`joint`).
    AllSteps,
    /// Settled points only (`steady`).
    Settled,
}

#[derive(Debug)]
pub(crate) struct Forecaster {
    config: IdentifyConfig,
    scope: Scope,
}

impl Forecaster {
    pub(crate) fn of(config: IdentifyConfig, scope: Scope) -> Self {
        // A forecast uses total pressures.
        let total = PressureTap::Total;
        Forecaster { config: IdentifyConfig { inlet_tap: total, outlet_tap: total, ..config }, scope }
    }
}

impl PredictedMethod for Forecaster {
    fn predict_step(&self, window: &[ForecastRow], interval_s: f64) -> Option<MethodResult> {
        if self.scope != Scope::EachStep || window.is_empty() {
            return None;
        }
        expected(window, interval_s, &self.config)
    }

    fn predict_campaign(&self, steps: &[&[ForecastRow]]) -> Option<MethodResults> {
        if self.scope != Scope::AllSteps {
            return None;
        }
        expected_together(steps, &self.config)
    }

    fn predict_settled(&self, row: &ForecastRow) -> Option<(f64, f64)> {
        expected_steady(row, &self.config)
    }
}

/// Setpoints and predicted readings of the nominal machine near or beyond its surge line. `None` beyond the limits of P3 or T2.
pub fn hold_near_surge(campaign: &Campaign, model: &Model, point: OperatingPoint) -> Option<HoldConditions> {
    let boundary = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
    let steady = hold_speed(model, point.speed_rpm, &boundary, campaign.follow_outlet).ok()?;
    let (limits, outputs) = (&campaign.limits, &steady.outputs);
    let p3_pa = steady.boundary.p3_pa;
    let within = (limits.p3_min_pa..=limits.p3_max_pa).contains(&p3_pa)
        && limits.t2_max_k.is_none_or(|limit_k| outputs.t2_k <= limit_k);
    within.then(|| HoldConditions {
        p3_pa,
        t3_k: steady.boundary.t3_k,
        oil_temperature_k: steady.boundary.oil_temperature_k,
        predicted: Predicted::settled(outputs.flow_kg_s, outputs.pressure_ratio, outputs.t2_k, 0.0),
        surge_margin_ratio: steady.surge_margin_ratio(model),
    })
}

pub(crate) fn add_surge_search(campaign: &Campaign, model: &Model, plan: &mut Plan) {
    let Some(seek) = campaign.surge_search else { return };
    let mut ends: Vec<OperatingPoint> = Vec::new();
    for step in &plan.steps {
        match ends.iter_mut().find(|end| (end.speed_rpm - step.to.speed_rpm).abs() < 1e-3) {
            Some(end) if end.valve_opening_ratio <= step.to.valve_opening_ratio => {}
            Some(end) => *end = step.to,
            None => ends.push(step.to),
        }
    }
    let margin = |end: &OperatingPoint| {
        hold_near_surge(campaign, model, *end).map_or(1.0, |steady| steady.surge_margin_ratio)
    };
    let approaches: usize = ends.iter().map(|end| surge::expected_readings(margin(end), &seek)).sum();
    plan.surge_search_s = approaches as f64 * seek.dwell_s + ends.len() as f64 * SurgeSearch::AROUND_S;
    plan.figures.minutes = plan.duration_s() / 60.0;
    plan.remarks.push(PlanRemark::SurgeSearch {
        lines: ends.len(),
        closest_margin_ratio: seek.closest_margin_ratio,
        steps: approaches + 2 * ends.len(),
        duration_s: plan.surge_search_s,
    });
}

pub(crate) fn find_surge_marks(
    approaches: &Recording,
    campaign: Option<&Campaign>,
    config: &IdentifyConfig,
) -> SurgeMarks {
    let errors = campaign.map_or_else(SurgeErrors::default, |campaign| {
        SurgeErrors::of(&declared(campaign, &ChannelMap::native()))
    });
    let search = campaign.and_then(|campaign| campaign.surge_search).unwrap_or_default();
    surge::find_surge_marks(approaches, config.reference, errors, search.soft_growth_ratio)
}

/// Maximum size of a plan file, bytes.
const MAX_FILE_BYTES: u64 = 32 << 20;
/// Maximum number of steps.
const MAX_STEPS: usize = 20_000;
/// Minimum duration of a step, s, and minimum speed of a point, rpm.
const MIN_DWELL_S: f64 = 0.1;
const MIN_SPEED_RPM: f64 = 1.0;
/// Longest step, warm-up or cool-down, s: a day, as in campaigns.
const MAX_STEP_S: f64 = 86_400.0;
/// Longest run, s: two weeks.
const MAX_RUN_S: f64 = 14.0 * 86_400.0;
/// Relative tolerance on limits, because the plan's numbers were rounded in a file.
const ROUNDING_RATIO: f64 = 1e-9;

/// Reads a plan from a file and rejects it if its inputs differ from `now`.
pub fn stored_plan(path: &Path, now: &PlanInputHashes, campaign: &Campaign) -> Result<Plan, SessionError> {
    let bytes = read_at_most(path, MAX_FILE_BYTES)?;
    let wrong = |why: String| SessionError::InvalidPlan { path: path.to_owned(), why };
    let stored: Plan =
        serde_json::from_slice(&bytes).map_err(|source| SessionError::NotAPlan(path.to_owned(), source))?;
    let then = &stored.made_from;
    let changed: Vec<&str> = [
        ("the campaign", then.campaign_sha256 != now.campaign_sha256),
        ("the nominal model", then.model_sha256 != now.model_sha256),
        ("the sequence script", then.script_sha256 != now.script_sha256),
        // A plan made without a rig may be run on any rig.
        (
            "the description of the rig",
            both_known_and_differ(then.rig_sha256.as_deref(), now.rig_sha256.as_deref()),
        ),
    ]
    .into_iter()
    .filter_map(|(what, changed)| changed.then_some(what))
    .collect();
    if !changed.is_empty() {
        return Err(SessionError::StalePlan { path: path.to_owned(), changed });
    }
    match find_violation(&stored, campaign) {
        None => Ok(stored),
        Some(why) => Err(wrong(why)),
    }
}

fn find_violation(plan: &Plan, campaign: &Campaign) -> Option<String> {
    if plan.steps.is_empty() || plan.steps.len() > MAX_STEPS {
        return Some(format!("it has {} steps; a plan has 1 to {MAX_STEPS}", plan.steps.len()));
    }
    for (what, duration_s) in [("warm-up", plan.warm_up_s), ("cool-down", plan.cool_down_s)] {
        if !(0.0..=MAX_STEP_S).contains(&duration_s) {
            return Some(format!("its {what} lasts {duration_s} s; at most {MAX_STEP_S} s are allowed"));
        }
    }
    let first = plan.steps.iter().enumerate().find_map(|(place, step)| {
        let why = step_violation(place, step, campaign)?;
        Some(format!("step {} {why}", step_number(place)))
    });
    first.or_else(|| {
        let duration_s = plan.duration_s();
        (duration_s > MAX_RUN_S)
            .then(|| format!("it lasts {duration_s:.0} s; at most {MAX_RUN_S} s are allowed"))
    })
}

fn step_violation(place: usize, step: &PlanStep, campaign: &Campaign) -> Option<String> {
    if step.index != place {
        return Some(format!("has the number {}", step_number(step.index)));
    }
    let limits = &campaign.limits;
    let coldest_k = 250.0;
    let hottest_k = limits.t3_max_k.unwrap_or(1400.0);
    let openings = 0.05..=OperatingPoint::OPENING_MAX_RATIO;
    for (what, value, low, high, unit) in [
        ("dwell", step.dwell_s, MIN_DWELL_S, MAX_STEP_S, " s"),
        ("speed", step.to.speed_rpm, MIN_SPEED_RPM, limits.speed_max_rpm, " rpm"),
        ("valve opening", step.to.valve_opening_ratio, *openings.start(), *openings.end(), ""),
        ("P3", step.p3_pa, limits.p3_min_pa, limits.p3_max_pa, " Pa"),
        ("T3", step.t3_k, coldest_k, hottest_k, " K"),
        ("T_oil", step.oil_temperature_k, coldest_k, 450.0, " K"),
        ("start", step.start_s, 0.0, MAX_RUN_S, " s"),
    ] {
        let (lowest, highest) = (low * (1.0 - ROUNDING_RATIO), high * (1.0 + ROUNDING_RATIO));
        if !(lowest..=highest).contains(&value) {
            // Written out, 1e300 would fill the screen.
            let value = if value.abs() < 1e15 { format!("{value}") } else { format!("{value:e}") };
            return Some(format!("has {what} = {value}{unit}, outside {low} to {high}{unit}"));
        }
    }
    if let Some(range) = limits.avoid.refusing(step.to.speed_rpm) {
        let (from_krpm, to_krpm) = (range.from_rpm / 1e3, range.to_rpm / 1e3);
        return Some(format!("stays within the speeds to avoid, {from_krpm} to {to_krpm} krpm"));
    }
    let from = step.from.is_some_and(|from| {
        !(0.0..=limits.speed_max_rpm * (1.0 + ROUNDING_RATIO)).contains(&from.speed_rpm)
            || !(0.0..=OperatingPoint::OPENING_MAX_RATIO).contains(&from.valve_opening_ratio)
    });
    from.then(|| "starts from a point outside the limits".to_owned())
}

pub(crate) struct ScriptedSteps {
    script: SequenceRunner,
    config: IdentifyConfig,
    warm_up_s: f64,
    cool_down_s: f64,
    /// The last two steps with their samples. Identification of the last step needs only these.
    recent: Recording,
    current_step: Option<PlanStep>,
    rest: Option<Soak>,
    settling: Option<SettleWatch>,
    pub(crate) finished: Option<StepResult>,
    pub done: Vec<PlanStep>,
}

impl ScriptedSteps {
    pub fn new(
        campaign: &Campaign,
        model: &Model,
        source: &SequenceSource,
        rig: &RigDescription,
    ) -> Result<Self, SessionError> {
        let script = Script { path: source.path.clone(), text: source.text.clone() };
        let script = SequenceRunner::start(script, request(campaign, model, rig.accepts))?;
        Ok(ScriptedSteps {
            script,
            // A script gets each step immediately; the joint method identifies all steps at the end.
            config: config_for_single_steps(identification(campaign)),
            warm_up_s: campaign.timing.warm_up_s,
            cool_down_s: campaign.timing.cool_down_s,
            recent: Recording::default(),
            current_step: None,
            rest: None,
            settling: None,
            finished: None,
            done: Vec::new(),
        })
    }

    /// The executed steps as a plan, with all other fields from `base`.
    pub fn executed(&self, base: &Plan) -> Plan {
        with_steps(base.clone(), self.done.clone())
    }
}

impl StepSource for ScriptedSteps {
    fn warm_up_s(&self) -> f64 {
        self.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        self.cool_down_s
    }

    fn is_ready(&mut self) -> bool {
        self.script.request_step(self.finished.take());
        self.script.is_ready()
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.script.next_step(self.finished.take()).map_err(StepSourceError::new)?;
        let Some(next) = next else { return Ok(None) };
        self.settling = match next.end {
            EndCondition::Dwell => None,
            EndCondition::UntilSettled(rule) => Some(SettleWatch::new(rule, next.step.start_s)),
        };
        self.rest = next.rest;
        self.current_step = Some(next.step.clone());
        Ok(Some(next.step))
    }

    fn rest(&self) -> Option<Soak> {
        self.rest
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        append_samples(&mut self.recent, batch);
        self.settling.as_mut().is_some_and(|watch| watch.has_settled(batch))
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let Some(mut step) = self.current_step.take() else { return Ok(()) };
        retain_last_two_steps(&mut self.recent, marker);
        let identified = identify_each(&self.recent, &self.config).map_err(StepSourceError::new)?.pop();
        let readings = readings(&self.recent, marker);
        self.finished = Some(result_of(&step, marker, identified.and_then(Result::ok), readings));
        (step.start_s, step.dwell_s) = (marker.start_s, marker.end_s - marker.start_s);
        step.predicted.minutes = step.dwell_s / 60.0;
        self.done.push(step);
        Ok(())
    }

    fn after_skipped_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let Some(step) = self.current_step.take() else { return Ok(()) };
        self.finished = Some(result_of(&step, marker, None, readings(&self.recent, marker)));
        Ok(())
    }

    fn take_notes(&mut self) -> Vec<String> {
        self.script.take_notes()
    }
}

/// Mean and variance of each channel over the second half of a step.
fn readings(recording: &Recording, marker: &StepMarker) -> BTreeMap<Channel, (f64, f64)> {
    let middle_s = 0.5 * (marker.start_s + marker.end_s);
    let of_channel = |(channel, series): (&Channel, &Series)| {
        let values: Vec<f64> = series
            .slice(middle_s, marker.end_s)
            .1
            .iter()
            .copied()
            .filter(|value| value.is_finite())
            .collect();
        Some((*channel, (mean(&values)?, standard_deviation(&values)?.powi(2))))
    };
    recording.series.iter().filter_map(of_channel).collect()
}

fn result_of(
    step: &PlanStep,
    marker: &StepMarker,
    identified: Option<IdentifiedPoint>,
    readings: BTreeMap<Channel, (f64, f64)>,
) -> StepResult {
    StepResult {
        number: step_number(step.index),
        target: step.to,
        from: step.from,
        start_s: marker.start_s,
        end_s: marker.end_s,
        identified,
        readings,
    }
}

fn with_steps(mut plan: Plan, steps: Vec<PlanStep>) -> Plan {
    plan.steps = steps;
    let gradients = || plan.steps.iter().filter_map(|step| step.predicted.dtc_k).map(f64::abs);
    let (sum_k, min_k) = (gradients().sum(), gradients().min_by(f64::total_cmp));
    plan.figures.sum_gradient_k = sum_k;
    plan.figures.min_gradient_k = min_k;
    plan.figures.worst_sigma_eta =
        plan.steps.iter().filter_map(|step| step.predicted.sigma_eta).max_by(f64::total_cmp);
    plan.figures.minutes = plan.duration_s() / 60.0;
    plan
}

fn request(campaign: &Campaign, model: &Model, accepts: Option<SetpointRanges>) -> SequenceRequest {
    let (planned, machine) = (campaign.clone(), model.clone());
    SequenceRequest {
        points: campaign.points.clone(),
        timing: campaign.timing,
        window: campaign.identification.window,
        settle_bands: campaign.identification.settle_bands,
        model: model.clone(),
        boundary: campaign.boundary,
        follow_outlet: campaign.follow_outlet,
        limits: campaign.limits,
        accepts,
        actuators: campaign.rig_actuators(),
        order: Box::new(move |points| {
            // The script itself decides on repeat visits.
            let subset = Campaign {
                points: points.to_vec(),
                sequence: None,
                repeats: None,
                return_to_first: false,
                ..planned.clone()
            };
            order_points(&subset, &machine).map_err(|error| error.to_string())
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shipped;

    #[test]
    fn a_longer_soak_is_mentioned_if_it_reduces_an_offset_clearly() {
        let mut campaign = shipped::campaign(&[]);
        let named = |campaign: &_| match zero_remark(campaign) {
            Some(PlanRemark::OffsetsAfterSoak { soak_s, longer_offset_sigmas, .. }) => {
                Some((soak_s, longer_offset_sigmas.into_keys().collect::<Vec<_>>()))
            }
            _ => None,
        };
        // Only the housing has not settled; averaging no longer improves the other sensors.
        assert_eq!(named(&campaign), Some((1800.0, vec![Channel::Tc])));
        let soak = campaign.zero.as_mut().unwrap();
        soak.duration_s = 4.0 * 3600.0;
        assert_eq!(named(&campaign), Some((4.0 * 3600.0, Vec::new())));
        campaign.zero = None;
        assert_eq!(named(&campaign), None);
    }
}
