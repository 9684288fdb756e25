//! The initial state of the model from a recording.

use mapper_core::Channel;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{State, rad_s_of_rpm};

/// The state given by readings; `read` returns the mean of a channel. Missing readings are replaced by typical values of a turbocharger under
/// the boundary conditions, which suffice because the steady state does not depend on them.
pub fn estimate_state(boundary: &BoundaryConditions, read: impl Fn(Channel) -> Option<f64>) -> State {
    let read_or = |channel: Channel, usual: f64| read(channel).unwrap_or(usual);
    State::new(
        rad_s_of_rpm(read_or(Channel::ShaftSpeed, 90e3).max(1e3)),
        read_or(Channel::P2, 1.5 * boundary.p1_pa).max(boundary.p1_pa),
        read_or(Channel::Tc, boundary.t1_k + 40.0),
        read_or(Channel::Tt, 0.5 * (boundary.t3_k + boundary.t1_k)),
        read_or(Channel::T2, boundary.t1_k + 50.0),
    )
}
