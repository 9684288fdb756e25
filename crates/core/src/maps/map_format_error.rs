//! Errors of writing and reading maps.

use crate::{ReferenceState, step_number};

/// The error of a library below a format.
type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Reason why a map could not be written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ExportError {
    #[error("failed to write the map as {format}: {source}")]
    Failed { format: &'static str, source: Cause },
    /// A coordinate is NaN: JSON would turn it into null, and the file would be unreadable. `step` counts from 0.
    #[error("step {}: {quantity} is {value}, which the format cannot represent; remove the point from the map", step_number(*step))]
    NotFinite { step: usize, quantity: &'static str, value: f64 },
    #[error("`{format}` needs a fitted map, but this one has only points; fit it first")]
    NeedsFit { format: &'static str },
    #[error("turbine maps cannot be written as `{format}`; choose csv, sae, json, modelica or simscape")]
    NoTurbine { format: &'static str },
    #[error("`{format}` can only be read; choose another format to write")]
    OnlyRead { format: &'static str },
}

impl ExportError {
    /// The library that writes `format` failed.
    pub fn failed<E: Into<Cause>>(format: &'static str) -> impl Fn(E) -> ExportError {
        move |source| ExportError::Failed { format, source: source.into() }
    }
}

/// Reason why a file is not a map.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ImportError {
    #[error("the file has {bytes} bytes; a map has at most {limit}")]
    TooLarge { bytes: usize, limit: usize },
    #[error("line {line} contains control characters, so the file is not text; save the map as CSV or text")]
    NotText { line: usize },
    #[error("line {line}: {source}")]
    Row { line: usize, source: Cause },
    #[error("line {line}: `{text}` is not {form}")]
    RowForm { line: usize, text: String, form: &'static str },
    #[error("line {line}: `{text}` belongs to a turbine map, but a compressor map is needed here")]
    Turbine { line: usize, text: String },
    #[error(
        "turbine maps cannot be read from `{format}`; give a table of points as CSV, text or workbook, or JSON written by this program"
    )]
    NoTurbine { format: &'static str },
    #[error(
        "line {line}: the column `{heading}` has no unit; write it into the heading, or state it in a map description, e.g. `{key}={example}`"
    )]
    NoUnit { line: usize, heading: String, key: &'static str, example: &'static str },
    #[error(
        "line {line}: no column contains the {missing} (found: {found}); name it in its heading, with the unit, e.g. `flow [kg/s]`"
    )]
    NoColumn { line: usize, missing: &'static str, found: String },
    #[error(
        "the file has no table of the {missing}; tables have the names of T-MATS (NcVec, WcArray, PRArray, EffArray), or of pyCycle and NPSS (NcMap, WcMap, PRmap, effMap)"
    )]
    NoTable { missing: &'static str },
    #[error(
        "the sizes of the tables do not match: {speeds} speeds, {flows} flows, {pressure_ratios} pressure ratios, {efficiencies} efficiencies; each needs the same number of values per speed"
    )]
    TableSize { speeds: usize, flows: usize, pressure_ratios: usize, efficiencies: usize },
    #[error(
        "the speeds are relative to a design speed that is not in the file (the highest is {fastest}); state the corrected speed of the design \
         point, e.g. `design_speed=150000 rpm`"
    )]
    RelativeSpeed { fastest: f64 },
    #[error(
        "a design speed was stated, but the speeds of this file are in rpm already (the highest is {fastest} rpm); leave it out"
    )]
    DesignSpeedUnused { fastest: f64 },
    #[error(
        "the file does not state the unit of its flows, and gas turbine programs use lb/s as well as kg/s; state the unit (`flow=kg/s`), or the \
         corrected flow of the design point (`design_flow=0.2 kg/s`)"
    )]
    FlowUnit,
    #[error(
        "the design point (speed {speed}, Rline {rline}) is not in the tables, so they cannot be scaled by `design_flow`, \
         `design_pressure_ratio` or `design_efficiency`; leave these out, or correct NcMapDes and RlineMapDes"
    )]
    DesignPoint { speed: f64, rline: f64 },
    /// An invalid statement of the user about this file.
    #[error("{key}: `{text}` {problem}")]
    Description { key: &'static str, text: String, problem: String },
    #[error("the workbook cannot be read as a map: {problem}")]
    Workbook { problem: String },
    #[error(
        "the compressed file cannot be unpacked: {problem}; check with `gunzip -t FILE` whether it is complete"
    )]
    Packed { problem: String },
    #[error(
        "the fastest speed line has only {speed_corrected_rpm} rpm, which is too slow for a turbocharger; if the speeds are in krpm, write that \
         in the heading (`speed [krpm]`)"
    )]
    Slow { speed_corrected_rpm: f64 },
    #[error(
        "line {line}: {flow_corrected_kg_s} kg/s at {speed_corrected_rpm} rpm is more than any compressor passes ({limit_kg_s:.2} kg/s); if the \
         flows are in g/s, kg/h or lb/min, write that in the heading (`flow [g/s]`)"
    )]
    Flow { line: usize, flow_corrected_kg_s: f64, speed_corrected_rpm: f64, limit_kg_s: f64 },
    #[error(
        "line {line}: a flow of {flow_corrected_kg_s} kg/s at a pressure ratio of {pressure_ratio}: if these columns are exchanged, correct their \
         headings; otherwise write their units there"
    )]
    Exchanged { line: usize, flow_corrected_kg_s: f64, pressure_ratio: f64 },
    #[error("line {line}: the {quantity} is `{text}`, not a number")]
    NotANumber { line: usize, quantity: String, text: String },
    #[error("line {line}: {quantity} = {value} is not possible; it must be {needed}")]
    Value { line: usize, quantity: &'static str, value: f64, needed: &'static str },
    #[error("the JSON is not a map written by this program: {0}")]
    Json(#[from] serde_json::Error),
    #[error("{place}: {quantity} = {value} is not possible; it must be {needed}")]
    Field { place: String, quantity: &'static str, value: f64, needed: &'static str },
    #[error(
        "the file does not state the reference state of its corrected flows and speeds; state it: {}, or a temperature and a pressure, e.g. \
         \"298 K, 100 kPa\"",
        crate::usual_references()
    )]
    NoReference,
    #[error(
        "the file has the reference state {found}, but {given} was stated; leave the statement out, or correct the file"
    )]
    ReferenceConflict { found: ReferenceState, given: ReferenceState },
    #[error(
        "`{text}` is not a reference state; write {}, or a temperature and a pressure, e.g. \"298 K, 100 kPa\" (200 to 400 K, 50 to 200 kPa)",
        crate::usual_references()
    )]
    Reference { text: String },
    #[error("the file contains no points")]
    Empty,
    #[error("line {line}: the file has more than {limit} points, which is more than a map has")]
    TooMany { line: usize, limit: usize },
    #[error("`{format}` can only be written; give a CSV, JSON or SAE file")]
    OnlyWritten { format: &'static str },
}
