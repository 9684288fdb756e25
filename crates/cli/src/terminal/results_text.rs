//! Results of a run or an identification, for a terminal.

use mapper_campaign::campaign::DisplayUnits;
use mapper_core::{CompressorMap, Verdict};
use mapper_maps::RepeatedJump;
use mapper_report::{
    Display, Paint, disagreement_text, first_doubts_text, paint_verdict, points_by_line_text, points_text,
    repeated_jumps_text, result_remark_text, sensors_text, shared_errors_text, surge_columns_text,
    surge_text, thermal_text, truth_text, verdict_sentence, wrapped, zero_text,
};
use mapper_session::{Identified, Results};
use std::fmt::Write;

/// Default width of a terminal, columns.
const COLUMNS: usize = 80;

/// Level of detail.
#[derive(Debug, Clone, Copy, Default)]
pub struct DetailLevel {
    /// Everything, in tables as wide as they need to be.
    pub full: bool,
    /// The simulator's truth next to each value.
    pub truth: bool,
    /// Colours.
    pub paint: Paint,
}

/// Results of a run, or of identified recordings.
struct ShownResults<'a> {
    identified: &'a Identified,
    map: Option<&'a CompressorMap>,
    repeats: &'a [RepeatedJump],
    remarks: Vec<String>,
    /// The command that shows the rest.
    command: &'a str,
}

/// The results of a run: a table, notes, verdict and files. `command`: the command that shows the rest, in words.
pub fn results_text(units: &DisplayUnits, results: &Results, command: &str, shown: DetailLevel) -> String {
    let mut text = shown_results_text(
        units,
        &ShownResults {
            identified: &results.identified,
            map: results.compressor_map.as_ref(),
            repeats: &results.repeats,
            remarks: remarks(&results.identified, false).collect(),
            command,
        },
        shown,
    );
    let mut files: Vec<(&str, &std::path::Path)> = Vec::new();
    files.extend(results.map.values().map(|path| ("map", path.as_path())));
    files.extend([("report", results.report.as_path()), ("page", results.page.as_path())]);
    let recordings = std::iter::once(&results.recording).chain(&results.further_recordings);
    files.extend(recordings.map(|path| ("recording", path.as_path())));
    for (what, path) in files {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{what:<11}{}", path.display());
    }
    text
}

/// The results of an identification that wrote no files. `command`: the command that shows the rest, in sentence; `warnings`: problems of
/// the recordings.
pub fn identified_text(
    units: &DisplayUnits,
    identified: &Identified,
    command: &str,
    warnings: &[String],
    shown: DetailLevel,
) -> String {
    let warnings = warnings.iter().map(|warning| format!("recording: {warning}"));
    let found = ShownResults {
        identified,
        map: None,
        repeats: &[],
        remarks: remarks(identified, false).chain(warnings).collect(),
        command,
    };
    shown_results_text(units, &found, shown)
}

/// Sentences of the remarks that concern all points, or of the others.
fn remarks(identified: &Identified, concern_all: bool) -> impl Iterator<Item = String> {
    let remarks = identified.remarks.iter();
    remarks.filter(move |remark| remark.concerns_all_points() == concern_all).map(result_remark_text)
}

fn shown_results_text(units: &DisplayUnits, found: &ShownResults<'_>, shown: DetailLevel) -> String {
    let display = Display::new(units);
    let mut text = if shown.full { full(&display, found, shown) } else { short(&display, found, shown) };
    let has = |verdict| found.identified.points_alone().any(|point| point.verdict == verdict);
    let worst = [Verdict::Unusable, Verdict::Doubtful].into_iter().find(|verdict| has(*verdict));
    let sentence = verdict_sentence(found.identified.points_alone());
    let sentence = paint_verdict(worst.unwrap_or(Verdict::Good), &sentence, shown.paint);
    let premises = remarks(found.identified, true).map(|premise| wrapped(&premise, COLUMNS, 2));
    let _ = writeln!(text, "\n{sentence}\n{}", premises.collect::<String>());
    text
}

fn short(display: &Display, found: &ShownResults<'_>, shown: DetailLevel) -> String {
    let identified = found.identified;
    let mut text = String::new();
    if let Some(disagreement) = disagreement_text(&identified.points, &identified.dynamic, display) {
        text.push_str(&wrapped(&disagreement, COLUMNS, 2));
        text.push('\n');
    }
    text.push_str(&points_by_line_text(&identified.points, found.map, display, shown.truth, shown.paint));
    text.push('\n');
    text.push_str(&first_doubts_text(&identified.points));
    if let Some(truth) = truth_text(&identified.points).filter(|_| shown.truth) {
        text.push_str(&wrapped(&truth, COLUMNS, 2));
    }
    if let Some(surge) = &identified.surge {
        text.push_str(&surge_columns_text(surge, display, shown.truth));
    }
    // Omit sensors that all agree.
    for fused in identified.sensors.iter().filter(|fused| !fused.left_out.is_empty()) {
        text.push_str(&wrapped(&fused.to_string(), COLUMNS, 2));
    }
    for remark in &found.remarks {
        text.push_str(&wrapped(remark, COLUMNS, 2));
    }
    let footer = format!(
        "+/- covers the 95 % interval; points.json has its ends. Common errors, repeats, sensors and zero: {}, or the page of the run.",
        found.command
    );
    text.push_str(&wrapped(&footer, COLUMNS, 2));
    text
}

fn full(display: &Display, found: &ShownResults<'_>, shown: DetailLevel) -> String {
    let identified = found.identified;
    let mut text = disagreement_text(&identified.points, &identified.dynamic, display).unwrap_or_default();
    text.push_str(&points_text(&identified.points, display, shown.truth));
    if let Some(shared) = shared_errors_text(identified.points_alone(), display) {
        let _ = writeln!(text, "{shared}");
    }
    text.push_str(&repeated_jumps_text(found.repeats, display));
    if let Some(thermal) = &identified.thermal {
        text.push_str(&thermal_text(thermal));
    }
    text.push_str(&sensors_text(&identified.sensors));
    text.push_str(&zero_text(&identified.zero));
    if let Some(surge) = &identified.surge {
        let _ = write!(text, "\n{}", surge_text(surge, display));
    }
    for remark in &found.remarks {
        let _ = writeln!(text, "{remark}");
    }
    text
}
