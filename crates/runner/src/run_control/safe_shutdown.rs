//! The safe shutdown after a fault: first the safe state, then the records of the reason.

use crate::guards::guard::CommandedState;
use crate::run_control::protection::Protection;
use crate::run_control::run::{Halt, Run, panic_message};
use crate::run_control::run_error::RunError;
use mapper_core::{BackendError, Event, EventKind, GuardName, RunEnding, SampleBatch, Setpoints};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Time between two setpoints of the run-down, s.
const STEP_S: f64 = 0.1;
/// How long the rig is observed after it was made safe, s: the recording shows that it reached the safe state.
const OBSERVATION_S: f64 = 5.0;
/// Number of safe-state commands before the rig counts as lost.
const MAX_ATTEMPTS: usize = 3;
/// Time between two of these commands, s of the run's clock: an interrupted link may recover.
const PAUSE_S: f64 = 0.5;

/// A panic of the backend, as its error.
#[derive(Debug, thiserror::Error)]
#[error("the backend failed: {0}")]
struct PanicError(String);

/// Contains a panic of an observer, so that the shutdown continues.
pub(crate) fn catch_panic(report: impl FnOnce() -> Result<(), RunError>) -> Result<(), RunError> {
    let panicked =
        |panic: Box<dyn std::any::Any + Send>| Err(RunError::Panicked { message: panic_message(&*panic) });
    catch_unwind(AssertUnwindSafe(report)).unwrap_or_else(panicked)
}

impl Run<'_, '_> {
    /// Makes the rig safe, then reports the reason. It cannot be interrupted and takes a bounded time.
    pub(crate) fn shut_down(&mut self, halt: Halt) -> Result<RunEnding, RunError> {
        // The first command is sent before anything is written: a disk may be slow.
        let start = self.begin_run_down();
        // A step that missed its speed does not count, whatever its duration.
        let step_counts = !matches!(&halt, Halt::Tripped(trip, _) if trip.guard == GuardName::Speed);
        let (end, kind, message, unreported) = match halt {
            Halt::Interrupted => (
                Ok(RunEnding::Interrupted { t_s: self.now_s }),
                EventKind::Interrupted,
                "stopped by the operator".to_owned(),
                None,
            ),
            Halt::Tripped(trip, unreported) => {
                let reason = trip.reason.clone();
                (Ok(RunEnding::Tripped(trip)), EventKind::GuardTripped, reason, unreported)
            }
            Halt::Cut(trip) => {
                let reason = trip.reason.clone();
                (Ok(RunEnding::Tripped(trip)), EventKind::GuardTripped, reason, None)
            }
            Halt::Failed(error) => {
                let message = error.to_string();
                (Err(error), EventKind::Note, message, None)
            }
        };
        // The error that ended the run takes precedence over errors while reporting it.
        let reported = catch_panic(|| self.report_reason(unreported.as_deref(), step_counts, kind, &message));
        let safe = self.run_down(start).and_then(|()| self.cut_air());
        let reported = reported.and_then(|()| catch_panic(|| self.report_safe(safe.as_ref().err())));
        match (end, safe) {
            (Err(error), Err(source)) => Err(RunError::NotSafe { why: error.to_string(), source }),
            (Ok(_), Err(source)) => Err(RunError::NotSafe { why: message, source }),
            (Err(error), Ok(())) => Err(error),
            (Ok(end), Ok(())) => {
                reported?;
                Ok(end)
            }
        }
    }

    fn report_reason(
        &mut self,
        unreported: Option<&SampleBatch>,
        step_counts: bool,
        kind: EventKind,
        message: &str,
    ) -> Result<(), RunError> {
        if let Some(batch) = unreported {
            self.runner.observer.on_batch(batch)?;
        }
        match self.open_step.take() {
            Some(marker) if step_counts => self.runner.observer.on_step_end(&marker)?,
            Some(marker) => self.runner.observer.on_step_abandoned(&marker)?,
            None => {}
        }
        // The rig has reported its own trip in the batch.
        let was_reported =
            unreported.is_some_and(|batch| batch.events.iter().any(|event| event.message == message));
        let message = if was_reported { "the run ends, because the rig tripped" } else { message };
        self.runner.observer.on_event(&Event { t_s: self.now_s, kind, message: message.to_owned() })?;
        Ok(self.pass_notes()?)
    }

    fn report_safe(&mut self, failed: Option<&BackendError>) -> Result<(), RunError> {
        let t_s = self.now_s;
        if let Some(error) = failed {
            let message = format!("the rig did not confirm its safe state: {error}");
            return Ok(self.runner.observer.on_event(&Event { t_s, kind: EventKind::Latched, message })?);
        }
        let message = "air off, valve open".to_owned();
        self.runner.observer.on_event(&Event { t_s, kind: EventKind::SafeState, message })?;
        self.runner.clock.wait_until(t_s + OBSERVATION_S);
        // The rig is already safe: a panic of the backend here costs only the last seconds of the recording.
        match catch_unwind(AssertUnwindSafe(|| self.runner.backend.poll(t_s + OBSERVATION_S))) {
            Ok(batch) => Ok(self.runner.observer.on_batch(&batch?)?),
            Err(_) => Ok(()),
        }
    }

    /// Setpoints `after_s` into the run-down; `None` if the air is to be cut.
    fn run_down_setpoints(&self, from: &Setpoints, after_s: f64) -> Option<Setpoints> {
        let Protection { safe, p3_min_pa, accepts, .. } = self.protection;
        safe.setpoints(from, after_s, *p3_min_pa, accepts.as_ref())
    }

    /// Sends the first command of the run-down. Returns the setpoints from which it starts, or `None` if the air is to be cut at once.
    fn begin_run_down(&mut self) -> Option<Setpoints> {
        let from = self.sent?;
        self.commanded = CommandedState::default();
        let first = self.run_down_setpoints(&from, STEP_S)?;
        let sent = catch_unwind(AssertUnwindSafe(|| self.runner.backend.set(&first)));
        matches!(sent, Ok(Ok(()))).then_some(from)
    }

    /// Lowers P3 step by step. Any failure ends the run-down, and the air is cut at once.
    fn run_down(&mut self, from: Option<Setpoints>) -> Result<(), BackendError> {
        let Some(from) = from else { return Ok(()) };
        let steps = (self.protection.safe.within_s / STEP_S).ceil().clamp(0.0, 1e5) as usize;
        let mut recorded = true;
        for step in 1..=steps {
            let next_s = self.now_s + STEP_S;
            let polled = catch_unwind(AssertUnwindSafe(|| {
                self.runner.clock.wait_until(next_s);
                self.runner.backend.poll(next_s)
            }));
            let Ok(Ok(batch)) = polled else { break };
            self.now_s = next_s;
            recorded = recorded && self.runner.observer.on_batch(&batch).is_ok();
            let Some(next) = self.run_down_setpoints(&from, STEP_S * (step + 1) as f64) else { break };
            let sent = catch_unwind(AssertUnwindSafe(|| self.runner.backend.set(&next)));
            if !matches!(sent, Ok(Ok(()))) {
                break;
            }
        }
        Ok(())
    }

    /// Shuts the air off, with a limited number of retries.
    fn cut_air(&mut self) -> Result<(), BackendError> {
        let mut last = Ok(());
        for attempt in 0..MAX_ATTEMPTS {
            if attempt > 0 {
                self.now_s += PAUSE_S;
                self.runner.clock.wait_until(self.now_s);
            }
            last =
                catch_unwind(AssertUnwindSafe(|| self.runner.backend.make_safe())).unwrap_or_else(|panic| {
                    let source = Box::new(PanicError(panic_message(&*panic)));
                    Err(BackendError::Lost { t_s: self.now_s, source })
                });
            if last.is_ok() {
                break;
            }
        }
        last
    }
}
