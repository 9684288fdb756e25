//! `sensors:`

use crate::units::{Fraction, Length, MassFlow, PressureDifference, Quantity, Speed, TemperatureDifference};
use schemars::JsonSchema;
use serde::Deserialize;

/// Declared uncertainty of each measured channel, by its symbol; one standard deviation throughout.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SensorsFile {
    /// Shaft speed.
    #[serde(rename = "N")]
    pub n: SpeedSensor,
    /// Compressor mass flow.
    pub m_c: FlowSensor,
    /// Compressor inlet pressure.
    #[serde(rename = "P1")]
    pub p1: PressureSensor,
    /// Compressor inlet total temperature.
    #[serde(rename = "T1")]
    pub t1: TemperatureSensor,
    /// Compressor outlet pressure.
    #[serde(rename = "P2")]
    pub p2: PressureSensor,
    /// Compressor outlet total temperature.
    #[serde(rename = "T2")]
    pub t2: ProbeSensor,
    /// Compressor housing temperature.
    #[serde(rename = "Tc")]
    pub tc: TemperatureSensor,
    /// Turbine mass flow.
    pub m_t: Option<FlowSensor>,
    /// Turbine inlet pressure.
    #[serde(rename = "P3")]
    pub p3: Option<PressureSensor>,
    /// Turbine inlet total temperature.
    #[serde(rename = "T3")]
    pub t3: Option<TemperatureSensor>,
    /// Turbine outlet pressure.
    #[serde(rename = "P4")]
    pub p4: Option<PressureSensor>,
    /// Turbine outlet total temperature.
    #[serde(rename = "T4")]
    pub t4: Option<TemperatureSensor>,
    /// Turbine housing temperature.
    #[serde(rename = "Tt")]
    pub tt: Option<TemperatureSensor>,
    /// Oil inlet temperature.
    #[serde(rename = "T_oil")]
    pub t_oil: Option<TemperatureSensor>,
    /// Ambient temperature.
    #[serde(rename = "T_amb")]
    pub t_amb: Option<TemperatureSensor>,
}

/// Symbols of all channels that have a sensor.
pub(crate) const CALIBRATED: [&str; 15] =
    ["N", "m_c", "P1", "T1", "P2", "T2", "Tc", "m_t", "P3", "T3", "P4", "T4", "Tt", "T_oil", "T_amb"];

/// Speed sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpeedSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 rpm"), example = &"30 rpm")]
    pub noise: Quantity<Speed>,
    /// Fixed offset left after calibration; 0 where none is given.
    #[schemars(extend("x-min" = "0 rpm"), example = &"0 rpm")]
    pub offset: Option<Quantity<Speed>>,
    /// Fixed error of the gain; 0 where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    pub gain: Option<Quantity<Fraction>>,
}

/// Flow meter.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FlowSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 kg/s"))]
    pub noise: Quantity<MassFlow>,
    /// Fixed offset left after calibration; 0 where none is given.
    #[schemars(extend("x-min" = "0 kg/s"), example = &"0 kg/s")]
    pub offset: Option<Quantity<MassFlow>>,
    /// Fixed error of the gain; 0 where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    pub gain: Option<Quantity<Fraction>>,
}

/// Pressure sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 Pa"), example = &"20 Pa")]
    pub noise: Quantity<PressureDifference>,
    /// Fixed offset left after calibration; 0 where none is given.
    #[schemars(extend("x-min" = "0 Pa"))]
    pub offset: Option<Quantity<PressureDifference>>,
    /// Fixed error of the gain; 0 where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    pub gain: Option<Quantity<Fraction>>,
    /// What the tap feels: `total` (the default), or `static`, converted with `pipe_diameter`.
    pub tap: Option<TapName>,
    /// Inner diameter of the pipe at the tap; needed for a static tap.
    #[schemars(extend("x-above" = "0 mm", "x-max" = "1 m"), example = &"40 mm")]
    pub pipe_diameter: Option<Quantity<Length>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum TapName {
    Total,
    Static,
}

/// Temperature sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TemperatureSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 K"), example = &"0.1 K")]
    pub noise: Quantity<TemperatureDifference>,
    /// Fixed offset left after calibration; 0 where none is given.
    #[schemars(extend("x-min" = "0 K"))]
    pub offset: Option<Quantity<TemperatureDifference>>,
    /// Fixed error of the gain; 0 where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    pub gain: Option<Quantity<Fraction>>,
}

/// Temperature probe with its own inertia.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ProbeSensor {
    /// Noise of one sample.
    #[schemars(extend("x-min" = "0 K"), example = &"0.1 K")]
    pub noise: Quantity<TemperatureDifference>,
    /// Fixed offset left after calibration; 0 where none is given.
    #[schemars(extend("x-min" = "0 K"))]
    pub offset: Option<Quantity<TemperatureDifference>>,
    /// Fixed error of the gain; 0 where none is given.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
    pub gain: Option<Quantity<Fraction>>,
    /// Diameter of the probe's tip; 0 mm, the default, is a probe without inertia.
    #[schemars(extend("x-min" = "0 mm", "x-max" = "20 mm"), example = &"1.5 mm")]
    pub probe_diameter: Option<Quantity<Length>>,
}
