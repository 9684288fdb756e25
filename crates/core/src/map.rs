//! The product: a compressor map in corrected quantities.

use crate::{IdentifiedPoint, Method, ReferenceState};
use serde::{Deserialize, Serialize};

/// One measured point of the map, brought to corrected quantities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// Corrected mass flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, fraction; `None` where the point could not be identified.
    pub eta: Option<f64>,
    /// The point as identified, with its uncertainty and warnings.
    pub identified: IdentifiedPoint,
}

/// Points of one corrected speed, from the surge side to the choke side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpeedLine {
    /// Mean corrected speed of the line's points, rpm.
    pub speed_corrected_rpm: f64,
    /// Largest minus smallest corrected speed of the line's points, rpm.
    pub speed_spread_rpm: f64,
    /// Target shaft speed (physical) that the points share, rpm; `None` where they were grouped by measured speed.
    pub target_speed_rpm: Option<f64>,
    /// Points in order of corrected flow.
    pub points: Vec<MapPoint>,
}

/// A complete map with the state its corrected quantities refer to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompressorMap {
    /// Name of the machine.
    pub machine: String,
    /// Reference state of corrected flow and speed.
    pub reference: ReferenceState,
    /// How the points were identified.
    pub method: Method,
    /// Speed lines in order of speed.
    pub lines: Vec<SpeedLine>,
}
