//! The file of uncertainty budgets.

use crate::{SessionError, recording::run_directory};
use mapper_core::PointBudgets;
use mapper_report::{BUDGET_COLUMNS, budget_rows};
use std::path::Path;

/// The budgets as a table of rows.
pub(crate) fn budget_csv(budgets: &[PointBudgets]) -> Result<Vec<u8>, SessionError> {
    let failed =
        |error: csv::Error| SessionError::file("write", Path::new(run_directory::BUDGET))(error.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(BUDGET_COLUMNS).map_err(failed)?;
    for row in budget_rows(budgets) {
        writer.write_record(row).map_err(failed)?;
    }
    writer.into_inner().map_err(|error| failed(error.into_error().into()))
}
