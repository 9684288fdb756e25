//! The resolved speed lines of a campaign, as text.

use crate::formatting::display::Display;
use crate::formatting::number::percent;
use crate::formatting::table;
use mapper_campaign::{Campaign, ResolvedLine};

/// The points of each line from choke to surge as a table with a line below; empty without lines.
pub fn lines_text(campaign: &Campaign, lines: &[ResolvedLine]) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let display = Display::new(&campaign.display);
    let mut rows = table::with_heads(&[
        display.speed_head("corrected"),
        display.speed_head("physical"),
        display.flow_head("corrected flow"),
        "PR".to_owned(),
        "opening".to_owned(),
        "surge margin %".to_owned(),
    ]);
    for line in lines {
        for point in &line.points {
            rows.add_row([
                display.speed(line.speed_corrected_rpm),
                display.speed(line.speed_rpm),
                display.flow(point.flow_corrected_kg_s),
                format!("{:.3}", point.pressure_ratio),
                format!("{:.4}", point.valve_opening_ratio),
                percent(Some(point.surge_margin_ratio), 1),
            ]);
        }
    }
    format!(
        "{rows}\nThe points of each line on the nominal machine, from choke to surge; corrected to {}.\n",
        campaign.reference
    )
}
