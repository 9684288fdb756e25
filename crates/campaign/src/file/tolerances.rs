//! `tolerances:`

use crate::units::{Duration, Fraction, Quantity};
use schemars::JsonSchema;
use serde::Deserialize;

/// How far the nominal model may be off without anything being wrong, one standard deviation each. The diagnosis of the gap calls nothing within them an effect.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TolerancesFile {
    /// Gain of the compressor's flow meter; 0.5 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    pub flow_meter_gain: Option<Quantity<Fraction>>,
    /// Flow of the compressor map; 0.5 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    pub flow_map: Option<Quantity<Fraction>>,
    /// Efficiency of the compressor map, everywhere alike; 0.5 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    pub compressor_efficiency: Option<Quantity<Fraction>>,
    /// Error of the efficiency map that changes smoothly over it; 0.3 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.3 %")]
    pub efficiency_shape: Option<Quantity<Fraction>>,
    /// Efficiency of the turbine; 1 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"1 %")]
    pub turbine_efficiency: Option<Quantity<Fraction>>,
    /// Area of the back-pressure valve; 0.5 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    pub valve_area: Option<Quantity<Fraction>>,
    /// Convection between gas and compressor housing; 3 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"3 %")]
    pub convection: Option<Quantity<Fraction>>,
    /// Convection of both housings to the cell; 10 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"10 %")]
    pub external_convection: Option<Quantity<Fraction>>,
    /// Conductance to the oil; 5 % where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "50 %"), example = &"5 %")]
    pub oil_conductance: Option<Quantity<Fraction>>,
    /// Lag of the turbine inlet pressure behind its command, as declared; 0.3 s where none is given.
    #[schemars(extend("x-min" = "0 s", "x-max" = "60 s"), example = &"0.3 s")]
    pub actuator_lag: Option<Quantity<Duration>>,
}
