//! Reads a plan from an untrusted file and checks it against its inputs and the limits of all plans.

use crate::SessionError;
use crate::recording::files::read_at_most;
use crate::recording::journal::both_known_and_differ;
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, Plan, PlanInputHashes, PlanStep, step_number};
use std::path::Path;

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
///
/// # Errors
/// [`SessionError::StalePlan`] with the differences; [`SessionError::NotAPlan`] and [`SessionError::File`] if the file does not contain a plan;
/// [`SessionError::InvalidPlan`] if the plan violates a limit.
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

/// The first violation in a plan, in words.
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
    let from = step.from.is_some_and(|from| {
        !(0.0..=limits.speed_max_rpm * (1.0 + ROUNDING_RATIO)).contains(&from.speed_rpm)
            || !(0.0..=OperatingPoint::OPENING_MAX_RATIO).contains(&from.valve_opening_ratio)
    });
    from.then(|| "starts from a point outside the limits".to_owned())
}
