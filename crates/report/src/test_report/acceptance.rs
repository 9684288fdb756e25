//! Energy balance of the points, and criteria of acceptance.

use crate::document::{Document, Table};
use crate::point_results::points::END_S;
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, Recording, StepMarker, half_width_95, step_number};
use mapper_observe::acceptance::{CriterionResult, judge_acceptance};
use mapper_observe::energy_balance::{EnergyBalance, Gases, Power, energy_balance};
use mapper_recording::score::ScoredPoint;
use std::collections::BTreeMap;

/// Meaning of the columns.
const BALANCE_WORDS: &str = "Means of the last 2 s of each step, half widths of 95 % intervals from the declared sensors. Compressor: rise of \
                                 the enthalpy of its air. Turbine: drop of the enthalpy of its gas. Losses: turbine minus the \
                                 others; until the housings are settled, heat that they store is part of them, and so are oil and water where they \
                                 are not measured.";

/// The points and their readings.
pub struct JudgedPoints<'a> {
    /// Its criteria; `None` for a log without a campaign.
    pub campaign: Option<&'a Campaign>,
    /// The readings.
    pub recording: &'a Recording,
    pub gases: Gases,
    pub points: &'a [ScoredPoint],
    /// Uncertainty of each channel used in the identification.
    pub used: &'a BTreeMap<Channel, DeclaredUncertainty>,
}

fn balances<'a>(report: &JudgedPoints<'a>) -> Vec<(&'a StepMarker, EnergyBalance)> {
    let steps = report
        .points
        .iter()
        .filter_map(|scored| report.recording.steps.iter().find(|step| step.index == scored.point.step));
    let balance = |step: &'a StepMarker| {
        let span_s = ((step.end_s - END_S).max(step.start_s), step.end_s);
        (step, energy_balance(report.recording, span_s, &report.gases, report.used))
    };
    steps.map(balance).collect()
}

/// A row for each point; none if the power of the turbine was not measured.
fn balance_rows(report: &JudgedPoints<'_>) -> Vec<[String; 6]> {
    let balances = balances(report);
    if balances.iter().all(|(_, balance)| balance.turbine.is_none()) {
        return Vec::new();
    }
    let shown = |power: Option<Power>| match power {
        Some(power) => format!("{:.0} +/- {:.0}", power.w, half_width_95(power.sigma_w)),
        None => "-".to_owned(),
    };
    let row = |(step, balance): (&StepMarker, EnergyBalance)| {
        let EnergyBalance { compressor, turbine, oil, water, losses } = balance;
        let [compressor, turbine, oil, water, losses] = [compressor, turbine, oil, water, losses].map(shown);
        [step_number(step.index).to_string(), compressor, turbine, oil, water, losses]
    };
    balances.into_iter().map(row).collect()
}

/// A row for each criterion of the campaign; none without criteria.
fn acceptance_rows(report: &JudgedPoints<'_>) -> Vec<[String; 5]> {
    let criteria = report.campaign.and_then(|campaign| campaign.acceptance.as_ref());
    let Some(criteria) = criteria else { return Vec::new() };
    let row = |judged: CriterionResult| {
        let failed: Vec<String> = judged.failed().map(|step| step_number(step).to_string()).collect();
        let result = match (judged.largest_ratio(), failed.len()) {
            (None, _) => "not measured".to_owned(),
            (Some(_), 0) => "pass".to_owned(),
            (Some(_), failed) => format!("fail at {failed} of {}", judged.steps.len()),
        };
        let percent = |ratio: f64| format!("{:.2}", 100.0 * ratio);
        [
            judged.channel.map_or_else(
                || "heat balance: losses over turbine".to_owned(),
                |channel| format!("fluctuation of {channel}"),
            ),
            percent(judged.limit_ratio),
            judged.largest_ratio().map_or_else(|| "-".to_owned(), percent),
            result,
            failed.join(", "),
        ]
    };
    judge_acceptance(criteria, report.recording, &balances(report)).into_iter().map(row).collect()
}

/// Name, source and window of the campaign's criteria, a sentence.
fn acceptance_words(report: &JudgedPoints<'_>) -> Option<String> {
    let criteria = report.campaign?.acceptance.as_ref()?;
    Some(format!(
        "{} ({}). Judged over the last {} s of each step; a fluctuation is the highest minus the lowest reading over the mean.",
        criteria.name, criteria.source, criteria.window_s
    ))
}

/// Criteria and results; empty without criteria.
pub(crate) fn acceptance_section(report: &JudgedPoints<'_>) -> Document {
    let mut document = Document::default();
    let heads = ["criterion", "limit, %", "largest, %", "result", "steps that fail"];
    document.text(acceptance_words(report).unwrap_or_default());
    document.table(Table::new(heads).with_texts([3, 4]).rows(acceptance_rows(report)));
    document
}

/// The energy balance of each point; empty if the power of the turbine was not measured.
pub(crate) fn balance_section(report: &JudgedPoints<'_>) -> Document {
    let mut document = Document::default();
    let rows = balance_rows(report);
    if !rows.is_empty() {
        let heads = ["step", "compressor, W", "turbine, W", "oil, W", "water, W", "losses, W"];
        document.text(BALANCE_WORDS);
        document.table(Table::new(heads).rows(rows));
    }
    document
}
