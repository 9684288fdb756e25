//! Fits a surface to a map, stiff enough that no lines cross.

use super::MapFitError;
use crate::map_fit::fitted_surface::surface::MapFit;
use crate::map_fit::fitted_surface::table::{MapFitOptions, table};
use crate::map_fit::least_squares::observations::Observations;
use crate::map_fit::least_squares::solution::Solution;
use crate::map_fit::least_squares::solve::solve;
use crate::map_fit::speed_lines::crossing::count_crossings;
use crate::map_fit::speed_lines::ends::End;
use mapper_core::{CompressorMap, FittedLine};
use std::collections::BTreeMap;

/// Factors on the smallest penalty that are tried until no lines cross. Bound: the last is nearly similarity, whose lines do not cross.
const STIFFNESSES: [f64; 3] = [1.0, 30.0, 1000.0];

impl MapFit {
    /// Fits all lines of a map, every point at its own corrected speed.
    ///
    /// If lines cross, the fit is made again with stiffer parameters over speed.
    ///
    /// # Errors
    /// [`MapFitError`] if there are too few or too many points, or they do not determine the fit.
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
