//! Setpoints that mean something on a gas stand of turbochargers: what lies outside is a mistake of whoever sends it.

use mapper_core::{BackendError, Setpoints};

/// Refuses setpoints outside the limits, and those that are not numbers.
///
/// # Errors
/// [`BackendError::SetpointOutOfRange`] for the first one outside.
pub(crate) fn check(setpoints: &Setpoints) -> Result<(), BackendError> {
    for (quantity, value, unit, low, high) in [
        ("P3", setpoints.p3_pa, "Pa", 50e3, 2e6),
        ("T3", setpoints.t3_k, "K", 250.0, 1400.0),
        ("valve opening", setpoints.valve_opening_ratio, "1", 0.05, 2.5),
        ("T_oil", setpoints.oil_temperature_k, "K", 250.0, 450.0),
    ] {
        if !(low..=high).contains(&value) {
            return Err(BackendError::SetpointOutOfRange { quantity, value, unit, low, high });
        }
    }
    Ok(())
}
