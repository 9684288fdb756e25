//! The map of a turbine: flow and efficiency over expansion ratio and speed, and over the position of its vanes.

use crate::{ImportRemark, ImportedColumn, MeasuredTurbinePoint};
use serde::{Deserialize, Serialize};

/// One point of a turbine map. Speed and flow are reduced by the state at the inlet, so they need no reference state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TurbineMapPoint {
    /// Position of the vanes or of the bypass valve, as in the file; `None` for fixed geometry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vane_position: Option<f64>,
    /// Speed over the root of the inlet temperature, rpm/K^0.5.
    pub speed_parameter_rpm_sqrt_k: f64,
    /// Flow parameter `m sqrt(T3)/P3`, kg K^0.5/(s kPa).
    pub flow_parameter_kg_sqrt_k_s_kpa: f64,
    /// Expansion ratio, above 1.
    pub expansion_ratio: f64,
    /// Efficiency, fraction; `None` if the file has none.
    pub efficiency: Option<f64>,
}

/// A turbine map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TurbineMap {
    /// Name of the machine; empty if the file names none.
    pub machine: String,
    /// Points in order of vane position, speed and expansion ratio.
    pub points: Vec<TurbineMapPoint>,
    /// Smooth surface through the points, as a table; `None` if none was fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<FittedTurbine>,
}

/// A smooth turbine map as a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedTurbine {
    /// Lines in order of vane position and speed.
    pub lines: Vec<FittedTurbineLine>,
    /// Root mean square of the flow's error at lines that were left out of the fit, fraction of the flow.
    pub flow_error_rms_ratio: f64,
    /// Root mean square of the efficiency's error at these lines, fraction; `None` without efficiencies.
    pub efficiency_error_rms: Option<f64>,
}

/// A line of a fitted turbine map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedTurbineLine {
    /// Position of the vanes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vane_position: Option<f64>,
    /// Speed parameter, rpm/K^0.5.
    pub speed_parameter_rpm_sqrt_k: f64,
    /// Nodes in order of expansion ratio, which is the same for all lines.
    pub nodes: Vec<FittedTurbineNode>,
}

/// A node of a fitted turbine map, with 95 % intervals of a measurement at the node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FittedTurbineNode {
    /// Expansion ratio.
    pub expansion_ratio: f64,
    /// Flow parameter, kg K^0.5/(s kPa).
    pub flow_parameter_kg_sqrt_k_s_kpa: f64,
    /// Lower end of its interval.
    pub flow_low: f64,
    /// Upper end of its interval.
    pub flow_high: f64,
    /// Efficiency, fraction.
    pub efficiency: Option<f64>,
    /// Lower end of its interval.
    pub efficiency_low: Option<f64>,
    /// Upper end of its interval.
    pub efficiency_high: Option<f64>,
    /// Whether the node is beyond the measured expansion ratios of the line.
    pub extrapolated: bool,
}

/// A turbine map from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedTurbine {
    /// The map.
    pub map: TurbineMap,
    /// The columns of the table.
    pub columns: Vec<ImportedColumn>,
    /// Assumptions of the reader.
    pub remarks: Vec<ImportRemark>,
    /// The points of a table of measured points, in its order; empty for any other file.
    pub measured: Vec<MeasuredTurbinePoint>,
}

impl From<TurbineMap> for ImportedTurbine {
    fn from(map: TurbineMap) -> Self {
        ImportedTurbine { map, columns: Vec::new(), remarks: Vec::new(), measured: Vec::new() }
    }
}

impl TurbineMap {
    /// Ratio of the speeds of two points of one line. Bound: it varies by 1 %, and lines of maps are at least 5 % apart.
    pub const SAME_LINE_RATIO: f64 = 1.015;

    /// The speed lines: points of one vane position whose speeds differ by less than 1.5 %, as lines of compressor maps.
    pub fn lines(&self) -> impl Iterator<Item = &[TurbineMapPoint]> {
        self.points.chunk_by(|a, b| {
            a.vane_position == b.vane_position
                && b.speed_parameter_rpm_sqrt_k <= TurbineMap::SAME_LINE_RATIO * a.speed_parameter_rpm_sqrt_k
        })
    }
}
