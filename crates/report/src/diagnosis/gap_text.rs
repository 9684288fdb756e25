//! The diagnosis of a gap between rig and nominal model.

use crate::diagnosis::gap_next::{heat_table, next_section, residual_maps, traces};
use crate::diagnosis::stand_actions::{next_measurement, stand_actions};
use crate::document::{Cell, Describe, Document, Table};
use crate::formatting::{Message, display_scale, four_figures};
use mapper_core::{Channel, probability_text, step_number, valve_area_text, with_unit};
use mapper_diagnose::gap::{
    Baseline, BeyondPrior, Candidate, ClosureTerm, Diagnosed, Diagnosis, Estimate, Evidence, Gap, MapEffect,
    PointGap, SmallestSeen, Verdict,
};

/// Maximum number of causes shown.
const CAUSES: usize = 8;

/// Name of the hypothesis without a cause.
const NOTHING: &str = "nothing beyond tolerance";
/// Effects of the library that the list does not contain.
const UNLISTED: &str = "other effects of the library";
/// Causes that are listed only on request.
const IMPROBABLE: &str = "others, each below 5 % (--all)";
/// Probability from which they have a row: it is not rounded to zero.
const SHOWN: f64 = 5e-3;
/// The answer that the cause is not in the library.
const OUTSIDE: &str = "a cause outside the effect library";

impl Describe for Diagnosis {
    fn document(&self) -> Document {
        let mut document = Document::default();
        document.strong(headline(self));
        document.append(findings(self));
        document.append(recommendations(self));
        document
    }
}

pub(crate) fn gap_document(diagnosed: &Diagnosed, figures: &Evidence) -> Document {
    let diagnosis = &diagnosed.diagnosis;
    let mut document = Document::default();
    document.strong(headline(diagnosis));
    document.append(findings(diagnosis));
    document.section("Evidence", evidence(diagnosed, figures));
    document.append(recommendations(diagnosis));
    document
}

fn findings(diagnosis: &Diagnosis) -> Document {
    let mut document = Document::default();
    document.text(nearest(diagnosis).unwrap_or_default());
    if let Some(baseline) = &diagnosis.baseline {
        add_unjudged(&mut document, baseline);
    }
    if diagnosis.verdict != Verdict::WithinTolerance {
        for sensor in &diagnosis.offsets_at_rest {
            document.text(format!("{}: subtracted before the diagnosis", sensor.message()));
        }
    }
    document.section("Causes", causes(diagnosis));
    document.section("Location", locations(diagnosis));
    document.section("Detection limits", detection_limits(&diagnosis.smallest_seen));
    add_closure_terms(&mut document, diagnosis);
    add_gap_reduction(&mut document, diagnosis);
    document
}

fn recommendations(diagnosis: &Diagnosis) -> Document {
    let mut document = Document::default();
    let mut body = Document::default();
    let mut actions = stand_actions(diagnosis);
    actions.extend(next_measurement(diagnosis));
    if actions.is_empty() {
        body.text("Nothing: the rig is as declared.");
    } else {
        actions.push("then record again, and repeat the diagnosis".to_owned());
        body.numbered(actions);
    }
    document.section("What to do", body);
    document.section("Next experiment", next_section(diagnosis));
    let mut assumed = Document::default();
    assumed.list(diagnosis.assumed.iter().map(ToString::to_string));
    document.section("Assumed", assumed);
    let mut limits = Document::default();
    limits.list(diagnosis.warnings.iter().map(Message::message));
    document.section("Limits of this diagnosis", limits);
    document
}

fn causes(diagnosis: &Diagnosis) -> Document {
    let candidate_rows = diagnosis.listed().take(CAUSES).map(|candidate| {
        let others =
            candidate.equivalent.iter().map(|set| format!("; indistinguishable from {}", set.join(" + ")));
        (candidate.probability, cause(candidate) + others.collect::<String>().as_str())
    });
    let listed: f64 = diagnosis.listed().map(|candidate| candidate.probability).sum();
    let all: f64 = diagnosis.candidates.iter().map(|candidate| candidate.probability).sum();
    let with_closure = diagnosis.candidates.iter().filter(|candidate| candidate.has_closure());
    let unmodelled = diagnosis.probability_outside - with_closure.map(|one| one.probability).sum::<f64>();
    let improbable = Some((all - listed, IMPROBABLE.to_owned())).filter(|(sum, _)| *sum > SHOWN);
    let mut rows: Vec<(f64, String)> = candidate_rows
        .chain(improbable)
        .chain([
            (diagnosis.probability_none, NOTHING.to_owned()),
            (diagnosis.probability_unlisted, UNLISTED.to_owned()),
            (unmodelled.max(0.0), OUTSIDE.to_owned()),
        ])
        .collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut table = Table::new(["probability", "cause"]).with_texts([1]);
    for (probability, name) in rows {
        let cell = Cell::number(probability_text(probability), probability);
        table.row([cell.bar(probability), name.into()]);
    }
    let mut document = Document::default();
    document.table(table);
    document.list(diagnosis.suspects.iter().map(|suspect| format!("suspect: {}", suspect_text(suspect))));
    document
}

fn locations(diagnosis: &Diagnosis) -> Document {
    let mut document = Document::default();
    if diagnosis.locations.is_empty() {
        document.text("No part departs from the model by more than noise.");
    }
    let heads = ["part", "share", "sigma", "largest in", "after the jump", "region", "size"];
    let mut table = Table::new(heads).with_texts([3, 4, 5, 6]);
    for place in &diagnosis.locations {
        table.row([
            part_name(&place.submodel),
            format!("{:.0} %", 100.0 * place.share),
            format!("{:.0}", place.sigma),
            place.channel.to_string(),
            place.phase.to_string(),
            place.region.to_string(),
            format!("{} {}", four_figures(place.size), place.unit),
        ]);
    }
    document.table(table);
    if !diagnosis.inseparable.is_empty() {
        document.text(format!("Inseparable in this recording: {}.", diagnosis.inseparable.join(", ")));
    }
    document
}

fn detection_limits(effects: &[SmallestSeen]) -> Document {
    let mut document = Document::default();
    if effects.is_empty() {
        return document;
    }
    document.text("An effect would have been named, in 95 of 100 recordings like this one, from this size.");
    document.facts(
        "",
        effects.iter().map(|seen| {
            let size = seen.size.clone().unwrap_or_else(|| "no size within its range".to_owned());
            (format!("{} ({})", seen.name, seen.effect), size)
        }),
    );
    document
}

fn evidence(diagnosed: &Diagnosed, figures: &Evidence) -> Document {
    let Diagnosed { diagnosis, study, .. } = diagnosed;
    let mut document = Document::default();
    document.figures(
        "Ends of the steps on the map, coloured by the difference between measured and computed readings.",
        residual_maps(study, figures),
    );
    if !diagnosis.closure_terms_by_balance.is_empty() {
        let quantities = diagnosis
            .closure_terms_by_balance
            .iter()
            .map(|source| format!("{}, {}", source.quantity, source.unit));
        let mut table = Table::new(["step".to_owned()].into_iter().chain(quantities))
            .caption("Missing heat, power or flow of each balance, if it alone has one");
        for step in 0..study.steps.len() {
            let values =
                diagnosis.closure_terms_by_balance.iter().filter_map(|source| source.steps.get(step));
            let cells = values.map(|[value, low, high]| {
                format!("{} ({} .. {})", four_figures(*value), four_figures(*low), four_figures(*high))
            });
            table.row([step_number(step).to_string()].into_iter().chain(cells));
        }
        document.table(table);
    }
    document.text(
        "Root mean square of the difference between measured and computed readings for each step and channel, in units of the declared \
         uncertainty: 1 is noise. Tolerances are fitted.",
    );
    document.table(heat_table(study, "without a cause", &figures.without_cause.1));
    if let Some((cause, _, residual)) = &figures.with_cause {
        document.table(heat_table(study, &format!("with {cause}"), residual));
        document.figures(
            "Measured minus computed readings over time, of the four channels with the largest gap.",
            traces(study, figures),
        );
    }
    document
}

fn suspect_text(suspect: &BeyondPrior) -> String {
    format!(
        "{} ends {:.1} sigma from its declared value ({})",
        suspect.what,
        suspect.sigmas,
        four_figures(suspect.value)
    )
}

/// Below this probability a closure term closes a gap without being its cause.
const NOT_THE_TRUTH: f64 = 0.05;

fn add_closure_terms(document: &mut Document, diagnosis: &Diagnosis) {
    if let (Some(source), Some(place)) =
        (diagnosis.closure_terms_by_balance.first(), diagnosis.locations.first())
        && source.submodel == place.submodel
    {
        let (low, high) =
            source.steps.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), [value, ..]| {
                (low.min(*value), high.max(*value))
            });
        let mut body = Document::default();
        body.text(format!(
            "{}: {} .. {} over the steps",
            source.quantity,
            four_figures(low),
            with_unit(four_figures(high), &source.unit)
        ));
        document.section("Residual source term", body);
    }
    for term in &diagnosis.closure_terms {
        let mut body = Document::default();
        body.strong(&term.sentence);
        body.text(format!(
            "{}; {} on held-out steps",
            probability_text(term.probability),
            describe_removed_residual(term)
        ));
        if term.probability < NOT_THE_TRUTH {
            body.text("its residual is more than noise: its form is not the true one");
        }
        body.list(term.equivalent.iter().map(|other| format!("indistinguishable from: {other}")));
        if let Some(file) = &term.rhai {
            body.text(format!("written to {file}: give it with --effect"));
        }
        document.section(format!("Closure term for {}", part_name(&term.submodel)), body);
    }
}

fn describe_removed_residual(term: &ClosureTerm) -> String {
    format!("removes {:.0} % of the gap", 100.0 * term.gap_reduction)
}

/// The most probable answer, and what it does to the map.
pub fn headline(diagnosis: &Diagnosis) -> String {
    let effect = diagnosis.map_effect.as_ref().map(|effect| format!(": {}", map_effect(effect)));
    format!("{}{}", answer(diagnosis), effect.unwrap_or_default())
}

/// Changes of an efficiency below this are not worth a word, fraction.
const NO_CHANGE: f64 = 5e-4;

fn map_effect(effect: &MapEffect) -> String {
    let MapEffect { speed_rpm, valve, eta_error, half_interval, .. } = effect;
    if eta_error.abs().max(*half_interval) < NO_CHANGE {
        return "no efficiency reads wrong because of it".to_owned();
    }
    format!(
        "from its step alone, efficiency at {:.0} krpm and valve area {} reads {:.2} +/- {:.2} points {}",
        speed_rpm / 1e3,
        valve_area_text(*valve),
        100.0 * eta_error.abs(),
        100.0 * half_interval,
        if *eta_error > 0.0 { "high" } else { "low" }
    )
}

fn answer(diagnosis: &Diagnosis) -> String {
    let first = diagnosis.candidates.first();
    let baseline = diagnosis.baseline.as_ref().map(|baseline| baseline.recording.as_str());
    let seen =
        baseline.map_or_else(|| "is seen".to_owned(), |baseline| format!("has changed since {baseline}"));
    match (diagnosis.verdict, first) {
        (Verdict::WithinTolerance, _) if !diagnosis.offsets_at_rest.is_empty() => format!(
            "{}; with that subtracted nothing beyond the declared tolerances {seen}",
            diagnosis.offsets_at_rest.iter().map(Message::message).collect::<Vec<_>>().join(", ")
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
        (Verdict::Explained, Some(first)) if is_not_borne_out(&diagnosis.gap) => format!(
            "{} is the most probable cause, and removes {:.0} % of the gap on held-out steps",
            candidate_name(first),
            100.0 * diagnosis.gap.gap_reduction.max(0.0)
        ),
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
            match first.filter(|first| first.has_closure()) {
                Some(first) if first.effects.len() > 1 => {
                    format!("{} explain the gap{suffix}", members(first))
                }
                Some(first) => format!("{outside}: {}", members(first)),
                None => outside,
            }
        }
    }
}

/// Whether steps with a gap that the fit of the cause did not see keep half of it.
fn is_not_borne_out(gap: &Gap) -> bool {
    gap.folds.len() > 1 && gap.steps_with_gap > 0 && gap.gap_reduction <= STANDS_IN
}

/// Effects in both recordings, which are not judged, if a reference recording was given; and what a campaign declares to do without it.
fn add_unjudged(document: &mut Document, baseline: &Baseline) {
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
    document.text(format!(
        "only the change since {} is reported; the residual already present there is not judged: {}",
        baseline.recording,
        residuals.join(", ")
    ));
    document.text("a diagnosis without it needs these errors of the model's equations in the campaign:");
    document.code(flow_mapping("tolerances: {structure: {", &structure, "}}"));
    if !offsets.is_empty() {
        document.code(flow_mapping("sensors: {", &offsets, "}"));
    }
}

/// Width of lines of a campaign.
const WIDTH: usize = 78;

fn flow_mapping(start: &str, entries: &[String], end: &str) -> String {
    let mut lines = vec![start.to_owned()];
    for (index, entry) in entries.iter().enumerate() {
        let entry = format!("{entry}{}", if index + 1 < entries.len() { ", " } else { end });
        match lines.last_mut() {
            Some(line) if line.len() + entry.trim_end().len() <= WIDTH => line.push_str(&entry),
            _ => lines.push(format!("  {entry}")),
        }
    }
    lines.iter().map(|line| format!("{}\n", line.trim_end())).collect()
}

/// Name of a part of the machine in words, e.g. `T2 probe` for `t2_probe`.
pub(crate) fn part_name(submodel: &str) -> String {
    let word = |word: &str| match word.as_bytes() {
        [b't' | b'p', b'c' | b'0'..=b'9'] => word[..1].to_uppercase() + &word[1..],
        _ => word.to_owned(),
    };
    submodel.split('_').map(word).collect::<Vec<_>>().join(" ")
}

fn nearest(diagnosis: &Diagnosis) -> Option<String> {
    let first = diagnosis.listed().next();
    if first.is_some_and(Candidate::has_closure) {
        return None;
    }
    match (diagnosis.verdict, first) {
        (Verdict::PartlyExplained, Some(first)) => Some(format!(
            "nearest in the effect library: {}, whose residual exceeds the declared tolerances",
            candidate_name(first)
        )),
        (Verdict::PartlyExplained | Verdict::Unexplained, _) => {
            Some("no effect of the library comes near".to_owned())
        }
        (Verdict::WithinTolerance | Verdict::Explained, _) => None,
    }
}

/// Each member with its sizes and its own probability.
fn members(candidate: &Candidate) -> String {
    let member = |((id, name), probability): ((&String, &String), &f64)| {
        let probability = probability_text(*probability);
        if id == Candidate::CLOSURE {
            return format!("{name} (closure term, {probability})");
        }
        let own = candidate.parameters.iter().filter(|(key, _)| key.split('.').next() == Some(id));
        let sizes: Vec<&str> = own.map(|(_, estimate)| estimate.size.as_str()).collect();
        format!("{name} ({id}) {} ({probability})", sizes.join(", "))
    };
    let ids = candidate.effects.iter().zip(&candidate.names);
    ids.zip(&candidate.each).map(member).collect::<Vec<_>>().join(" and ")
}

fn candidate_name(candidate: &Candidate) -> String {
    let describe = |(id, name): (&String, &String)| match candidate.onsets.get(id) {
        Some(onset) if onset.grows => format!("{name} ({id}) growing from step {}", step_number(onset.step)),
        Some(onset) => format!("{name} ({id}) from step {} on", step_number(onset.step)),
        None => format!("{name} ({id})"),
    };
    candidate.effects.iter().zip(&candidate.names).map(describe).collect::<Vec<_>>().join(" + ")
}

pub(crate) fn cause(candidate: &Candidate) -> String {
    let parameters: Vec<String> = candidate.parameters.iter().map(|(name, e)| parameter(name, e)).collect();
    let separator = if parameters.is_empty() { "" } else { ": " };
    format!("{}{separator}{}", candidate_name(candidate), parameters.join(", "))
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

/// Share of the gap from which a step is named: that of five equal steps.
const NAMED_SHARE: f64 = 0.2;

/// Number of steps that support the cause, and the step that dominates the gap; empty without held-out steps.
fn describe_support(gap: &Gap) -> String {
    let count = gap.held_out_steps.len();
    if count == 0 {
        return String::new();
    }
    let step = gap.largest_step.filter(|_| gap.largest_share >= NAMED_SHARE);
    let largest =
        step.map(|step| format!("; step {} has {:.0} % of it", step_number(step), 100.0 * gap.largest_share));
    format!("{} of {count} steps show a gap{}", gap.steps_with_gap, largest.unwrap_or_default())
}

fn add_gap_reduction(document: &mut Document, diagnosis: &Diagnosis) {
    let gap = &diagnosis.gap;
    let mut body = Document::default();
    let closure = diagnosis.probable_closure_term().is_some();
    let named = closure || diagnosis.verdict.names_a_cause();
    let basis = match gap.folds.len() {
        0 | 1 => "on the fitted steps; there are too few to hold any out".to_owned(),
        folds => format!("on {} held-out steps ({folds}-fold cross-validation)", gap.held_out_steps.len()),
    };
    if named && gap.worse.is_empty() && gap.gap_reduction <= 0.0 {
        body.text(match gap.steps_with_gap {
            0 => "tolerances leave no gap on these steps either",
            _ => "the cause does not reduce the gap on these steps",
        });
    } else if named && gap.worse.is_empty() {
        body.text(format!(
            "{:.1} % of the gap removed (95 % interval for similar steps: {:.0} .. {:.0} %)",
            100.0 * gap.gap_reduction,
            (100.0 * gap.gap_reduction_low).floor(),
            (100.0 * gap.gap_reduction_high).ceil()
        ));
        body.text(describe_support(gap));
    } else if !gap.worse.is_empty() {
        body.text(format!("the gap does not shrink: {} gets worse", gap.worse.join(", ")));
    }
    body.table(by_channel(diagnosis, if named { 3 } else { 2 }));
    body.text(describe_affected_points(diagnosis).unwrap_or_default());
    if named {
        body.text(describe_strained_tolerance(gap).unwrap_or_default());
        body.text(describe_points(&gap.points));
    }
    document.section(format!("Gap reduction, {basis}"), body);
}

/// Points that a cause outside the library may touch, if no closure term describes it.
fn describe_affected_points(diagnosis: &Diagnosis) -> Option<String> {
    let points = diagnosis.gap.points.iter().enumerate();
    let largest = points.max_by(|a, b| a.1.eta_residual.total_cmp(&b.1.eta_residual));
    let (step, point) = largest.filter(|_| diagnosis.is_outside_without_closure())?;
    Some(format!(
        "no closure term describes the cause: it may change the efficiency of every point; by the residual of T2, up to +/- {:.2} points (step {})",
        100.0 * point.eta_residual,
        step_number(step)
    ))
}

/// A cause that removes less than this share of the residual after tolerances can be replaced by them.
const STANDS_IN: f64 = 0.5;

/// If tolerances can replace the cause without a larger residual: the tolerance that would have to exceed its prior.
fn describe_strained_tolerance(gap: &Gap) -> Option<String> {
    let beyond_prior = gap.beyond_prior.as_ref().filter(|_| gap.gap_reduction < STANDS_IN)?;
    Some(format!(
        "tolerances can replace the cause, but exceed their declaration: {} by {:.1} sigma",
        beyond_prior.what, beyond_prior.sigmas
    ))
}

/// The rms residual of each channel in the first so many columns.
fn by_channel(diagnosis: &Diagnosis, columns: usize) -> Table {
    let bare = if diagnosis.baseline.is_some() { "baseline" } else { "nominal" };
    let heads = ["rms residual", "unit"]
        .into_iter()
        .chain([bare, "tolerances fitted", "with the cause"].into_iter().take(columns));
    let mut table = Table::new(heads).with_texts([1]);
    for (channel, row) in &diagnosis.gap.channels {
        let (scale, unit) = display_scale(&row.unit);
        let values = [row.nominal, row.before, row.after].into_iter().take(columns);
        let values = values.map(|value| four_figures(scale * value));
        table.row([channel.clone(), unit.to_owned()].into_iter().chain(values));
    }
    table
}

/// The effect of the cause on efficiency and heat transfer at equal speed and pressures.
fn describe_points(points: &[PointGap]) -> String {
    let largest = |change_of: fn(&PointGap) -> f64| {
        let changes = points.iter().map(change_of).filter(|change| change.is_finite());
        changes.fold(0.0f64, |most, change| if change.abs() > most.abs() { change } else { most })
    };
    let eta_points = 100.0 * largest(|point| point.eta_after - point.eta_before);
    let h_w_m2k = largest(|point| point.h_after_w_m2k - point.h_before_w_m2k);
    format!(
        "at equal speed and pressures, the cause changes the wheel's own efficiency by up to {eta_points:+.2} points and h by up to \
         {h_w_m2k:+.0} W/(m2 K); `mapper gap correct` gives its effect on the identified efficiencies"
    )
}
