//! The cause of a deviation on one side of a machine, from a log without steps.

use crate::document::{Describe, Document, Table};
use mapper_chart::{Axis, Dash, Figure, Line, Panel, Rule, RuleAt, Scatter, ScatterPoint, palette};
use mapper_core::probability_text;
use mapper_diagnose::driven::{Beyond, Diagnosis, HeldOut, SideCause, SideVerdict};
use mapper_diagnose::gap::Estimate;

/// Maximum number of causes shown in addition to the undecided ones.
const FURTHER_ROWS: usize = 3;
/// Causes less likely than this are not shown.
const NOT_WORTH: f64 = 0.005;

/// The verdict, the causes, the held-out residual, and what was and could not be tested.
impl Describe for Diagnosis {
    fn document(&self) -> Document {
        let first = self.judged.first().copied().unwrap_or("");
        let mut document = Document::default();
        document.text(format!(
            "The {} side compared with the campaign's machine, driven by measured {}; judged: {}.",
            self.side.name(),
            self.driven_by.join(", "),
            self.judged.join(", ")
        ));
        document.strong(headline(self));
        document.table(causes(self));
        if open_causes(self).iter().any(|cause| !cause.at_the_end.is_empty()) {
            document.text(
                "A value at the end of its range exceeds the possible size of such an effect: the true cause is probably not in the effect library.",
            );
        }
        document.text(format!(
            "fitted: {first} is off by {:.2} K rms without a cause, by {:.2} K with the named causes",
            self.before_k, self.after_k
        ));
        match &self.held_out {
            Some(held_out) => add_phases(&mut document, held_out, first),
            None => document.text("held out: nothing, because the fitted part is a single phase"),
        }
        if let Some(beyond) = &self.beyond {
            document.text(format!("predicted: {}; {}", describe_delay(beyond), verdict(beyond, self.word)));
        }
        if self.lost_rows > 0 {
            document.text(format!(
                "{} readings of {first} were omitted, because a channel is missing or impossible there",
                self.lost_rows
            ));
        }
        document.table(unknowns(self));
        let sizes =
            self.asked.iter().filter_map(|seen| Some(format!("{} {}", seen.effect, seen.size.as_deref()?)));
        if !self.asked.is_empty() {
            document.text(format!(
                "Tested, with the smallest size that is detected in 95 of 100 logs like this one: {}.",
                sizes.collect::<Vec<_>>().join(", ")
            ));
        }
        let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
        for effect in &self.not_asked {
            match reasons.iter_mut().find(|(reason, _)| *reason == effect.reason) {
                Some((_, effects)) => effects.push(&effect.effect),
                None => reasons.push((&effect.reason, vec![&effect.effect])),
            }
        }
        let mut untested = Document::default();
        untested.list(reasons.iter().map(|(reason, effects)| format!("{}: {reason}", effects.join(", "))));
        document.section("Not testable on this side", untested);
        document
    }
}

fn open_causes(diagnosis: &Diagnosis) -> &[SideCause] {
    &diagnosis.causes[..diagnosis.open.min(diagnosis.causes.len())]
}

fn headline(diagnosis: &Diagnosis) -> String {
    let open = open_causes(diagnosis);
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

fn capitalise(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn causes(diagnosis: &Diagnosis) -> Table {
    let is_shown = |(place, cause): &(usize, &SideCause)| {
        *place < diagnosis.open
            || *place == 0
            || (*place < diagnosis.open + FURTHER_ROWS && cause.candidate.probability > NOT_WORTH)
    };
    let heads = ["cause", "probability", "size", "95 % interval", "residual, K"];
    let mut table = Table::new(heads).with_texts(2..4);
    for (_, cause) in diagnosis.causes.iter().enumerate().filter(is_shown) {
        let each = |text_of: &dyn Fn(&Estimate) -> String| {
            cause.candidate.parameters.values().map(text_of).collect::<Vec<_>>().join("; ")
        };
        let interval = each(&|estimate| {
            let (scale, unit) = match estimate.unit.as_str() {
                "m" => (1e3, "mm"),
                "1" => (1.0, ""),
                unit => (1.0, unit),
            };
            let [low, high] = [estimate.low, estimate.high].map(|value| significant(scale * value));
            format!("{low} .. {high} {unit}").trim_end().to_owned()
        });
        let end = if cause.at_the_end.is_empty() { "" } else { " (end of its range)" };
        table.row([
            cause.candidate.effects.join(" + "),
            probability_text(cause.candidate.probability),
            each(&|estimate| estimate.size.clone()) + end,
            interval,
            cause.model_error_sigma_k.first().map_or_else(String::new, |k| format!("{k:.2}")),
        ]);
    }
    table
}

fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (2 - value.abs().log10().floor() as i32).max(0);
    format!("{value:.*}", decimals as usize)
}

fn add_phases(document: &mut Document, held_out: &HeldOut, channel: &str) {
    document.text(format!(
        "held out: {channel} of each phase, predicted by fits to the others: {:.2} K rms without a cause, {:.2} K with the cause that they \
         choose; {:.2} K less on average ({:.2} .. {:.2}, {} phases)",
        held_out.before_k,
        held_out.after_k,
        held_out.gap_reduction_k,
        held_out.gap_reduction_low_k,
        held_out.gap_reduction_high_k,
        held_out.phases.len()
    ));
    let named = held_out.phases.iter().any(|phase| !phase.chosen.is_empty());
    if named && held_out.after_k >= held_out.before_k {
        document.text("the cause does not reduce the residual of held-out phases");
    } else if named && held_out.gap_reduction_low_k <= 0.0 {
        document.text("too few phases to exclude chance");
    }
    let heads = ["from s", "to s", "from krpm", "to krpm", "without, K", "with, K", "cause"];
    let mut table = Table::new(heads).with_texts([6]);
    for phase in &held_out.phases {
        table.row([
            format!("{:.1}", phase.from_s),
            format!("{:.1}", phase.until_s),
            format!("{:.0}", phase.from_rpm / 1e3),
            format!("{:.0}", phase.until_rpm / 1e3),
            format!("{:.2}", phase.before_k),
            format!("{:.2}", phase.after_k),
            phase.chosen.join(" + "),
        ]);
    }
    document.table(table);
}

fn describe_delay(beyond: &Beyond) -> String {
    format!(
        "{:.1} to {:.1} s, {} readings that were not fitted: {:.2} K rms without a cause, {:.2} K with; expected {:.2} K ({:.2} .. {:.2}); \
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

fn unknowns(diagnosis: &Diagnosis) -> Table {
    let heads = ["unknown", "value", "95 % interval", "unit", "known from", "description"];
    let row = |unknown: &mapper_diagnose::driven::Unknown| {
        [
            unknown.name.to_owned(),
            format!("{:.3}", unknown.value),
            format!("{:.3} .. {:.3}", unknown.low, unknown.high),
            unknown.unit.to_owned(),
            if unknown.identified { "the log" } else { "its prior" }.to_owned(),
            unknown.description.to_owned(),
        ]
    };
    Table::new(heads).with_texts(3..6).rows(diagnosis.unknowns.iter().map(row))
}

/// Two panels over time: the reading with both predictions, and both residuals.
pub fn why_figure(name: &str, diagnosis: &Diagnosis) -> Figure {
    let history = &diagnosis.time_history;
    let channel = diagnosis.judged.first().copied().unwrap_or("");
    let over = |values: &mut dyn Iterator<Item = f64>| -> Vec<(f64, f64)> {
        history.t_s.iter().copied().zip(values).collect()
    };
    let rule = |panel: &mut Panel| {
        if let Some(beyond) = &diagnosis.beyond {
            let at = Rule::new(RuleAt::X(beyond.from_s)).label("predicted from here on");
            panel.add(Rule { dash: Dash::Dashed, ..at });
        }
    };
    let mut readings = Panel::new(Axis::new("time, s"), Axis::new(format!("{channel}, degC")))
        .title(format!("(a) {channel} as read and as predicted"));
    let celsius = |values: &[f64]| over(&mut values.iter().map(|k| k - 273.15));
    readings.add(Line::new(celsius(&history.before_k), palette::INK).label("without a cause"));
    readings.add(Line::new(celsius(&history.after_k), palette::BLUE).label(cause_label(diagnosis)));
    let dot = |(x, y): (f64, f64)| ScatterPoint { x, y, x_interval: None, y_interval: None };
    let dots = celsius(&history.read_k).into_iter().map(dot).collect();
    readings.add(Scatter::new(dots, palette::INK).size_px(2.0).label("read"));
    rule(&mut readings);
    let mut left =
        Panel::new(Axis::new("time, s"), Axis::new("read less predicted, K")).title("(b) residual");
    let off = |predicted: &[f64]| {
        over(&mut history.read_k.iter().zip(predicted).map(|(read, predicted)| read - predicted))
    };
    left.add(Line::new(off(&history.before_k), palette::INK).label("without a cause"));
    left.add(Line::new(off(&history.after_k), palette::BLUE).label(cause_label(diagnosis)));
    rule(&mut left);
    let side = diagnosis.side.name();
    Figure::new(format!("The {side} side of {name}, driven by its measured neighbours"))
        .subtitle(format!("{} drive throughout.", diagnosis.driven_by.join(", ")))
        .panel(readings)
        .panel(left)
        .columns(2)
        .panel_size_px(520.0, 380.0)
}

fn cause_label(diagnosis: &Diagnosis) -> String {
    match (diagnosis.word, diagnosis.causes.first()) {
        (SideVerdict::Named | SideVerdict::NotDistinguished, Some(cause)) => {
            format!("with {}", cause.candidate.names.join(" and "))
        }
        _ => "no cause is named".to_owned(),
    }
}
