//! The initial state of the model from a recording.

use mapper_core::Channel;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{State, rad_s_of_rpm};

/// Shaft speed, rpm. Bound: a start value; the steady state does not depend on it.
const USUAL_RPM: f64 = 90e3;
/// Minimum shaft speed, rpm. Bound: the model divides by it.
const MIN_RPM: f64 = 1e3;
/// Pressure ratio. Bound: a start value.
const USUAL_PRESSURE_RATIO: f64 = 1.5;
/// Rise of the compressor housing above the inlet, K. Bound: a start value.
const USUAL_HOUSING_RISE_K: f64 = 40.0;
/// Rise of the gas, K. Bound: a start value.
const USUAL_RISE_K: f64 = 50.0;

/// The state given by readings; `read` returns the mean of a channel. Missing readings are replaced by typical values of a turbocharger under
/// the boundary conditions, which suffice because the steady state does not depend on them.
pub fn estimate_state(boundary: &BoundaryConditions, read: impl Fn(Channel) -> Option<f64>) -> State {
    let read_or = |channel: Channel, usual: f64| read(channel).unwrap_or(usual);
    State::new(
        rad_s_of_rpm(read_or(Channel::ShaftSpeed, USUAL_RPM).max(MIN_RPM)),
        read_or(Channel::P2, USUAL_PRESSURE_RATIO * boundary.p1_pa).max(boundary.p1_pa),
        read_or(Channel::Tc, boundary.t1_k + USUAL_HOUSING_RISE_K),
        read_or(Channel::Tt, 0.5 * (boundary.t3_k + boundary.t1_k)),
        read_or(Channel::T2, boundary.t1_k + USUAL_RISE_K),
    )
}
