//! Perturbations of the model that give the responses of the readings by finite differences.

use mapper_core::{Channel, Dimension};
use mapper_observe::perturbation::Perturbation;

pub(crate) const PERTURBATIONS: [Perturbation; 19] = [
    Perturbation::Input(Channel::T1),
    Perturbation::Input(Channel::P1),
    Perturbation::Input(Channel::P3),
    Perturbation::Input(Channel::T3),
    Perturbation::Input(Channel::P4),
    Perturbation::Input(Channel::TOil),
    Perturbation::Ambient,
    Perturbation::Efficiency,
    Perturbation::Flow,
    Perturbation::TurbineEfficiency,
    Perturbation::TurbineFlow,
    Perturbation::ValveArea,
    Perturbation::CompressorConvection,
    Perturbation::TurbineConvection,
    Perturbation::ExternalConvection,
    Perturbation::OilConductance,
    Perturbation::Friction,
    Perturbation::StartTc,
    Perturbation::StartTt,
];

/// Size of a perturbation: small enough for curvature, large enough for rounding errors.
pub(crate) fn difference_step(perturbation: Perturbation) -> f64 {
    match perturbation {
        Perturbation::Input(channel) if channel.info().dimension == Dimension::Pressure => 100.0,
        Perturbation::Input(_) | Perturbation::Ambient | Perturbation::StartTc | Perturbation::StartTt => 0.5,
        Perturbation::Friction => 5e-8,
        _ => 2e-3,
    }
}
