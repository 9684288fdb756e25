//! Stops requested from outside: immediately, or at the end of the step.

use crate::run_control::run::{Halt, Run};
use mapper_core::{Event, EventKind};
use std::sync::atomic::Ordering;

/// How often a stop is looked for while the run waits for its rig, s of run time: half of the 20 ms that a stop may take.
const LOOK_S: f64 = 0.01;

impl Run<'_, '_> {
    /// Waits for the clock; `false` if a stop came first.
    pub(crate) fn waited_until(&mut self, t_s: f64, in_step: bool) -> bool {
        let mut look_s = self.now_s + LOOK_S;
        while look_s < t_s && self.with.clock.advances_by_itself() {
            self.with.clock.wait_until(look_s);
            if self.stops(in_step) {
                return false;
            }
            look_s += LOOK_S;
        }
        self.with.clock.wait_until(t_s);
        !self.stops(in_step)
    }

    /// Whether a stop was requested that ends the run now: outside a step, also one at the end of the step.
    fn stops(&self, in_step: bool) -> bool {
        let with_step = self.protection.stop_after_step.load(Ordering::Relaxed);
        self.with.stop.load(Ordering::Relaxed) || (with_step && !in_step)
    }

    /// Checks for a requested stop. Outside a step the run ends immediately. Within a step, one event confirms the request and states the
    /// remaining time, so that the operator knows that the stop was received.
    pub(crate) fn look_for_a_stop(&mut self, in_step: bool, until_s: f64) -> Result<(), Halt> {
        if self.stops(in_step) {
            return Err(Halt::Interrupted);
        }
        if self.protection.stop_after_step.load(Ordering::Relaxed)
            && !std::mem::replace(&mut self.stop_sent, true)
        {
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
