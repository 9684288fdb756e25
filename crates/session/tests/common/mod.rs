//! Campaigns driven on the virtual lab, and what became of the speed of each step.

pub mod shipped;

use mapper_campaign::Campaign;
use mapper_core::{Channel, Event, EventKind, RunEnding, SampleBatch, StepMarker};
use mapper_runner::{ObserverError, PlanSteps, RunObserver};
use mapper_session::{Registry, drive, nominal_model, plan};
use std::sync::atomic::AtomicBool;

/// A step as it went.
#[derive(Debug, Clone)]
pub struct Step {
    pub marker: StepMarker,
    /// Time after the jump s, speed rpm, commanded P3 Pa.
    pub rows: Vec<(f64, f64, f64)>,
    /// Whether the run reported that its speed was not reached.
    pub not_reached: bool,
}

impl Step {
    pub fn target_rpm(&self) -> f64 {
        self.marker.to.unwrap().speed_rpm
    }

    /// Mean speed between two times after the jump, over its target, minus one.
    pub fn off_ratio(&self, start_s: f64, end_s: f64) -> f64 {
        let speeds: Vec<f64> =
            self.rows.iter().filter(|row| row.0 >= start_s && row.0 < end_s).map(|row| row.1).collect();
        speeds.iter().sum::<f64>() / speeds.len() as f64 / self.target_rpm() - 1.0
    }

    /// The same over the last 10 s.
    pub fn end_off_ratio(&self) -> f64 {
        let end_s = self.marker.end_s - self.marker.start_s;
        self.off_ratio(end_s - 10.0, end_s)
    }

    /// How far the step overshoots its target: the highest mean of a second over it, ratio. `None` if the jump comes from
    /// above or from the same speed.
    pub fn overshoot_ratio(&self) -> Option<f64> {
        let from_below = self.marker.from.is_some_and(|from| from.speed_rpm < self.target_rpm());
        let seconds = (self.marker.end_s - self.marker.start_s) as usize;
        let mean = |second: usize| self.off_ratio(second as f64, second as f64 + 1.0);
        from_below.then(|| (0..seconds).map(mean).fold(f64::NEG_INFINITY, f64::max))
    }

    /// Standard deviation of the commanded P3 about its own course, a straight line over each 30 s from 30 s after the
    /// jump on, Pa.
    pub fn p3_scatter_pa(&self) -> f64 {
        let late: Vec<(f64, f64)> =
            self.rows.iter().filter(|row| row.0 >= 30.0).map(|row| (row.0, row.2)).collect();
        let (mut sum, mut count) = (0.0, 0.0);
        for part in late.chunks(300).filter(|part| part.len() == 300) {
            let n = part.len() as f64;
            let (t, p) = part.iter().fold((0.0, 0.0), |(t, p), row| (t + row.0 / n, p + row.1 / n));
            let (tt, tp) = part
                .iter()
                .fold((0.0, 0.0), |(tt, tp), row| (tt + (row.0 - t).powi(2), tp + (row.0 - t) * (row.1 - p)));
            sum += part.iter().map(|row| (row.1 - p - tp / tt * (row.0 - t)).powi(2)).sum::<f64>();
            count += n - 2.0;
        }
        (sum / f64::max(count, 1.0)).sqrt()
    }
}

/// A whole run.
#[derive(Debug, Clone, Default)]
pub struct Driven {
    pub steps: Vec<Step>,
    pub events: Vec<Event>,
    /// Highest speed at all, rpm.
    pub highest_rpm: f64,
    running: bool,
}

impl RunObserver for Driven {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.running = true;
        self.steps.push(Step { marker: *marker, rows: Vec::new(), not_reached: false });
        Ok(())
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let speeds = batch.column(Channel::ShaftSpeed).unwrap();
        let commands = batch.column(Channel::P3Command).unwrap();
        self.highest_rpm = speeds.iter().copied().fold(self.highest_rpm, f64::max);
        if let (true, Some(step)) = (self.running, self.steps.last_mut()) {
            let start_s = step.marker.start_s;
            let rows = batch.t_s.iter().zip(speeds).zip(commands);
            step.rows.extend(rows.map(|((t_s, speed), command)| (t_s - start_s, *speed, *command)));
        }
        self.events.extend(batch.events.iter().cloned());
        Ok(())
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.events.push(event.clone());
        if let (EventKind::SpeedNotReached, Some(step)) = (event.kind, self.steps.last_mut()) {
            step.not_reached = true;
        }
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.running = false;
        self.steps.last_mut().unwrap().marker = *marker;
        Ok(())
    }
}

/// Drives a campaign on its lab from the first step to the last.
pub fn driven(campaign: &Campaign) -> Driven {
    let (driven, end) = driven_to_the_end(campaign);
    assert_eq!(end, RunEnding::Completed);
    driven
}

/// Drives a campaign on its lab until the run ends.
pub fn driven_to_the_end(campaign: &Campaign) -> (Driven, RunEnding) {
    let registry = Registry {
        backends: vec![mapper_backends::virtual_lab::PLUGIN],
        effects: mapper_effects::catalogue(),
        ..Registry::empty()
    };
    let model = nominal_model(campaign).unwrap();
    let plan = plan(campaign, &model).unwrap();
    let mut backend = registry.make_backend(campaign, &model).unwrap();
    let mut seen = Driven::default();
    let mut steps = PlanSteps::new(&plan);
    let end =
        drive(campaign, &model, &mut steps, backend.as_mut(), &mut seen, &AtomicBool::new(false)).unwrap();
    (seen, end)
}
