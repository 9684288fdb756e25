//! A map corrected for heat transfer, as text.

use mapper_maps::HeatCorrection;

/// Scatter of the work above which the lines do not form one curve. On the lab: 0.35 % if they do, 1.7 % if they do not.
const ONE_CURVE_RATIO: f64 = 0.01;

/// The correction, and its effect line by line.
pub fn heat_correction_text(correction: &HeatCorrection) -> String {
    let mut text = match (correction.heat_shown_w, correction.heat_standard_error_w) {
        (Some(shown_w), Some(error_w)) => format!(
            "heat       {shown_w:.0} W (+/- {error_w:.0} W by leaving out lines), from {} points outside choke; scatter of the work {:.1} %\n",
            correction.points_used,
            100.0 * correction.scatter_ratio.unwrap_or(f64::NAN)
        ),
        _ => format!("heat       {:.0} W, as given\n", correction.heat_w),
    };
    if correction.heat_shown_w.is_some_and(|shown_w| shown_w <= 0.0) {
        text += "           slow lines do not need more work than fast ones: nothing is subtracted\n";
    }
    if correction.scatter_ratio.is_some_and(|ratio| ratio > ONE_CURVE_RATIO) {
        text += "           the lines do not become one curve: part of this is not heat, and slow lines come out too good\n";
    }
    text += "\n krpm  points  apparent, %  corrected, %\n";
    for line in &correction.lines {
        text += &format!(
            "{:5.1}  {:6}  {:11.2}  {:12.2}{}\n",
            line.speed_corrected_rpm / 1e3,
            line.points,
            100.0 * line.eta_apparent,
            100.0 * line.eta,
            if line.lost == 0 { String::new() } else { format!("  {} without efficiency now", line.lost) },
        );
    }
    text += "\nAll that slow lines take in work beyond fast ones counts as heat; heat that fast lines\nlose is not seen. Measured with Tc, `method: joint` needs no such premise.\n";
    text
}
