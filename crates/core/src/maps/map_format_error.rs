//! Errors of writing and reading maps.

use crate::{ReferenceState, step_number};

/// The error of a library below a format.
type Cause = Box<dyn std::error::Error + Send + Sync>;

/// Reason why a map could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The library that writes the format failed.
    #[error("failed to write the map as {format}: {source}")]
    Failed {
        /// The format.
        format: &'static str,
        /// The error of the library.
        source: Cause,
    },
    /// A coordinate is NaN: JSON would turn it into null, and the file would be unreadable.
    #[error("step {}: {quantity} is {value}, which the format cannot represent; remove the point from the map", step_number(*step))]
    NotFinite {
        /// Index of the step, from 0.
        step: usize,
        /// Name of the field.
        quantity: &'static str,
        /// Value.
        value: f64,
    },
    /// The format is a table over the whole map, and the map has only points.
    #[error("`{format}` needs a fitted map, but this one has only points; fit it first")]
    NeedsFit {
        /// The format.
        format: &'static str,
    },
    /// The format has no maps of turbines.
    #[error("turbine maps cannot be written as `{format}`; choose csv, sae, json, modelica or simscape")]
    NoTurbine {
        /// The format.
        format: &'static str,
    },
    /// The format is read-only.
    #[error("`{format}` can only be read; choose another format to write")]
    OnlyRead {
        /// The format.
        format: &'static str,
    },
}

impl ExportError {
    /// The library that writes `format` failed.
    pub fn failed<E: Into<Cause>>(format: &'static str) -> impl Fn(E) -> ExportError {
        move |source| ExportError::Failed { format, source: source.into() }
    }
}

/// Reason why a file is not a map.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Larger than any map.
    #[error("the file has {bytes} bytes; a map has at most {limit}")]
    TooLarge {
        /// Size.
        bytes: usize,
        /// Largest size read.
        limit: usize,
    },
    /// Not text.
    #[error("line {line} contains control characters, so the file is not text; save the map as CSV or text")]
    NotText {
        /// Line, from 1.
        line: usize,
    },
    /// A row that the library below the format cannot parse.
    #[error("line {line}: {source}")]
    Row {
        /// Line, from 1.
        line: usize,
        /// The error of the library.
        source: Cause,
    },
    /// A row that does not have the form of the format.
    #[error("line {line}: `{text}` is not {form}")]
    RowForm {
        /// Line, from 1.
        line: usize,
        /// The row, shortened.
        text: String,
        /// The expected form of a row.
        form: &'static str,
    },
    /// The map of a turbine.
    #[error("line {line}: `{text}` belongs to a turbine map, but a compressor map is needed here")]
    Turbine {
        /// Line, from 1.
        line: usize,
        /// The title or heading, shortened.
        text: String,
    },
    /// The format has no maps of turbines.
    #[error(
        "turbine maps cannot be read from `{format}`; give a table of points as CSV, text or workbook, or JSON written by this program"
    )]
    NoTurbine {
        /// The format.
        format: &'static str,
    },
    /// A column whose unit decides its size by powers of ten.
    #[error(
        "line {line}: the column `{heading}` has no unit; write it into the heading, or state it in a map description, e.g. `{key}={example}`"
    )]
    NoUnit {
        /// Line of the heading, from 1.
        line: usize,
        /// The heading.
        heading: String,
        /// Key of the quantity.
        key: &'static str,
        /// A unit.
        example: &'static str,
    },
    /// A table without a column that every map has.
    #[error(
        "line {line}: no column contains the {missing} (found: {found}); name it in its heading, with the unit, e.g. `flow [kg/s]`"
    )]
    NoColumn {
        /// Line of the heading, from 1.
        line: usize,
        /// The quantity that is missing.
        missing: &'static str,
        /// The headings, shortened.
        found: String,
    },
    /// A file of tables without one of them.
    #[error(
        "the file has no table of the {missing}; tables have the names of T-MATS (NcVec, WcArray, PRArray, EffArray), or of pyCycle and NPSS (NcMap, WcMap, PRmap, effMap)"
    )]
    NoTable {
        /// The missing quantity.
        missing: &'static str,
    },
    /// Tables whose sizes do not belong together.
    #[error(
        "the sizes of the tables do not match: {speeds} speeds, {flows} flows, {pressure_ratios} pressure ratios, {efficiencies} efficiencies; each needs the same number of values per speed"
    )]
    TableSize {
        /// Number of speeds.
        speeds: usize,
        /// Number of flows.
        flows: usize,
        /// Number of pressure ratios.
        pressure_ratios: usize,
        /// Number of efficiencies.
        efficiencies: usize,
    },
    /// Speeds relative to a design point that the file does not give.
    #[error(
        "the speeds are relative to a design speed that is not in the file (the highest is {fastest}); state the corrected speed of the design \
         point, e.g. `design_speed=150000 rpm`"
    )]
    RelativeSpeed {
        /// The largest of them.
        fastest: f64,
    },
    /// A design speed for speeds that are not relative.
    #[error(
        "a design speed was stated, but the speeds of this file are in rpm already (the highest is {fastest} rpm); leave it out"
    )]
    DesignSpeedUnused {
        /// The largest speed, rpm.
        fastest: f64,
    },
    /// Scaled flows without unit and without the flow of the design point.
    #[error(
        "the file does not state the unit of its flows, and gas turbine programs use lb/s as well as kg/s; state the unit (`flow=kg/s`), or the \
         corrected flow of the design point (`design_flow=0.2 kg/s`)"
    )]
    FlowUnit,
    /// A design point that the tables do not have.
    #[error(
        "the design point (speed {speed}, Rline {rline}) is not in the tables, so they cannot be scaled by `design_flow`, \
         `design_pressure_ratio` or `design_efficiency`; leave these out, or correct NcMapDes and RlineMapDes"
    )]
    DesignPoint {
        /// Speed as in the file.
        speed: f64,
        /// Auxiliary coordinate.
        rline: f64,
    },
    /// An invalid statement of the user about this file.
    #[error("{key}: `{text}` {problem}")]
    Description {
        /// Key of the statement.
        key: &'static str,
        /// Text.
        text: String,
        /// The problem.
        problem: String,
    },
    /// A workbook that cannot be read.
    #[error("the workbook cannot be read as a map: {problem}")]
    Workbook {
        /// The problem.
        problem: String,
    },
    /// A compressed file that cannot be unpacked.
    #[error(
        "the compressed file cannot be unpacked: {problem}; check with `gunzip -t FILE` whether it is complete"
    )]
    Packed {
        /// The problem.
        problem: String,
    },
    /// All lines are slower than those of any turbocharger.
    #[error(
        "the fastest speed line has only {speed_corrected_rpm} rpm, which is too slow for a turbocharger; if the speeds are in krpm, write that \
         in the heading (`speed [krpm]`)"
    )]
    Slow {
        /// The fastest corrected speed, rpm.
        speed_corrected_rpm: f64,
    },
    /// More flow than an inlet can pass.
    #[error(
        "line {line}: {flow_corrected_kg_s} kg/s at {speed_corrected_rpm} rpm is more than any compressor passes ({limit_kg_s:.2} kg/s); if the \
         flows are in g/s, kg/h or lb/min, write that in the heading (`flow [g/s]`)"
    )]
    Flow {
        /// Line, from 1.
        line: usize,
        /// Corrected flow, kg/s.
        flow_corrected_kg_s: f64,
        /// Corrected speed, rpm.
        speed_corrected_rpm: f64,
        /// Largest flow of an inlet, kg/s.
        limit_kg_s: f64,
    },
    /// Flow and pressure ratio in each other's column.
    #[error(
        "line {line}: a flow of {flow_corrected_kg_s} kg/s at a pressure ratio of {pressure_ratio}: if these columns are exchanged, correct their \
         headings; otherwise write their units there"
    )]
    Exchanged {
        /// Line, from 1.
        line: usize,
        /// Corrected flow, kg/s.
        flow_corrected_kg_s: f64,
        /// Total pressure ratio.
        pressure_ratio: f64,
    },
    /// A field that holds something other than a number.
    #[error("line {line}: the {quantity} is `{text}`, not a number")]
    NotANumber {
        /// Line, from 1.
        line: usize,
        /// Name of the quantity or column.
        quantity: String,
        /// Text, shortened.
        text: String,
    },
    /// A value without physical meaning.
    #[error("line {line}: {quantity} = {value} is not possible; it must be {needed}")]
    Value {
        /// Line, from 1.
        line: usize,
        /// Name of the column.
        quantity: &'static str,
        /// Value.
        value: f64,
        /// The allowed range.
        needed: &'static str,
    },
    /// Not a map in JSON.
    #[error("the JSON is not a map written by this program: {0}")]
    Json(#[from] serde_json::Error),
    /// A field of a JSON map is not a valid number.
    #[error("{place}: {quantity} = {value} is not possible; it must be {needed}")]
    Field {
        /// Line and point of the map.
        place: String,
        /// Name of the field.
        quantity: &'static str,
        /// Value.
        value: f64,
        /// The allowed range.
        needed: &'static str,
    },
    /// The corrected quantities have no reference state.
    #[error(
        "the file does not state the reference state of its corrected flows and speeds; state it: {}, or a temperature and a pressure, e.g. \
         \"298 K, 100 kPa\"",
        crate::usual_references()
    )]
    NoReference,
    /// The reference states of file and user differ.
    #[error(
        "the file has the reference state {found}, but {given} was stated; leave the statement out, or correct the file"
    )]
    ReferenceConflict {
        /// Reference state in the file.
        found: ReferenceState,
        /// Given.
        given: ReferenceState,
    },
    /// An invalid reference state.
    #[error(
        "`{text}` is not a reference state; write {}, or a temperature and a pressure, e.g. \"298 K, 100 kPa\" (200 to 400 K, 50 to 200 kPa)",
        crate::usual_references()
    )]
    Reference {
        /// The given values.
        text: String,
    },
    /// The file is empty.
    #[error("the file contains no points")]
    Empty,
    /// More points than any map has.
    #[error("line {line}: the file has more than {limit} points, which is more than a map has")]
    TooMany {
        /// Line at which the limit was passed.
        line: usize,
        /// The limit.
        limit: usize,
    },
    /// The format is write-only.
    #[error("`{format}` can only be written; give a CSV, JSON or SAE file")]
    OnlyWritten {
        /// The format.
        format: &'static str,
    },
}
