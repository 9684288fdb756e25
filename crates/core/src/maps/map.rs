//! The result: a compressor map in corrected quantities.

use crate::{EfficiencyDefinition, FittedMap, IdentifiedPoint, Method, ReferenceState, SurgeMark};
use serde::{Deserialize, Serialize};

/// One measured point of the map, converted to corrected quantities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// Corrected mass flow at the speed of the line, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1 at the speed of the line.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, fraction; `None` if the point could not be identified.
    pub eta: Option<f64>,
    /// The point as identified, with its uncertainty and warnings.
    pub identified: IdentifiedPoint,
    /// The correction of the point to the speed of its line; `None` if it was not corrected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<SpeedShift>,
}

/// Changes due to the correction of a point from its own corrected speed to that of its line, by similarity: flow in proportion
/// to speed, isentropic head to its square, efficiency unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedShift {
    /// Corrected speed of the line minus that of the point, rpm.
    pub speed_corrected_rpm: f64,
    /// Added to the measured corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Added to the measured pressure ratio.
    pub pressure_ratio: f64,
}

/// Points of one corrected speed, from the surge side to the choke side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpeedLine {
    /// Mean corrected speed of the line's points, rpm.
    pub speed_corrected_rpm: f64,
    /// Largest minus smallest corrected speed of the line's points, rpm.
    pub speed_spread_rpm: f64,
    /// Target shaft speed (physical) that the points share, rpm; `None` if they were grouped by measured speed.
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
    /// Method that identified the points.
    pub method: Method,
    /// Definition of the efficiencies; `None` if a map file does not name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub efficiency: Option<EfficiencyDefinition>,
    /// Description of the gas; corrected flows are those of dry air at equal Mach numbers. `None` if a map file does not name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gas: Option<String>,
    /// Speed lines in order of speed.
    pub lines: Vec<SpeedLine>,
    /// Measured surge-side ends, in order of speed; empty if none were measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub surge: Vec<SurgeMark>,
    /// Smooth surface through the points, as a table; `None` if none was fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<FittedMap>,
}

impl CompressorMap {
    /// Refers the corrected flows and speeds to another reference state.
    pub fn at_reference(mut self, reference: ReferenceState) -> Self {
        let (flow, speed) =
            (self.reference.flow_factor_to(reference), self.reference.speed_factor_to(reference));
        for line in &mut self.lines {
            line.speed_corrected_rpm *= speed;
            line.speed_spread_rpm *= speed;
            for point in &mut line.points {
                point.flow_corrected_kg_s *= flow;
                point.identified.flow_corrected_kg_s *= flow;
                point.identified.speed_corrected_rpm *= speed;
                if let Some(shift) = &mut point.shift {
                    shift.speed_corrected_rpm *= speed;
                    shift.flow_corrected_kg_s *= flow;
                }
            }
        }
        self.surge.iter_mut().for_each(|mark| mark.scale(speed, flow));
        if let Some(fitted) = &mut self.fitted {
            fitted.scale(speed, flow);
        }
        self.reference = reference;
        self
    }
}
