//! The state that a browser shows, with a size limit for any run, and how events change it.

use mapper_campaign::Campaign;
use mapper_campaign::campaign::DisplayUnits;
use mapper_core::{Channel, IdentifiedPoint, Plan, PlanStep, SignalGuard, StepMarker, valve_area_text};
use mapper_report::Display;
use mapper_report::page::{LiveMap, LivePoint, Planned, live_map, live_point, planned, target_line_name};
use mapper_session::{Operator, SessionEvent, soak_s};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Number of stored rows of readings, one per second of rig time.
const TRACE_ROWS: usize = 300;
/// Maximum number of stored events; the latest are kept.
const MAX_EVENTS: usize = 200;
/// Maximum number of stored points, more than a night produces.
const MAX_POINTS: usize = 2000;

#[derive(Debug, Clone, Serialize)]
pub(crate) struct State {
    pub(crate) machine: String,
    campaign: String,
    pub(crate) units: DisplayUnits,
    pub(crate) lines: Vec<String>,
    planned: Vec<Planned>,
    steps: usize,
    duration_s: f64,
    pace: Option<f64>,
    traced: Vec<TracedChannel>,
    /// Run time, s, and readings.
    rows: VecDeque<Vec<Option<f64>>>,
    pub(crate) points: Vec<LivePoint>,
    pub(crate) map: LiveMap,
    pub(crate) events: VecDeque<LoggedMessage>,
    pub(crate) now: CurrentValues,
    pub(crate) outcome: Option<String>,
    pub(crate) page: Option<String>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct TracedChannel {
    pub(crate) name: String,
    pub(crate) unit: String,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct LoggedMessage {
    pub(crate) t_s: f64,
    pub(crate) message: String,
}

#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct CurrentValues {
    pub(crate) t_s: f64,
    phase: String,
    pub(crate) step: Option<Step>,
    /// Remaining rig time and half-width of its 95 % interval, s.
    left_s: f64,
    left_half_s: f64,
    holds: bool,
    pub(crate) stops: bool,
    pub(crate) readings: Vec<Reading>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Step {
    /// Its number, from 1; `None` for one that a resumed run repeats.
    pub(crate) step: Option<usize>,
    pub(crate) place: String,
    start_s: f64,
    pub(crate) end_s: f64,
    /// Expected settling time, s after its start.
    settle_s: Option<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Reading {
    symbol: &'static str,
    pub(crate) what: &'static str,
    pub(crate) unit: String,
    pub(crate) value: f64,
    shown: String,
    low: Option<f64>,
    high: Option<f64>,
}

/// Minimum interval of updates for values that change all the time.
const TICK: Duration = Duration::from_millis(200);
/// Channels with a chart of the last minutes.
const TRACED: [Channel; 6] =
    [Channel::T2, Channel::Tc, Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P2, Channel::P3];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OperatorCommand {
    Hold,
    Continue,
    /// Stop the run at the end of the step.
    StopAfterStep,
    SafeNow,
}

/// The run and its stop flags.
pub struct LiveRun<'a> {
    /// The campaign.
    pub campaign: &'a Campaign,
    /// The plan.
    pub plan: &'a Plan,
    /// Ratio of rig time to wall-clock time; `None`: as fast as possible.
    pub pace: Option<f64>,
    /// Operator requests read by the runner.
    pub operator: Arc<Operator>,
    /// Stops at the end of the step.
    pub after_step: Arc<AtomicBool>,
    /// Stops now.
    pub now: Arc<AtomicBool>,
}

pub(crate) struct Feed {
    current: Mutex<FeedState>,
    display: Display,
    guards: Vec<SignalGuard>,
    plan: Vec<PlanStep>,
    campaign: Campaign,
    /// Points so far. They have a separate lock, so that drawing the map blocks no other thread.
    estimated: Mutex<Vec<IdentifiedPoint>>,
    operator: Arc<Operator>,
    after_step: Arc<AtomicBool>,
}

struct FeedState {
    state: State,
    unsent: VecDeque<Vec<Option<f64>>>,
    last_tick: Option<Instant>,
    /// Excess of each step's actual duration over the planned one, s.
    overrun_s: Vec<f64>,
    /// Whether the operator held the current step: its duration must not influence the forecast.
    held: bool,
    started_steps: usize,
    soak_s: f64,
    /// Planned rig time after the current step, s.
    after_s: f64,
}

impl Feed {
    pub(crate) fn new(run: &LiveRun<'_>) -> Self {
        let display = Display::new(&run.campaign.display);
        let soak_s = soak_s(run.campaign);
        let mut speeds_rpm: Vec<f64> = run.plan.steps.iter().map(|step| step.to.speed_rpm).collect();
        speeds_rpm.sort_by(f64::total_cmp);
        let mut lines: Vec<String> =
            speeds_rpm.iter().map(|rpm| target_line_name(*rpm, run.campaign, &display)).collect();
        lines.dedup();
        let state = State {
            machine: run.campaign.machine.name.clone(),
            campaign: run.campaign.name.clone(),
            units: display.units.clone(),
            lines,
            planned: planned(run.campaign, run.plan, &display),
            steps: run.plan.steps.len(),
            duration_s: soak_s + run.plan.duration_s(),
            pace: run.pace,
            traced: TRACED
                .map(|channel| TracedChannel {
                    name: channel.symbol().to_owned(),
                    unit: display.unit_of(channel).to_owned(),
                })
                .to_vec(),
            rows: VecDeque::new(),
            points: Vec::new(),
            map: LiveMap::default(),
            events: VecDeque::new(),
            now: CurrentValues { phase: "planned".to_owned(), ..CurrentValues::default() },
            outcome: None,
            page: None,
        };
        let current = FeedState {
            state,
            unsent: VecDeque::new(),
            last_tick: None,
            overrun_s: Vec::new(),
            held: false,
            started_steps: 0,
            soak_s,
            after_s: 0.0,
        };
        Feed {
            current: Mutex::new(current),
            display,
            guards: run.campaign.guard_set().signals,
            plan: run.plan.steps.clone(),
            campaign: run.campaign.clone(),
            estimated: Mutex::default(),
            operator: run.operator.clone(),
            after_step: run.after_step.clone(),
        }
    }

    pub(crate) fn snapshot(&self) -> Arc<str> {
        let Ok(mut current) = self.current.lock() else { return Arc::from("{}") };
        self.update_operator_flags(&mut current.state);
        message("snapshot", json!(current.state))
    }

    pub(crate) fn process(&self, event: &SessionEvent) -> Vec<Arc<str>> {
        // Called on the identification thread, so that the rig does not wait for the map.
        let map = match event {
            SessionEvent::PointEstimated(point) => self.map_with(point),
            _ => None,
        };
        let Ok(mut current) = self.current.lock() else { return Vec::new() };
        let current = &mut *current;
        match event {
            SessionEvent::RunStarted { steps, duration_s, .. } => {
                (current.state.steps, current.state.duration_s) = (*steps, *duration_s);
                current.state.now.phase = if current.soak_s > 0.0 {
                    "at rest, for the zero of the sensors".to_owned()
                } else {
                    "warming up at the first point".to_owned()
                };
                vec![self.tick(current)]
            }
            SessionEvent::RigTime { t_s } => {
                current.state.now.t_s = *t_s;
                if current.started_steps == 0 && current.soak_s > 0.0 && *t_s > current.soak_s {
                    current.state.now.phase = "warming up at the first point".to_owned();
                }
                (current.state.now.left_s, current.state.now.left_half_s) = current.left_s();
                Vec::new()
            }
            SessionEvent::Readings { t_s, values } => {
                self.readings(&mut current.state.now.readings, values);
                let shown = |channel: &Channel| {
                    let found = values.iter().find(|(other, _)| other == channel);
                    found.map(|(_, value)| self.display.reading(*channel, *value))
                };
                let row: Vec<Option<f64>> =
                    std::iter::once(Some(*t_s)).chain(TRACED.iter().map(shown)).collect();
                for rows in [&mut current.state.rows, &mut current.unsent] {
                    rows.push_back(row.clone());
                    while rows.len() > TRACE_ROWS {
                        rows.pop_front();
                    }
                }
                if current.last_tick.is_none_or(|at| at.elapsed() >= TICK) {
                    vec![self.tick(current)]
                } else {
                    Vec::new()
                }
            }
            SessionEvent::StepStarted { marker, .. } => {
                self.step(current, marker);
                vec![self.tick(current)]
            }
            SessionEvent::StepEnded(marker) => {
                let held = std::mem::replace(&mut current.held, self.operator.is_holding());
                let planned_s = self.plan.get(marker.index).filter(|_| !held).map(|step| step.dwell_s);
                current
                    .overrun_s
                    .extend(planned_s.map(|planned_s| marker.end_s - marker.start_s - planned_s));
                Vec::new()
            }
            SessionEvent::Reported(event) => {
                let entry = LoggedMessage { t_s: event.t_s, message: event.message.clone() };
                let new = message("event", json!(entry));
                current.state.events.push_back(entry);
                while current.state.events.len() > MAX_EVENTS {
                    current.state.events.pop_front();
                }
                vec![new, self.tick(current)]
            }
            SessionEvent::PointEstimated(point) => {
                let shown = live_point(point, &self.campaign, &self.display);
                let new = message("point", json!(shown));
                if current.state.points.len() < MAX_POINTS {
                    current.state.points.push(shown);
                }
                let drawn = map.map(|map| {
                    let new = message("map", json!({ "map": map }));
                    current.state.map = map;
                    new
                });
                std::iter::once(new).chain(drawn).collect()
            }
            SessionEvent::Progress { what, .. } => {
                (current.state.now.phase, current.state.now.step) = (what.clone(), None);
                vec![self.tick(current)]
            }
            SessionEvent::RigReleased
            | SessionEvent::PointIdentified(_)
            | SessionEvent::PiecesDone { .. } => Vec::new(),
        }
    }

    fn map_with(&self, point: &IdentifiedPoint) -> Option<LiveMap> {
        let mut estimated = self.estimated.lock().ok()?;
        if estimated.len() < MAX_POINTS {
            estimated.push(point.clone());
        }
        Some(live_map(&estimated, &self.campaign, &self.display))
    }

    pub(crate) fn show_command(&self, command: OperatorCommand) {
        if let Ok(mut current) = self.current.lock() {
            current.held |= command == OperatorCommand::Hold;
            let now = &mut current.state.now;
            match command {
                OperatorCommand::Hold => now.holds = true,
                OperatorCommand::Continue => now.holds = false,
                OperatorCommand::StopAfterStep | OperatorCommand::SafeNow => now.stops = true,
            }
        }
    }

    pub(crate) fn show_end(&self, outcome: &str, page: Option<&Path>) -> Arc<str> {
        let Ok(mut current) = self.current.lock() else { return Arc::from("{}") };
        current.state.outcome = Some(outcome.to_owned());
        current.state.page = page.map(|page| page.display().to_string());
        let end = json!({ "outcome": current.state.outcome, "page": current.state.page });
        message("end", end)
    }

    fn step(&self, current: &mut FeedState, marker: &StepMarker) {
        let forecast = self.plan.get(marker.index);
        current.started_steps = marker.number().unwrap_or(current.started_steps);
        if let Some(forecast) = forecast {
            current.after_s = current.state.duration_s - current.soak_s - forecast.start_s - forecast.dwell_s;
        }
        let place = marker.to.map(|to| {
            let line = target_line_name(to.speed_rpm, &self.campaign, &self.display);
            format!(
                "{line} {}, valve area {}",
                self.display.units.speed,
                valve_area_text(to.valve_opening_ratio)
            )
        });
        current.state.now.phase = "step".to_owned();
        current.state.now.step = Some(Step {
            step: marker.number(),
            place: place.unwrap_or_default(),
            start_s: marker.start_s,
            end_s: marker.end_s,
            settle_s: forecast.and_then(|step| step.predicted.settle_s),
        });
    }

    fn readings(&self, shown: &mut Vec<Reading>, values: &[(Channel, f64)]) {
        *shown = values
            .iter()
            .filter(|(channel, _)| channel.info().group != mapper_core::Group::Command)
            .map(|(channel, value)| {
                let guard = self.guards.iter().find(|guard| guard.channel == *channel);
                let bound = |of: fn(&SignalGuard) -> Option<f64>| {
                    guard.and_then(of).map(|inside| self.display.reading(*channel, inside))
                };
                Reading {
                    symbol: channel.symbol(),
                    what: channel.info().description,
                    unit: self.display.unit_of(*channel).to_owned(),
                    value: self.display.reading(*channel, *value),
                    shown: self.display.shown_reading(*channel, *value),
                    low: bound(|guard| guard.below),
                    high: bound(|guard| guard.above),
                }
            })
            .collect();
    }

    fn update_operator_flags(&self, state: &mut State) {
        state.now.holds = self.operator.is_holding();
        state.now.stops = self.after_step.load(Ordering::SeqCst);
    }

    fn tick(&self, current: &mut FeedState) -> Arc<str> {
        self.update_operator_flags(&mut current.state);
        current.last_tick = Some(Instant::now());
        let rows: Vec<Vec<Option<f64>>> = current.unsent.drain(..).collect();
        message("tick", json!({ "now": current.state.now, "rows": rows }))
    }
}

impl FeedState {
    /// Remaining rig time, s, and half-width of its 95 % interval. Future steps are assumed to exceed their plan as the past ones did.
    fn left_s(&self) -> (f64, f64) {
        let (state, count) = (&self.state, self.overrun_s.len() as f64);
        let remaining_steps = state.steps.saturating_sub(self.started_steps) as f64;
        let mean_s = if count > 0.0 { self.overrun_s.iter().sum::<f64>() / count } else { 0.0 };
        let variance =
            self.overrun_s.iter().map(|s| (s - mean_s).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
        // Each future step has its own scatter; all share the error of the mean.
        let sigma_s = (variance * remaining_steps * (1.0 + remaining_steps / count.max(1.0))).sqrt();
        let planned_s = match &state.now.step {
            Some(step) => (step.end_s - state.now.t_s).max(0.0) + self.after_s,
            None => state.duration_s - state.now.t_s,
        };
        ((planned_s + mean_s * remaining_steps).max(0.0), mapper_core::half_width_95(sigma_s))
    }
}

fn message(kind: &str, mut data: Value) -> Arc<str> {
    data["type"] = kind.into();
    // JSON on one line, because a line break would end the server-sent event.
    Arc::from(data.to_string())
}
