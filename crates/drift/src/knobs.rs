//! What the model is turned by, to see how the readings answer.

use mapper_core::{Channel, Dimension, ModelTolerances};
use mapper_observe::perturbation::Perturbation;

/// All that is turned.
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

/// By how much a knob is turned for the difference: small against curvature, large against rounding.
pub(crate) fn difference_step(knob: Perturbation) -> f64 {
    match knob {
        Perturbation::Input(channel) if channel.info().dimension == Dimension::Pressure => 100.0,
        Perturbation::Input(_) | Perturbation::Ambient | Perturbation::StartTc | Perturbation::StartTt => 0.5,
        Perturbation::Friction => 5e-8,
        _ => 2e-3,
    }
}

/// Constant deviations may be so many times as large as is declared: they are not drift, however large, and repeats tell
/// the two apart.
const WIDER: f64 = 2.0;
/// That of the turbine housing at the start still more: it takes an hour to forget how it began.
const WIDER_TT: f64 = 4.0;

/// One standard deviation of what a knob may be off by over the whole campaign, beside declared offsets of inputs.
pub(crate) fn sigma(knob: Perturbation, tolerances: &ModelTolerances) -> f64 {
    let wider = if knob == Perturbation::StartTt { WIDER_TT } else { WIDER };
    wider * knob.tolerance(tolerances)
}
