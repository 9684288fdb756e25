//! An armed rig and its safe trajectory.

use crate::descent::{Descent, Flight, STEP_S};
use mapper_core::{Backend, RigDescription, Setpoints};
use mapper_driver_host::protocol::LEASE_S;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// An armed rig.
pub(crate) struct Armed {
    /// On the driver's clock, s.
    pub(crate) at_s: f64,
    /// Arming may take seconds: time and lease begin with the first message or tick after it.
    pub(crate) fresh: bool,
    pub(crate) commanded: Option<Setpoints>,
    /// Number of the next sample to poll for, in real time.
    pub(crate) ticks: u64,
    /// Run time of the last poll, s.
    pub(crate) polled_s: f64,
    /// When the lease ends and the rig is made safe, s on the driver's clock.
    pub(crate) lease_s: f64,
    pub(crate) descent: Option<Descent>,
    /// The lease has ended; only disarming is allowed.
    pub(crate) ended: bool,
    /// The rig has not confirmed its safe state. It is not polled then, so that the watchdog on the driver's heartbeat acts.
    pub(crate) in_doubt: bool,
}

impl Armed {
    /// A newly armed rig, at this time of the driver's clock, s.
    pub(crate) fn new(now_s: f64) -> Armed {
        Armed {
            at_s: now_s,
            fresh: true,
            commanded: None,
            ticks: 0,
            polled_s: 0.0,
            lease_s: now_s + LEASE_S,
            descent: None,
            ended: false,
            in_doubt: false,
        }
    }

    /// Continues the safe trajectory, if one has begun. Returns when the next step is due, s from now, and once why the rig is
    /// in doubt, once.
    pub(crate) fn fly_on(
        &mut self,
        rig: &mut dyn Backend,
        description: &RigDescription,
        now_s: f64,
        leaving: bool,
    ) -> Option<(f64, Option<String>)> {
        let mut descent = self.descent?;
        let simulated = description.simulated_time;
        let t_s = if simulated { self.polled_s } else { now_s - self.at_s };
        let flight = descent.fly(rig, description, t_s);
        let hopeless = leaving && descent.is_hopeless(description, t_s);
        self.descent = (flight != Flight::Safe && !hopeless).then_some(descent);
        if simulated && flight != Flight::Safe {
            self.polled_s += STEP_S;
            let until_s = self.polled_s;
            // Samples of the safe trajectory, which are discarded.
            let _ = catch_unwind(AssertUnwindSafe(|| rig.poll(until_s)));
        }
        let due_s = if simulated && flight == Flight::GoesOn { 0.0 } else { STEP_S };
        let doubt = match flight {
            Flight::Safe => {
                (self.commanded, self.in_doubt) = (None, false);
                None
            }
            Flight::Doubt(error) => (!std::mem::replace(&mut self.in_doubt, true)).then_some(error),
            Flight::Waits | Flight::GoesOn => None,
        };
        Some((due_s, doubt))
    }
}
