//! A diagnosis as a page for a terminal.

use crate::diagnosis::gap_next::next_text;
use crate::diagnosis::gap_warning_text::{gap_warning_text, offset_at_rest_text};
use crate::diagnosis::stand_actions::stand_actions;
use crate::formatting::number::four_figures;
use crate::formatting::table::COLUMNS;
use crate::formatting::wrapped::wrapped;
use mapper_core::{Channel, probability_text, step_number, with_unit};
use mapper_diagnose::gap::{
    Baseline, BeyondPrior, Candidate, ChannelGap, ClosureTerm, Diagnosis, Estimate, Gap, PointGap,
    SmallestSeen, Verdict,
};
use std::collections::BTreeMap;

/// Maximum number of causes shown.
const CAUSES: usize = 5;
/// Maximum number of places shown.
const PLACES: usize = 5;

/// Name of the hypothesis without a cause.
pub const NOTHING: &str = "nothing beyond tolerance";
/// Effects of the library that the list does not contain.
pub const UNLISTED: &str = "other effects of the library";
/// The answer that the cause is not in the library.
pub const OUTSIDE: &str = "a cause outside the effect library";

/// The page.
pub fn gap_text(diagnosis: &Diagnosis) -> String {
    let mut text = format!("{}\n", headline(diagnosis));
    if let Some(nearest) = nearest(diagnosis) {
        text += &format!("{nearest}\n");
    }
    if let Some(baseline) = &diagnosis.baseline {
        text += &not_judged(baseline);
    }
    if diagnosis.verdict != Verdict::WithinTolerance {
        for sensor in &diagnosis.offsets_at_rest {
            text += &format!("{}: subtracted before the diagnosis\n", offset_at_rest_text(sensor));
        }
    }
    if !diagnosis.locations.is_empty() {
        text += "\nlocation\n";
        for place in diagnosis.locations.iter().take(PLACES) {
            let place = format!(
                "  {}: {:.0} % of the gap, {:.0} sigma; largest in {}, {} after the jump, {}: {} {}",
                part_name(&place.submodel),
                100.0 * place.share,
                place.sigma,
                place.channel,
                place.phase,
                place.region,
                four_figures(place.size),
                place.unit,
            );
            text += &wrapped(&place, COLUMNS, 6);
        }
    }
    if !diagnosis.inseparable.is_empty() {
        let parts = diagnosis.inseparable.join(", ");
        text += &wrapped(&format!("  inseparable in this recording: {parts}"), COLUMNS, 6);
    }
    if !diagnosis.smallest_seen.is_empty() {
        text += &list_smallest_detectable(&diagnosis.smallest_seen);
    }
    text += "\ncauses\n";
    let mut causes: Vec<(f64, String)> = diagnosis
        .listed()
        .take(CAUSES)
        .map(|candidate| {
            let lines = wrapped(&cause(candidate), COLUMNS - 11, 0);
            let mut lines = lines.trim_end().replace('\n', "\n           ");
            for set in &candidate.equivalent {
                lines += &format!("\n           indistinguishable from {}", set.join(" + "));
            }
            (candidate.probability, lines)
        })
        .chain([
            (diagnosis.probability_none, NOTHING.to_owned()),
            (diagnosis.probability_unlisted, UNLISTED.to_owned()),
            (diagnosis.probability_outside, OUTSIDE.to_owned()),
        ])
        .collect();
    causes.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (probability, lines) in causes {
        text += &format!("  {:>7}  {lines}\n", probability_text(probability));
    }
    for suspect in &diagnosis.suspects {
        text += &format!("  suspect: {}\n", suspect_text(suspect));
    }
    text += &closure_terms(diagnosis);
    text += &describe_gap_reduction(diagnosis);
    let actions = stand_actions(diagnosis);
    if !actions.is_empty() {
        text += "\ncheck at the stand\n";
        text += &actions.iter().map(|action| wrapped(&format!("  {action}"), COLUMNS, 4)).collect::<String>();
    }
    text += &next_text(diagnosis);
    if !diagnosis.assumed.is_empty() {
        text += "\nassumed\n";
        for assumption in &diagnosis.assumed {
            text += &wrapped(&format!("  {assumption}"), COLUMNS, 4);
        }
    }
    if !diagnosis.warnings.is_empty() {
        text += "\nlimits of this diagnosis\n";
        for warning in &diagnosis.warnings {
            text += &wrapped(&format!("  {}", gap_warning_text(warning)), COLUMNS, 4);
        }
    }
    text
}

/// A warning that the named cause is not the best explanation, on separate lines; empty if there is none.
pub fn doubt_text(doubt: Option<&str>) -> String {
    doubt.map_or_else(String::new, |doubt| wrapped(&format!("warning: {doubt}"), COLUMNS, 2))
}

/// A tolerance outside its prior, in words.
pub fn suspect_text(suspect: &BeyondPrior) -> String {
    format!(
        "{} ends {:.1} sigma from its declared value ({})",
        suspect.what,
        suspect.sigmas,
        four_figures(suspect.value)
    )
}

/// Below this probability a closure term closes a gap without being its cause.
const NOT_THE_TRUTH: f64 = 0.05;

/// The missing term and the closure term for it.
fn closure_terms(diagnosis: &Diagnosis) -> String {
    let mut text = String::new();
    if let (Some(source), Some(place)) =
        (diagnosis.closure_terms_by_balance.first(), diagnosis.locations.first())
        && source.submodel == place.submodel
    {
        let (low, high) =
            source.steps.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), [value, ..]| {
                (low.min(*value), high.max(*value))
            });
        text += &format!(
            "\nresidual source term\n  {}: {} .. {} over the steps\n",
            source.quantity,
            four_figures(low),
            with_unit(four_figures(high), &source.unit)
        );
    }
    for term in &diagnosis.closure_terms {
        text += &format!(
            "\nclosure term\n  {}\n  {}; {} on held-out steps\n",
            term.sentence,
            probability_text(term.probability),
            describe_removed_residual(term)
        );
        if term.probability < NOT_THE_TRUTH {
            text += "  its residual is more than noise: its form is not the true one\n";
        }
        for other in &term.equivalent {
            text += &format!("  indistinguishable from: {other}\n");
        }
        if let Some(file) = &term.rhai {
            text += &format!("  written to {file}: give it with --effect\n");
        }
    }
    text
}

/// The effect of a closure term on the gap, in words.
fn describe_removed_residual(term: &ClosureTerm) -> String {
    match term.worse.as_slice() {
        [] => format!("removes {:.0} % of the gap", 100.0 * term.gap_reduction),
        worse => format!("the gap does not shrink: {} gets worse", worse.join(", ")),
    }
}

/// One sentence: the most probable answer.
pub fn headline(diagnosis: &Diagnosis) -> String {
    let first = diagnosis.candidates.first();
    let baseline = diagnosis.baseline.as_ref().map(|baseline| baseline.recording.as_str());
    let seen =
        baseline.map_or_else(|| "is seen".to_owned(), |baseline| format!("has changed since {baseline}"));
    match (diagnosis.verdict, first) {
        (Verdict::WithinTolerance, _) if !diagnosis.offsets_at_rest.is_empty() => format!(
            "{}; with that subtracted nothing beyond the declared tolerances {seen}",
            diagnosis.offsets_at_rest.iter().map(offset_at_rest_text).collect::<Vec<_>>().join(", ")
        ),
        (Verdict::WithinTolerance, Some(first)) if first.probability > diagnosis.probability_none => format!(
            "nothing beyond the declared tolerances {seen} for certain; {} is suspected ({})",
            candidate_name(first),
            probability_text(first.probability)
        ),
        (Verdict::WithinTolerance, _) if !diagnosis.suspects.is_empty() => {
            format!("no cause is named, but {}", suspect_text(&diagnosis.suspects[0]))
        }
        (Verdict::WithinTolerance, _) => format!("nothing beyond the declared tolerances {seen}"),
        (Verdict::Explained, Some(first)) if is_not_borne_out(&diagnosis.gap) => {
            format!("{} is the most probable cause; held-out steps do not confirm it", candidate_name(first))
        }
        (Verdict::Explained, Some(first)) => {
            let verb = if first.effects.len() == 1 { "explains" } else { "explain" };
            let target = baseline
                .map_or_else(|| "the gap".to_owned(), |baseline| format!("the change since {baseline}"));
            format!("{} {verb} {target}", candidate_name(first))
        }
        _ => {
            let suffix =
                baseline.map_or_else(String::new, |baseline| format!(" of the change since {baseline}"));
            let outside = format!(
                "{OUTSIDE} is the most probable{suffix} ({})",
                probability_text(diagnosis.probability_outside)
            );
            diagnosis
                .probable_closure_term()
                .map_or_else(|| outside.clone(), |term| format!("{outside}: {}", term.sentence))
        }
    }
}

/// Whether steps with a gap that the fit of the cause did not see keep it.
fn is_not_borne_out(gap: &Gap) -> bool {
    gap.folds.len() > 1 && gap.steps_with_gap > 0 && gap.gap_reduction <= 0.0
}

/// Effects in both recordings, which are not judged, if a reference recording was given; and what a campaign declares to do without it.
fn not_judged(baseline: &Baseline) -> String {
    let (mut residuals, mut structure, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
    for (channel, error) in &baseline.lacking {
        let (scale, unit) = display_scale(&error.unit);
        residuals.push(format!("{channel} {}", with_unit(four_figures(scale * error.size), unit)));
        // P3 is an input.
        if *channel != Channel::P3.symbol() {
            structure.push(format!("{channel}: {:.1} %", 100.0 * error.declare.structure_ratio));
            offsets.extend(error.declare.offset.map(|offset| {
                format!("{channel}: {{offset: {}}}", with_unit(four_figures(scale * offset), unit))
            }));
        }
    }
    let unjudged = format!(
        "only the change since {} is reported; the residual already present there is not judged: {}\n\
         a diagnosis without it needs these errors of the model's equations in the campaign:",
        baseline.recording,
        residuals.join(", ")
    );
    let mut text = wrapped(&unjudged, COLUMNS, 2);
    text.push_str(&flow_mapping("  tolerances: {structure: {", &structure, "}}"));
    if !offsets.is_empty() {
        text.push_str(&flow_mapping("  sensors: {", &offsets, "}"));
    }
    text
}

/// A mapping of a campaign on few lines, broken between its entries.
fn flow_mapping(start: &str, entries: &[String], end: &str) -> String {
    let mut lines = vec![start.to_owned()];
    for (index, entry) in entries.iter().enumerate() {
        let entry = format!("{entry}{}", if index + 1 < entries.len() { ", " } else { end });
        match lines.last_mut() {
            Some(line) if line.len() + entry.trim_end().len() <= COLUMNS => line.push_str(&entry),
            _ => lines.push(format!("    {entry}")),
        }
    }
    lines.iter().map(|line| format!("{}\n", line.trim_end())).collect()
}

/// Factor to the unit in which residuals are shown, and that unit.
pub(crate) fn display_scale(unit: &str) -> (f64, &str) {
    match unit {
        "Pa" => (1e-3, "kPa"),
        "kg/s" => (1e3, "g/s"),
        unit => (1.0, unit),
    }
}

/// Name of a part of the machine in words, e.g. `T2 probe` for `t2_probe`.
pub(crate) fn part_name(submodel: &str) -> String {
    let word = |word: &str| match word.as_bytes() {
        [b't' | b'p', b'c' | b'0'..=b'9'] => word[..1].to_uppercase() + &word[1..],
        _ => word.to_owned(),
    };
    submodel.split('_').map(word).collect::<Vec<_>>().join(" ")
}

/// The effect of the library that is closest to an unmodelled cause.
fn nearest(diagnosis: &Diagnosis) -> Option<String> {
    let first = diagnosis.candidates.first()?;
    match diagnosis.verdict {
        Verdict::PartlyExplained => Some(format!(
            "nearest in the effect library: {}, whose residual exceeds the declared tolerances",
            candidate_name(first)
        )),
        Verdict::Unexplained => Some("no effect of the library comes near".to_owned()),
        Verdict::WithinTolerance | Verdict::Explained => None,
    }
}

/// Effects by their names, with ids and onset times.
pub fn candidate_name(candidate: &Candidate) -> String {
    let describe = |(id, name): (&String, &String)| match candidate.onsets.get(id) {
        Some(onset) if onset.grows => format!("{name} ({id}) growing from step {}", step_number(onset.step)),
        Some(onset) => format!("{name} ({id}) from step {} on", step_number(onset.step)),
        None => format!("{name} ({id})"),
    };
    candidate.effects.iter().zip(&candidate.names).map(describe).collect::<Vec<_>>().join(" + ")
}

/// A cause with its parameters.
pub fn cause(candidate: &Candidate) -> String {
    let parameters: Vec<String> = candidate.parameters.iter().map(|(name, e)| parameter(name, e)).collect();
    format!("{}: {}", candidate_name(candidate), parameters.join(", "))
}

fn parameter(name: &str, estimate: &Estimate) -> String {
    // A ratio that is shown in per cent has its interval in per cent.
    let percent = estimate.size.strip_suffix(" %").and_then(|size| size.parse::<f64>().ok());
    if percent.is_some_and(|percent| (percent - 100.0 * estimate.value).abs() <= 0.01 * percent.abs()) {
        let [value, low, high] =
            [estimate.value, estimate.low, estimate.high].map(|ratio| four_figures(100.0 * ratio));
        return format!("{name} = {value} % ({low} .. {high} %)");
    }
    let value = with_unit(four_figures(estimate.value), &estimate.unit);
    let (low, high) = (four_figures(estimate.low), four_figures(estimate.high));
    // The size is rounded, and often in a clearer unit.
    let same_unit = estimate.size.ends_with(&format!(" {}", estimate.unit));
    let size = if same_unit { String::new() } else { format!(", {}", estimate.size) };
    format!("{name} = {value} ({low} .. {high}){size}")
}

/// The smallest detectable size of each effect.
fn list_smallest_detectable(effects: &[SmallestSeen]) -> String {
    let mut text =
        "\nan effect would have been named, in 95 of 100 recordings like this one, from\n".to_owned();
    for seen in effects {
        let size = seen.size.as_deref().unwrap_or("no size within its range");
        text += &format!("  {:40} {size}\n", format!("{} ({})", seen.name, seen.effect));
    }
    text
}

/// Share of the gap from which a step is named: that of five equal steps.
const NAMED_SHARE: f64 = 0.2;

/// Number of steps that support the cause, and the step that dominates the gap.
fn describe_support(gap: &mapper_diagnose::gap::Gap) -> String {
    let count = gap.held_out_steps.len();
    if count == 0 {
        return String::new();
    }
    let mut text = format!("  {} of {count} steps show a gap", gap.steps_with_gap);
    if let Some(step) = gap.largest_step.filter(|_| gap.largest_share >= NAMED_SHARE) {
        text += &format!("; step {} has {:.0} % of it", step_number(step), 100.0 * gap.largest_share);
    }
    text + "\n"
}

fn describe_gap_reduction(diagnosis: &Diagnosis) -> String {
    let gap = &diagnosis.gap;
    if let Some(term) = diagnosis.probable_closure_term() {
        return describe_closure_reduction(diagnosis, term, gap.folds.iter().map(Vec::len).sum());
    }
    let named = matches!(diagnosis.verdict, Verdict::Explained | Verdict::PartlyExplained);
    let mut text = match gap.folds.len() {
        0 | 1 => "\ngap reduction, on the fitted steps; there are too few to hold any out\n".to_owned(),
        folds => format!(
            "\ngap reduction, on {} held-out steps ({folds}-fold cross-validation)\n",
            gap.held_out_steps.len()
        ),
    };
    if named && gap.worse.is_empty() && gap.gap_reduction <= 0.0 {
        text += match gap.steps_with_gap {
            0 => "  tolerances leave no gap on these steps either\n",
            _ => "  the cause does not reduce the gap on these steps\n",
        };
    } else if named && gap.worse.is_empty() {
        text += &format!(
            "  {:.1} % of the gap removed (95 % interval for similar steps: {:.0} .. {:.0} %)\n",
            100.0 * gap.gap_reduction,
            (100.0 * gap.gap_reduction_low).floor(),
            (100.0 * gap.gap_reduction_high).ceil()
        );
        text += &describe_support(gap);
    } else if !gap.worse.is_empty() {
        text += &format!("  the gap does not shrink: {} gets worse\n", gap.worse.join(", "));
    }
    text += &by_channel(diagnosis, &gap.channels, "with the cause", if named { 3 } else { 2 });
    text += &list_affected_points(diagnosis);
    if named {
        text += &describe_strained_tolerance(gap);
        text += &points(&gap.points);
    }
    text
}

/// Points that a cause outside the library may touch, if no term describes it.
fn list_affected_points(diagnosis: &Diagnosis) -> String {
    let points = diagnosis.gap.points.iter().enumerate();
    let largest = points.max_by(|a, b| a.1.eta_residual.total_cmp(&b.1.eta_residual));
    let Some((step, point)) = largest.filter(|_| diagnosis.is_outside_without_closure()) else {
        return String::new();
    };
    wrapped(
        &format!(
            "  no closure term describes the cause: it may change the efficiency of every point; by the residual of T2, up to +/- {:.2} points (step {})",
            100.0 * point.eta_residual,
            step_number(step)
        ),
        COLUMNS,
        4,
    )
}

/// If tolerances can replace the cause without a larger residual: the tolerance that would have to exceed its prior.
fn describe_strained_tolerance(gap: &Gap) -> String {
    let Some(beyond_prior) = gap.beyond_prior.as_ref().filter(|_| gap.gap_reduction < STANDS_IN) else {
        return String::new();
    };
    format!(
        "  tolerances can replace the cause, but exceed their declaration: {} by {:.1} sigma\n",
        beyond_prior.what, beyond_prior.sigmas
    )
}

/// A cause that removes less than this share of the residual after tolerances can be replaced by them.
const STANDS_IN: f64 = 0.5;

/// The gap reduction of a closure term that resembles no effect of the library.
fn describe_closure_reduction(diagnosis: &Diagnosis, term: &ClosureTerm, steps: usize) -> String {
    let seen = match term.held_out_steps {
        0 => "on the fitted steps; there are too few to hold any out".to_owned(),
        held => format!("on {held} of {steps} steps, used neither to find the closure term nor to fit it"),
    };
    format!("\ngap reduction, {seen}\n  {}\n", describe_removed_residual(term))
        + by_channel(diagnosis, &term.channels, "with the term", 3).as_str()
}

/// The residual of each channel in the first so many columns.
fn by_channel(
    diagnosis: &Diagnosis,
    channels: &BTreeMap<String, ChannelGap>,
    with: &str,
    columns: usize,
) -> String {
    let mut text = "  rms residual\n      ".to_owned();
    let bare = if diagnosis.baseline.is_some() { "baseline" } else { "nominal" };
    for head in [bare, "tolerances fitted", with].iter().take(columns) {
        text += &format!(" {head:>18}");
    }
    text += "\n";
    for (channel, row) in channels {
        let (scale, unit) = display_scale(&row.unit);
        text += &format!("  {channel:4}");
        for value in [row.nominal, row.before, row.after].iter().take(columns) {
            text += &format!(" {:>18}", four_figures(scale * value));
        }
        text += &format!(" {unit}\n");
    }
    text
}

/// The effect of the cause on efficiency and heat transfer at equal speed and pressures.
fn points(points: &[PointGap]) -> String {
    let largest = |suffix: fn(&PointGap) -> f64| {
        let changes = points.iter().map(suffix).filter(|d| d.is_finite());
        changes.fold(0.0f64, |most, d| if d.abs() > most.abs() { d } else { most })
    };
    let eta_points = 100.0 * largest(|p| p.eta_after - p.eta_before);
    let h_w_m2k = largest(|p| p.h_after_w_m2k - p.h_before_w_m2k);
    let line = format!(
        "  at equal speed and pressures, the cause changes the wheel's own efficiency by up to {eta_points:+.2} points and h by up to \
         {h_w_m2k:+.0} W/(m2 K); `mapper gap correct` gives its effect on the identified efficiencies"
    );
    wrapped(&line, COLUMNS, 4)
}
