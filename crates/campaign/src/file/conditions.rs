//! `boundary:`, `timing:`, `limits:` and reference states.

use crate::units::{Duration, Fraction, Pressure, Quantity, Speed, Temperature, TemperatureDifference};
use schemars::JsonSchema;
use serde::Deserialize;

/// What the rig and the cell hold constant.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoundaryFile {
    /// Compressor inlet total temperature, T1.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    pub inlet_temperature: Quantity<Temperature>,
    /// Compressor inlet total pressure, P1.
    #[schemars(extend("x-min" = "20 kPa", "x-max" = "400 kPa"))]
    pub inlet_pressure: Quantity<Pressure>,
    /// Temperature around the housings; `inlet_temperature` where none is given.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    pub ambient_temperature: Option<Quantity<Temperature>>,
    /// Turbine inlet total temperature, T3.
    #[schemars(extend("x-min" = "250 K", "x-max" = "1400 K"), example = &"500 degC")]
    pub turbine_inlet_temperature: Quantity<Temperature>,
    /// Turbine outlet pressure, P4.
    #[schemars(extend("x-min" = "20 kPa", "x-max" = "400 kPa"), example = &"110 kPa")]
    pub turbine_outlet_pressure: Quantity<Pressure>,
    /// Oil inlet temperature.
    #[schemars(extend("x-min" = "230 K", "x-max" = "450 K"), example = &"50 degC")]
    pub oil_temperature: Quantity<Temperature>,
    /// What is held at the compressor's outlet temperature instead, at each point at that of the nominal machine settled there: `[turbine_inlet_temperature, oil_temperature]` for adiabatic mapping. Nothing where none is given.
    #[schemars(extend("uniqueItems" = true, "examples" = [["turbine_inlet_temperature", "oil_temperature"]]))]
    pub follow_outlet: Option<Vec<FollowerName>>,
}

/// What may follow the compressor's outlet temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FollowerName {
    TurbineInletTemperature,
    OilTemperature,
}

/// How long things take.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TimingFile {
    /// Time at the first point before its step begins; 0 s where none is given.
    #[schemars(extend("x-min" = "0 s", "x-max" = "24 h"), example = &"10 min")]
    pub warm_up: Option<Quantity<Duration>>,
    /// Time without flow after the last step; 0 s where none is given.
    #[schemars(extend("x-min" = "0 s", "x-max" = "24 h"), example = &"0 s")]
    pub cool_down: Option<Quantity<Duration>>,
    /// Time at each point, jump included.
    #[schemars(extend("x-above" = "0 s", "x-max" = "24 h"), example = &"120 s")]
    pub dwell: Quantity<Duration>,
}

/// What the run must never leave.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LimitsFile {
    /// Highest shaft speed.
    #[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"), example = &"180 krpm")]
    pub speed: Quantity<Speed>,
    /// Lowest and highest turbine inlet pressure the rig may be told, P3.
    pub turbine_inlet_pressure: PressureRangeFile,
    /// Highest turbine inlet temperature, T3.
    #[schemars(extend("x-min" = "250 K", "x-max" = "1400 K"), example = &"600 degC")]
    pub turbine_inlet_temperature: Option<Quantity<Temperature>>,
    /// Highest compressor outlet temperature, T2.
    #[schemars(extend("x-min" = "250 K", "x-max" = "800 K"), example = &"250 degC")]
    pub compressor_outlet_temperature: Option<Quantity<Temperature>>,
    /// Smallest surge margin: flow over the surge flow at equal corrected speed, minus one.
    #[schemars(extend("x-min" = "-50 %", "x-max" = "200 %"), example = &"2 %")]
    pub surge_margin: Option<Quantity<Fraction>>,
    /// Largest change of the compressor housing within an identification window.
    #[schemars(extend("x-above" = "0 K", "x-max" = "500 K"), example = &"30 K")]
    pub housing_gradient: Option<Quantity<TemperatureDifference>>,
}

/// Lowest and highest pressure.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureRangeFile {
    /// Lowest pressure.
    #[schemars(extend("x-above" = "0 kPa", "x-max" = "2 MPa"), example = &"110 kPa")]
    pub min: Quantity<Pressure>,
    /// Highest pressure.
    #[schemars(extend("x-above" = "0 kPa", "x-max" = "2 MPa"), example = &"400 kPa")]
    pub max: Quantity<Pressure>,
    /// Time the rig takes from the lowest to the highest pressure; where none is given it plays no part in the plan.
    #[schemars(extend("x-above" = "0 s", "x-max" = "24 h"), example = &"10 s")]
    pub stroke: Option<Quantity<Duration>>,
}

// Untagged: which of the two it is shows in the YAML's own form, and the schema is checked before.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum ReferenceFile {
    Named(NamedReference),
    State(StateFile),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
pub(crate) enum NamedReference {
    #[serde(rename = "SAE")]
    Sae,
    Garrett,
    BorgWarner,
}

/// A reference state.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StateFile {
    /// Reference temperature.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"), example = &"298 K")]
    pub temperature: Quantity<Temperature>,
    /// Reference pressure.
    #[schemars(extend("x-min" = "50 kPa", "x-max" = "200 kPa"))]
    pub pressure: Quantity<Pressure>,
}
