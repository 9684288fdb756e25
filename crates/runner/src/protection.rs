//! What stands around a run besides its guards: the way into the safe state, the band of the speed, the pace of looking.

use crate::operator::Operator;
use mapper_core::{SafeTrajectory, SetpointRanges, SpeedBand};
use std::sync::atomic::AtomicBool;

/// See the module. [`Protection::default`] has none of it.
#[derive(Debug, Clone, Copy)]
pub struct Protection<'a> {
    /// The way into the safe state.
    pub safe: SafeTrajectory,
    /// P3 at which the air is cut, Pa: the lowest that the rig may be told.
    pub p3_min_pa: f64,
    /// What the rig accepts, the way into the safe state included; `None`: everything.
    pub accepts: Option<SetpointRanges>,
    /// How far a step may miss its speed; `None`: it is not looked at.
    pub speed: Option<SpeedBand>,
    /// Set from outside to stop at the end of the step.
    pub stop_after_step: &'a AtomicBool,
    /// Asks the rig for each sample by itself. A simulated rig is asked so only while a guard is alert.
    pub each_sample: bool,
    /// What the operator asks for besides; `None`: nobody can.
    pub operator: Option<&'a Operator>,
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl Default for Protection<'_> {
    fn default() -> Self {
        Protection {
            safe: SafeTrajectory::default(),
            p3_min_pa: 0.0,
            accepts: None,
            speed: None,
            stop_after_step: &NEVER,
            each_sample: false,
            operator: None,
        }
    }
}
