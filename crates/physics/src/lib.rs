//! The lumped turbocharger model of Burke et al., and the laws it consists of.
//!
//! One file per law; [`model`] combines them, [`simulate`] integrates them, [`steady`] finds steady states.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod air;
pub mod backend_plugin;
pub mod bearing_friction;
pub mod boundary;
pub mod characteristic;
pub mod closed_form_map;
pub mod compression;
pub mod driven;
pub mod effect;
pub mod effect_kind;
pub mod efficiency_shape;
pub mod follow_outlet;
pub mod forecast;
pub mod hooks;
pub mod housing;
pub mod inlet_convection;
pub mod inlet_limit;
pub mod inputs;
pub mod instruments;
pub mod line_points;
pub mod model;
pub mod nominal_rig;
pub mod nusselt;
pub mod orifice;
pub mod outputs;
pub mod params;
mod power;
pub mod pressure_tap;
pub mod reach;
pub mod rodas5p;
pub mod rosenbrock;
pub mod sensor_fault;
pub mod settled;
pub mod similarity;
pub mod simulate;
pub mod speed_response;
pub mod standstill;
pub mod state;
pub mod steady;
pub mod tabulated_map;
pub mod thermocouple;
pub mod turbine;
