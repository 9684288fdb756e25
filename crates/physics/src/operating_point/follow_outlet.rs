//! Steady states in which hot side and oil follow the compressor's outlet temperature: adiabatic mapping.
//!
//! If gas, oil and both housings have the same temperature, the compressor's gas exchanges no heat except what the
//! gas itself brings, and the efficiency from the temperature rise is the adiabatic one.

use crate::machine::params::BoundaryConditions;
use crate::simulation::model::Model;
use crate::simulation::steady::{self, SteadyError, SteadyState};
use serde::{Deserialize, Serialize};

/// Temperatures that follow the compressor's outlet temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FollowOutlet {
    /// Turbine inlet total temperature, T3.
    pub turbine_inlet: bool,
    /// Oil inlet temperature.
    pub oil: bool,
}

impl FollowOutlet {
    /// Whether nothing follows.
    pub fn is_off(&self) -> bool {
        !(self.turbine_inlet || self.oil)
    }
}

/// Maximum number of rounds until the temperatures agree; each reduces the difference to a few per cent.
const MAX_ROUNDS: usize = 40;
/// Maximum difference of temperatures after convergence, K.
const TOLERANCE_K: f64 = 1e-6;

/// Like [`steady::hold_speed`], with the temperatures in `follow` at the outlet temperature of that steady state; the others are as
/// in `boundary`.
///
/// # Errors
/// [`SteadyError`] of the last round; [`SteadyError::NoHeatBalance`] if the temperatures do not converge.
pub fn hold_speed(
    model: &Model,
    speed_rpm: f64,
    boundary: &BoundaryConditions,
    follow: FollowOutlet,
) -> Result<SteadyState, SteadyError> {
    let mut boundary = *boundary;
    if follow.is_off() {
        return steady::hold_speed(model, speed_rpm, &boundary);
    }
    for _ in 0..MAX_ROUNDS {
        let steady_state = steady::hold_speed(model, speed_rpm, &boundary)?;
        let outlet_k = steady_state.outputs.t2_k;
        let off_k = |follows: bool, value_k: f64| if follows { (outlet_k - value_k).abs() } else { 0.0 };
        if off_k(follow.turbine_inlet, boundary.t3_k).max(off_k(follow.oil, boundary.oil_temperature_k))
            < TOLERANCE_K
        {
            return Ok(steady_state);
        }
        if follow.turbine_inlet {
            boundary.t3_k = outlet_k;
        }
        if follow.oil {
            boundary.oil_temperature_k = outlet_k;
        }
    }
    Err(SteadyError::NoHeatBalance { speed_rpm, valve_opening_ratio: boundary.valve_opening_ratio })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gas::air::Air;

    /// With T3 and oil at T2 the temperature rise gives the map's own efficiency, except for losses to the cell.
    #[test]
    fn nothing_heats_the_gas_when_all_is_at_its_temperature() {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..BoundaryConditions::default() };
        let follow = FollowOutlet { turbine_inlet: true, oil: true };
        let error = |steady_state: &SteadyState| {
            let outputs = &steady_state.outputs;
            let rise = crate::laws::compression::isentropic_rise_ratio(
                outputs.pressure_ratio,
                boundary.t1_k,
                Air::PAPER,
            );
            (boundary.t1_k * rise / (outputs.t2_k - boundary.t1_k) - outputs.efficiency).abs()
        };
        for speed_rpm in [50e3, 80e3] {
            let steady_state = hold_speed(&model, speed_rpm, &boundary, follow).unwrap();
            assert!((steady_state.boundary.t3_k - steady_state.outputs.t2_k).abs() < 1e-5);
            assert!((steady_state.boundary.oil_temperature_k - steady_state.outputs.t2_k).abs() < 1e-5);
            // The remaining difference is the housings' loss to the cell, some watts.
            assert!(error(&steady_state) < 0.01, "{}", error(&steady_state));
        }
        // At low speed the hot turbine heats the compressor most: several points of efficiency.
        let cold = hold_speed(&model, 50e3, &boundary, follow).unwrap();
        let hot = steady::hold_speed(&model, 50e3, &boundary).unwrap();
        assert!(error(&cold) < 0.25 * error(&hot), "{} {}", error(&cold), error(&hot));
        // Nothing to follow: the same state.
        let plain = hold_speed(&model, 80e3, &boundary, FollowOutlet::default()).unwrap();
        assert_eq!(plain, steady::hold_speed(&model, 80e3, &boundary).unwrap());
    }
}
