//! An armed rig and its safe trajectory, which the driver executes when its host is gone.

use mapper_core::{Backend, BackendError, RigDescription, Setpoints};
use mapper_driver_host::protocol::LEASE_S;
use std::panic::{AssertUnwindSafe, catch_unwind};

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

/// Time between two setpoints of the trajectory, and between two attempts to cut the air, s.
const STEP_S: f64 = 0.1;
/// Pressure of the cell, below which no gas flows, Pa.
const ATMOSPHERE_PA: f64 = 105e3;
/// Time after the end of the trajectory at which a driver without a host stops repeating the command, s.
const GIVE_UP_AFTER_S: f64 = 20.0;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Descent {
    from: Option<Setpoints>,
    begun_s: f64,
    /// Time of the next command, s.
    due_s: f64,
    cut: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum DescentState {
    NothingDue,
    CommandSent,
    Safe,
    /// The rig does not confirm its safe state; the command is repeated.
    NotConfirmed(String),
}

impl Descent {
    /// Begins at the current setpoints, at this run time, s.
    pub(crate) fn new(from: Option<Setpoints>, now_s: f64) -> Descent {
        Descent { from, begun_s: now_s, due_s: now_s, cut: false }
    }

    fn execute_step(
        &mut self,
        rig: &mut dyn Backend,
        description: &RigDescription,
        now_s: f64,
    ) -> DescentState {
        // The tolerance covers rounding.
        if now_s < self.due_s - 5e-7 * STEP_S {
            return DescentState::NothingDue;
        }
        self.due_s = now_s + STEP_S;
        let RigDescription { safe, accepts, .. } = description;
        let after_s = now_s - self.begun_s + STEP_S;
        let next = self.from.filter(|_| !self.cut);
        if let Some(next) =
            next.and_then(|from| safe.setpoints(&from, after_s, ATMOSPHERE_PA, accepts.as_ref()))
            && matches!(catch_unwind(AssertUnwindSafe(|| rig.set(&next))), Ok(Ok(())))
        {
            return DescentState::CommandSent;
        }
        self.cut = true;
        match make_safe(rig) {
            Ok(()) => DescentState::Safe,
            Err(error) => DescentState::NotConfirmed(error),
        }
    }

    /// Whether a driver without a host may end although the rig has not confirmed its safe state.
    fn may_give_up(&self, description: &RigDescription, now_s: f64) -> bool {
        now_s - self.begun_s > description.safe.within_s + GIVE_UP_AFTER_S
    }
}

/// Cuts the air, once.
pub(crate) fn make_safe(rig: &mut dyn Backend) -> Result<(), String> {
    match catch_unwind(AssertUnwindSafe(|| rig.make_safe())) {
        Ok(answer) => answer.map_err(|error: BackendError| error.to_string()),
        Err(_) => Err("it panicked".to_owned()),
    }
}
