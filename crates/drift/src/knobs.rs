//! What the model is turned by, to see how the readings answer.

use mapper_core::{Channel, Dimension, ModelTolerances};
use mapper_observe::knob::Knob;

/// All that is turned.
pub(crate) const KNOBS: [Knob; 19] = [
    Knob::Input(Channel::T1),
    Knob::Input(Channel::P1),
    Knob::Input(Channel::P3),
    Knob::Input(Channel::T3),
    Knob::Input(Channel::P4),
    Knob::Input(Channel::TOil),
    Knob::Ambient,
    Knob::Efficiency,
    Knob::Flow,
    Knob::TurbineEfficiency,
    Knob::TurbineFlow,
    Knob::ValveArea,
    Knob::CompressorConvection,
    Knob::TurbineConvection,
    Knob::ExternalConvection,
    Knob::OilConductance,
    Knob::Friction,
    Knob::StartTc,
    Knob::StartTt,
];

/// By how much a knob is turned for the difference: small against curvature, large against rounding.
pub(crate) fn difference_step(knob: Knob) -> f64 {
    match knob {
        Knob::Input(channel) if channel.info().dimension == Dimension::Pressure => 100.0,
        Knob::Input(_) | Knob::Ambient | Knob::StartTc | Knob::StartTt => 0.5,
        Knob::Friction => 5e-8,
        _ => 2e-3,
    }
}

/// Constant deviations may be so many times as large as is declared: they are not drift, however large, and repeats tell
/// the two apart.
const WIDER: f64 = 2.0;
/// That of the turbine housing at the start still more: it takes an hour to forget how it began.
const WIDER_TT: f64 = 4.0;

/// One standard deviation of what a knob may be off by over the whole campaign, beside declared offsets of inputs.
pub(crate) fn sigma(knob: Knob, tolerances: &ModelTolerances) -> f64 {
    let wider = if knob == Knob::StartTt { WIDER_TT } else { WIDER };
    wider * knob.tolerance(tolerances)
}
