//! How long the steps last where all of them are identified together.
//!
//! What a point's error has in common with others (the law, alpha_A, the probe) falls with the time that all steps take
//! together, so all get the same time, unless one settles later. It is found by the forecast itself: on logarithmic scales
//! the error is nearly a line in the time.

use crate::figures::open_rms_error_eta;
use crate::request::{PlanError, PlanRequest};
use crate::walk::{Route, Walk, walk};
use mapper_core::{PlanStep, StepKind, WindowRule};

/// Time at the settled point, s, however certain it is before, and how much later than forecast the rig may settle.
const AT_POINT_S: f64 = 10.0;
const LATER_S: f64 = 2.0;
/// Shortest step whose dwell is chosen, s.
pub const SHORTEST_S: f64 = 20.0;
/// Forecasts that are made where the time is to be found closely.
pub(crate) const FORECASTS: usize = 5;
/// The required error counts as reached up to this multiple of it.
pub const REACHED_RATIO: f64 = 1.02;
/// How the error falls with the time, if nothing better is known: a half by averaging, a half by the larger gradients.
const FALL: f64 = -0.8;

/// How long steps have to last by what is left of error after `tried_s`, s.
pub(crate) fn needed_s(request: &PlanRequest<'_>, tried_s: f64, error: f64) -> f64 {
    let longest_s = request.timing.dwell_s;
    let needed_s = |required: f64| tried_s * (required / error).powf(1.0 / FALL);
    request.required_sigma_eta.map_or(longest_s, needed_s).clamp(SHORTEST_S.min(longest_s), longest_s)
}

/// Goes through a route with steps that last until the points are certain enough, about `guess_s`, found by that many forecasts at most; with the request's where
/// no error is required, or each step is identified by itself.
pub(crate) fn walk_until_certain(
    request: &PlanRequest<'_>,
    route: Route<'_>,
    guess_s: f64,
    forecasts: usize,
) -> Result<Walk, PlanError> {
    let joint = request.method.is_some_and(|method| method.is_joint());
    let longest_s = request.timing.dwell_s;
    let (Some(required), true) = (request.required_sigma_eta, joint) else {
        return walk(request, route, None);
    };
    // Time and error of the forecast before.
    let mut before: Option<(f64, f64)> = None;
    let mut time_s = guess_s.min(longest_s);
    let mut walked: Option<Walk> = None;
    for _ in 0..forecasts {
        let dwells_s = match &walked {
            Some(walked) => dwells_s(&walked.steps, route, time_s, longest_s),
            None => vec![time_s; route.visits.len()],
        };
        let now = walked.insert(walk(request, route, Some(&dwells_s))?);
        let (true, Some(error)) = (now.forbidden.is_empty(), open_rms_error_eta(&now.steps)) else { break };
        let fall = match before {
            Some(before) if (before.0 / time_s).ln().abs() > 0.02 => {
                ((before.1 / error).ln() / (before.0 / time_s).ln()).clamp(-2.0, -0.3)
            }
            _ => FALL,
        };
        // Whole seconds: nobody holds a point for 31.4159 s.
        let next_s = (time_s * (required / error).powf(1.0 / fall)).ceil().clamp(SHORTEST_S, longest_s);
        let reached = error <= REACHED_RATIO * required;
        // The first walk knows of no settling times yet.
        if before.is_some() && (next_s == time_s || (reached && next_s > time_s - 2.0)) {
            break;
        }
        before = Some((time_s, error));
        time_s = next_s;
    }
    walked.map_or_else(|| walk(request, route, None), Ok)
}

/// The dwell of each step, s; repeats compare when they last equally long.
fn dwells_s(steps: &[PlanStep], route: Route<'_>, time_s: f64, longest_s: f64) -> Vec<f64> {
    let mut dwells_s: Vec<f64> = steps.iter().map(|step| rested_dwell_s(step, time_s, longest_s)).collect();
    let is_repeat =
        |i: &usize| steps[*i].kind == StepKind::Repeat && Some(route.visits[*i].index) == route.repeated;
    let repeats: Vec<usize> = (0..steps.len()).filter(is_repeat).collect();
    let repeat_s = repeats.iter().map(|i| dwells_s[*i]).fold(0.0, f64::max);
    repeats.iter().for_each(|i| dwells_s[*i] = repeat_s);
    dwells_s
}

/// `time_s`, or what the step needs to have settled in good time before its end, by its forecast, s.
pub fn rested_dwell_s(step: &PlanStep, time_s: f64, longest_s: f64) -> f64 {
    let Some(settle_s) = step.predicted.settle_s else { return longest_s };
    let rests = |dwell_s: &f64| {
        let rest_s = WindowRule::rest_at_end_s(*dwell_s).max(AT_POINT_S - LATER_S);
        dwell_s - settle_s - LATER_S >= rest_s
    };
    (0..).map(|i| time_s + f64::from(i)).take_while(|s| *s < longest_s).find(rests).unwrap_or(longest_s)
}
