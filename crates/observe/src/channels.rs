//! Channels that drive the model, and channels that are compared with it.

use mapper_core::Channel;
use mapper_physics::machine::params::BoundaryConditions;

/// Outputs of the model that a sensor measures. P3 is a boundary condition and is compared only if its lag matters.
pub const OUTPUTS: [Channel; 8] = [
    Channel::ShaftSpeed,
    Channel::P2,
    Channel::CompressorFlow,
    Channel::TurbineFlow,
    Channel::T2,
    Channel::Tc,
    Channel::Tt,
    Channel::T4,
];

/// Recorded boundary conditions that drive the model.
pub const INPUT_CHANNELS: [Channel; 6] =
    [Channel::T1, Channel::P1, Channel::P3, Channel::T3, Channel::P4, Channel::TOil];

/// The boundary condition that a channel measures; `None` for channels that are not inputs.
pub fn boundary_condition(boundary: &mut BoundaryConditions, channel: Channel) -> Option<&mut f64> {
    match channel {
        Channel::T1 => Some(&mut boundary.t1_k),
        Channel::P1 => Some(&mut boundary.p1_pa),
        Channel::P3 => Some(&mut boundary.p3_pa),
        Channel::T3 => Some(&mut boundary.t3_k),
        Channel::P4 => Some(&mut boundary.p4_pa),
        Channel::TOil => Some(&mut boundary.oil_temperature_k),
        Channel::TAmb => Some(&mut boundary.ambient_temperature_k),
        _ => None,
    }
}
