//! A night's runs compared with earlier nights, as text.

use mapper_history::{Comparison, Night};
use std::fmt::Write;
use std::path::Path;

/// The night as text.
pub fn night_text(night: &Night, comparison: &Comparison, path: &Path) -> String {
    let mut text = String::new();
    for (run, failure) in &comparison.failed {
        let _ = writeln!(text, "failed   {run}: {failure}");
    }
    for run in &comparison.missing {
        let _ = writeln!(text, "missing  {run}: the last nights had it");
    }
    for moved in &comparison.moved {
        let (unit, factor) = moved.figure.display_unit();
        let value = moved.value.map_or_else(|| "-".to_owned(), |value| format!("{:.4}", factor * value));
        let _ = writeln!(
            text,
            "moved    {}: {} = {value} {unit}; it was {:.4} ({:.4} to {:.4}) in {} {}",
            moved.run,
            moved.figure,
            factor * moved.band.median,
            factor * moved.band.low,
            factor * moved.band.high,
            moved.band.nights,
            nights(moved.band.nights),
        );
    }
    for moved in &comparison.moved_points {
        let shift = |shift| moved.quantity.format_shift(shift, moved.mean_level);
        let _ = write!(
            text,
            "moved    {}: {} at {} of {} points, by {} on average",
            moved.run,
            moved.quantity.words(),
            moved.moved,
            moved.compared,
            shift(moved.mean_shift),
        );
        if let Some(largest) = &moved.largest {
            let by = moved.quantity.format_shift(largest.value - largest.band.median, largest.band.median);
            let _ = write!(text, ", largest at {} ({by})", largest.place);
        }
        text.push('\n');
    }
    for sentence in &comparison.conclusions {
        let _ = writeln!(text, "{sentence}");
    }
    let points: usize = night.runs.iter().map(|run| run.points.len()).sum();
    let _ = writeln!(
        text,
        "{} maps, {points} points in {:.1} s, in {}.",
        night.runs.len(),
        night.duration_s,
        path.display()
    );
    let _ = match comparison.nights {
        0 if !comparison.missing.is_empty() => {
            writeln!(
                text,
                "Nothing of tonight was there on the nights before: there is nothing to compare with."
            )
        }
        0 => writeln!(text, "The first night: there is nothing to compare with yet."),
        count if comparison.is_quiet() => {
            writeln!(text, "Every figure lies in the band of the last {count} {}.", nights(count))
        }
        _ if night.accepted => writeln!(text, "Accepted: this night begins a new band."),
        _ => Ok(()),
    };
    text
}

fn nights(count: usize) -> &'static str {
    if count == 1 { "night" } else { "nights" }
}
