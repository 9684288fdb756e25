//! Nights of runs: each night compared with the ones before, and all of them listed.

use crate::document::{Document, Table};
use crate::formatting::number;
use mapper_history::{Comparison, ListedRun, Metric, Night, median};
use std::collections::BTreeMap;
use std::path::Path;

/// A time of the history in UTC by a strftime format; a dash if it is not a time.
pub fn time(ms: i64, format: &str) -> String {
    jiff::Timestamp::from_millisecond(ms)
        .map_or_else(|_| "-".to_owned(), |time| time.strftime(format).to_string())
}

fn heads(first: &[&str], figures: &[Metric]) -> Vec<String> {
    let figure_heads = figures.iter().map(|figure| format!("{figure} {}", figure.display_unit().0));
    first.iter().map(|head| (*head).to_owned()).chain(figure_heads).collect()
}

fn format_metric(figure: Metric, value: Option<f64>) -> String {
    let decimals = match figure {
        Metric::GoodPoints | Metric::HMean | Metric::HTrueMean | Metric::RigMinutes => 1,
        _ => 3,
    };
    number(value.map(|value| figure.display_unit().1 * value), decimals)
}

fn state(listed: &ListedRun) -> &'static str {
    match (listed.night.accepted, listed.night.moved) {
        (true, _) => "accepted",
        (_, true) => "moved",
        _ => "",
    }
}

/// A row per night, campaign and method: medians over the seeds.
pub fn night_groups(runs: &[ListedRun], figures: &[Metric]) -> Document {
    let mut groups: BTreeMap<(i64, i64, &str, &str), Vec<&ListedRun>> = BTreeMap::new();
    for listed in runs {
        let key = (
            listed.night.started_ms,
            listed.night.id,
            listed.run.key.campaign.as_str(),
            listed.run.key.method.as_str(),
        );
        groups.entry(key).or_default().push(listed);
    }
    let mut table = Table::new(heads(&["night (UTC)", "campaign", "method", "seeds", "night is"], figures))
        .with_texts([1, 2, 4]);
    for ((started_ms, _, campaign, method), group) in &groups {
        let mut row = vec![
            time(*started_ms, "%Y-%m-%d %H:%M"),
            (*campaign).to_owned(),
            (*method).to_owned(),
            group.len().to_string(),
            group.first().map(|listed| state(listed)).unwrap_or_default().to_owned(),
        ];
        row.extend(figures.iter().map(|figure| {
            format_metric(
                *figure,
                median(group.iter().filter_map(|listed| listed.run.figures.get(figure).copied())),
            )
        }));
        table.row(row);
    }
    let mut document = Document::default();
    document.table(table);
    document.text(format!(
        "{} rows of {} runs; figures are medians over the seeds.",
        groups.len(),
        runs.len()
    ));
    document
}

/// A row per run.
pub fn listed_runs(runs: &[ListedRun], figures: &[Metric]) -> Document {
    let mut table = Table::new(heads(&["night (UTC)", "campaign", "method", "seed", "night is"], figures))
        .with_texts([1, 2, 4]);
    let mut failures = Vec::new();
    for listed in runs {
        let key = &listed.run.key;
        let started = time(listed.night.started_ms, "%Y-%m-%d %H:%M");
        if let Some(failure) = &listed.run.failure {
            failures.push(format!("{started} {key} failed: {failure}"));
        }
        let mut row = vec![
            started,
            key.campaign.clone(),
            key.method.clone(),
            key.seed.to_string(),
            state(listed).to_owned(),
        ];
        row.extend(
            figures.iter().map(|figure| format_metric(*figure, listed.run.figures.get(figure).copied())),
        );
        table.row(row);
    }
    let mut document = Document::default();
    document.table(table);
    failures.into_iter().for_each(|failure| document.text(failure));
    document.text(format!("{} runs.", runs.len()));
    document
}

/// One run of a night for a program.
pub fn listed_run_json(listed: &ListedRun) -> serde_json::Value {
    let ListedRun { night, run } = listed;
    let figures: BTreeMap<&str, Option<f64>> =
        Metric::ALL.into_iter().map(|figure| (figure.name(), run.figures.get(&figure).copied())).collect();
    serde_json::json!({
        "night": {
            "id": night.id, "name": night.name, "started": time(night.started_ms, "%Y-%m-%dT%H:%M:%SZ"),
            "duration_s": night.duration_s, "program": night.program, "accepted": night.accepted, "moved": night.moved,
        },
        "campaign": run.key.campaign, "machine": run.key.machine, "method": run.key.method, "seed": run.key.seed,
        "campaign_sha256": run.campaign_sha256, "model_sha256": run.model_sha256,
        "failure": run.failure, "figures": figures,
    })
}

/// The changes of a night, and its size.
pub fn night_comparison(night: &Night, comparison: &Comparison, path: &Path) -> Document {
    let mut document = Document::default();
    for (run, failure) in &comparison.failed {
        document.text(format!("failed: {run}: {failure}"));
    }
    for run in &comparison.missing {
        document.text(format!("missing: {run}: the last nights had it"));
    }
    for moved in &comparison.moved {
        let (unit, factor) = moved.figure.display_unit();
        let value = moved.value.map_or_else(|| "-".to_owned(), |value| format!("{:.4}", factor * value));
        document.text(format!(
            "moved: {}: {} = {value} {unit}; it was {:.4} ({:.4} to {:.4}) in {} {}",
            moved.run,
            moved.figure,
            factor * moved.band.median,
            factor * moved.band.low,
            factor * moved.band.high,
            moved.band.nights,
            nights(moved.band.nights),
        ));
    }
    for moved in &comparison.moved_points {
        let shift = |shift| moved.quantity.format_shift(shift, moved.mean_level);
        let line = format!(
            "moved: {}: {} at {} of {} points, by {} on average",
            moved.run,
            moved.quantity.words(),
            moved.moved,
            moved.compared,
            shift(moved.mean_shift),
        );
        let largest = moved.largest.as_ref().map_or_else(String::new, |largest| {
            let by = moved.quantity.format_shift(largest.value - largest.band.median, largest.band.median);
            format!(", largest at {} ({by})", largest.place)
        });
        document.text(line + largest.as_str());
    }
    for sentence in &comparison.conclusions {
        document.text(sentence.to_string());
    }
    let points: usize = night.runs.iter().map(|run| run.points.len()).sum();
    document.text(format!(
        "{} maps, {points} points in {:.1} s, in {}.",
        night.runs.len(),
        night.duration_s,
        path.display()
    ));
    let (before, all_failed) = (comparison.nights, comparison.failed.len() == night.runs.len());
    document.text(match (comparison.stored_nights, before) {
        (0, _) if all_failed => "The first night: no run gave figures.".to_owned(),
        (0, _) => "The first night: there is nothing to compare with yet.".to_owned(),
        (_, 1..) if all_failed => {
            format!("No run gave figures tonight; on the last {before} {} they had figures.", nights(before))
        }
        (_, 0) if !comparison.missing.is_empty() => {
            "Nothing of tonight was there on the nights before: there is nothing to compare with.".to_owned()
        }
        (stored, 0) => format!(
            "There is nothing to compare with: the runs of {stored} earlier {} failed or lay outside their band.",
            nights(stored)
        ),
        _ if comparison.is_quiet() => {
            format!("Every figure lies in the band of the last {before} {}.", nights(before))
        }
        _ if night.accepted => "Accepted: this night begins a new band.".to_owned(),
        _ => String::new(),
    });
    document
}

fn nights(count: usize) -> &'static str {
    if count == 1 { "night" } else { "nights" }
}
