//! Points without the drift, for other programs.

use mapper_drift::DriftReport;
use std::fmt::Write;

/// Corrected points for other programs.
pub fn corrected_csv(report: &DriftReport) -> String {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let mut text =
        "run,step,speed_rpm,valve,eta,sigma_eta,h_w_m2k,eta_identified,eta_uncorrected,correction\n"
            .to_owned();
    for point in &report.corrected_points {
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{}",
            point.run,
            point.step,
            point.speed_rpm,
            point.valve,
            point.eta,
            point.sigma_eta,
            point.h_w_m2k,
            number(point.eta_identified),
            number(point.eta_uncorrected),
            point.correction,
        );
    }
    text
}
