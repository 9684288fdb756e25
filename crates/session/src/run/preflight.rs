//! Checks before the rig is armed.

use crate::SessionError;
use mapper_core::{Plan, RigDescription, RigMode, Setpoints, step_number};
use std::path::Path;

/// Recording size for one sample of one channel, bytes: measured on the virtual lab with truth, plus 50 %.
const BYTES_PER_VALUE: f64 = 40.0;
/// Additional free space required, bytes.
const SPARE_BYTES: f64 = 50e6;

/// Rejects a plan with a setpoint that the rig would refuse during the run.
///
/// # Errors
/// [`SessionError::Preflight`] with the first step that it does not accept.
pub(crate) fn check_setpoints(plan: &Plan, rig: &RigDescription) -> Result<(), SessionError> {
    let Some(accepts) = &rig.accepts else { return Ok(()) };
    for (place, step) in plan.steps.iter().enumerate() {
        let setpoints = Setpoints {
            mode: RigMode::Running,
            p3_pa: step.p3_pa,
            t3_k: step.t3_k,
            valve_opening_ratio: step.to.valve_opening_ratio,
            oil_temperature_k: step.oil_temperature_k,
        };
        accepts.check(&setpoints).map_err(|error| {
            SessionError::Preflight(format!("step {} of the plan: {error}", step_number(place)))
        })?;
    }
    Ok(())
}

/// Rejects a disk without room for the whole run. Rigs with simulated time are exempt, because their run can be repeated.
///
/// # Errors
/// [`SessionError::Preflight`] with the available and the required space.
pub(crate) fn check_room(
    directory: &Path,
    duration_s: f64,
    rig: &RigDescription,
) -> Result<(), SessionError> {
    if rig.simulated_time {
        return Ok(());
    }
    let needed = duration_s * rig.sample_rate_hz * rig.channels.len() as f64 * BYTES_PER_VALUE + SPARE_BYTES;
    match free_bytes(directory) {
        Some(free) if free < needed => Err(SessionError::Preflight(format!(
            "the run needs {:.0} MB on the disk of {}, which has {:.0} MB left",
            needed / 1e6,
            directory.display(),
            free / 1e6
        ))),
        _ => Ok(()),
    }
}

/// Free bytes of a file system for this user; `None` if unknown.
#[cfg(unix)]
fn free_bytes(directory: &Path) -> Option<f64> {
    let file_system = rustix::fs::statvfs(directory).ok()?;
    Some(file_system.f_bavail as f64 * file_system.f_frsize as f64)
}

#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<f64> {
    None
}
