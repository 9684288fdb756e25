//! Evidence of drift from repeats of one jump, in sentences.

use crate::formatting::display::Display;
use crate::formatting::number::percent;
use mapper_maps::RepeatedJump;
use std::fmt::Write;

/// One sentence for each repeated jump.
pub fn repeated_jumps_text(jumps: &[RepeatedJump], display: &Display) -> String {
    let mut text = String::new();
    for jump in jumps {
        let found: Vec<String> = jump.eta.iter().map(|eta| format!("{:.2}", 100.0 * eta)).collect();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "Repeats of the jump from {} to {}: efficiency {} %; from first to last {:+.2} points (standard error from noise {} points).",
            display.place_in_words(jump.from),
            display.place_in_words(jump.to),
            found.join(", "),
            100.0 * jump.eta_change,
            percent(jump.eta_change_standard_error, 2),
        );
    }
    text
}
