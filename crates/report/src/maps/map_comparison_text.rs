//! Differences between two maps, as text.

use crate::formatting::number::number;
use crate::formatting::table;
use mapper_core::half_width_95;
use mapper_maps::{MapComparison, PlaceComparison};
use mapper_numerics::statistics::mean;
use std::fmt::Write;

/// A row for each line and sentences below.
pub fn map_comparison_text(comparison: &MapComparison) -> String {
    let heads = [
        "corrected rpm",
        "places",
        "flow kg/s",
        "PR",
        "distance %",
        "+/- %",
        "eta points",
        "+/- points",
        "line differs %",
        "eta differs %",
    ];
    let mut table = table::with_heads(&heads);
    for line in &comparison.lines {
        let mean = |value: fn(&PlaceComparison) -> f64| mean(line.places.iter().map(value));
        let share = |differs: fn(&PlaceComparison) -> bool| {
            let count = line.places.iter().filter(|p| differs(p)).count();
            (!line.places.is_empty()).then(|| 100.0 * count as f64 / line.places.len() as f64)
        };
        table.add_row(vec![
            format!("{:.0}", line.speed_corrected_rpm),
            line.places.len().to_string(),
            number(mean(|p| p.flow_difference_kg_s), 5),
            number(mean(|p| p.pressure_ratio_difference), 4),
            number(mean(|p| 100.0 * p.distance_ratio), 2),
            number(mean(|p| 100.0 * half_width_95(p.distance_standard_error_ratio)), 2),
            number(mean(|p| 100.0 * p.eta_difference), 2),
            number(mean(|p| 100.0 * half_width_95(p.eta_standard_error)), 2),
            number(share(PlaceComparison::line_differs), 0),
            number(share(PlaceComparison::eta_differs), 0),
        ]);
    }
    let mut text = format!(
        "{table}\n\nSecond minus first, means over each line; +/- is the 95 % interval of one place. "
    );
    let _ = writeln!(
        text,
        "Over all places: distance {:.2} % rms, efficiency {:+.2} points on average, {:.2} rms; lines differ beyond their \
         uncertainty at {:.0} % of places, efficiencies at {:.0} %.",
        100.0 * comparison.distance_rms_ratio,
        100.0 * comparison.eta_difference_mean,
        100.0 * comparison.eta_difference_rms,
        100.0 * comparison.line_differs_ratio,
        100.0 * comparison.eta_differs_ratio,
    );
    if !comparison.not_compared_rpm.is_empty() {
        let speeds: Vec<String> = comparison.not_compared_rpm.iter().map(|s| format!("{s:.0}")).collect();
        let _ = writeln!(text, "Only one of the maps reaches {} rpm: not compared.", speeds.join(", "));
    }
    text
}
