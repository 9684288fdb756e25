//! A smooth surface through all speed lines together.

mod beyond;
mod common_errors;
mod crossing;
mod ends;
mod error;
mod fit;
mod leave_out;
mod line_errors;
mod line_shape;
mod miss;
mod nearest;
mod observations;
mod precisions;
mod problem;
mod solution;
mod solve;
mod speed_spline;
mod splines;
mod surface;
mod table;
mod variances;

pub use error::MapFitError;
pub use leave_out::leave_out;
pub use surface::{MapFit, NearestPlace};
pub use table::MapFitOptions;

use mapper_core::{CompressorMap, FittedMap};

impl MapFit {
    /// The fit as a table.
    ///
    /// # Errors
    /// [`MapFitError::Speed`] for a further speed below a tenth of the slowest or above 1.3 times the fastest line.
    pub fn table(&self, options: &MapFitOptions) -> Result<FittedMap, MapFitError> {
        let mut table = table::table(self, options)?;
        if options.leave_one_out {
            table.left_out = leave_out(self);
        }
        Ok(table)
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
