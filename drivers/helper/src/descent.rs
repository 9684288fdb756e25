//! The way into the safe state that a driver flies by itself.

use mapper_core::{Backend, BackendError, RigMode, SafeTrajectory, Setpoints};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Time between two setpoints on the way, s.
pub(crate) const STEP_S: f64 = 0.1;
/// A heater that is told this does not heat, K.
const HEATER_OFF_K: f64 = 293.15;
/// Below the pressure of the cell no gas flows, Pa.
const ATMOSPHERE_PA: f64 = 105e3;
/// How often the rig is asked to become safe.
const TRIES: usize = 3;

/// A way that has begun.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Descent {
    from: Option<Setpoints>,
    begun_s: f64,
}

impl Descent {
    /// Begins at the setpoints that hold, at this run time, s.
    pub(crate) fn new(from: Option<Setpoints>, now_s: f64) -> Descent {
        Descent { from, begun_s: now_s }
    }

    /// What the rig is told now; `None`: the air is cut.
    fn setpoints(&self, safe: &SafeTrajectory, now_s: f64) -> Option<Setpoints> {
        let from = self.from.filter(|from| from.mode == RigMode::Running)?;
        let after_s = now_s - self.begun_s + STEP_S;
        let p3_pa = from.p3_pa - safe.p3_slew_pa_s? * after_s;
        (after_s <= safe.within_s && p3_pa > ATMOSPHERE_PA).then_some(Setpoints {
            p3_pa,
            t3_k: HEATER_OFF_K,
            valve_opening_ratio: from.valve_opening_ratio.max(safe.valve_opening_ratio),
            ..from
        })
    }

    /// Tells the rig what is due at this run time, s. True when the way is over: the rig was made safe, or would not be.
    pub(crate) fn fly(
        &self,
        rig: &mut dyn Backend,
        safe: &SafeTrajectory,
        now_s: f64,
    ) -> (bool, Result<(), String>) {
        if let Some(setpoints) = self.setpoints(safe, now_s) {
            let told = catch_unwind(AssertUnwindSafe(|| rig.set(&setpoints)));
            if matches!(told, Ok(Ok(()))) {
                return (false, Ok(()));
            }
        }
        (true, make_safe(rig))
    }
}

/// Air off, as often as it takes, within reason.
pub(crate) fn make_safe(rig: &mut dyn Backend) -> Result<(), String> {
    let mut last = Ok(());
    for _ in 0..TRIES {
        last = match catch_unwind(AssertUnwindSafe(|| rig.make_safe())) {
            Ok(Ok(())) => return Ok(()),
            Ok(Err(error)) => Err::<(), BackendError>(error).map_err(|error| error.to_string()),
            Err(_) => Err("it panicked".to_owned()),
        };
    }
    last
}
