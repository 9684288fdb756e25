//! The safe trajectory, flown by the driver without its host.

use mapper_core::{Backend, BackendError, RigDescription, Setpoints};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Time between two setpoints of the trajectory, and between two attempts to cut the air, s.
pub(crate) const STEP_S: f64 = 0.1;
/// Pressure of the cell, below which no gas flows, Pa.
const ATMOSPHERE_PA: f64 = 105e3;
/// How long a driver without a host keeps trying after the longest trajectory, s.
const PATIENCE_S: f64 = 20.0;

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
pub(crate) enum Flight {
    /// No command is due.
    Waits,
    /// The due command was sent.
    GoesOn,
    /// The rig has confirmed its safe state.
    Safe,
    /// The rig does not confirm its safe state; the command is repeated.
    Doubt(String),
}

impl Descent {
    /// Begins at the current setpoints, at this run time, s.
    pub(crate) fn new(from: Option<Setpoints>, now_s: f64) -> Descent {
        Descent { from, begun_s: now_s, due_s: now_s, cut: false }
    }

    /// Sends the command that is due at this run time, s.
    pub(crate) fn fly(&mut self, rig: &mut dyn Backend, description: &RigDescription, now_s: f64) -> Flight {
        // Half a millionth of a step is rounding.
        if now_s < self.due_s - 5e-7 * STEP_S {
            return Flight::Waits;
        }
        self.due_s = now_s + STEP_S;
        let RigDescription { safe, accepts, .. } = description;
        let after_s = now_s - self.begun_s + STEP_S;
        let next = self.from.filter(|_| !self.cut);
        if let Some(next) =
            next.and_then(|from| safe.setpoints(&from, after_s, ATMOSPHERE_PA, accepts.as_ref()))
            && matches!(catch_unwind(AssertUnwindSafe(|| rig.set(&next))), Ok(Ok(())))
        {
            return Flight::GoesOn;
        }
        self.cut = true;
        match make_safe(rig) {
            Ok(()) => Flight::Safe,
            Err(error) => Flight::Doubt(error),
        }
    }

    /// Whether a driver without a host may end although the rig has not confirmed its safe state.
    pub(crate) fn is_hopeless(&self, description: &RigDescription, now_s: f64) -> bool {
        now_s - self.begun_s > description.safe.within_s + PATIENCE_S
    }
}

/// Cuts the air, once.
pub(crate) fn make_safe(rig: &mut dyn Backend) -> Result<(), String> {
    match catch_unwind(AssertUnwindSafe(|| rig.make_safe())) {
        Ok(answer) => answer.map_err(|error: BackendError| error.to_string()),
        Err(_) => Err("it panicked".to_owned()),
    }
}
