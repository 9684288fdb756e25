//! The cause of a deviation on one side of a machine, for a terminal and a report.

use crate::formatting::table::{self, COLUMNS};
use crate::formatting::wrapped::wrapped;
use mapper_core::probability_text;
use mapper_diagnose::driven::{Beyond, Diagnosis, HeldOut, SideCause, SideVerdict};
use std::fmt::Write;

/// Maximum number of causes shown in addition to the undecided ones.
const FURTHER_ROWS: usize = 3;
/// Causes less likely than this are not shown.
const NOT_WORTH: f64 = 0.005;

/// The verdict, the causes, the held-out residual, and what was and could not be tested.
pub fn why_text(diagnosis: &Diagnosis) -> String {
    let first = diagnosis.judged.first().copied().unwrap_or("");
    // Writing to a String cannot fail.
    let mut text = format!(
        "The {} side compared with the campaign's machine, driven by measured {}; judged: {}.\n\n",
        diagnosis.side.name(),
        diagnosis.driven_by.join(", "),
        diagnosis.judged.join(", ")
    );
    text += &wrapped(&headline(diagnosis), COLUMNS, 2);
    text.push('\n');
    causes(&mut text, diagnosis);
    let _ = writeln!(
        text,
        "fitted    {first} is off by {:.2} K rms without a cause, by {:.2} K with the named causes",
        diagnosis.before_k, diagnosis.after_k
    );
    match &diagnosis.held_out {
        Some(held_out) => phases(&mut text, held_out, first),
        None => text.push_str("held out  nothing: the fitted part is a single phase\n"),
    }
    if let Some(beyond) = &diagnosis.beyond {
        let _ = writeln!(
            text,
            "predicted {}\n          {}",
            describe_delay(beyond),
            verdict(beyond, diagnosis.word)
        );
    }
    if diagnosis.lost_rows > 0 {
        let _ = writeln!(
            text,
            "{} readings of {first} were omitted, because a channel is missing or impossible there",
            diagnosis.lost_rows
        );
    }
    unknowns(&mut text, diagnosis);
    if !diagnosis.asked.is_empty() {
        let sizes = diagnosis
            .asked
            .iter()
            .filter_map(|seen| Some(format!("{} {}", seen.effect, seen.size.as_deref()?)));
        let sizes = sizes.collect::<Vec<_>>().join(", ");
        text.push('\n');
        text += &wrapped(
            &format!(
                "Tested, with the smallest size that is detected in 95 of 100 logs like this one: {sizes}."
            ),
            COLUMNS,
            2,
        );
    }
    if !diagnosis.not_asked.is_empty() {
        text.push_str("\nNot testable on this side:\n");
        let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
        for effect in &diagnosis.not_asked {
            match reasons.iter_mut().find(|(reason, _)| *reason == effect.reason) {
                Some((_, effects)) => effects.push(&effect.effect),
                None => reasons.push((&effect.reason, vec![&effect.effect])),
            }
        }
        for (reason, effects) in reasons {
            text += &wrapped(&format!("  {}: {reason}", effects.join(", ")), COLUMNS, 4);
        }
    }
    text
}

fn headline(diagnosis: &Diagnosis) -> String {
    let open = &diagnosis.causes[..diagnosis.open.min(diagnosis.causes.len())];
    match diagnosis.word {
        SideVerdict::Named => format!(
            "{} explains it ({}).",
            open.first().map_or_else(String::new, |cause| capitalise(&cause.candidate.names.join(" and "))),
            open.first().map_or_else(String::new, |cause| probability_text(cause.candidate.probability))
        ),
        SideVerdict::NotDistinguished => format!(
            "{} explain it equally well and are indistinguishable.",
            capitalise(
                &open
                    .iter()
                    .map(|cause| cause.candidate.names.join(" and "))
                    .collect::<Vec<_>>()
                    .join("; or ")
            )
        ),
        SideVerdict::NotBorneOut => format!(
            "No cause is named: {} would explain the fitted part, but the residual of other phases does not decrease.",
            open.first().map_or_else(String::new, |cause| cause.candidate.names.join(" and "))
        ),
        SideVerdict::WithinTolerance => format!(
            "Nothing is seen beyond the usual uncertainty of such a machine (no cause: {}).",
            probability_text(diagnosis.probability_none)
        ),
        SideVerdict::Outside => format!(
            "No effect of the library explains it: the cause is unmodelled ({}). The residual of the nearest effect is below.",
            probability_text(diagnosis.probability_outside)
        ),
    }
}

/// With a capital first letter.
fn capitalise(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn causes(text: &mut String, diagnosis: &Diagnosis) {
    let shown = |(place, cause): &(usize, &SideCause)| {
        *place < diagnosis.open
            || *place == 0
            || (*place < diagnosis.open + FURTHER_ROWS && cause.candidate.probability > NOT_WORTH)
    };
    let heads = ["cause", "probability", "size", "95 % interval", "residual, K"];
    let mut rows = table::with_heads(&heads).with_texts(2..4);
    for (_, cause) in diagnosis.causes.iter().enumerate().filter(shown) {
        let each = |of: &dyn Fn(&mapper_diagnose::gap::Estimate) -> String| {
            cause.candidate.parameters.values().map(of).collect::<Vec<_>>().join("; ")
        };
        let interval = each(&|e| {
            let scale = if e.unit == "m" { 1e3 } else { 1.0 };
            let unit = if e.unit == "m" {
                "mm"
            } else if e.unit == "1" {
                ""
            } else {
                &e.unit
            };
            format!("{} .. {} {unit}", significant(scale * e.low), significant(scale * e.high))
                .trim_end()
                .to_owned()
        });
        let end = if cause.at_the_end.is_empty() { "" } else { " (end of its range)" };
        rows.add_row([
            cause.candidate.effects.join(" + "),
            probability_text(cause.candidate.probability),
            each(&|e| e.size.clone()) + end,
            interval,
            cause.model_error_sigma_k.first().map_or_else(String::new, |k| format!("{k:.2}")),
        ]);
    }
    let _ = writeln!(text, "{rows}\n");
    if diagnosis.causes[..diagnosis.open.min(diagnosis.causes.len())]
        .iter()
        .any(|cause| !cause.at_the_end.is_empty())
    {
        text.push_str(
            "A value at the end of its range exceeds the possible size of such an effect: the true cause is probably not in the effect library.\n\n",
        );
    }
}

/// Three figures.
fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (2 - value.abs().log10().floor() as i32).max(0);
    format!("{value:.*}", decimals as usize)
}

fn phases(text: &mut String, held_out: &HeldOut, channel: &str) {
    let _ = writeln!(
        text,
        "held out  {channel} of each phase, predicted by fits to the others: {:.2} K rms without a cause,\n          \
         {:.2} K with the cause that they choose; {:.2} K less on average ({:.2} .. {:.2}, {} phases)",
        held_out.before_k,
        held_out.after_k,
        held_out.gap_reduction_k,
        held_out.gap_reduction_low_k,
        held_out.gap_reduction_high_k,
        held_out.phases.len()
    );
    let named = held_out.phases.iter().any(|phase| !phase.chosen.is_empty());
    if named && held_out.after_k >= held_out.before_k {
        text.push_str("          the cause does not reduce the residual of held-out phases\n");
    } else if named && held_out.gap_reduction_low_k <= 0.0 {
        text.push_str("          too few phases to exclude chance\n");
    }
    for phase in &held_out.phases {
        let chosen =
            if phase.chosen.is_empty() { String::new() } else { format!("  {}", phase.chosen.join(" + ")) };
        let _ = writeln!(
            text,
            "          {:6.1} .. {:5.1} s, {:3.0} to {:3.0} krpm: {:6.2} -> {:5.2} K{chosen}",
            phase.from_s,
            phase.until_s,
            phase.from_rpm / 1e3,
            phase.until_rpm / 1e3,
            phase.before_k,
            phase.after_k
        );
    }
}

fn describe_delay(beyond: &Beyond) -> String {
    format!(
        "{:.1} to {:.1} s, {} readings that were not fitted: {:.2} K rms without a cause, {:.2} K with; expected {:.2} K ({:.2} .. {:.2});\n          \
         intervals contain {:.0} % of the readings",
        beyond.from_s,
        beyond.until_s,
        beyond.rows,
        beyond.before_k,
        beyond.after_k,
        beyond.expected_k,
        beyond.expected_low_k,
        beyond.expected_high_k,
        100.0 * beyond.inside_ratio
    )
}

fn verdict(beyond: &Beyond, word: SideVerdict) -> &'static str {
    match (beyond.after_k > beyond.expected_high_k, word) {
        (false, _) => "the residual is within what the fitted part predicts",
        (true, SideVerdict::Named | SideVerdict::NotDistinguished) => {
            "the residual exceeds the expectation for this cause: another cause acts as well, or instead"
        }
        (true, _) => {
            "the residual exceeds the expectation from the fitted part: a cause acts there that has no effect elsewhere"
        }
    }
}

fn unknowns(text: &mut String, diagnosis: &Diagnosis) {
    let heads = ["unknown", "value", "95 % interval", "unit", "known from", "description"];
    let mut rows = table::with_heads(&heads).with_texts(3..6);
    for unknown in &diagnosis.unknowns {
        rows.add_row([
            unknown.name.to_owned(),
            format!("{:.3}", unknown.value),
            format!("{:.3} .. {:.3}", unknown.low, unknown.high),
            unknown.unit.to_owned(),
            if unknown.identified { "the log" } else { "its prior" }.to_owned(),
            unknown.description.to_owned(),
        ]);
    }
    let _ = writeln!(text, "\n{rows}");
}
