//! Boundary conditions of the machine, and the range in which the running model is valid.

use mapper_core::with_unit;
use serde::{Deserialize, Serialize};

/// Conditions around the machine that rig or cell set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundaryConditions {
    /// Compressor inlet total temperature (station 1), K.
    pub t1_k: f64,
    /// Compressor inlet total pressure (station 1), Pa.
    pub p1_pa: f64,
    /// Turbine inlet total pressure (station 3), Pa.
    pub p3_pa: f64,
    /// Turbine inlet total temperature (station 3), K.
    pub t3_k: f64,
    /// Turbine outlet pressure (station 4), Pa.
    pub p4_pa: f64,
    /// Oil temperature, K.
    pub oil_temperature_k: f64,
    /// Ambient temperature around the housings, K.
    pub ambient_temperature_k: f64,
    /// Back-pressure valve opening relative to the nominal area, 0..2.5.
    pub valve_opening_ratio: f64,
}

impl Default for BoundaryConditions {
    /// The nominal boundary conditions, with the turbine at its outlet pressure (no flow) and the valve at 1.
    fn default() -> Self {
        BoundaryConditions {
            t1_k: 298.15,
            p1_pa: 100_000.0,
            p3_pa: 110_000.0,
            t3_k: 773.15,
            p4_pa: 110_000.0,
            oil_temperature_k: 323.15,
            ambient_temperature_k: 298.15,
            valve_opening_ratio: 1.0,
        }
    }
}

/// Boundary conditions under which the model is not valid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum BoundaryError {
    #[error(
        "P3 = {p3_pa:.0} Pa is not above P4 = {p4_pa:.0} Pa: the running model needs flow through the turbine; use standstill instead"
    )]
    NoTurbineFlow { p3_pa: f64, p4_pa: f64 },
    #[error(
        "{name} = {} has no physical meaning here; it must be finite and above {}",
        with_unit(value, unit),
        with_unit(0, unit)
    )]
    NotPhysical { name: &'static str, value: f64, unit: &'static str },
}

impl BoundaryConditions {
    /// Checks that the running model is valid here.
    ///
    /// # Errors
    /// A pressure, temperature or opening that is not positive and finite, or P3 not above P4.
    pub fn check(&self) -> Result<(), BoundaryError> {
        for (name, value, unit) in [
            ("T1", self.t1_k, "K"),
            ("P1", self.p1_pa, "Pa"),
            ("P3", self.p3_pa, "Pa"),
            ("T3", self.t3_k, "K"),
            ("P4", self.p4_pa, "Pa"),
            ("T_oil", self.oil_temperature_k, "K"),
            ("T_amb", self.ambient_temperature_k, "K"),
            ("valve opening", self.valve_opening_ratio, "1"),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(BoundaryError::NotPhysical { name, value, unit });
            }
        }
        if self.p3_pa <= self.p4_pa {
            return Err(BoundaryError::NoTurbineFlow { p3_pa: self.p3_pa, p4_pa: self.p4_pa });
        }
        Ok(())
    }
}
