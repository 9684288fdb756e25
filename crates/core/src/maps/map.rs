//! The compressor map: speed lines of points, and the fit through all of them.

use crate::{EfficiencyDefinition, IdentifiedPoint, Method, ReferenceState, SurgeMark};
use serde::{Deserialize, Serialize};

/// Share of a line's largest flow at which the machine chokes. Bound: the end of a line is vertical within the reading of a flow meter.
const CHOKED_SHARE: f64 = 0.998;

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
    /// Diameter of the compressor wheel at its exit, m; `None` if it is not declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wheel_diameter_m: Option<f64>,
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
        let speed = self.reference.speed_factor_to(reference);
        self.scale_corrected(speed, self.reference.flow_factor_to(reference));
        self.reference = reference;
        self
    }

    /// Multiplies all corrected speeds and flows, with their errors.
    pub fn scale_corrected(&mut self, speed: f64, flow: f64) {
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
    }
}

/// One node of a fitted speed line. Errors are one standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FittedNode {
    /// Corrected mass flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1; below 1 at the far end of the choke side.
    pub pressure_ratio: f64,
    /// Isentropic efficiency, fraction; 0 at pressure ratio 1 and negative below, where the machine only brakes the gas.
    pub eta: f64,
    /// Isentropic efficiency by the work coefficient: isentropic work over actual work. Actual specific work over
    /// `cp T_ref`, ratio, always above 0.
    pub work_ratio: f64,
    /// Flow component of the standard error across the line, kg/s.
    pub flow_standard_error_kg_s: f64,
    /// Pressure ratio component of the standard error across the line.
    pub pressure_ratio_standard_error: f64,
    /// Standard error of `eta`, including the shared part, fraction.
    pub eta_standard_error: f64,
    /// Part of the standard error of `eta` that all nodes share, as far as the points determine it, fraction.
    #[serde(default)]
    pub eta_common_standard_error: f64,
    /// Standard error that the corrected flows of all nodes share (the gain of the flow meter), kg/s; not part of the error across
    /// the line.
    #[serde(default)]
    pub flow_common_standard_error_kg_s: f64,
    /// Standard error that the pressure ratios of all nodes share.
    #[serde(default)]
    pub pressure_ratio_common_standard_error: f64,
    /// Whether no measured point supports this node: beyond the ends of the measured lines, or between two lines
    /// beyond the outermost speeds.
    pub extrapolated: bool,
}

/// A fitted speed line, from the choke side to the surge side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedLine {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Whether this is the speed of a measured line.
    pub measured: bool,
    /// Nodes; equal index is equal `beta` on every line.
    pub nodes: Vec<FittedNode>,
}

/// Error at a speed line that was left out of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LeftOutLine {
    /// Corrected speed of the line, rpm.
    pub speed_corrected_rpm: f64,
    /// Whether the line is the slowest or the fastest: the fit was extrapolated.
    pub outermost: bool,
    /// Median orthogonal distance of its points: flow over the line's largest flow, PR - 1 over the line's largest;
    /// ratio.
    pub distance_ratio: f64,
    /// Median absolute error of efficiency at the nearest place of the fitted line, fraction; `None` if no point
    /// has an efficiency.
    pub eta: Option<f64>,
    /// Share of its points whose distance lies within the 95 % interval of the fitted line and of a point about it;
    /// `None` in files that do not contain it.
    #[serde(default)]
    pub distance_held_ratio: Option<f64>,
    /// Share of its efficiencies within their 95 % intervals; `None` without efficiencies.
    #[serde(default)]
    pub eta_held_ratio: Option<f64>,
}

/// A fitted map: a rectangular table over corrected speed and `beta` (0 at the choke end, 1 at the surge end).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FittedMap {
    /// Position of each node on its line, 0..1, rising.
    pub beta_ratio: Vec<f64>,
    /// Lines in order of speed, each with as many nodes as `beta_ratio`.
    pub lines: Vec<FittedLine>,
    /// Root mean square of the points' orthogonal distance from their fitted line (measure as in [`LeftOutLine`]).
    pub distance_rms_ratio: f64,
    /// Root mean square of the points' efficiency minus the fitted one, fraction.
    pub eta_rms: f64,
    /// Scatter of whole lines about the smooth surface (errors of speed, of the day): of flow, ratio.
    pub line_scatter_ratio: f64,
    /// Pairs of neighbouring lines that cross; 0 in a valid fit.
    pub crossings: usize,
    /// Error at each line if it is left out of the fit; empty if not requested or if there are too few lines.
    pub left_out: Vec<LeftOutLine>,
}

impl FittedMap {
    /// Surge-side end of each line: (corrected speed, rpm; node).
    pub fn surge_line(&self) -> impl Iterator<Item = (f64, &FittedNode)> {
        self.lines.iter().filter_map(|line| Some((line.speed_corrected_rpm, line.nodes.last()?)))
    }

    /// Largest flow of each line: (corrected speed, rpm; node where the flow is first reached from the surge side).
    pub fn choke_line(&self) -> impl Iterator<Item = (f64, &FittedNode)> {
        self.lines.iter().filter_map(|line| {
            let largest = line.nodes.iter().map(|n| n.flow_corrected_kg_s).fold(f64::MIN, f64::max);
            // The end of a line is vertical: the machine chokes at its top.
            let node = line.nodes.iter().rev().find(|n| n.flow_corrected_kg_s >= CHOKED_SHARE * largest)?;
            Some((line.speed_corrected_rpm, node))
        })
    }

    /// Multiplies all corrected speeds and flows, for a change of the reference state.
    pub(crate) fn scale(&mut self, speed_factor: f64, flow_factor: f64) {
        for line in &mut self.lines {
            line.speed_corrected_rpm *= speed_factor;
            for node in &mut line.nodes {
                node.flow_corrected_kg_s *= flow_factor;
                node.flow_standard_error_kg_s *= flow_factor;
                node.flow_common_standard_error_kg_s *= flow_factor;
            }
        }
        for line in &mut self.left_out {
            line.speed_corrected_rpm *= speed_factor;
        }
    }
}
