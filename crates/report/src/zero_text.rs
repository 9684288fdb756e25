//! The isothermal zero, for people.

use mapper_core::half_width_95;
use mapper_identify::ZeroOutcome;
use std::fmt::Write;

/// Offsets subtracted from the readings, with what is not known of them, or why there are none; empty where none was asked for.
pub fn zero_text(zero: &ZeroOutcome) -> String {
    match zero {
        ZeroOutcome::NotAsked => String::new(),
        ZeroOutcome::Refused(reason) => {
            format!("\nno isothermal zero: {reason}. The declared offsets stand.\n")
        }
        ZeroOutcome::Found(zero) => {
            let mut text = format!(
                "\nisothermal zero from {:.0} to {:.0} s, subtracted from the readings (+/- 95 %):\n",
                zero.start_s, zero.end_s
            );
            for (channel, offset) in &zero.offsets {
                let half = half_width_95(zero.left_sigma.get(channel).copied().unwrap_or(f64::NAN));
                // Writing to a String cannot fail.
                let _ = writeln!(text, "  {channel:<6} {offset:+.2} +/- {half:.2} {}", channel.unit());
            }
            text
        }
    }
}
