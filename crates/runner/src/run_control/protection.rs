//! Protection of a run in addition to its guards: safe shutdown, speed band, plausible readings, polling rate.

use crate::guards::plausibility_watch::ReadingBounds;
use crate::run_control::operator::Operator;
use mapper_core::{SafeTrajectory, SetpointRanges, SpeedBand};
use std::sync::atomic::AtomicBool;

/// Protection of a run; [`Protection::default`] applies none.
#[derive(Debug, Clone, Copy)]
pub struct Protection<'a> {
    /// The trajectory into the safe state.
    pub safe: SafeTrajectory,
    /// P3 at which the air is cut, Pa: the lowest setpoint that the rig accepts.
    pub p3_min_pa: f64,
    /// Setpoint ranges that the rig accepts, also during safe shutdown; `None`: unlimited.
    pub accepts: Option<SetpointRanges>,
    /// Allowed deviation of a step's speed; `None`: not checked.
    pub speed: Option<SpeedBand>,
    /// Bounds for the plausibility check of every sample; `None`: not checked.
    pub readings: Option<ReadingBounds>,
    /// Set from outside to stop at the end of the step.
    pub stop_after_step: &'a AtomicBool,
    /// Polls the rig sample by sample. A simulated rig is otherwise polled so only while a guard is alert.
    pub each_sample: bool,
    /// Requests of the operator; `None`: no operator.
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
            readings: None,
            stop_after_step: &NEVER,
            each_sample: false,
            operator: None,
        }
    }
}
