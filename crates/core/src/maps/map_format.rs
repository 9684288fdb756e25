//! The interface of map formats, and the errors of reading and writing.

use crate::unit_factors::RPM_PER_KRPM;
use crate::{
    CompressorMap, ImportedMap, ImportedTurbine, MapDescription, ReferenceState, TurbineMap, step_number,
};

/// Maximum size of a map file, bytes. Bound: a measured map has some ten thousand.
pub const MAP_FILE_SIZE_LIMIT: usize = 32 << 20;

/// Turns a map into the bytes of a file. The same map gives the same bytes.
pub type WriteMap = fn(&CompressorMap) -> Result<Vec<u8>, ExportError>;

/// Turns a map into the bytes of a picture with numbers in these units.
pub type DrawMap = fn(&CompressorMap, &MapUnits) -> Result<Vec<u8>, ExportError>;

/// Units of a picture of a map; the map itself stays in kg/s and rpm.
#[derive(Debug, Clone, PartialEq)]
pub struct MapUnits {
    /// Unit of flows.
    pub flow: String,
    /// A flow of 1 kg/s in this unit, > 0.
    pub flow_of_one_kg_s: f64,
    /// Unit of speeds.
    pub speed: String,
    /// A speed of 1 rpm in this unit, > 0.
    pub speed_of_one_rpm: f64,
}

impl Default for MapUnits {
    /// kg/s and krpm.
    fn default() -> Self {
        MapUnits {
            flow: "kg/s".to_owned(),
            flow_of_one_kg_s: 1.0,
            speed: "krpm".to_owned(),
            speed_of_one_rpm: 1.0 / RPM_PER_KRPM,
        }
    }
}

/// Parses the bytes of a file into a map; the second argument is the user's description of the file.
///
/// A map without a reference state is rejected: a wrong one shifts speeds by 1.7 % and more, and is not noticed.
pub type ReadMap = fn(&[u8], &MapDescription) -> Result<ImportedMap, ImportError>;

/// Turns a turbine map into the bytes of a file.
pub type WriteTurbine = fn(&TurbineMap) -> Result<Vec<u8>, ExportError>;
/// Reads a turbine map from the bytes of a file.
pub type ReadTurbine = fn(&[u8], &MapDescription) -> Result<ImportedTurbine, ImportError>;

/// The writer and the reader of turbine maps in a format.
#[derive(Debug, Clone, Copy, Default)]
pub struct TurbineFormat {
    /// Turns a map into the bytes of a file.
    pub write: Option<WriteTurbine>,
    /// Parses the bytes of a file.
    pub read: Option<ReadTurbine>,
}

impl TurbineFormat {
    /// A format without turbine maps.
    pub const NONE: TurbineFormat = TurbineFormat { write: None, read: None };
}

/// One file format of maps.
#[derive(Debug, Clone, Copy)]
pub struct MapFormat {
    /// Name as written in campaigns and on the command line.
    pub name: &'static str,
    /// Extension, without the dot, of written files; it may have several parts (`fitted.csv`).
    pub extension: &'static str,
    /// Further extensions of its files.
    pub further_extensions: &'static [&'static str],
    /// A one-line description.
    pub description: &'static str,
    /// Writer, if the format can be written.
    pub write: Option<WriteMap>,
    /// Writer in display units, if the format is a picture.
    pub draw: Option<DrawMap>,
    /// Extension and writer of a second file with what the format has no place for.
    pub companion: Option<(&'static str, WriteMap)>,
    /// Reader, if the format can be read.
    pub read: Option<ReadMap>,
    /// Writer and reader of turbine maps.
    pub turbine: TurbineFormat,
}

impl MapFormat {
    /// A format that can neither be written nor read: the values of the fields that a format does not set.
    pub const NONE: MapFormat = MapFormat {
        name: "",
        extension: "",
        further_extensions: &[],
        description: "",
        write: None,
        draw: None,
        companion: None,
        read: None,
        turbine: TurbineFormat::NONE,
    };

    /// All extensions of its files.
    fn extensions(&self) -> impl Iterator<Item = &'static str> + use<> {
        std::iter::once(self.extension).chain(self.further_extensions.iter().copied())
    }

    /// Writes a file with `map`.
    pub fn write(&self, map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
        match self.write {
            Some(write) => write(map),
            None => Err(ExportError::OnlyRead { format: self.name }),
        }
    }

    /// Writes a map in display units, if the format is a picture.
    pub fn write_in(&self, map: &CompressorMap, units: &MapUnits) -> Result<Vec<u8>, ExportError> {
        self.draw.map_or_else(|| self.write(map), |draw| draw(map, units))
    }

    /// Parses the map of a file; `given` is the user's description of it, or the reference state alone.
    ///
    /// # Errors
    /// [`ImportError`]: the format is write-only, the file is too large, not text, not a map (with its line), or
    /// without a reference state.
    pub fn read(&self, bytes: &[u8], given: impl Into<MapDescription>) -> Result<ImportedMap, ImportError> {
        let read = self.read.ok_or(ImportError::OnlyWritten { format: self.name })?;
        if bytes.len() > MAP_FILE_SIZE_LIMIT {
            return Err(ImportError::TooLarge { bytes: bytes.len(), limit: MAP_FILE_SIZE_LIMIT });
        }
        read(bytes, &given.into())
    }

    /// Writes a file with the map of a turbine.
    pub fn write_turbine(&self, map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
        match self.turbine.write {
            Some(write) => write(map),
            None => Err(ExportError::NoTurbine { format: self.name }),
        }
    }

    /// Parses the map of a turbine.
    pub fn read_turbine(
        &self,
        bytes: &[u8],
        given: impl Into<MapDescription>,
    ) -> Result<ImportedTurbine, ImportError> {
        let read = self.turbine.read.ok_or(ImportError::NoTurbine { format: self.name })?;
        if bytes.len() > MAP_FILE_SIZE_LIMIT {
            return Err(ImportError::TooLarge { bytes: bytes.len(), limit: MAP_FILE_SIZE_LIMIT });
        }
        read(bytes, &given.into())
    }
}

/// The formats of a program.
#[derive(Debug, Clone, Copy)]
pub struct MapFormats(pub &'static [MapFormat]);

impl MapFormats {
    /// All formats, in display order.
    pub fn iter(self) -> impl Iterator<Item = &'static MapFormat> {
        self.0.iter()
    }

    /// The format with this name.
    pub fn find(self, name: &str) -> Option<&'static MapFormat> {
        self.iter().find(|format| format.name == name)
    }

    /// The formats that can be written.
    pub fn written(self) -> impl Iterator<Item = &'static MapFormat> {
        self.iter().filter(|format| format.write.is_some())
    }

    /// The format for writing a file of this name, ignoring case. The longest extension counts:
    /// `map.fitted.csv` is not plain CSV.
    pub fn written_to(self, file_name: &str) -> Option<&'static MapFormat> {
        let file_name = file_name.to_ascii_lowercase();
        let ends =
            |extension: &&str| file_name.strip_suffix(*extension).is_some_and(|before| before.ends_with('.'));
        let fitting = |format: &'static MapFormat| {
            let longest = format.extensions().filter(ends).map(str::len).max()?;
            Some((longest, format))
        };
        let longest = self.written().filter_map(fitting).max_by_key(|(length, _)| *length);
        longest.map(|(_, format)| format)
    }

    /// The format for reading a file with this extension (without the dot).
    pub fn read_from(self, extension: &str) -> Option<&'static MapFormat> {
        let is_read = |format: &&MapFormat| {
            format.read.is_some() && format.extensions().any(|known| known.eq_ignore_ascii_case(extension))
        };
        self.iter().find(is_read)
    }

    /// Every extension of files that can be read.
    pub fn read_extensions(self) -> impl Iterator<Item = &'static str> {
        self.iter().filter(|format| format.read.is_some()).flat_map(MapFormat::extensions)
    }
}

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

fn quoted_or_missing(text: &str) -> String {
    if text.is_empty() { "missing".to_owned() } else { format!("`{text}`") }
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
    #[error(
        "line {line}: as at {points} of {of} points, {problem}, so these are not the readings of a compressor; name its columns, e.g. `p1=#5`, \
         or read the file as a turbine map"
    )]
    NotACompressor { line: usize, points: usize, of: usize, problem: &'static str },
    #[error("line {line}: the {quantity} is {}, not a number", quoted_or_missing(text))]
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
