//! Stops requested from outside: immediately, or at the end of the step.

use crate::run_control::protection::Protection;
use crate::run_control::run::{Halt, Run, Runner};
use crate::run_control::run_error::RunError;
use crate::run_control::safe_shutdown::catch_panic;
use mapper_core::{Event, EventKind};
use std::panic::resume_unwind;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Interval at which a waiting run checks for a stop, s of run time: half of the 20 ms that a stop may take.
const STOP_CHECK_INTERVAL_S: f64 = 0.01;

impl Runner<'_> {
    /// Connects and arms the rig. A stop request in the meantime is confirmed immediately. No setpoint is sent before the rig is armed, so
    /// after a stop the safe command is the first one. The inner result is that of the confirmation: its failure must not leave an armed rig.
    pub(crate) fn arm(&mut self, protection: &Protection<'_>) -> Result<Result<(), RunError>, RunError> {
        let Runner { backend, observer, stop, .. } = self;
        let stops = || stop.load(Ordering::Relaxed) || protection.stop_after_step.load(Ordering::Relaxed);
        let mut confirmation = None;
        let armed = thread::scope(|scope| {
            let (done, ended) = channel();
            let arming = scope.spawn(move || {
                let armed = backend.arm();
                // The caller waits for it.
                let _ = done.send(());
                armed
            });
            while ended.recv_timeout(Duration::from_secs_f64(STOP_CHECK_INTERVAL_S))
                == Err(RecvTimeoutError::Timeout)
            {
                if confirmation.is_none() && stops() {
                    let message = "stop requested while the rig is being connected: the rig has no setpoint yet and is made safe as \
                                   soon as it is connected"
                        .to_owned();
                    let event = Event { t_s: 0.0, kind: EventKind::Note, message };
                    confirmation = Some(catch_panic(|| Ok(observer.on_event(&event)?)));
                }
            }
            arming.join().unwrap_or_else(|panic| resume_unwind(panic))
        });
        armed.map_err(RunError::NotArmed)?;
        Ok(confirmation.unwrap_or(Ok(())))
    }
}

impl Run<'_, '_> {
    /// Waits for the clock; `false` if a stop came first.
    pub(crate) fn wait_until_or_stop(&mut self, t_s: f64, in_step: bool) -> bool {
        let mut next_check_s = self.now_s + STOP_CHECK_INTERVAL_S;
        while next_check_s < t_s && self.runner.clock.advances_by_itself() {
            self.runner.clock.wait_until(next_check_s);
            if self.is_stop_requested(in_step) {
                return false;
            }
            next_check_s += STOP_CHECK_INTERVAL_S;
        }
        self.runner.clock.wait_until(t_s);
        !self.is_stop_requested(in_step)
    }

    /// Whether a stop was requested that ends the run now: outside a step, also one at the end of the step.
    fn is_stop_requested(&self, in_step: bool) -> bool {
        let with_step = self.protection.stop_after_step.load(Ordering::Relaxed);
        self.runner.stop.load(Ordering::Relaxed) || (with_step && !in_step)
    }

    /// Checks for a requested stop. Outside a step the run ends immediately. Within a step, one event confirms the request and states the
    /// remaining time, so that the operator knows that the stop was received.
    pub(crate) fn check_for_stop(&mut self, in_step: bool, until_s: f64) -> Result<(), Halt> {
        if self.is_stop_requested(in_step) {
            return Err(Halt::Interrupted);
        }
        if self.protection.stop_after_step.load(Ordering::Relaxed)
            && !std::mem::replace(&mut self.stop_confirmed, true)
        {
            let left_s = until_s - self.now_s;
            let message = format!(
                "stop requested: the run ends with this step, in at most {left_s:.0} s; request it again (Ctrl-C) and the rig is made \
                 safe now"
            );
            self.runner.observer.on_event(&Event { t_s: self.now_s, kind: EventKind::Note, message })?;
        }
        Ok(())
    }
}
