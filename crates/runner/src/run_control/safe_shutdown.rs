//! The safe shutdown after a fault: first the safe state, then the records of the reason.

use crate::guards::guard::Commanded;
use crate::run_control::protection::Protection;
use crate::run_control::run::{Halt, Run, RunEnd, words_of};
use crate::run_control::run_error::RunError;
use mapper_core::{BackendError, Event, EventKind, GuardName, SampleBatch, Setpoints};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Time between two setpoints of the run-down, s.
const STEP_S: f64 = 0.1;
/// How long the rig is observed after it was made safe, s: the recording shows that it reached the safe state.
const WATCH_S: f64 = 5.0;
/// Number of safe-state commands before the rig counts as lost.
const TRIES: usize = 3;
/// Time between two of these commands, s of the run's clock: an interrupted link may recover.
const PAUSE_S: f64 = 0.5;

/// A panic of the backend, as its error.
#[derive(Debug, thiserror::Error)]
#[error("the backend failed: {0}")]
struct Panicked(String);

/// Contains a panic of an observer, so that the shutdown continues.
fn contained(report: impl FnOnce() -> Result<(), RunError>) -> Result<(), RunError> {
    let panicked =
        |panic: Box<dyn std::any::Any + Send>| Err(RunError::Panicked { message: words_of(&*panic) });
    catch_unwind(AssertUnwindSafe(report)).unwrap_or_else(panicked)
}

impl Run<'_, '_> {
    /// Makes the rig safe, then reports the reason. It cannot be interrupted and takes a bounded time.
    pub(crate) fn way_out(&mut self, halt: Halt) -> Result<RunEnd, RunError> {
        // The first command is sent before anything is written: a disk may be slow.
        let begun = self.first_command();
        // A step that missed its speed does not count, whatever its duration.
        let counts = !matches!(&halt, Halt::Tripped(trip, _) if trip.guard == GuardName::Speed);
        let (end, kind, message, unseen) = match halt {
            Halt::Interrupted => (
                Ok(RunEnd::Interrupted { t_s: self.now_s }),
                EventKind::Interrupted,
                "stopped by the operator".to_owned(),
                None,
            ),
            Halt::Tripped(trip, unseen) => {
                let reason = trip.reason.clone();
                (Ok(RunEnd::Tripped(trip)), EventKind::GuardTripped, reason, unseen)
            }
            Halt::Cut(trip) => {
                let reason = trip.reason.clone();
                (Ok(RunEnd::Tripped(trip)), EventKind::GuardTripped, reason, None)
            }
            Halt::Failed(error) => {
                let message = error.to_string();
                (Err(error), EventKind::Note, message, None)
            }
        };
        // The error that ended the run takes precedence over errors while reporting it.
        let reported = contained(|| self.report_reason(unseen.as_deref(), counts, kind, &message));
        let safe = self.down(begun).and_then(|()| self.cut_air());
        let reported = reported.and_then(|()| contained(|| self.report_safe(safe.as_ref().err())));
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
        unseen: Option<&SampleBatch>,
        counts: bool,
        kind: EventKind,
        message: &str,
    ) -> Result<(), RunError> {
        if let Some(batch) = unseen {
            self.with.observer.on_batch(batch)?;
        }
        match self.open.take() {
            Some(marker) if counts => self.with.observer.on_step_end(&marker)?,
            Some(marker) => self.with.observer.on_step_abandoned(&marker)?,
            None => {}
        }
        self.with.observer.on_event(&Event { t_s: self.now_s, kind, message: message.to_owned() })?;
        Ok(self.pass_notes()?)
    }

    fn report_safe(&mut self, failed: Option<&BackendError>) -> Result<(), RunError> {
        let t_s = self.now_s;
        if let Some(error) = failed {
            let message = format!("the rig did not confirm its safe state: {error}");
            return Ok(self.with.observer.on_event(&Event { t_s, kind: EventKind::Latched, message })?);
        }
        let message = "air off, valve open".to_owned();
        self.with.observer.on_event(&Event { t_s, kind: EventKind::SafeState, message })?;
        self.with.clock.wait_until(t_s + WATCH_S);
        // The rig is already safe: a panic of the backend here costs only the last seconds of the recording.
        match catch_unwind(AssertUnwindSafe(|| self.with.backend.poll(t_s + WATCH_S))) {
            Ok(batch) => Ok(self.with.observer.on_batch(&batch?)?),
            Err(_) => Ok(()),
        }
    }

    /// Setpoints `after_s` into the run-down; `None` if the air is to be cut.
    fn on_the_way(&self, from: &Setpoints, after_s: f64) -> Option<Setpoints> {
        let Protection { safe, p3_min_pa, accepts, .. } = self.protection;
        safe.setpoints(from, after_s, *p3_min_pa, accepts.as_ref())
    }

    /// Sends the first command of the run-down; returns its starting setpoints if the run-down continues.
    fn first_command(&mut self) -> Option<Setpoints> {
        let from = self.sent?;
        self.commanded = Commanded::default();
        let first = self.on_the_way(&from, STEP_S)?;
        let sent = catch_unwind(AssertUnwindSafe(|| self.with.backend.set(&first)));
        matches!(sent, Ok(Ok(()))).then_some(from)
    }

    /// Lowers P3 step by step. Any failure ends the run-down, and the air is cut at once.
    fn down(&mut self, from: Option<Setpoints>) -> Result<(), BackendError> {
        let Some(from) = from else { return Ok(()) };
        let steps = (self.protection.safe.within_s / STEP_S).ceil().clamp(0.0, 1e5) as usize;
        let mut recorded = true;
        for step in 1..=steps {
            let next_s = self.now_s + STEP_S;
            let polled = catch_unwind(AssertUnwindSafe(|| {
                self.with.clock.wait_until(next_s);
                self.with.backend.poll(next_s)
            }));
            let Ok(Ok(batch)) = polled else { break };
            self.now_s = next_s;
            recorded = recorded && self.with.observer.on_batch(&batch).is_ok();
            let Some(next) = self.on_the_way(&from, STEP_S * (step + 1) as f64) else { break };
            let sent = catch_unwind(AssertUnwindSafe(|| self.with.backend.set(&next)));
            if !matches!(sent, Ok(Ok(()))) {
                break;
            }
        }
        Ok(())
    }

    /// Shuts the air off, with a limited number of retries.
    fn cut_air(&mut self) -> Result<(), BackendError> {
        let mut last = Ok(());
        for tried in 0..TRIES {
            if tried > 0 {
                self.now_s += PAUSE_S;
                self.with.clock.wait_until(self.now_s);
            }
            last = catch_unwind(AssertUnwindSafe(|| self.with.backend.make_safe())).unwrap_or_else(|panic| {
                let source = Box::new(Panicked(words_of(&*panic)));
                Err(BackendError::Lost { t_s: self.now_s, source })
            });
            if last.is_ok() {
                break;
            }
        }
        last
    }
}
