//! `identification:`, `order:`, `repeats:`, `outputs:`, `report:` and `display:`.

use super::grid::PointFile;
use crate::units::{Duration, Fraction, Kind, Pressure, Quantity, Temperature, Unit};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;
use std::collections::BTreeMap;

/// How efficiency and heat-transfer coefficient are found.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct IdentificationFile {
    /// `dynamic`, the default, finds both from the transient; `joint` fits all points together; `steady` is conventional mapping.
    pub method: Option<MethodName>,
    /// Part of the step that is used: `auto`, the default, begins when speed, flow and pressure ratio have settled; or `start` and `end` after the jump.
    #[schemars(example = &"auto")]
    pub window: Option<WindowFile>,
    /// Share of the internal area before compression that identification assumes, a plain number from 0 to 1; the machine's where none is given.
    #[schemars(range(min = 0, max = 1), example = 0.0)]
    pub alpha_area: Option<f64>,
    /// Drifts within which a point counts as settled.
    pub stabilisation: Option<StabilisationFile>,
    /// What `joint` finds and what it takes as declared; everything is found where nothing is said.
    pub joint: Option<JointFile>,
}

/// Refinements of the joint method. With every one switched off it is the dynamic method.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct JointFile {
    /// Share of the internal area before compression.
    pub alpha_area: Option<ChoiceName>,
    /// Diameter of the T2 probe; `fixed` takes that of `sensors.T2.probe_diameter`.
    pub probe: Option<ChoiceName>,
    /// Factor on the heat-transfer coefficient where the metal is hotter than the gas; 1 where `fixed`.
    pub direction: Option<ChoiceName>,
    /// Offsets of the sensors, with their declared uncertainty as prior.
    pub offsets: Option<ChoiceName>,
    /// Efficiency within a step: `constant`, or as a surface through all points has it.
    pub efficiency: Option<EfficiencyName>,
    /// Heat-transfer coefficient within a step: `constant`, or by a law that all points share.
    pub h: Option<ConvectionName>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ChoiceName {
    Fixed,
    Fitted,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EfficiencyName {
    Constant,
    Shaped,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ConvectionName {
    Constant,
    Law,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum MethodName {
    Dynamic,
    Joint,
    Steady,
}

// Untagged: which of the two it is shows in the YAML's own form, and the schema is checked before.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum WindowFile {
    Named(NamedWindow),
    Fixed(FixedWindow),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedWindow {
    Auto,
}

/// Part of the step, in time after the jump.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FixedWindow {
    /// Begin, after the jump.
    #[schemars(extend("x-min" = "0 s"))]
    pub start: Quantity<Duration>,
    /// End, after the jump.
    #[schemars(extend("x-above" = "0 s"), example = &"110 s")]
    pub end: Quantity<Duration>,
}

/// Drifts over the window within which a point counts as settled.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct StabilisationFile {
    /// Shaft speed; 0.8 % where none is given.
    #[schemars(extend("x-above" = "0 %", "x-max" = "100 %"), example = &"0.8 %")]
    pub speed: Option<Quantity<Fraction>>,
    /// Compressor flow; 1.5 % where none is given.
    #[schemars(extend("x-above" = "0 %", "x-max" = "100 %"), example = &"1.5 %")]
    pub flow: Option<Quantity<Fraction>>,
    /// Pressure ratio; 2 % where none is given.
    #[schemars(extend("x-above" = "0 %", "x-max" = "100 %"), example = &"2 %")]
    pub pressure_ratio: Option<Quantity<Fraction>>,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum OrderName {
    SumGradient,
    WorstGradient,
    Information,
    Time,
    Greedy,
    Listed,
}

// Untagged: which of the two it is shows in the YAML's own form, and the schema is checked before.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum RepeatsFile {
    Named(NamedRepeats),
    Jump(RepeatedJumpFile),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedRepeats {
    Off,
}

/// A jump that is made again and again.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RepeatedJumpFile {
    /// The jump; where none is given, from the slowest to the fastest point of the middle opening, or the next best jump that is allowed.
    pub jump: Option<JumpFile>,
    /// Steps between two repeats, at most; 12 where none is given.
    #[schemars(range(min = 2, max = 20000), example = 12)]
    pub every: Option<usize>,
    /// Fewest repeats; 2 where none is given.
    #[schemars(range(min = 1, max = 1000), example = 2)]
    pub at_least: Option<usize>,
}

/// From where to where.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct JumpFile {
    /// The point before the jump.
    pub from: PointFile,
    /// The point after it.
    pub to: PointFile,
}

/// What is done about drift.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriftFile {
    /// `hold` ends the run in its safe state, `zero` too and asks for a zero of the sensors, `continue` goes on with a note.
    #[schemars(example = &"hold")]
    pub on_drift: OnDriftName,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum OnDriftName {
    Hold,
    Continue,
    Zero,
}

/// What is written, and where.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OutputsFile {
    /// Directory of the run directories; `runs` where none is given.
    #[schemars(length(min = 1), example = &"runs")]
    pub directory: Option<String>,
    /// Formats of the map; csv, json, svg and fitted where none is given.
    #[schemars(extend("uniqueItems" = true, "examples" = [["csv", "json", "svg"]]))]
    pub formats: Option<Vec<FormatName>>,
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FormatName {
    Csv,
    Json,
    Svg,
    Png,
    Sae,
    Fitted,
    Modelica,
    Simscape,
    Npss,
    Pycycle,
}

/// What a test report needs and no sensor measures.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReportFile {
    /// Who ran the test.
    pub operator: Option<String>,
    /// Where it was run.
    pub test_cell: Option<String>,
    /// Day of the last calibration of each sensor, by its symbol, e.g. `T2: 2026-09-01`.
    pub calibration: Option<BTreeMap<SensorSymbol, Date>>,
    /// Barometric pressure in the cell.
    #[schemars(extend("x-min" = "50 kPa", "x-max" = "120 kPa"))]
    pub barometer: Option<Quantity<Pressure>>,
    /// Relative humidity in the cell.
    #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"), example = &"50 %")]
    pub humidity: Option<Quantity<Fraction>>,
    /// Temperature in the cell, if it differs from `boundary.ambient_temperature`.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    pub cell_temperature: Option<Quantity<Temperature>>,
}

/// A channel that has a sensor, by its symbol.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(transparent)]
pub(crate) struct SensorSymbol(pub mapper_core::Channel);

impl JsonSchema for SensorSymbol {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "SensorSymbol".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({"type": "string", "enum": super::CALIBRATED})
    }
}

/// A day, written year-month-day, e.g. `2026-09-01`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(transparent)]
pub(crate) struct Date(
    #[schemars(regex(pattern = r"^[0-9]{4}-(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])$"), example = &"2026-09-01")]
    pub String,
);

/// Units in which people are shown results.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DisplayFile {
    /// Unit of temperatures; degC where none is given.
    #[schemars(extend("enum" = symbols(Kind::Temperature)), example = &"degC")]
    pub temperature: Option<String>,
    /// Unit of pressures; kPa where none is given.
    #[schemars(extend("enum" = symbols(Kind::Pressure)), example = &"kPa")]
    pub pressure: Option<String>,
    /// Unit of shaft speeds; krpm where none is given.
    #[schemars(extend("enum" = symbols(Kind::Speed)), example = &"krpm")]
    pub speed: Option<String>,
    /// Unit of mass flows; g/s where none is given.
    #[schemars(extend("enum" = symbols(Kind::MassFlow)), example = &"g/s")]
    pub flow: Option<String>,
}

fn symbols(kind: Kind) -> serde_json::Value {
    json!(kind.units().iter().map(Unit::symbol).collect::<Vec<_>>())
}
