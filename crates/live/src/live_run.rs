//! The run shown on the live page.

use mapper_campaign::Campaign;
use mapper_core::{Channel, Plan};
use mapper_session::Operator;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The run and its stop flags.
pub struct LiveRun<'a> {
    /// The campaign.
    pub campaign: &'a Campaign,
    /// The plan.
    pub plan: &'a Plan,
    /// Ratio of rig time to wall-clock time; `None`: as fast as possible.
    pub pace: Option<f64>,
    /// Measured channels and setpoints of the rig.
    pub channels: &'a [Channel],
    /// Epoch time of run time 0, ns, as in the recording.
    pub start_time_ns: u64,
    /// Operator requests read by the runner.
    pub operator: Arc<Operator>,
    /// Stops at the end of the step.
    pub after_step: Arc<AtomicBool>,
    /// Stops now.
    pub now: Arc<AtomicBool>,
}
