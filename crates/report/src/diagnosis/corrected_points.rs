//! Points corrected for drift, for other programs.

use mapper_core::test_plan::step_number::step_number;
use mapper_diagnose::drift::DriftReport;

/// Corrected points as CSV, one row each under the names of [`CorrectedPoint`](mapper_diagnose::drift::CorrectedPoint). Each drift has a column
/// for its correction, `correction_` and its cause. A missing number is empty.
///
/// # Errors
/// None in practice: an error of the writer, and writing to memory never fails.
pub fn corrected_csv(report: &DriftReport) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let heads = [
        "run",
        "step",
        "speed_rpm",
        "valve",
        "eta",
        "sigma_eta",
        "h_w_m2k",
        "eta_identified",
        "eta_uncorrected",
    ];
    let corrections = report.drifts.iter().map(|drift| format!("correction_{}", drift.cause));
    writer.write_record(heads.into_iter().map(str::to_owned).chain(corrections))?;
    for point in &report.corrected_points {
        let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let cells = [
            point.run.to_string(),
            step_number(point.step).to_string(),
            point.speed_rpm.to_string(),
            point.valve.to_string(),
            point.eta.to_string(),
            point.sigma_eta.to_string(),
            point.h_w_m2k.to_string(),
            optional(point.eta_identified),
            optional(point.eta_uncorrected),
        ];
        writer.write_record(cells.into_iter().chain(point.corrections.iter().map(f64::to_string)))?;
    }
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}
