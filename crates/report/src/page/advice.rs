//! The verdict of a run in a sentence, and the most important actions.

use crate::page::run_page::RunPage;
use crate::{RunReport, disagreement_text, doubts, zero_words};
use mapper_core::Verdict;
use mapper_identify::ZeroOutcome;

/// Whether the map can be used as it is, without a condition.
pub(crate) fn is_clean(page: &RunPage<'_>) -> bool {
    let report = page.report;
    !report.points.is_empty()
        && report.points.iter().all(|scored| scored.point.verdict == Verdict::Good)
        && report.map.is_some()
        && !report.remarks.iter().any(mapper_core::ResultRemark::concerns_all_points)
}

/// Recommended actions in order of importance, each a sentence.
pub(crate) fn recommended_actions(report: &RunReport<'_>) -> Vec<String> {
    let mut actions: Vec<String> = Vec::new();
    if !report.origin.is_complete() {
        actions.push(report.origin.sentence());
    }
    if let Some(text) = disagreement_text(report.points, report.dynamic, &report.display()) {
        actions.push(text.trim_end().to_owned());
    }
    if let (ZeroOutcome::Refused(_), Some(sentence)) = (report.zero, zero_words(report.zero)) {
        actions.push(sentence);
    }
    let points_with = |verdict| report.identified().filter(move |point| point.verdict == verdict);
    for verdict in [Verdict::Unusable, Verdict::Doubtful] {
        // Findings about the most steps come first. Three sentences are enough here; the rest is listed with the points.
        let mut warnings = doubts(points_with(verdict));
        warnings.sort_by_key(|doubt| std::cmp::Reverse(doubt.count()));
        actions
            .extend(warnings.iter().take(3).map(|doubt| format!("{}: {}", doubt.steps(), doubt.message())));
    }
    actions
}
