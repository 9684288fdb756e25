//! Results of a log without steps, for a terminal and a report.

use crate::formatting::table;
use mapper_diagnose::driven::{DrivenOutcome, Judged, Moves};
use std::fmt::Write;

/// Bare thermocouples and resistance thermometers of test stands are thinner than this, mm.
const THICKEST_PROBE_MM: f64 = 6.0;

/// The T2 residual, the sensitivities of T2, and the parameters.
pub fn transient_text(outcome: &DrivenOutcome) -> String {
    // Writing to a String cannot fail.
    let mut text = String::from(
        "Compressor side driven by measured speed, flow, P1, P2 and T1; T2 is compared. Intervals are 95 %.\n\n",
    );
    let _ = writeln!(text, "fitted    {}", judged_text(&outcome.fitted));
    if let Some(held_out) = &outcome.held_out {
        let _ = writeln!(text, "held out  {}", judged_text(held_out));
        let _ = writeln!(text, "          {}", verdict(held_out));
    }
    if outcome.lost_rows > 0 {
        let _ = writeln!(
            text,
            "{} readings of T2 were omitted, because a channel is missing or impossible there",
            outcome.lost_rows
        );
    }
    let _ = writeln!(text, "\nContributions to T2 in the fitted part (rms):");
    let _ = writeln!(text, "  lag of the probe                 {}", moves_text(&outcome.probe_moves));
    let _ = writeln!(text, "  heat to and from the housing     {}", moves_text(&outcome.heat_moves));
    let probe = outcome.parameters.iter().find(|fitted| fitted.parameter.name == "probe");
    if probe.is_some_and(|probe| probe.value > THICKEST_PROBE_MM) {
        text.push_str(
            "  No bare probe is that thick. The sensor probably has a sheath, or little contact with the gas.\n",
        );
    }
    text.push('\n');
    let heads = ["parameter", "value", "95 % interval", "unit", "known from", "description"];
    let mut rows = table::with_heads(&heads).with_texts(3..6);
    for fitted in &outcome.parameters {
        let parameter = &fitted.parameter;
        rows.add_row([
            parameter.name.to_owned(),
            format!("{:.3}", fitted.value),
            format!("{:.3} .. {:.3}", fitted.low, fitted.high),
            parameter.unit.to_owned(),
            if fitted.identified { "the log" } else { "its prior" }.to_owned(),
            parameter.description.to_owned(),
        ]);
    }
    let _ = writeln!(text, "{rows}");
    text
}

fn judged_text(judged: &Judged) -> String {
    format!(
        "{:.1} to {:.1} s, {} readings: {:.2} K rms; expected {:.2} K ({:.2} .. {:.2}); intervals contain {:.0} % of the readings",
        judged.from_s,
        judged.until_s,
        judged.rows,
        judged.rms_k,
        judged.expected_rms_k,
        judged.expected_low_k,
        judged.expected_high_k,
        100.0 * judged.inside_ratio
    )
}

fn verdict(held_out: &Judged) -> &'static str {
    if held_out.rms_k > held_out.expected_high_k {
        "the residual exceeds the expectation from the fitted part: a cause acts there that this side does not model, or that its readings do not show"
    } else {
        "the residual is within what the fitted part predicts"
    }
}

fn moves_text(moves: &Moves) -> String {
    format!("{:5.1} K  ({:.1} .. {:.1})", moves.rms_k, moves.low_k, moves.high_k)
}
