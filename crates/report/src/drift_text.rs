//! What is said of drift, for people.

use crate::{number, table};
use mapper_core::half_width_95;
use mapper_drift::{Cause, DriftReport, RateOrStep, RepeatGroup};
use std::fmt::Write;

/// The answer for people.
pub fn drift_text(report: &DriftReport) -> String {
    let mut text = format!("{}\n", report.reason);
    if let (Some(low), Some(high), Some(cause)) = (report.low, report.high, report.cause) {
        let _ = writeln!(
            text,
            "95 % interval: {} to {}{}",
            cause.show(low),
            cause.show(high),
            match report.size {
                Some(RateOrStep::RatePerH(_)) => " per hour",
                _ => "",
            }
        );
    }
    if let (Some(low_s), Some(high_s)) = (report.onset_low_s, report.onset_high_s) {
        let _ = writeln!(text, "Onset: {low_s:.0} s to {high_s:.0} s of the campaign.");
    }
    if report.probability > 0.0 {
        let cause = |cause: Option<Cause>| cause.map_or("no drift", Cause::name);
        let _ = write!(text, "Probability: {} {:.1} %", cause(report.cause), 100.0 * report.probability);
        for alternative in report.alternatives.iter().filter(|other| other.probability > 5e-4).take(4) {
            let _ = write!(text, ", {} {:.1} %", cause(alternative.cause), 100.0 * alternative.probability);
        }
        text.push_str(".\n");
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
                unit if limit.change < 1e-3 => write!(text, " {} {:.1e} {unit},", limit.cause, limit.change),
                unit => write!(text, " {} {:.3} {unit},", limit.cause, limit.change),
            };
        }
        text.pop();
        text.push_str(".\n");
    }
    text
}

fn group_table(group: &RepeatGroup) -> comfy_table::Table {
    let symbols: Vec<&str> =
        group.visits.first().map(|visit| visit.channels.keys().copied().collect()).unwrap_or_default();
    let mut heads: Vec<String> =
        ["t s", "eta %", "+/- points", "h W/(m2 K)", "+/- W/(m2 K)"].map(str::to_owned).to_vec();
    heads.extend(symbols.iter().map(|symbol| format!("d {symbol}")));
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
            // Against the first visit, what the boundary conditions do taken out.
            let first = group.visits.first().and_then(|first| first.channels.get(symbol));
            let change = visit
                .channels
                .get(symbol)
                .zip(first)
                .map(|(now, first)| now.end_less_model - first.end_less_model);
            let decimals = if symbol.starts_with("m_") { 6 } else { 2 };
            number::number(change, decimals)
        }));
        table.add_row(row);
    }
    table
}
