//! What a run or an identification has given, for a terminal.

use mapper_campaign::campaign::DisplayUnits;
use mapper_core::Verdict;
use mapper_report::{
    Display, Paint, disagreement_text, first_doubts_text, paint_verdict, points_by_line_text, points_text,
    repeated_jumps_text, score_text, sensors_text, shared_errors_text, surge_text, thermal_text,
    verdict_sentence, wrapped, zero_text,
};
use mapper_session::Results;
use std::fmt::Write;

/// Columns of a terminal that nobody has made wider.
const COLUMNS: usize = 80;

/// How much is shown.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shown {
    /// All that is known, in tables as wide as they are.
    pub full: bool,
    /// The simulator's truth beside it.
    pub truth: bool,
    /// Colours.
    pub paint: Paint,
}

/// A table with what to know below it; verdict and files last.
pub fn results_text(units: &DisplayUnits, results: &Results, shown: Shown) -> String {
    // Writing to a String cannot fail.
    let mut text = if shown.full { full(units, results, shown) } else { short(units, results, shown) };
    let verdict = match () {
        () if results.points.iter().any(|scored| scored.point.verdict == Verdict::Unusable) => {
            Verdict::Unusable
        }
        () if results.points.iter().any(|scored| scored.point.verdict == Verdict::Doubtful) => {
            Verdict::Doubtful
        }
        () => Verdict::Good,
    };
    let words = verdict_sentence(results.points.iter().map(|scored| &scored.point));
    let _ = writeln!(text, "\n{}\n", paint_verdict(verdict, &words, shown.paint));
    let mut files: Vec<(&str, &std::path::Path)> = Vec::new();
    files.extend(results.map.values().map(|path| ("map", path.as_path())));
    files.extend([("report", results.report.as_path()), ("page", results.page.as_path())]);
    let recordings = std::iter::once(&results.recording).chain(&results.further_recordings);
    files.extend(recordings.map(|path| ("recording", path.as_path())));
    for (what, path) in files {
        let _ = writeln!(text, "{what:<11}{}", path.display());
    }
    text
}

fn short(units: &DisplayUnits, results: &Results, shown: Shown) -> String {
    let mut text = String::new();
    let mut say = |sentence: &str| text.push_str(&wrapped(sentence, COLUMNS, 2));
    if let Some(disagreement) = disagreement_text(&results.points, &results.two_parameter, units) {
        say(&disagreement);
        say("");
    }
    text.push_str(&points_by_line_text(
        &results.points,
        results.compressor_map.as_ref(),
        units,
        shown.truth,
        shown.paint,
    ));
    text.push('\n');
    text.push_str(&first_doubts_text(&results.points));
    let mut say = |sentence: &str| text.push_str(&wrapped(sentence, COLUMNS, 2));
    if let Some(score) = results.score.as_ref().filter(|_| shown.truth) {
        say(&score_text(score));
    }
    if let Some(surge) = &results.surge {
        text.push_str(&surge_text(&surge.marks, &surge.remarks, surge.surges, units));
    }
    let mut say = |sentence: &str| text.push_str(&wrapped(sentence, COLUMNS, 2));
    results.remarks.iter().for_each(|remark| say(remark));
    say(&format!(
        "+/- is half a 95 % interval. What all points share, repeats, sensors and the zero: the page, or `mapper identify {} --full`.",
        results.run.display()
    ));
    text
}

fn full(units: &DisplayUnits, results: &Results, shown: Shown) -> String {
    let mut text = disagreement_text(&results.points, &results.two_parameter, units).unwrap_or_default();
    text.push_str(&points_text(&results.points, units, shown.truth));
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
    text
}
