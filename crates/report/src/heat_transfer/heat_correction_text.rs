//! A map corrected for heat transfer.

use crate::document::{Describe, Document, Table};
use mapper_maps::HeatCorrection;

/// Scatter of the work above which the lines do not form one curve. On the lab: 0.35 % if they do, 1.7 % if they do not.
const ONE_CURVE_RATIO: f64 = 0.01;

/// The correction, and its effect line by line.
impl Describe for HeatCorrection {
    fn document(&self) -> Document {
        let mut document = Document::default();
        document.text(match (self.heat_shown_w, self.heat_standard_error_w) {
            (Some(shown_w), Some(error_w)) => format!(
                "heat: {shown_w:.0} W (+/- {error_w:.0} W by leaving out lines), from {} points outside choke; scatter of the work {:.1} %",
                self.points_used,
                100.0 * self.scatter_ratio.unwrap_or(f64::NAN)
            ),
            _ => format!("heat: {:.0} W, as given", self.heat_w),
        });
        if self.heat_shown_w.is_some_and(|shown_w| shown_w <= 0.0) {
            document.text("slow lines do not need more work than fast ones: nothing is subtracted");
        }
        if self.scatter_ratio.is_some_and(|ratio| ratio > ONE_CURVE_RATIO) {
            document
                .text("the lines do not become one curve: part of this is not heat, and slow lines come out too good");
        }
        let row = |line: &mapper_maps::CorrectedLine| {
            [
                format!("{:.1}", line.speed_corrected_rpm / 1e3),
                line.points.to_string(),
                format!("{:.2}", 100.0 * line.eta_apparent),
                format!("{:.2}", 100.0 * line.eta),
                line.lost.to_string(),
            ]
        };
        let heads = ["krpm", "points", "apparent, %", "corrected, %", "without efficiency now"];
        document.table(Table::new(heads).rows(self.lines.iter().map(row)));
        document.text(
            "All that slow lines take in work beyond fast ones counts as heat; heat that fast lines lose is not seen. Measured with Tc, \
             `method: joint` needs no such premise.",
        );
        document
    }
}
