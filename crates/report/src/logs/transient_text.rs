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
        "Compressor side driven by measured speed, flow, P1, P2 and T1; T2 is judged. Intervals are 95 %.\n\n",
    );
    let _ = writeln!(text, "fitted    {}", judged_text(&outcome.fitted));
    if let Some(held_out) = &outcome.held_out {
        let _ = writeln!(text, "held out  {}", judged_text(held_out));
        let _ = writeln!(text, "          {}", verdict(held_out));
    }
    if outcome.lost_rows > 0 {
        let _ = writeln!(
            text,
            "{} readings of T2 were left out: a channel is missing there or impossible",
            outcome.lost_rows
        );
    }
    let _ = writeln!(text, "\nWhat moves T2 while it is fitted (rms):");
    let _ = writeln!(text, "  lag of the probe                 {}", moves_text(&outcome.probe_moves));
    let _ = writeln!(text, "  heat to and from the housing     {}", moves_text(&outcome.heat_moves));
    let probe = outcome.parameters.iter().find(|found| found.parameter.name == "probe");
    if probe.is_some_and(|probe| probe.value > THICKEST_PROBE_MM) {
        text.push_str(
            "  No bare probe is that thick: rather a sheath around the sensor, or a sensor that the gas hardly reaches.\n",
        );
    }
    text.push('\n');
    let heads = ["parameter", "value", "95 % interval", "unit", "known from", "what it is"];
    let mut rows = table::with_heads(&heads).with_texts(3..6);
    for found in &outcome.parameters {
        let parameter = &found.parameter;
        rows.add_row([
            parameter.name.to_owned(),
            format!("{:.3}", found.value),
            format!("{:.3} .. {:.3}", found.low, found.high),
            parameter.unit.to_owned(),
            if found.identified { "the log" } else { "beforehand" }.to_owned(),
            parameter.description.to_owned(),
        ]);
    }
    let _ = writeln!(text, "{rows}");
    text
}

fn judged_text(judged: &Judged) -> String {
    format!(
        "{:.1} to {:.1} s, {} readings: {:.2} K rms; expected {:.2} K ({:.2} .. {:.2}); intervals hold {:.0} % of the readings",
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
        "more is left than the fitted part allows: something acts there that this side has not, or that its readings do not show"
    } else {
        "the residual is within what the fitted part predicts"
    }
}

fn moves_text(moves: &Moves) -> String {
    format!("{:5.1} K  ({:.1} .. {:.1})", moves.rms_k, moves.low_k, moves.high_k)
}
