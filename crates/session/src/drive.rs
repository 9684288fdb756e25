//! Steps, a rig and who looks on: the one place that starts the runner.

use crate::guards::guards;
use mapper_campaign::Campaign;
use mapper_core::{Backend, UnpacedClock};
use mapper_runner::{RunEnd, RunError, RunObserver, Runner, Soaked, StepSource};
use std::sync::atomic::AtomicBool;

/// Drives the rig through the steps, after the soak where the campaign has one, under the campaign's guards.
///
/// # Errors
/// [`RunError`] where rig, steps or observer fail; the rig is safe then.
pub fn drive(
    campaign: &Campaign,
    steps: &mut dyn StepSource,
    backend: &mut dyn Backend,
    observer: &mut dyn RunObserver,
    stop: &AtomicBool,
) -> Result<RunEnd, RunError> {
    let guards = guards(campaign, &backend.describe().channels);
    let mut soaked;
    let steps: &mut dyn StepSource = match campaign.zero {
        None => steps,
        Some(soak) => {
            soaked = Soaked::new(steps, soak);
            &mut soaked
        }
    };
    // Every backend so far has simulated time.
    Runner { steps, backend, clock: &mut UnpacedClock, guards, observer, stop }.run()
}

/// Time at rest before the plan begins, s.
pub fn soak_s(campaign: &Campaign) -> f64 {
    campaign.zero.map_or(0.0, |zero| zero.duration_s)
}
