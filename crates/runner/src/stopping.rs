//! Stops requested from outside: immediately, or at the end of the step.

use crate::run::{Halt, Run};
use mapper_core::{Event, EventKind};
use std::sync::atomic::Ordering;

impl Run<'_, '_> {
    /// Checks for a requested stop. Outside a step the run ends immediately. Within a step, one event confirms the request and states the
    /// remaining time, so that the operator knows that the stop was received.
    pub(crate) fn look_for_a_stop(&mut self, in_step: bool, until_s: f64) -> Result<(), Halt> {
        let with_step = self.protection.stop_after_step.load(Ordering::Relaxed);
        if self.with.stop.load(Ordering::Relaxed) || (with_step && !in_step) {
            return Err(Halt::Interrupted);
        }
        if with_step && !std::mem::replace(&mut self.stop_sent, true) {
            let left_s = until_s - self.now_s;
            let message = format!(
                "asked to stop: the run ends with this step, in {left_s:.0} s at most; ask again (Ctrl-C) and the rig is made \
                 safe now"
            );
            self.with.observer.on_event(&Event { t_s: self.now_s, kind: EventKind::Note, message })?;
        }
        Ok(())
    }
}
