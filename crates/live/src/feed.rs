//! Converts session events into messages for browsers.

use crate::live_run::LiveRun;
use crate::operator_commands::OperatorCommand;
use crate::state::{
    LoggedMessage, MAX_EVENTS, MAX_POINTS, Now, Reading, State, Step, TRACE_ROWS, TracedChannel,
};
use mapper_campaign::Campaign;
use mapper_core::{Channel, IdentifiedPoint, PlanStep, SignalGuard, StepMarker};
use mapper_report::Display;
use mapper_report::page::{LiveMap, live_map, live_point, planned};
use mapper_session::{Operator, SessionEvent, soak_s};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Minimum interval of updates for values that change all the time.
const TICK: Duration = Duration::from_millis(200);
/// Channels with a chart of the last minutes.
const TRACED: [Channel; 6] =
    [Channel::T2, Channel::Tc, Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P2, Channel::P3];

/// Keeps the state and returns its changes.
pub(crate) struct Feed {
    kept: Mutex<FeedState>,
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
    /// Rows not yet sent to browsers.
    unsent: VecDeque<Vec<Option<f64>>>,
    ticked: Option<Instant>,
    /// Excess of each step's actual duration over the planned one, s.
    overrun_s: Vec<f64>,
    /// Whether the operator held the current step: its duration must not influence the forecast.
    held: bool,
    /// Number of started steps.
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
        let mut lines: Vec<String> = speeds_rpm.iter().map(|rpm| display.line_name(*rpm)).collect();
        lines.dedup();
        let state = State {
            machine: run.campaign.machine.name.clone(),
            campaign: run.campaign.name.clone(),
            units: display.units().clone(),
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
            now: Now { phase: "planned".to_owned(), ..Now::default() },
            outcome: None,
            page: None,
        };
        let kept = FeedState {
            state,
            unsent: VecDeque::new(),
            ticked: None,
            overrun_s: Vec::new(),
            held: false,
            started_steps: 0,
            soak_s,
            after_s: 0.0,
        };
        Feed {
            kept: Mutex::new(kept),
            display,
            guards: run.campaign.guard_set().signals,
            plan: run.plan.steps.clone(),
            campaign: run.campaign.clone(),
            estimated: Mutex::default(),
            operator: run.operator.clone(),
            after_step: run.after_step.clone(),
        }
    }

    /// The complete state.
    pub(crate) fn snapshot(&self) -> Arc<str> {
        let Ok(mut kept) = self.kept.lock() else { return Arc::from("{}") };
        self.update_operator_flags(&mut kept.state);
        message("snapshot", json!(kept.state))
    }

    /// Processes an event and returns messages for the observers.
    pub(crate) fn process(&self, event: &SessionEvent) -> Vec<Arc<str>> {
        // Called on the identification thread, so that the rig does not wait for the map.
        let map = match event {
            SessionEvent::PointEstimated(point) => self.map_with(point),
            _ => None,
        };
        let Ok(mut kept) = self.kept.lock() else { return Vec::new() };
        let kept = &mut *kept;
        match event {
            SessionEvent::RunStarted { steps, duration_s, .. } => {
                (kept.state.steps, kept.state.duration_s) = (*steps, *duration_s);
                kept.state.now.phase = match kept.soak_s > 0.0 {
                    true => "at rest, for the zero of the sensors".to_owned(),
                    false => "warming up at the first point".to_owned(),
                };
                vec![self.tick(kept)]
            }
            SessionEvent::RigTime { t_s } => {
                kept.state.now.t_s = *t_s;
                if kept.started_steps == 0 && kept.soak_s > 0.0 && *t_s > kept.soak_s {
                    kept.state.now.phase = "warming up at the first point".to_owned();
                }
                (kept.state.now.left_s, kept.state.now.left_half_s) = kept.left_s();
                Vec::new()
            }
            SessionEvent::Readings { t_s, values } => {
                self.readings(&mut kept.state.now.readings, values);
                let shown = |channel: &Channel| {
                    let found = values.iter().find(|(other, _)| other == channel);
                    found.map(|(_, value)| self.display.reading(*channel, *value))
                };
                let row: Vec<Option<f64>> =
                    std::iter::once(Some(*t_s)).chain(TRACED.iter().map(shown)).collect();
                for rows in [&mut kept.state.rows, &mut kept.unsent] {
                    rows.push_back(row.clone());
                    while rows.len() > TRACE_ROWS {
                        rows.pop_front();
                    }
                }
                match kept.ticked.is_none_or(|at| at.elapsed() >= TICK) {
                    true => vec![self.tick(kept)],
                    false => Vec::new(),
                }
            }
            SessionEvent::StepStarted(marker) => {
                self.step(kept, marker);
                vec![self.tick(kept)]
            }
            SessionEvent::StepEnded(marker) => {
                let held = std::mem::replace(&mut kept.held, self.operator.is_holding());
                let planned_s = self.plan.get(marker.index).filter(|_| !held).map(|step| step.dwell_s);
                kept.overrun_s.extend(planned_s.map(|planned_s| marker.end_s - marker.start_s - planned_s));
                Vec::new()
            }
            SessionEvent::Reported(event) => {
                let entry = LoggedMessage { t_s: event.t_s, message: event.message.clone() };
                let new = message("told", json!(entry));
                kept.state.events.push_back(entry);
                while kept.state.events.len() > MAX_EVENTS {
                    kept.state.events.pop_front();
                }
                vec![new, self.tick(kept)]
            }
            SessionEvent::PointEstimated(point) => {
                let shown = live_point(point, &self.display);
                let new = message("point", json!(shown));
                if kept.state.points.len() < MAX_POINTS {
                    kept.state.points.push(shown);
                }
                let drawn = map.map(|map| {
                    let new = message("map", json!({ "map": map }));
                    kept.state.map = map;
                    new
                });
                std::iter::once(new).chain(drawn).collect()
            }
            SessionEvent::Progress { what, .. } => {
                (kept.state.now.phase, kept.state.now.step) = (what.clone(), None);
                vec![self.tick(kept)]
            }
            SessionEvent::RigReleased
            | SessionEvent::PointIdentified(_)
            | SessionEvent::PiecesDone { .. } => Vec::new(),
        }
    }

    /// The map with one additional point.
    fn map_with(&self, point: &IdentifiedPoint) -> Option<LiveMap> {
        let mut estimated = self.estimated.lock().ok()?;
        if estimated.len() < MAX_POINTS {
            estimated.push(point.clone());
        }
        Some(live_map(&estimated, &self.campaign, &self.display))
    }

    /// Shows a pressed button before the run has processed it.
    pub(crate) fn show_command(&self, asked: OperatorCommand) {
        if let Ok(mut kept) = self.kept.lock() {
            kept.held |= asked == OperatorCommand::Hold;
            let now = &mut kept.state.now;
            match asked {
                OperatorCommand::Hold => now.holds = true,
                OperatorCommand::Continue => now.holds = false,
                OperatorCommand::StopAfterStep | OperatorCommand::SafeNow => now.stops = true,
            }
        }
    }

    /// Shows the end of the run.
    pub(crate) fn show_end(&self, outcome: &str, page: Option<&Path>) -> Arc<str> {
        let Ok(mut kept) = self.kept.lock() else { return Arc::from("{}") };
        kept.state.outcome = Some(outcome.to_owned());
        kept.state.page = page.map(|page| page.display().to_string());
        let end = json!({ "outcome": kept.state.outcome, "page": kept.state.page });
        message("end", end)
    }

    fn step(&self, kept: &mut FeedState, marker: &StepMarker) {
        let forecast = self.plan.get(marker.index);
        kept.started_steps = marker.number().unwrap_or(kept.started_steps);
        if let Some(forecast) = forecast {
            kept.after_s = kept.state.duration_s - kept.soak_s - forecast.start_s - forecast.dwell_s;
        }
        let place = marker.to.map(|to| {
            let (_, opening) = to.shown();
            format!("{} {}, opening {opening}", self.display.speed(to.speed_rpm), self.display.units().speed)
        });
        kept.state.now.phase = "step".to_owned();
        kept.state.now.step = Some(Step {
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

    fn tick(&self, kept: &mut FeedState) -> Arc<str> {
        self.update_operator_flags(&mut kept.state);
        kept.ticked = Some(Instant::now());
        let rows: Vec<Vec<Option<f64>>> = kept.unsent.drain(..).collect();
        message("tick", json!({ "now": kept.state.now, "rows": rows }))
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
