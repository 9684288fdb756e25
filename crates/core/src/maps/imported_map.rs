//! A map from a file, with what the reader understood.

use crate::{CompressorMap, ReferenceState};
use serde::Serialize;

/// A map from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedMap {
    /// The map.
    pub map: CompressorMap,
    /// The columns of a table; empty for files that name their fields.
    pub columns: Vec<ImportedColumn>,
    /// What the reader assumed or computed.
    pub remarks: Vec<ImportRemark>,
}

impl From<CompressorMap> for ImportedMap {
    fn from(map: CompressorMap) -> Self {
        ImportedMap { map, columns: Vec::new(), remarks: Vec::new() }
    }
}

/// A column of a table of points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImportedColumn {
    /// Its heading; empty if it has none.
    pub heading: String,
    /// Its number, from 1.
    pub number: usize,
    /// The quantity it holds.
    pub quantity: &'static str,
    /// Key of the quantity in a map description.
    pub key: &'static str,
    /// Its unit as written; empty if it names none.
    pub unit: String,
    /// Smallest value in SI, speeds in rpm; volume flows as mass flows, reduced quantities as corrected ones.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

/// What a reader of a map assumed or computed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ImportRemark {
    /// The columns have no headings: rpm, kg/s, pressure ratio, efficiency were assumed.
    NoHeading,
    /// Efficiencies are percentages, from their size.
    EfficiencyInPercent,
    /// A row without speed has that of the row above.
    SpeedOfRowAbove,
    /// The table has no efficiencies.
    NoEfficiency,
    /// Reduced quantities became corrected ones of this state.
    ReducedQuantities {
        /// The state.
        reference: ReferenceState,
    },
    /// Measured points were corrected; their efficiency is the apparent one, heat transfer included.
    Measured,
    /// The file names no unit of flow; kg/s was taken.
    FlowUnitAssumed,
    /// Speeds without a unit were taken as rpm/K^0.5, from their size.
    SpeedParameterAssumed,
    /// Relative speeds were multiplied by this one.
    DesignSpeed {
        /// Speed of 1, rpm.
        rpm: f64,
    },
    /// Nodes that the fit of the map extrapolated were left out.
    ExtrapolatedNodes {
        /// Their number.
        count: usize,
    },
}
