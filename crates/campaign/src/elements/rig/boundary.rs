//! `boundary:`

use crate::si_values::value_or;
use crate::units::{Pressure, Quantity, Temperature};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::follow_outlet::FollowOutlet;
use schemars::JsonSchema;
use serde::Deserialize;

/// Conditions that the rig and the cell hold constant.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoundaryFile {
    /// Compressor inlet total temperature, T1.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    inlet_temperature: Quantity<Temperature>,
    /// Compressor inlet total pressure, P1.
    #[schemars(extend("x-min" = "20 kPa", "x-max" = "400 kPa"))]
    inlet_pressure: Quantity<Pressure>,
    /// Temperature around the housings; `inlet_temperature` if none is given.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    ambient_temperature: Option<Quantity<Temperature>>,
    /// Turbine inlet total temperature, T3.
    #[schemars(extend("x-min" = "250 K", "x-max" = "1400 K"), example = &"500 degC")]
    turbine_inlet_temperature: Quantity<Temperature>,
    /// Turbine outlet pressure, P4.
    #[schemars(extend("x-min" = "20 kPa", "x-max" = "400 kPa"), example = &"110 kPa")]
    turbine_outlet_pressure: Quantity<Pressure>,
    /// Oil inlet temperature.
    #[schemars(extend("x-min" = "230 K", "x-max" = "450 K"), example = &"50 degC")]
    oil_temperature: Quantity<Temperature>,
    /// Conditions that follow the outlet temperature of the compressor instead, which is that of the nominal machine in steady state at each point: `[turbine_inlet_temperature, oil_temperature]` for adiabatic mapping. None if it is omitted.
    #[serde(default)]
    #[schemars(extend("uniqueItems" = true, "examples" = [["turbine_inlet_temperature", "oil_temperature"]]))]
    follow_outlet: Vec<FollowerName>,
}

/// Quantities that may follow the compressor outlet temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FollowerName {
    TurbineInletTemperature,
    OilTemperature,
}

impl BoundaryFile {
    /// The boundary conditions; P3 and valve come from the plan, and are set to no flow and to 1 until then.
    pub(crate) fn conditions(&self) -> BoundaryConditions {
        BoundaryConditions {
            t1_k: self.inlet_temperature.value,
            p1_pa: self.inlet_pressure.value,
            p3_pa: self.turbine_outlet_pressure.value,
            t3_k: self.turbine_inlet_temperature.value,
            p4_pa: self.turbine_outlet_pressure.value,
            oil_temperature_k: self.oil_temperature.value,
            ambient_temperature_k: value_or(self.ambient_temperature, self.inlet_temperature.value),
            valve_opening_ratio: 1.0,
        }
    }

    /// Conditions that follow the outlet temperature instead.
    pub(crate) fn follow_outlet(&self) -> FollowOutlet {
        FollowOutlet {
            turbine_inlet: self.follow_outlet.contains(&FollowerName::TurbineInletTemperature),
            oil: self.follow_outlet.contains(&FollowerName::OilTemperature),
        }
    }
}
