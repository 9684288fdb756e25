//! What a run or an identification has given, for a terminal.

use mapper_campaign::campaign::DisplayUnits;
use mapper_report::{
    Display, disagreement_text, points_text, repeated_jumps_text, sensors_text, shared_errors_text,
    surge_text, thermal_text, zero_text,
};
use mapper_session::Results;
use std::fmt::Write;

/// A table with what to know below it.
pub fn results_text(units: &DisplayUnits, results: &Results) -> String {
    // Writing to a String cannot fail.
    let disagreement = disagreement_text(&results.points, &results.two_parameter, units);
    let mut text = disagreement.unwrap_or_default();
    text.push_str(&points_text(&results.points, units));
    let points = results.points.iter().map(|scored| &scored.point);
    if let Some(shared) = shared_errors_text(points, units) {
        let _ = writeln!(text, "{shared}");
    }
    text.push_str(&repeated_jumps_text(&results.repeats, &Display::new(units)));
    if let Some(thermal) = &results.thermal {
        text.push_str(&thermal_text(thermal));
    }
    text.push_str(&sensors_text(&results.sensors));
    text.push_str(&zero_text(&results.zero));
    if let Some(surge) = &results.surge {
        let _ = write!(text, "\n{}", surge_text(&surge.marks, &surge.remarks, surge.surges, units));
    }
    for remark in &results.remarks {
        let _ = writeln!(text, "{remark}");
    }
    for path in results.map.values() {
        let _ = writeln!(text, "map        {}", path.display());
    }
    let _ = writeln!(text, "report     {}", results.report.display());
    let _ = writeln!(text, "page       {}", results.page.display());
    for recording in std::iter::once(&results.recording).chain(&results.further_recordings) {
        let _ = writeln!(text, "recording  {}", recording.display());
    }
    text
}
