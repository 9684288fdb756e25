//! Fits a smooth surface to all speed lines together.

mod error;
mod fit;
mod fitted_surface;
mod least_squares;
mod prediction_errors;
mod speed_lines;

pub use error::MapFitError;
pub(crate) use fitted_surface::surface::{MIN_FLOW_KG_S, MIN_RATIO_RANGE};
pub use fitted_surface::surface::{MapFit, NearestPlace};
pub use fitted_surface::table::MapFitOptions;
pub use prediction_errors::leave_out::leave_out;

use mapper_core::{CompressorMap, FittedMap};

impl MapFit {
    /// The fit as a table.
    ///
    /// # Errors
    /// [`MapFitError::Speed`] for a further speed below a tenth of the slowest or above 1.3 times the fastest line.
    pub fn table(&self, options: &MapFitOptions) -> Result<FittedMap, MapFitError> {
        let mut table = fitted_surface::table::table(self, options)?;
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
