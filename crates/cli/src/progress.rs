//! The one progress bar: draws on a terminal alone.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mapper_session::SessionEvent;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// How often the clock of a bar is drawn.
const TICK: Duration = Duration::from_millis(250);

/// Shows what a session tells. It may be told from many threads.
pub struct Progress {
    bar: ProgressBar,
    /// Steps of the run.
    steps: AtomicUsize,
}

impl Progress {
    /// A bar that is drawn with the first event.
    pub fn new() -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        Progress { bar: ProgressBar::with_draw_target(None, target), steps: AtomicUsize::new(0) }
    }

    /// Shows an event.
    pub fn show(&self, event: &SessionEvent) {
        match event {
            SessionEvent::RunStarted { steps, duration_s, .. } => {
                self.steps.store(*steps, Ordering::Relaxed);
                let template = "{msg:34} [{wide_bar}] {pos}/{len} s of the rig's time, {eta} left";
                self.begin(duration_s.ceil() as u64, template);
                self.bar.set_message("soak, warm-up");
            }
            SessionEvent::RigTime { t_s } => self.bar.set_position(*t_s as u64),
            SessionEvent::StepStarted(marker) => {
                let place = marker.to.map(|point| point.to_string()).unwrap_or_default();
                let steps = self.steps.load(Ordering::Relaxed);
                self.bar.set_message(format!("step {}/{steps} {place}", marker.index + 1));
            }
            SessionEvent::Told(event) => {
                self.bar.println(format!("{:8.1} s  {}", event.t_s, event.message));
            }
            SessionEvent::Progress { done_ratio, what } => {
                self.begin(100, "[{bar:40}] {percent:>3} % {elapsed_precise} {msg}");
                // Between two reports the clock shows that work goes on.
                self.bar.enable_steady_tick(TICK);
                self.bar.set_position((100.0 * done_ratio) as u64);
                self.bar.set_message(what.clone());
            }
            SessionEvent::PiecesDone { done, of } => self.pieces(*done, *of),
            SessionEvent::StepEnded(_) | SessionEvent::PointIdentified(_) => {}
        }
    }

    /// Shows how many of many pieces of work are done.
    pub fn pieces(&self, done: usize, of: usize) {
        self.begin(of as u64, "[{wide_bar}] {pos}/{len}, {eta} left");
        self.bar.set_position(done as u64);
    }

    /// Takes the bar away.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }

    /// Gives the bar its length and its look, once.
    fn begin(&self, length: u64, template: &str) {
        if self.bar.length().is_some() {
            return;
        }
        self.bar.set_length(length);
        // A template that does not parse leaves the plain style.
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style.progress_chars("=> "));
        }
    }
}
