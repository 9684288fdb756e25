//! The run that is looked at.

use mapper_campaign::Campaign;
use mapper_core::{Channel, Plan};
use mapper_session::Operator;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What is run, and how it is stopped.
pub struct LiveRun<'a> {
    /// The campaign.
    pub campaign: &'a Campaign,
    /// The plan.
    pub plan: &'a Plan,
    /// The rig's time over time on the wall; `None`: as fast as it goes.
    pub pace: Option<f64>,
    /// What the rig reads and is told.
    pub channels: &'a [Channel],
    /// Epoch time of run time 0, ns, as in the recording.
    pub start_time_ns: u64,
    /// What the runner looks at.
    pub operator: Arc<Operator>,
    /// Stops at the end of the step.
    pub after_step: Arc<AtomicBool>,
    /// Stops now.
    pub now: Arc<AtomicBool>,
}
