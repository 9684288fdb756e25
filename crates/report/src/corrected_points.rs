//! Points without the drift, for other programs.

use mapper_drift::DriftReport;

/// Corrected points as CSV, one row each under the names of [`CorrectedPoint`](mapper_drift::CorrectedPoint); a number
/// that is not there is empty.
///
/// # Errors
/// None in practice: the writer's own, which memory never raises.
pub fn corrected_csv(report: &DriftReport) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for point in &report.corrected_points {
        writer.serialize(point)?;
    }
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}
