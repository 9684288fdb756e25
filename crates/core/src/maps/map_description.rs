//! A user's description of a map file: the data that the file omits.

use crate::ReferenceState;

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
