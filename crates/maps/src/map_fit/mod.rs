//! Fits a smooth surface to all speed lines together, stiff enough that no lines cross.

mod fitted_surface;
pub(crate) mod observations;
mod prediction_errors;
pub(crate) mod problem;
pub(crate) mod solution;
mod speed_lines;

pub(crate) use fitted_surface::{MIN_FLOW_KG_S, MIN_RATIO_RANGE};
pub use fitted_surface::{MapFit, MapFitOptions, NearestPlace};
pub use observations::MapFitError;
pub use prediction_errors::leave_out;

use fitted_surface::table;
use mapper_core::{CompressorMap, FittedLine, FittedMap};
use observations::Observations;
use solution::{Solution, solve};
use speed_lines::{End, count_crossings};
use std::collections::BTreeMap;

impl MapFit {
    /// The fit as a table.
    pub fn table(&self, options: &MapFitOptions) -> Result<FittedMap, MapFitError> {
        let mut table = table(self, options)?;
        if options.leave_one_out {
            table.left_out = leave_out(self);
        }
        Ok(table)
    }
}

/// Fits a map and puts the table into it ([`CompressorMap::fitted`]).
pub fn fit_map(mut map: CompressorMap, options: &MapFitOptions) -> Result<CompressorMap, MapFitError> {
    let fit = MapFit::new(&map)?;
    map.fitted = Some(fit.table(options)?);
    Ok(map)
}

/// Factors on the smallest penalty that are tried until no lines cross. Bound: the last is nearly similarity, whose lines do not cross.
const STIFFNESSES: [f64; 3] = [1.0, 30.0, 1000.0];

impl MapFit {
    /// Fits all lines of a map, every point at its own corrected speed.
    ///
    /// If lines cross, the fit is made again with stiffer parameters over speed.
    pub fn new(map: &CompressorMap) -> Result<Self, MapFitError> {
        Ok(MapFit::of(Observations::of(map)?, None)?.widened(&[End::Slow, End::Fast]))
    }

    /// As [`MapFit::new`], without widened errors beyond the measured speeds. `start`: a fit of nearly the same points, from which the search
    /// starts.
    pub(crate) fn of(data: Observations, start: Option<&Solution>) -> Result<Self, MapFitError> {
        let mut best: Option<(usize, MapFit)> = None;
        for stiffness in STIFFNESSES {
            let solution = solve(&data, stiffness, start)?;
            let fit = MapFit { solution, data: data.clone(), without_line: BTreeMap::new() };
            let crossings = count_crossings(&fit.lines_for_check());
            if best.as_ref().is_none_or(|(min, _)| crossings < *min) {
                best = Some((crossings, fit));
            }
            if crossings == 0 {
                break;
            }
        }
        best.map(|(_, fit)| fit).ok_or(MapFitError::Singular)
    }

    /// The fit of the other lines, searched from this one; `None` if they cannot be fitted.
    pub(crate) fn fit_without_line(&self, line: usize) -> Option<MapFit> {
        if let Some(known) = self.without_line.get(&line) {
            return Some(known.clone());
        }
        MapFit::of(self.data.without_line(line).ok()?, Some(&self.solution)).ok()
    }

    /// Measured and a few extrapolated lines with few nodes, to count crossings.
    fn lines_for_check(&self) -> Vec<FittedLine> {
        let options = MapFitOptions { further_speeds_rpm: None, nodes: 41, leave_one_out: false };
        table(self, &options).map(|table| table.lines).unwrap_or_default()
    }
}
