//! A map or measured points read from a file, and the description of what the file leaves open.

use crate::{CompressorMap, ReferenceState};
use serde::Serialize;

/// A map from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedMap {
    /// The map.
    pub map: CompressorMap,
    /// The columns of a table; empty for files that name their fields.
    pub columns: Vec<ImportedColumn>,
    /// Assumptions and computations of the reader.
    pub remarks: Vec<ImportRemark>,
    /// The points of a table of measured points, in its order; empty for any other file.
    pub measured: Vec<MeasuredPoint>,
}

/// A steady point as measured, in total values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// Line of the file, from 1.
    pub line: usize,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Mass flow, kg/s.
    pub flow_kg_s: f64,
    /// Inlet temperature, K.
    pub t1_k: f64,
    /// Outlet temperature, K.
    pub t2_k: Option<f64>,
    /// Inlet pressure, Pa.
    pub p1_pa: f64,
    /// Outlet pressure, Pa.
    pub p2_pa: f64,
    /// Temperature of the compressor housing, K.
    pub tc_k: Option<f64>,
    /// Water per dry air, kg/kg.
    pub humidity_kg_kg: Option<f64>,
    /// Readings of the turbine side.
    pub turbine: TurbineReadings,
    /// End of its speed line, if its row names one.
    pub end: Option<LineEnd>,
}

/// Readings of a turbine and of its oil, if the table has them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TurbineReadings {
    /// Inlet temperature, K.
    pub t3_k: Option<f64>,
    /// Inlet pressure, Pa.
    pub p3_pa: Option<f64>,
    /// Outlet pressure, Pa.
    pub p4_pa: Option<f64>,
    /// Oil inlet temperature, K.
    pub oil_k: Option<f64>,
}

/// A steady point of a turbine as measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredTurbinePoint {
    /// Line of the file, from 1.
    pub line: usize,
    /// Position of the vanes.
    pub vane_position: Option<f64>,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Mass flow, kg/s.
    pub flow_kg_s: f64,
    /// Inlet temperature, K.
    pub t3_k: f64,
    /// Inlet pressure, Pa.
    pub p3_pa: f64,
    /// Outlet pressure, Pa.
    pub p4_pa: f64,
    /// Outlet temperature, K.
    pub t4_k: Option<f64>,
}

/// An end of a speed line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LineEnd {
    /// Smallest flow.
    Surge,
    /// Largest flow.
    Choke,
}

impl From<CompressorMap> for ImportedMap {
    fn from(map: CompressorMap) -> Self {
        ImportedMap { map, columns: Vec::new(), remarks: Vec::new(), measured: Vec::new() }
    }
}

/// A column of a table of points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImportedColumn {
    /// Heading; empty if it has none.
    pub heading: String,
    /// Number, from 1.
    pub number: usize,
    /// The quantity it holds.
    pub quantity: &'static str,
    /// Key of the quantity in a map description.
    pub key: &'static str,
    /// Unit as written; empty if it names none.
    pub unit: String,
    /// Smallest value in SI, speeds in rpm; volume flows as mass flows, reduced quantities as corrected ones.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

/// Assumption or computation of a map reader.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the variants describe their values")]
pub enum ImportRemark {
    /// The columns have no headings: rpm, kg/s, pressure ratio, efficiency were assumed.
    NoHeading,
    /// Columns without headings after the efficiency were ignored.
    FurtherColumns { count: usize },
    /// Columns are not used: another one has their quantity, or the map has no such quantity.
    UnusedColumns { headings: Vec<String> },
    /// Efficiencies are percentages, from their size.
    EfficiencyInPercent,
    /// A row without speed has that of the row above.
    SpeedOfRowAbove,
    /// The table has no efficiencies.
    NoEfficiency,
    /// Reduced quantities became corrected ones of this state.
    ReducedQuantities { reference: ReferenceState },
    /// Measured points were corrected; their efficiency is the apparent one, heat transfer included.
    Measured,
    /// The file names no unit of flow; kg/s was taken.
    FlowUnitAssumed,
    /// Speeds without a unit were assumed to be in rpm/K^0.5, because of their size.
    SpeedParameterAssumed,
    /// Relative speeds were multiplied by this speed.
    DesignSpeed { rpm: f64 },
    /// Extrapolated nodes of the fitted map were ignored.
    ExtrapolatedNodes { count: usize },
    /// The file has a surge line of so many points.
    SurgeLine { points: usize },
    /// So many points of the surge line have no speeds: those of the lines that end at their pressure ratios were taken, but for some.
    SurgeSpeeds { points: usize, left_out: usize },
    /// The rows below a title, or a sheet, are not used.
    UnusedBlock { title: String, rows: usize },
    /// Rows at standstill were left out.
    Standstill { rows: Vec<usize> },
    /// Points were moved to the mean speed of their line by similarity; largest difference in speed, as a ratio.
    MovedToLineSpeed { points: usize, max_ratio: f64 },
}

/// Statements about a map file. Data that are not stated must be in the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MapDescription {
    /// Reference state of the corrected quantities.
    pub reference: Option<ReferenceState>,
    /// Sheet of a workbook.
    pub sheet: Option<String>,
    /// Columns of a table and units of quantities.
    pub columns: Vec<DescribedColumn>,
    /// Values at the design point, for files with relative ones.
    pub design: DesignPoint,
    /// Diameters of the pipes in which static pressures were measured.
    pub static_taps: StaticTaps,
    /// Ambient pressure of gauge pressures, Pa.
    pub ambient_pa: Option<f64>,
}

/// A statement about a column: its heading, its number or its unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DescribedColumn {
    /// Key of the quantity: `speed`, `flow`.
    pub quantity: &'static str,
    /// `X [lb/min]`, `#2 [kg/s]`, or a unit alone.
    pub text: String,
}

/// The real values at the design point of a map, which simulation programs scale.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DesignPoint {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: Option<f64>,
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: Option<f64>,
    /// Pressure ratio.
    pub pressure_ratio: Option<f64>,
    /// Efficiency, fraction.
    pub eta: Option<f64>,
}

/// Pipes of static taps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StaticTaps {
    /// Inner diameter at P1, m; `None` if P1 is a total pressure.
    pub inlet_diameter_m: Option<f64>,
    /// Inner diameter at P2, m.
    pub outlet_diameter_m: Option<f64>,
}

impl From<Option<ReferenceState>> for MapDescription {
    fn from(reference: Option<ReferenceState>) -> Self {
        MapDescription { reference, ..MapDescription::default() }
    }
}

impl From<&MapDescription> for MapDescription {
    fn from(description: &MapDescription) -> Self {
        description.clone()
    }
}
