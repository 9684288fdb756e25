//! Drift as text.

use crate::formatting::{number, table};
use mapper_core::{half_width_95, probability_text};
use mapper_diagnose::drift::{Alternative, Cause, DriftReport, RateOrStep, RepeatGroup};
use std::fmt::Write;

/// The drift diagnosis as text.
pub fn drift_text(report: &DriftReport) -> String {
    let mut text = format!("{}\n", report.reason);
    for drift in &report.drifts {
        let per_hour = if matches!(drift.size, RateOrStep::RatePerH(_)) { " per hour" } else { "" };
        let _ = writeln!(
            text,
            "{}: {} to {}{per_hour} (95 %), onset from {:.0} s to {:.0} s of the campaign{}.",
            drift.cause,
            drift.cause.show(drift.low),
            drift.cause.show(drift.high),
            drift.onset_low_s,
            drift.onset_high_s,
            list_likely_alternatives(&drift.alternatives)
                .map(|others| format!("; or {others}"))
                .unwrap_or_default()
        );
    }
    if report.drifts.is_empty()
        && let Some(others) = list_likely_alternatives(&report.alone)
    {
        let _ = writeln!(text, "Not excluded: {others}.");
    }
    if !report.groups.is_empty() {
        text.push_str(
            "\nd: change since the first visit, corrected for the boundary conditions.\n\
             +/-: noise of each visit, identified by itself (95 %); errors that all visits\n\
             share do not change the comparison.\n",
        );
    }
    for group in &report.groups {
        let _ = write!(text, "\nFrom {} to {}\n{}\n", group.from, group.to, group_table(group));
    }
    if !report.detection_limits.is_empty() {
        text.push_str("\nSmallest steady drift over the campaign that can be detected:");
        for limit in &report.detection_limits {
            let _ = match limit.unit {
                "1" => write!(text, " {} {:.2} %,", limit.cause, 100.0 * limit.change),
                _ if limit.cause == Cause::BearingFriction => {
                    write!(text, " {} {},", limit.cause, limit.cause.show(limit.change))
                }
                unit => {
                    write!(text, " {} {} {unit},", limit.cause, number::significant_digits(limit.change, 3))
                }
            };
        }
        text.pop();
        text.push_str(".\n");
    }
    text
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

fn group_table(group: &RepeatGroup) -> table::TextTable {
    let symbols: Vec<&str> =
        group.visits.first().map(|visit| visit.channels.keys().copied().collect()).unwrap_or_default();
    let mut heads: Vec<String> =
        ["t s", "eta %", "+/- points", "h W/(m2 K)", "+/- W/(m2 K)"].map(str::to_owned).to_vec();
    heads.extend(symbols.iter().map(|symbol| format!("d {symbol} {}", shown_in(symbol).0)));
    let mut table = table::with_heads(&heads);
    for visit in &group.visits {
        let mut row = vec![
            format!("{:.0}", visit.t_s),
            number::number(visit.eta.map(|eta| 100.0 * eta), 2),
            number::number(visit.sigma_eta.map(|sigma| 100.0 * half_width_95(sigma)), 2),
            number::number(visit.h_w_m2k, 0),
            number::number(visit.sigma_h_w_m2k.map(half_width_95), 0),
        ];
        row.extend(symbols.iter().map(|symbol| {
            let first = group.visits.first().and_then(|first| first.channels.get(symbol));
            let change = visit
                .channels
                .get(symbol)
                .zip(first)
                .map(|(now, first)| now.end_less_model - first.end_less_model);
            let (_, scale, decimals) = shown_in(symbol);
            number::number(change.map(|change| scale * change), decimals)
        }));
        table.add_row(row);
    }
    table
}
