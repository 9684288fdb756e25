//! Who looks on while a campaign runs: the recorder and the progress bar.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mapper_core::{Event, Plan, SampleBatch, StepMarker};
use mapper_record::{RecordingWriter, StepPhase};
use mapper_runner::{ObserverError, RunObserver};
use std::io::IsTerminal;

/// Writes everything into the run's recording.
pub struct Recorder {
    writer: RecordingWriter,
}

impl Recorder {
    /// Records into `writer`.
    pub fn new(writer: RecordingWriter) -> Self {
        Recorder { writer }
    }

    /// Ends the file.
    pub fn finish(self) -> Result<(), mapper_record::RecordError> {
        self.writer.finish()
    }
}

impl RunObserver for Recorder {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::Start).map_err(ObserverError::of)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        // The batch's own events are written with it.
        self.writer.write_batch(batch).map_err(ObserverError::of)
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.writer.write_event(event).map_err(ObserverError::of)
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::End).map_err(ObserverError::of)
    }
}

/// A progress bar over the run's own time; draws on a terminal alone.
pub struct Progress {
    bar: ProgressBar,
    steps: usize,
}

impl Progress {
    /// A bar for this plan, after a soak of so many seconds.
    pub fn new(plan: &Plan, soak_s: f64) -> Self {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some((soak_s + plan.duration_s()).ceil() as u64), target);
        let template = "{msg:34} [{wide_bar}] {pos}/{len} s of the rig's time, {eta} left";
        // A template that does not parse leaves the plain style.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(if soak_s > 0.0 { "soak, warm-up" } else { "warm-up" });
        Progress { bar, steps: plan.steps.len() }
    }

    /// Takes the bar away.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl RunObserver for Progress {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let place = marker.to.map(|point| point.to_string()).unwrap_or_default();
        self.bar.set_message(format!("step {}/{} {place}", marker.index + 1, self.steps));
        Ok(())
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        if let Some(t_s) = batch.t_s.last() {
            self.bar.set_position(*t_s as u64);
        }
        batch.events.iter().try_for_each(|event| self.on_event(event))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.bar.println(format!("{:8.1} s  {}", event.t_s, event.message));
        Ok(())
    }
}
