//! The diagnosis of a drift, and points corrected for it.

use crate::document::{Describe, Document, Table};
use crate::formatting::{number, significant_digits};
use mapper_core::test_plan::step_number::step_number;
use mapper_core::{half_width_95, probability_text};
use mapper_diagnose::drift::{Alternative, Cause, DriftReport, RateOrStep, RepeatGroup};

impl Describe for DriftReport {
    fn document(&self) -> Document {
        let mut document = Document::default();
        document.text(&self.reason);
        for drift in &self.drifts {
            let per_hour = if matches!(drift.size, RateOrStep::RatePerH(_)) { " per hour" } else { "" };
            document.text(format!(
                "{}: {} to {}{per_hour} (95 %), onset from {:.0} s to {:.0} s of the campaign{}.",
                drift.cause,
                drift.cause.show(drift.low),
                drift.cause.show(drift.high),
                drift.onset_low_s,
                drift.onset_high_s,
                list_likely_alternatives(&drift.alternatives)
                    .map(|others| format!("; or {others}"))
                    .unwrap_or_default()
            ));
        }
        if self.drifts.is_empty()
            && let Some(others) = list_likely_alternatives(&self.alone)
        {
            document.text(format!("Not excluded: {others}."));
        }
        document.text(self.unseen_before_s.map_or_else(String::new, |before_s| {
            format!("A change before {before_s:.0} s would not be seen: it is in every repeated visit.")
        }));
        let mut repeats = Document::default();
        if !self.groups.is_empty() {
            repeats.text(
                "d: change since the first visit, corrected for the boundary conditions. +/-: noise of each visit, identified by itself \
                 (95 %); errors that all visits share do not change the comparison.",
            );
        }
        self.groups.iter().for_each(|group| repeats.table(group_table(group)));
        document.section("Repeated visits", repeats);
        let limits: Vec<String> = self
            .detection_limits
            .iter()
            .map(|limit| match limit.unit {
                "1" => format!("{} {:.2} %", limit.cause, 100.0 * limit.change),
                _ if limit.cause == Cause::BearingFriction => {
                    format!("{} {}", limit.cause, limit.cause.show(limit.change))
                }
                unit => format!("{} {} {unit}", limit.cause, significant_digits(limit.change, 3)),
            })
            .collect();
        if !limits.is_empty() {
            document.text(format!(
                "Smallest steady drift over the campaign that can be detected: {}.",
                limits.join(", ")
            ));
        }
        document
    }
}

/// The most probable alternatives, no drift included, with their probabilities; `None` if no alternative is probable enough.
fn list_likely_alternatives(alternatives: &[Alternative]) -> Option<String> {
    let named = |other: &Alternative| {
        let cause = other.cause.map_or_else(|| "no drift".to_owned(), Cause::name);
        format!("{cause} {}", probability_text(other.probability))
    };
    // Half a per cent would be rounded to zero.
    let likely_alternatives = alternatives.iter().filter(|other| (5e-3..0.5).contains(&other.probability));
    let phrases: Vec<String> = likely_alternatives.take(4).map(named).collect();
    (!phrases.is_empty()).then(|| phrases.join(", "))
}

/// Unit, factor and decimals of a channel's changes.
fn shown_in(symbol: &str) -> (&'static str, f64, usize) {
    match symbol.as_bytes() {
        [b'm', ..] => ("g/s", 1e3, 3),
        [b'P', ..] => ("Pa", 1.0, 0),
        [b'N', ..] => ("rpm", 1.0, 0),
        _ => ("K", 1.0, 2),
    }
}

fn group_table(group: &RepeatGroup) -> Table {
    let symbols: Vec<&str> =
        group.visits.first().map(|visit| visit.channels.keys().copied().collect()).unwrap_or_default();
    let mut heads: Vec<String> =
        ["t s", "eta %", "+/- points", "h W/(m2 K)", "+/- W/(m2 K)"].map(str::to_owned).to_vec();
    heads.extend(symbols.iter().map(|symbol| format!("d {symbol} {}", shown_in(symbol).0)));
    let mut table = Table::new(heads).caption(format!("From {} to {}", group.from, group.to));
    for visit in &group.visits {
        let mut row = vec![
            format!("{:.0}", visit.t_s),
            number(visit.eta.map(|eta| 100.0 * eta), 2),
            number(visit.sigma_eta.map(|sigma| 100.0 * half_width_95(sigma)), 2),
            number(visit.h_w_m2k, 0),
            number(visit.sigma_h_w_m2k.map(half_width_95), 0),
        ];
        row.extend(symbols.iter().map(|symbol| {
            let first = group.visits.first().and_then(|first| first.channels.get(symbol));
            let change = visit
                .channels
                .get(symbol)
                .zip(first)
                .map(|(now, first)| now.end_less_model - first.end_less_model);
            let (_, scale, decimals) = shown_in(symbol);
            number(change.map(|change| scale * change), decimals)
        }));
        table.row(row);
    }
    table
}

/// Corrected points as CSV, a row each, with a column `correction_` and its cause for each drift. A missing number is empty.
pub fn corrected_csv(report: &DriftReport) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let heads = [
        "run",
        "step",
        "speed_rpm",
        "valve",
        "eta",
        "sigma_eta",
        "h_w_m2k",
        "eta_identified",
        "eta_uncorrected",
    ];
    let corrections = report.drifts.iter().map(|drift| format!("correction_{}", drift.cause));
    writer.write_record(heads.into_iter().map(str::to_owned).chain(corrections))?;
    for point in &report.corrected_points {
        let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let cells = [
            point.run.to_string(),
            step_number(point.step).to_string(),
            point.speed_rpm.to_string(),
            point.valve.to_string(),
            point.eta.to_string(),
            point.sigma_eta.to_string(),
            point.h_w_m2k.to_string(),
            optional(point.eta_identified),
            optional(point.eta_uncorrected),
        ];
        writer.write_record(cells.into_iter().chain(point.corrections.iter().map(f64::to_string)))?;
    }
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}
