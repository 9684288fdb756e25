//! The safe trajectory, which the driver executes when its host is gone.

use mapper_core::{Backend, BackendError, RigDescription, Setpoints};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Time between two setpoints of the trajectory, and between two attempts to cut the air, s.
pub(crate) const STEP_S: f64 = 0.1;
/// Pressure of the cell, below which no gas flows, Pa.
const ATMOSPHERE_PA: f64 = 105e3;
/// Time after the end of the trajectory at which a driver without a host stops repeating the command, s.
const GIVE_UP_AFTER_S: f64 = 20.0;

/// A safe trajectory in progress.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Descent {
    from: Option<Setpoints>,
    begun_s: f64,
    /// Time of the next command, s.
    due_s: f64,
    cut: bool,
}

/// Progress of the trajectory.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum DescentState {
    /// No command is due.
    NothingDue,
    /// The due command was sent.
    CommandSent,
    /// The rig has confirmed its safe state.
    Safe,
    /// The rig does not confirm its safe state; the command is repeated.
    NotConfirmed(String),
}

impl Descent {
    /// Begins at the current setpoints, at this run time, s.
    pub(crate) fn new(from: Option<Setpoints>, now_s: f64) -> Descent {
        Descent { from, begun_s: now_s, due_s: now_s, cut: false }
    }

    /// Sends the command that is due at this run time, s.
    pub(crate) fn execute_step(
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
    pub(crate) fn may_give_up(&self, description: &RigDescription, now_s: f64) -> bool {
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
