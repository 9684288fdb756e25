//! What the model is turned by, to see how the readings answer.

use mapper_core::Channel;
use mapper_physics::params::{BoundaryConditions, Params};

/// One quantity of model, inputs or initial state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Knob {
    Input(Channel),
    Ambient,
    Efficiency,
    Flow,
    TurbineEfficiency,
    TurbineFlow,
    ValveArea,
    CompressorConvection,
    TurbineConvection,
    ExternalConvection,
    OilConductance,
    Friction,
    InitialTc,
    InitialTt,
}

/// Inputs that are turned, and whose noise reaches the model.
pub(crate) const INPUTS: [Channel; 6] =
    [Channel::T1, Channel::P1, Channel::P3, Channel::T3, Channel::P4, Channel::TOil];

impl Knob {
    pub const ALL: [Knob; 19] = [
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
        Knob::InitialTc,
        Knob::InitialTt,
    ];

    /// By how much it is turned for the difference: small against curvature, large against rounding.
    pub fn step(self) -> f64 {
        match self {
            Knob::Input(channel) if channel.info().dimension == mapper_core::Dimension::Pressure => 100.0,
            Knob::Input(_) | Knob::Ambient | Knob::InitialTc | Knob::InitialTt => 0.5,
            Knob::Friction => 5e-8,
            _ => 2e-3,
        }
    }

    /// One standard deviation of what it may be off by over the whole campaign, beside declared offsets of inputs.
    ///
    /// Twice what is usual for a good gas stand (efficiencies and flows 0.5 to 1 %, convection 3 to 10 %, oil 5 %): a
    /// constant deviation is not drift, however large, and repeats tell the two apart.
    pub fn tolerance(self) -> f64 {
        match self {
            Knob::Input(_) => 0.0,
            Knob::Ambient => 2.0,
            Knob::Efficiency | Knob::Flow | Knob::ValveArea => 0.01,
            Knob::TurbineEfficiency => 0.02,
            Knob::TurbineFlow => 0.01,
            Knob::CompressorConvection | Knob::TurbineConvection => 0.06,
            Knob::ExternalConvection => 0.2,
            Knob::OilConductance => 0.1,
            Knob::Friction => 0.0,
            Knob::InitialTc => 10.0,
            Knob::InitialTt => 20.0,
        }
    }

    /// Turns the machine.
    pub fn turn(self, params: &mut Params, by: f64) {
        match self {
            Knob::Efficiency => params.compressor.efficiency_scale_ratio *= 1.0 + by,
            Knob::Flow => params.compressor.flow_scale_ratio *= 1.0 + by,
            Knob::TurbineEfficiency => params.turbine.peak_efficiency *= 1.0 + by,
            Knob::TurbineFlow => params.turbine.choked_flow_kg_s *= 1.0 + by,
            Knob::ValveArea => params.outlet.valve_area_m2 *= 1.0 + by,
            Knob::CompressorConvection => params.compressor.nusselt_coefficient *= 1.0 + by,
            Knob::TurbineConvection => params.turbine.nusselt_coefficient *= 1.0 + by,
            Knob::ExternalConvection => params.external_convection_ratio *= 1.0 + by,
            Knob::OilConductance => params.bearing.oil_conductance_w_k *= 1.0 + by,
            Knob::Friction => params.bearing_friction_w_s2 += by,
            Knob::Input(_) | Knob::Ambient | Knob::InitialTc | Knob::InitialTt => {}
        }
    }

    /// Turns the boundary conditions.
    pub fn shift(self, boundary: &mut BoundaryConditions, by: f64) {
        let Knob::Input(channel) = self else {
            if self == Knob::Ambient {
                boundary.ambient_temperature_k += by;
            }
            return;
        };
        match channel {
            Channel::T1 => boundary.t1_k += by,
            Channel::P1 => boundary.p1_pa += by,
            Channel::P3 => boundary.p3_pa += by,
            Channel::T3 => boundary.t3_k += by,
            Channel::P4 => boundary.p4_pa += by,
            Channel::TOil => boundary.oil_temperature_k += by,
            _ => {}
        }
    }
}
