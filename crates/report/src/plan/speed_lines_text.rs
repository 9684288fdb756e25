//! The resolved speed lines of a campaign, as text.

use crate::formatting::display::Display;
use crate::formatting::number::percent;
use crate::formatting::table;
use mapper_campaign::{Campaign, ResolvedLine, ResolvedPoint};

/// Each line with the first and last of its points as a table with a sentence below; empty without lines.
pub fn lines_text(campaign: &Campaign, lines: &[ResolvedLine]) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let display = Display::new(&campaign.display);
    let mut rows = table::with_heads(&[
        display.speed_head("corrected"),
        display.speed_head("physical"),
        "points".to_owned(),
        display.flow_head("corrected flow"),
        "PR".to_owned(),
        "opening".to_owned(),
        "surge margin %".to_owned(),
    ]);
    for line in lines {
        let [Some(first), Some(last)] = [line.points.first(), line.points.last()] else { continue };
        let range = |of: &dyn Fn(&ResolvedPoint) -> String| format!("{} to {}", of(first), of(last));
        rows.add_row([
            display.speed(line.speed_corrected_rpm),
            display.speed(line.speed_rpm),
            line.points.len().to_string(),
            range(&|point| display.flow(point.flow_corrected_kg_s)),
            range(&|point| format!("{:.3}", point.pressure_ratio)),
            range(&|point| format!("{:.3}", point.valve_opening_ratio)),
            percent(Some(last.surge_margin_ratio), 0),
        ]);
    }
    format!(
        "{rows}\nThe lines on the nominal machine, from choke to surge, corrected to\n{}. \
         `mapper plan` shows every point.\n",
        campaign.reference
    )
}
