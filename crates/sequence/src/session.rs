//! The implementation of the functions that a script calls.

use crate::error::throw;
use crate::request::{NominalForecast, Refusal, SequenceRequest, StepPrediction};
use crate::settle::{EndCondition, ScriptMessage, SequenceStep, SettleRule, StepResult};
use mapper_core::{OperatingPoint, PlanStep, RigMode, Setpoints, Soak, StepKind};
use mapper_physics::simulation::steady::SteadyState;
use rhai::{EvalAltResult, Position};
use std::ops::RangeInclusive;
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) type ScriptThrow = Box<EvalAltResult>;

/// Maximum number of steps of a sequence.
const STEP_LIMIT: usize = 2_000;
/// Maximum duration of a step, s: four hours. Its samples stay in memory until it is identified.
const DWELL_LIMIT_S: f64 = 14_400.0;
/// Maximum duration of a sequence, s: one day. The rehearsal has to simulate all of it, that of an endless loop too, which takes half a minute.
const DURATION_LIMIT_S: f64 = 86_400.0;
/// Maximum number of checks of points without a step to them, and an allowance for each point of the grid. A check takes as long as some
/// thousand operations.
const CHECK_LIMIT: usize = 2_000;
const CHECKS_PER_POINT: usize = 10;
/// Maximum number of points in one call of the planner (at least the grid); twice as many in total.
const ORDER_LIMIT: usize = 100;
/// Maximum number of notes, and of characters in each.
const NOTE_LIMIT: usize = 1000;
const NOTE_LENGTH_LIMIT: usize = 500;

/// State shared by the functions of a script.
pub(crate) struct Session {
    pub request: SequenceRequest,
    /// Dwell time of the following points, s.
    pub dwell_s: f64,
    /// Time without air before the next step, s, and whether it is a zero.
    rest: (f64, bool),
    pub results: Vec<StepResult>,
    nominal: NominalForecast,
    checks: usize,
    /// Points passed to the planner so far.
    ordered_points: usize,
    notes: Vec<String>,
    note_count: usize,
    to_caller: SyncSender<ScriptMessage>,
    from_caller: Receiver<Option<StepResult>>,
}

impl Session {
    pub fn new(
        request: SequenceRequest,
        to_caller: SyncSender<ScriptMessage>,
        from_caller: Receiver<Option<StepResult>>,
    ) -> Self {
        Session {
            dwell_s: request.timing.dwell.fixed_or_usual_s(),
            request,
            rest: (0.0, false),
            results: Vec::new(),
            nominal: NominalForecast::new(),
            checks: 0,
            ordered_points: 0,
            notes: Vec::new(),
            note_count: 0,
            to_caller,
            from_caller,
        }
    }

    /// Waits until the caller asks for the next step.
    pub fn wait(&mut self) -> Result<Option<StepResult>, ScriptThrow> {
        self.from_caller.recv().map_err(|_| stop_error())
    }

    /// Sends the result of the script to the caller, if it still exists.
    pub fn end(&mut self, end: impl FnOnce(Vec<String>) -> ScriptMessage) {
        let message = end(std::mem::take(&mut self.notes));
        let _ = self.to_caller.send(message);
    }

    /// Run time at which the next step starts, s.
    pub fn now_s(&self) -> f64 {
        self.results.last().map_or(self.request.timing.warm_up_s, |result| result.end_s) + self.rest.0
    }

    pub fn note(&mut self, text: &str) {
        self.note_count += 1;
        if self.note_count < NOTE_LIMIT {
            let harmless = |c: char| if c.is_control() { ' ' } else { c };
            self.notes.push(text.chars().take(NOTE_LENGTH_LIMIT).map(harmless).collect());
        } else if self.note_count == NOTE_LIMIT {
            self.notes.push(format!("the script has made {NOTE_LIMIT} notes; further ones are omitted"));
        }
    }

    fn check_limit(&self) -> usize {
        CHECK_LIMIT + CHECKS_PER_POINT * self.request.points.len()
    }

    fn check(&mut self, point: OperatingPoint) -> Result<SteadyState, ScriptThrow> {
        let limit = self.check_limit();
        if self.checks >= limit {
            let message = format!("the script has checked {limit} points without a step to them");
            return Err(throw(message, "check fewer points"));
        }
        self.checks += 1;
        self.request.check(point).map_err(|Refusal { message, remedy }| throw(message, &remedy))
    }

    pub fn is_reachable(&mut self, point: OperatingPoint) -> Result<bool, ScriptThrow> {
        if self.checks >= self.check_limit() {
            self.check(point)?;
        }
        Ok(self.check(point).is_ok())
    }

    pub fn order(&mut self, points: &[OperatingPoint]) -> Result<Vec<OperatingPoint>, ScriptThrow> {
        // The search time grows faster than the number of points, so a set larger than the grid is refused.
        let max_points = ORDER_LIMIT.max(self.request.points.len());
        if points.len() > max_points {
            let message =
                format!("the planner orders at most {max_points} points at once, not {}", points.len());
            return Err(throw(message, "order the grid, or a part of it"));
        }
        let limit = 2 * max_points;
        self.ordered_points += points.len();
        if self.ordered_points > limit {
            let message = format!("the planner has been asked to order more than {limit} points in total");
            return Err(throw(message, "order a set once and keep the result"));
        }
        if points.is_empty() {
            return Ok(Vec::new());
        }
        (self.request.order)(points)
            .map_err(|message| throw(format!("the planner cannot order the points: {message}"), ""))
    }

    /// The result of a step, by its number from 1.
    pub fn result(&self, number: i64) -> Result<StepResult, ScriptThrow> {
        let index = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
        index.and_then(|index| self.results.get(index)).cloned().ok_or_else(|| {
            let message =
                format!("no result of step {number}: {} steps have been executed", self.results.len());
            throw(message, "steps are counted from 1; jump() returns the result of its step")
        })
    }

    /// Sets the turbine inlet temperature of the following steps, K.
    pub fn set_t3(&mut self, t3_k: f64) -> Result<(), ScriptThrow> {
        if self.request.follow_outlet.turbine_inlet {
            return Err(outlet_follows_error("turbine inlet temperature"));
        }
        if let Some(limit_k) = self.request.limits.t3_max_k.filter(|limit_k| t3_k > *limit_k) {
            let message =
                format!("a turbine inlet temperature of {t3_k:.2} K is above the limit of {limit_k:.2} K");
            return Err(throw(message, "stay below `limits.turbine_inlet_temperature`"));
        }
        self.request.boundary.t3_k = check_temperature("turbine inlet temperature", t3_k, PLAUSIBLE_T3_K)?;
        Ok(())
    }

    /// Sets the oil inlet temperature of the following steps, K.
    pub fn set_oil_temperature(&mut self, oil_k: f64) -> Result<(), ScriptThrow> {
        if self.request.follow_outlet.oil {
            return Err(outlet_follows_error("oil temperature"));
        }
        self.request.boundary.oil_temperature_k =
            check_temperature("oil temperature", oil_k, PLAUSIBLE_OIL_K)?;
        Ok(())
    }

    /// Goes to a point and returns when the step has been executed.
    pub fn step(
        &mut self,
        to: OperatingPoint,
        dwell_s: f64,
        end: EndCondition,
    ) -> Result<StepResult, ScriptThrow> {
        let (index, start_s) = (self.results.len(), self.now_s());
        if index >= STEP_LIMIT {
            return Err(throw(
                format!("a sequence may have at most {STEP_LIMIT} steps"),
                "end the sequence earlier",
            ));
        }
        if !(dwell_s > 0.0 && dwell_s <= DWELL_LIMIT_S) {
            let message =
                format!("a step may last more than 0 s and at most {DWELL_LIMIT_S} s, not {dwell_s} s");
            return Err(throw(message, "give a time such as \"120 s\" or \"10 min\""));
        }
        if start_s + dwell_s > DURATION_LIMIT_S {
            return Err(throw("the sequence would last longer than a day".into(), "end it earlier"));
        }
        let target = self.check(to)?;
        if let Some(accepts) = &self.request.accepts {
            let setpoints = Setpoints {
                mode: RigMode::Running,
                p3_pa: target.boundary.p3_pa,
                t3_k: target.boundary.t3_k,
                valve_opening_ratio: to.valve_opening_ratio,
                oil_temperature_k: target.boundary.oil_temperature_k,
            };
            let refused = accepts.check(&setpoints);
            refused.map_err(|error| throw(error.to_string(), "stay within the range of the rig"))?;
        }
        let (rest_s, is_zero) = std::mem::take(&mut self.rest);
        if rest_s > 0.0 {
            self.nominal.rest(&self.request, rest_s);
        }
        // No jump leads from a machine at rest.
        let from = self.results.last().filter(|_| rest_s == 0.0).map(|result| result.target);
        let fail = |error| throw(format!("the forecast of the step to {to} failed: {error}"), "");
        let StepPrediction { predicted, transition, dwell_s } =
            self.nominal.forecast(&self.request, &target, dwell_s).map_err(fail)?;
        let visited = self.results.iter().any(|result| result.target.is_same_place(&to));
        let step = PlanStep {
            index,
            kind: if visited { StepKind::Repeat } else { StepKind::Point },
            from,
            to,
            p3_pa: target.boundary.p3_pa,
            t3_k: target.boundary.t3_k,
            oil_temperature_k: target.boundary.oil_temperature_k,
            dwell_s,
            start_s,
            transition,
            predicted,
        };
        let notes = std::mem::take(&mut self.notes);
        let boundary = &target.boundary;
        let soak = Soak {
            duration_s: rest_s,
            until_settled: false,
            oil_temperature_k: if is_zero { boundary.t1_k } else { boundary.oil_temperature_k },
            temperature_sigma_k: if is_zero { Soak::TEMPERATURE_SIGMA_K } else { 0.0 },
            pressure_sigma_pa: if is_zero { Soak::PRESSURE_SIGMA_PA } else { 0.0 },
        };
        let rest = (rest_s > 0.0).then_some(soak);
        let step = Box::new(SequenceStep { step, end, rest });
        self.to_caller.send(ScriptMessage::Step(step, notes)).map_err(|_| stop_error())?;
        let result = self.wait()?.ok_or_else(stop_error)?;
        let duration_s = result.end_s - result.start_s;
        self.nominal.finish(&self.request, &target.boundary, duration_s).map_err(fail)?;
        self.checks = self.checks.saturating_sub(1);
        self.results.push(result.clone());
        Ok(result)
    }

    /// Waits at the point of the last step.
    pub fn hold(&mut self, duration_s: f64) -> Result<StepResult, ScriptThrow> {
        let Some(last) = self.results.last() else {
            return Err(throw("no step has been executed yet".into(), "jump to a point first"));
        };
        self.step(last.target, duration_s, EndCondition::Dwell)
    }

    /// Puts a standstill before the next step, after which sensors are zeroed if it is a zero.
    pub fn rest(&mut self, duration_s: f64, is_zero: bool) -> Result<(), ScriptThrow> {
        if self.results.is_empty() {
            let message = "the machine is at rest before the first step".into();
            return Err(throw(message, "use `zero: {soak: ...}` of the campaign, or jump to a point first"));
        }
        if !(duration_s > 0.0 && self.rest.0 + duration_s <= DWELL_LIMIT_S) {
            let message =
                format!("a rest may last more than 0 s and at most {DWELL_LIMIT_S} s, not {duration_s} s");
            return Err(throw(message, "give a time such as \"5 min\""));
        }
        self.rest = (self.rest.0 + duration_s, self.rest.1 || is_zero);
        Ok(())
    }

    /// Repeats a step by the same jump.
    pub fn repeat(&mut self, number: i64) -> Result<StepResult, ScriptThrow> {
        let earlier = self.result(number)?;
        let Some(from) = earlier.from else {
            let message = format!("step {number} has no jump to repeat: the run began with it");
            return Err(throw(message, "repeat a later step, or jump to its point"));
        };
        let now = self.results.last().map(|result| result.target);
        if now.is_none_or(|now| !now.is_same_place(&from)) {
            self.step(from, self.dwell_s, EndCondition::Dwell)?;
        }
        self.step(earlier.target, earlier.end_s - earlier.start_s, EndCondition::Dwell)
    }

    /// Stays at a point until it has settled.
    pub fn settle(
        &mut self,
        to: OperatingPoint,
        max_s: f64,
        rate_max_k_s: f64,
    ) -> Result<StepResult, ScriptThrow> {
        let rule = SettleRule { rate_max_k_s, bands: self.request.settle_bands };
        self.step(to, max_s, EndCondition::UntilSettled(rule))
    }
}

/// Temperatures of a campaign's boundary, K; the ranges of a rig are checked at each step.
const PLAUSIBLE_T3_K: RangeInclusive<f64> = 250.0..=1400.0;
const PLAUSIBLE_OIL_K: RangeInclusive<f64> = 230.0..=450.0;

fn check_temperature(name: &str, value_k: f64, range: RangeInclusive<f64>) -> Result<f64, ScriptThrow> {
    if range.contains(&value_k) {
        return Ok(value_k);
    }
    let message = format!(
        "the {name} cannot be {value_k:.2} K; it is between {} K and {} K",
        range.start(),
        range.end()
    );
    Err(throw(message, "give a temperature such as \"70 degC\""))
}

fn outlet_follows_error(name: &str) -> ScriptThrow {
    let message = format!("the {name} follows the compressor's outlet in this campaign");
    throw(message, "remove it from `boundary.follow_outlet`")
}

/// The error that ends the script when its caller no longer exists. The script cannot catch it.
fn stop_error() -> ScriptThrow {
    Box::new(EvalAltResult::ErrorTerminated(().into(), Position::NONE))
}

/// Only one thread uses the session, so a lock poisoned by a panic is still usable.
pub(crate) fn lock(session: &Mutex<Session>) -> MutexGuard<'_, Session> {
    session.lock().unwrap_or_else(PoisonError::into_inner)
}
