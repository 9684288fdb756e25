//! Drives campaigns on virtual stands whose pressure and valve move at other speeds, and states the highest speed, overshoot, surges and time.
//!
//! ```text
//! cargo run --release --locked -p mapper-session --example stand_study -- FILE NAME 'OLD=>NEW' ...
//! ```
//!
//! Each `OLD=>NEW` replaces a part of the campaign file. With `plan` in place of a replacement, only the plan is made. With `recordings` in place of
//! FILE, the others are recordings, and a line of JSON states the highest speed, overshoot, surges and duration of each: `benches/stands.py`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout, missing_docs)]

use mapper_core::{Channel, Event, EventKind, OperatingPoint, Plan, Recording, SampleBatch, StepMarker};
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_runner::{ObserverError, PlanSteps, RunObserver};
use mapper_session::{Registry, drive, nominal_model, plan};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Interval of a trace, s.
const TRACE_S: f64 = 0.5;

#[derive(Default)]
struct Seen {
    step: Option<(StepMarker, f64)>,
    /// Overshoot over the higher target of each step's jump, and the step's number.
    overshoots: Vec<(f64, usize)>,
    events: Vec<Event>,
    highest_rpm: f64,
    last_s: f64,
    lowest_margin: f64,
    off: Vec<f64>,
    recent: Vec<f64>,
    traces: bool,
}

impl RunObserver for Seen {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.step = Some((*marker, 0.0));
        Ok(())
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let truth_of = |name: &str| {
            batch.truth.iter().find(|column| column.name == name).map(|column| &column.values[..])
        };
        let truth = truth_of("speed_rpm");
        for (flow, surge) in
            truth_of("flow_kg_s").into_iter().flatten().zip(truth_of("surge_flow_kg_s").into_iter().flatten())
        {
            // Flow is meaningful from the first step on.
            if self.step.is_some() && flow.is_finite() {
                self.lowest_margin = self.lowest_margin.min(flow / surge - 1.0);
            }
        }
        let speeds = truth.unwrap_or_else(|| batch.column(Channel::ShaftSpeed).unwrap());
        let highest = speeds.iter().copied().fold(0.0, f64::max);
        self.highest_rpm = self.highest_rpm.max(highest);
        if let Some((_, of_step)) = &mut self.step {
            *of_step = of_step.max(highest);
        }
        if self.traces
            && let Some((marker, _)) = self.step
            && (batch.t_s.last().copied().unwrap_or(0.0) / TRACE_S).floor() > (self.last_s / TRACE_S).floor()
        {
            let last =
                |channel: Channel| batch.column(channel).and_then(<[f64]>::last).copied().unwrap_or(f64::NAN);
            println!(
                "    {:.1} step {} +{:.1}: to {:.0} rpm, N {:.0}, P3 {:.1} of {:.1} kPa, valve {:.3}",
                self.last_s,
                marker.index + 1,
                self.last_s - marker.start_s,
                marker.to.map_or(0.0, |to| to.speed_rpm),
                last(Channel::ShaftSpeed),
                last(Channel::P3) / 1e3,
                last(Channel::P3Command) / 1e3,
                last(Channel::ValveCommand)
            );
        }
        self.recent.extend(speeds);
        let from = self.recent.len().saturating_sub(100);
        self.recent.drain(..from);
        self.last_s = batch.t_s.last().copied().unwrap_or(self.last_s);
        batch.events.iter().try_for_each(|event| self.on_event(event))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.events.push(event.clone());
        Ok(())
    }

    fn on_step_end(&mut self, _: &StepMarker) -> Result<(), ObserverError> {
        if let Some((marker, highest_rpm)) = self.step.take() {
            let rpm = |point: Option<OperatingPoint>| point.map_or(0.0, |point| point.speed_rpm);
            let target_rpm = rpm(marker.from).max(rpm(marker.to));
            self.overshoots.push((highest_rpm / target_rpm - 1.0, marker.index + 1));
            let mean_rpm = self.recent.iter().sum::<f64>() / self.recent.len() as f64;
            self.off.push((mean_rpm / rpm(marker.to) - 1.0).abs());
        }
        Ok(())
    }
}

fn describe(plan: &Plan) -> String {
    let jumps = || plan.steps.iter().filter_map(|step| step.transition);
    let highest = jumps().map(|jump| jump.highest_speed_rpm).fold(0.0, f64::max);
    let margin = jumps().map(|jump| jump.lowest_surge_margin_ratio).fold(f64::INFINITY, f64::min);
    let arrival_s = jumps().map(|jump| jump.arrival_s).fold(0.0, f64::max);
    let around = plan.steps.iter().filter(|step| step.kind == mapper_core::StepKind::Repeat).count();
    format!(
        "plan: {} steps ({around} revisits), {:.0} min, N {:.1} krpm, margin {:.1} %, arrival {arrival_s:.1} s",
        plan.steps.len(),
        plan.duration_s() / 60.0,
        highest / 1e3,
        100.0 * margin
    )
}

/// Of a recording: highest speed, rpm, largest overshoot over the higher target of a jump, number of surges and duration, s.
fn describe_recording(file: &str) -> String {
    let options = ReadOptions::default();
    let Recording { series, steps, events, .. } =
        read_recording(Path::new(file), &ChannelMap::native(), &options).unwrap().recording;
    let highest_rpm = |start_s: f64, end_s: f64| {
        series[&Channel::ShaftSpeed].slice(start_s, end_s).1.iter().copied().fold(0.0, f64::max)
    };
    let overshoot = |step: &StepMarker| {
        let rpm = |point: Option<OperatingPoint>| point.map_or(0.0, |point| point.speed_rpm);
        highest_rpm(step.start_s, step.end_s) / rpm(step.from).max(rpm(step.to)) - 1.0
    };
    let surges = events.iter().filter(|event| event.kind == EventKind::SurgeEntered).count();
    let run_s = steps.last().map_or(0.0, |last| last.end_s - steps[0].start_s);
    format!(
        "{{\"highest_rpm\": {}, \"overshoot_ratio\": {}, \"surges\": {surges}, \"steps_s\": {run_s}}}",
        highest_rpm(0.0, f64::MAX),
        steps.iter().map(overshoot).fold(0.0, f64::max)
    )
}

fn main() {
    let mut arguments = std::env::args().skip(1).peekable();
    if arguments.next_if_eq("recordings").is_some() {
        return arguments.for_each(|file| println!("{}", describe_recording(&file)));
    }
    let (file, name) = (arguments.next().unwrap(), arguments.next().unwrap());
    let mut text = std::fs::read_to_string(&file).unwrap();
    let (mut only_plan, mut is_loud, mut traces) = (false, false, false);
    for argument in arguments {
        match argument.split_once("=>") {
            Some((old, new)) => {
                assert!(text.contains(old), "{old}");
                text = text.replacen(old, &new.replace("\\n", "\n"), 1);
            }
            None => {
                only_plan |= argument == "plan";
                is_loud |= argument == "loud";
                traces |= argument == "trace";
            }
        }
    }
    let read = |path: &Path| std::fs::read_to_string(path);
    let campaign = match mapper_campaign::check(&text, Path::new(&file), &read) {
        Ok(campaign) => campaign,
        Err(findings) => return println!("| {name} | {findings}"),
    };
    let registry = Registry {
        backends: vec![mapper_backends::virtual_lab::PLUGIN],
        effects: mapper_effects::catalogue(),
        ..Registry::empty()
    };
    let model = nominal_model(&campaign).unwrap();
    let plan = match plan(&campaign, &model) {
        Ok(plan) => plan,
        Err(error) => return println!("| {name} | no plan: {error}"),
    };
    println!("{name}: {}", describe(&plan));
    if only_plan {
        return;
    }
    let mut backend = registry.make_backend(&campaign, &model).unwrap();
    let mut seen = Seen { lowest_margin: f64::INFINITY, traces, ..Seen::default() };
    let mut steps = PlanSteps::new(&plan);
    let end = drive(&campaign, &model, &mut steps, backend.as_mut(), &mut seen, &AtomicBool::new(false));
    let count = |kind: EventKind| seen.events.iter().filter(|event| event.kind == kind).count();
    seen.overshoots.sort_by(|a, b| b.0.total_cmp(&a.0));
    seen.off.sort_by(f64::total_cmp);
    let end = match end {
        Ok(ending) => format!("{ending:?}").chars().take(150).collect::<String>(),
        Err(error) => error.to_string(),
    };
    println!(
        "| {name} | {:.1} krpm | overshoots {:.1?} | surges {} | margin {:.1} % | not reached {} | worst end {:.2} % | {:.0} min | {end} |",
        seen.highest_rpm / 1e3,
        seen.overshoots.iter().take(3).map(|(ratio, step)| (100.0 * ratio, *step)).collect::<Vec<_>>(),
        count(EventKind::SurgeEntered),
        100.0 * seen.lowest_margin,
        count(EventKind::SpeedNotReached),
        100.0 * seen.off.last().copied().unwrap_or(f64::NAN),
        seen.last_s / 60.0
    );
    if is_loud {
        for event in &seen.events {
            println!("    {:.1} s {:?}: {}", event.t_s, event.kind, event.message);
        }
    }
}
