//! Perturbations of the model, to find the sensitivity of the readings.

use mapper_core::{Channel, Dimension, ModelTolerances};
use mapper_observe::perturbation::Perturbation;

/// All perturbations.
pub(crate) const KNOBS: [Perturbation; 19] = [
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

/// Size of a perturbation for the difference: small compared with curvature, large compared with rounding.
pub(crate) fn difference_step(knob: Perturbation) -> f64 {
    match knob {
        Perturbation::Input(channel) if channel.info().dimension == Dimension::Pressure => 100.0,
        Perturbation::Input(_) | Perturbation::Ambient | Perturbation::StartTc | Perturbation::StartTt => 0.5,
        Perturbation::Friction => 5e-8,
        _ => 2e-3,
    }
}

/// Factor on declared constant deviations: a constant is not drift, whatever its size, and repeats distinguish the two.
const WIDER: f64 = 2.0;
/// A larger factor for the turbine housing at the start: its initial state takes an hour to decay.
const WIDER_TT: f64 = 4.0;

/// One standard deviation of a perturbation over the whole campaign, in addition to declared offsets of inputs.
pub(crate) fn sigma(knob: Perturbation, tolerances: &ModelTolerances) -> f64 {
    let wider = if knob == Perturbation::StartTt { WIDER_TT } else { WIDER };
    wider * knob.tolerance(tolerances)
}
