//! A smooth surface through all speed lines together.

mod crossing;
mod error;
mod leave_out;
mod line_errors;
mod line_shape;
mod nearest;
mod observations;
mod problem;
mod solution;
mod solve;
mod speed_spline;
mod splines;
mod table;
mod variances;

pub use error::MapFitError;
pub use leave_out::leave_out;

use line_errors::LineErrors;
use line_shape::LineShape;
use mapper_core::{CompressorMap, FittedMap};
use nearest::{Scales, nearest};
use observations::Observations;
use solution::Solution;
use solve::solve;

/// Lowest and highest speed that a fit answers for, over the slowest and the fastest measured speed.
const SPEED_REACH: (f64, f64) = (0.1, 1.3);
/// Factors on the least penalty that are tried until no lines cross.
const STIFFNESSES: [f64; 3] = [1.0, 30.0, 1000.0];

/// What a table of the fit holds.
#[derive(Debug, Clone, PartialEq)]
pub struct MapFitOptions {
    /// Corrected speeds of further lines, rpm; the measured lines are always there. `None` adds two below and one
    /// above, all extrapolated.
    pub further_speeds_rpm: Option<Vec<f64>>,
    /// Nodes on each line, 5 to 400.
    pub nodes: usize,
    /// Whether each line is left out in turn to see the error at a line that was not measured.
    pub leave_one_out: bool,
}

impl Default for MapFitOptions {
    fn default() -> Self {
        MapFitOptions { further_speeds_rpm: None, nodes: 41, leave_one_out: true }
    }
}

/// A fitted surface.
#[derive(Debug, Clone)]
pub struct MapFit {
    data: Observations,
    solution: Solution,
}

/// How far a point lies from a fitted line, and what the line says there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestPlace {
    /// Distance in units of the line's scales (flow, pressure ratio less 1), not negative.
    pub distance_ratio: f64,
    /// Efficiency of the line at the nearest place, fraction.
    pub eta: f64,
    /// One standard error of the line there, across it, in units of the line's scales.
    pub distance_standard_error: f64,
    /// One standard error of the efficiency, fraction.
    pub eta_standard_error: f64,
}

impl MapFit {
    /// Fits all lines of a map, every point at its own corrected speed.
    ///
    /// Where lines cross, the fit is made anew with stiffer parameters over speed.
    ///
    /// # Errors
    /// [`MapFitError`] where there is too little, too much or nothing sensible to fit.
    pub fn new(map: &CompressorMap) -> Result<Self, MapFitError> {
        MapFit::of(Observations::of(map)?)
    }

    pub(crate) fn of(data: Observations) -> Result<Self, MapFitError> {
        let mut best: Option<(usize, MapFit)> = None;
        for stiffness in STIFFNESSES {
            let fit = MapFit { solution: solve(&data, stiffness)?, data: data.clone() };
            let crossings = crossing::crossings(&fit.lines_for_check());
            if best.as_ref().is_none_or(|(least, _)| crossings < *least) {
                best = Some((crossings, fit));
            }
            if crossings == 0 {
                break;
            }
        }
        best.map(|(_, fit)| fit).ok_or(MapFitError::Singular)
    }

    /// Nearest place of the line at `speed_corrected_rpm` to a flow (kg/s) and pressure ratio; distances are measured
    /// in `flow_scale_kg_s` and `ratio_scale`, both above 0.
    pub fn nearest(
        &self,
        speed_corrected_rpm: f64,
        flow_corrected_kg_s: f64,
        pressure_ratio: f64,
        flow_scale_kg_s: f64,
        ratio_scale: f64,
    ) -> NearestPlace {
        let speed_ratio = self.speed_ratio(speed_corrected_rpm);
        let scales = Scales { flow_kg_s: flow_scale_kg_s, ratio: ratio_scale };
        let point = (flow_corrected_kg_s, pressure_ratio);
        let foot = nearest(&self.shape(speed_corrected_rpm), speed_ratio, point, scales, None);
        let (x, y) = (
            (foot.place.flow_kg_s - point.0) / scales.flow_kg_s,
            (foot.place.pressure_ratio - point.1) / scales.ratio,
        );
        let error = LineErrors::new(&self.solution, speed_ratio).at(foot.angle_rad, scales);
        NearestPlace {
            distance_ratio: x.hypot(y),
            eta: self.believed(foot.place.eta, self.outside(speed_ratio)),
            distance_standard_error: error.distance,
            eta_standard_error: error.eta,
        }
    }

    /// The fit as a table.
    ///
    /// # Errors
    /// [`MapFitError::Speed`] for a further speed below a tenth of the slowest or above 1.3 times the fastest line.
    pub fn table(&self, options: &MapFitOptions) -> Result<FittedMap, MapFitError> {
        table::table(self, options)
    }

    fn speed_ratio(&self, speed_corrected_rpm: f64) -> f64 {
        speed_corrected_rpm / self.data.nominal_speed_rpm
    }

    fn shape(&self, speed_corrected_rpm: f64) -> LineShape {
        self.solution.shape(self.speed_ratio(speed_corrected_rpm))
    }

    /// Whether a speed lies beyond the slowest or the fastest measured one.
    fn outside(&self, speed_ratio: f64) -> bool {
        self.solution.splines.shape.outside(speed_ratio) > 1e-9
    }

    /// Efficiency as it is answered: where nothing was measured, no better than the best that was.
    fn believed(&self, eta: f64, extrapolated: bool) -> f64 {
        if extrapolated { eta.min(self.solution.best_eta) } else { eta }
    }

    fn speed_bounds_rpm(&self) -> (f64, f64) {
        let (first, last) = (self.data.lines_rpm.first(), self.data.lines_rpm.last());
        (SPEED_REACH.0 * first.copied().unwrap_or(1.0), SPEED_REACH.1 * last.copied().unwrap_or(1.0))
    }
}

/// Fits a map and puts the table into it ([`CompressorMap::fitted`]).
///
/// # Errors
/// [`MapFitError`].
pub fn fit_map(mut map: CompressorMap, options: &MapFitOptions) -> Result<CompressorMap, MapFitError> {
    let fit = MapFit::new(&map)?;
    map.fitted = Some(fit.table(options)?);
    Ok(map)
}
