//! An armed rig and its safe trajectory.

use crate::descent::{Descent, DescentState, STEP_S};
use mapper_core::{Backend, RigDescription, Setpoints};
use mapper_driver_host::protocol::LEASE_S;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// An armed rig.
pub(crate) struct Armed {
    /// On the driver's clock, s.
    pub(crate) at_s: f64,
    /// No message or tick has arrived since arming, which may take seconds: time and lease start with the first one.
    pub(crate) is_new: bool,
    pub(crate) commanded: Option<Setpoints>,
    /// Number of the next sample to poll for, in real time.
    pub(crate) ticks: u64,
    /// Run time of the last poll, s.
    pub(crate) polled_s: f64,
    /// When the lease ends and the rig is made safe, s on the driver's clock.
    pub(crate) lease_s: f64,
    pub(crate) descent: Option<Descent>,
    /// The lease has ended; only disarming is allowed.
    pub(crate) has_ended: bool,
    /// The rig has not confirmed its safe state. It is not polled then, so that the heartbeat stops and the rig's watchdog acts.
    pub(crate) is_unconfirmed: bool,
}

impl Armed {
    /// A newly armed rig, at this time of the driver's clock, s.
    pub(crate) fn new(now_s: f64) -> Armed {
        Armed {
            at_s: now_s,
            is_new: true,
            commanded: None,
            ticks: 0,
            polled_s: 0.0,
            lease_s: now_s + LEASE_S,
            descent: None,
            has_ended: false,
            is_unconfirmed: false,
        }
    }

    /// Continues a safe trajectory in progress. Returns the time to its next step, s, and the error of an unconfirmed safe state, once.
    pub(crate) fn continue_descent(
        &mut self,
        rig: &mut dyn Backend,
        description: &RigDescription,
        now_s: f64,
        is_leaving: bool,
    ) -> Option<(f64, Option<String>)> {
        let mut descent = self.descent?;
        let simulated = description.simulated_time;
        let t_s = if simulated { self.polled_s } else { now_s - self.at_s };
        let state = descent.execute_step(rig, description, t_s);
        let gives_up = is_leaving && descent.may_give_up(description, t_s);
        self.descent = (state != DescentState::Safe && !gives_up).then_some(descent);
        if simulated && state != DescentState::Safe {
            self.polled_s += STEP_S;
            let until_s = self.polled_s;
            // Samples of the safe trajectory, which are discarded.
            let _ = catch_unwind(AssertUnwindSafe(|| rig.poll(until_s)));
        }
        let due_s = if simulated && state == DescentState::CommandSent { 0.0 } else { STEP_S };
        let doubt = match state {
            DescentState::Safe => {
                (self.commanded, self.is_unconfirmed) = (None, false);
                None
            }
            DescentState::NotConfirmed(error) => {
                (!std::mem::replace(&mut self.is_unconfirmed, true)).then_some(error)
            }
            DescentState::NothingDue | DescentState::CommandSent => None,
        };
        Some((due_s, doubt))
    }
}
