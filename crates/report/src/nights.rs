//! Nights and studies.

use crate::document::{Describe, Document, Table};
use crate::formatting::{Message, number};
use mapper_fleet::{Cost, MergeOutcome, Status, Submission, UnfinishedItem};
use mapper_history::{CataloguePage, CataloguedRun, Comparison, ListedRun, Metric, Night, median};
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

/// Names and values of a catalogued run, as every table of runs shows them; drift and +/- in points of efficiency.
pub(crate) fn run_values(run: &CataloguedRun) -> [(&'static str, String); 13] {
    let summary = &run.summary;
    let known = |text: Option<&String>| text.map_or_else(|| "-".to_owned(), String::clone);
    let [good, doubtful, unusable] = summary.points.map(|count| count.to_string());
    let end = match (&summary.ending, summary.has_journal) {
        _ if summary.problem.is_some() => "Cannot be read.".to_owned(),
        (Some(ending), _) => ending.message(),
        (None, true) => "Goes on, or was killed.".to_owned(),
        (None, false) => "Identified from recordings.".to_owned(),
    };
    [
        ("start (UTC)", known(summary.started.as_ref()).trim_end_matches(" UTC").to_owned()),
        ("machine", summary.machine.clone()),
        ("serial", known(summary.serial_number.as_ref())),
        ("campaign", summary.campaign.clone()),
        ("rig", summary.backend.clone()),
        ("end", end),
        ("good", good),
        ("doubtful", doubtful),
        ("unusable", unusable),
        ("surges", summary.surges.map_or_else(|| "-".to_owned(), |surges| surges.to_string())),
        ("drift", summary.drift.map_or_else(|| "-".to_owned(), |drift| format!("{:+.2}", 100.0 * drift))),
        ("worst +/-", number(summary.worst_eta_half_width.map(|half| 100.0 * half), 2)),
        ("tags", run.tags.join(", ")),
    ]
}

/// Columns of [`run_values`] with text.
pub(crate) const TEXT_COLUMNS: [usize; 6] = [1, 2, 3, 4, 5, 12];

/// A table of runs; the last column is their folder.
pub(crate) fn run_table<'a>(runs: impl IntoIterator<Item = &'a CataloguedRun>) -> Table {
    let heads = run_values(&CataloguedRun::default()).map(|(head, _)| head).into_iter().chain(["folder"]);
    let cells = |run: &CataloguedRun| {
        let values = run_values(run).map(|(_, value)| value).into_iter();
        values.chain([run.folder.clone()]).collect::<Vec<_>>()
    };
    Table::new(heads).with_texts(TEXT_COLUMNS.into_iter().chain([13])).rows(runs.into_iter().map(cells))
}

impl Describe for CataloguePage {
    fn document(&self) -> Document {
        let mut document = Document::default();
        document.table(run_table(&self.runs));
        for run in &self.runs {
            document.text(
                run.summary.problem.as_ref().map_or_else(String::new, |why| format!("{}: {why}", run.folder)),
            );
        }
        document.text(format!(
            "{} of {} catalogued runs; drift and +/- in points of efficiency.",
            self.runs.len(),
            self.all
        ));
        document
    }
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

/// Maximum number of listed items; the rest is counted.
const SHOWN: usize = 20;

/// Done, in progress, failed, missing, remaining time.
pub fn study_status(name: &str, status: &Status, queue: Option<&BTreeMap<String, usize>>) -> Document {
    let mut document = Document::default();
    let in_progress = status.started_items();
    let states = [
        (status.failed.len(), "failed"),
        (status.refused.len(), "with an invalid part"),
        (in_progress, "in progress"),
        (status.missing.len() - in_progress, "not started"),
    ];
    let others = states.into_iter().filter(|(count, _)| *count > 0);
    let others: String = others.map(|(count, state)| format!(", {count} {state}")).collect();
    document.text(format!("{name}: {} of {} items done{others}", status.done, status.items));
    if let Some(left_s) = status.left_s().filter(|left_s| *left_s > 0.0) {
        document.text(format!("about {} of one core left", span(left_s)));
    }
    if let Some(states) = queue {
        let states: Vec<String> = states.iter().map(|(state, count)| format!("{count} {state}")).collect();
        let states = if states.is_empty() { "no tasks left".to_owned() } else { states.join(", ") };
        document.text(format!("the queue has {states}"));
    }
    add_lacking(&mut document, status, |item| item.why.is_some());
    document
}

fn add_lacking(document: &mut Document, status: &Status, shown: impl Fn(&UnfinishedItem) -> bool) {
    for (items, state) in [(&status.failed, "failed"), (&status.refused, "invalid part")] {
        list(document, items, |item| {
            format!("{state}: {} ({}): {}", item.name, item.hash.short(), item.why.as_deref().unwrap_or("-"))
        });
    }
    let missing: Vec<&UnfinishedItem> = status.missing.iter().filter(|item| shown(item)).collect();
    list(document, &missing, |item| {
        let worker = item.why.as_ref().map_or_else(String::new, |who| format!(", started by {who}"));
        format!("missing: {} ({}){worker}", item.name, item.hash.short())
    });
    list(document, &status.unrelated_parts, |name| {
        format!("omitted: parts/{name} belongs to no item of this study")
    });
}

fn list<T>(document: &mut Document, items: &[T], line: impl Fn(&T) -> String) {
    let more = (items.len() > SHOWN).then(|| format!("and {} more; `--json` has all", items.len() - SHOWN));
    document.list(items.iter().take(SHOWN).map(line).chain(more));
}

impl Describe for MergeOutcome {
    fn document(&self) -> Document {
        let (status, mut document) = (&self.status, Document::default());
        add_lacking(&mut document, status, |_| true);
        match &self.result {
            Some((path, description)) => {
                let note = if status.unfinished() > 0 { " (incomplete)" } else { "" };
                document.text(format!(
                    "merged {} of {} items{note} in {}",
                    status.done,
                    status.items,
                    path.display()
                ));
                document.text(description);
            }
            None => document
                .text(format!("nothing merged: {} of {} items have a result", status.done, status.items)),
        }
        document
    }
}

impl Describe for Cost {
    fn document(&self) -> Document {
        let memory = match self.memory_bytes {
            0 => "unknown memory".to_owned(),
            bytes => format!("{} of memory", bytes_text(bytes)),
        };
        let mut document = Document::default();
        document.text(format!("{} items, {} of them left", self.items, self.left));
        document.text(format!(
            "{} of one core an item on average, {} the longest, from {} that are done",
            span(self.item_s),
            span(self.longest_s),
            self.from
        ));
        document.text(format!("{:.2} processor hours in total, {:.2} left", self.hours, self.left_hours));
        document.text(format!(
            "{memory} for an item at a time, {} on the disk in total",
            bytes_text(self.disk_bytes)
        ));
        document
    }
}

impl Describe for Submission {
    fn document(&self) -> Document {
        let mut document = Document::default();
        let tasks = format!("tasks {} of {}: job {}", self.array, self.tasks, self.work);
        match (&self.merge, &self.merge_refused) {
            (Some(id), _) => document.text(format!("{tasks}, then the merge: job {id}")),
            (None, Some(why)) => {
                document.text(tasks);
                document.text(format!(
                    "the queue refused the merge job: {}",
                    why.lines().next_back().unwrap_or("no reason given")
                ));
                document.text("run `mapper fleet merge` when the tasks have ended");
            }
            (None, None) => document.text(tasks),
        }
        document.text(format!(
            "{} cores, {} min and {} MB a task at most",
            self.cpus, self.minutes, self.memory_mb
        ));
        document
    }
}

fn bytes_text(bytes: u64) -> String {
    let megabytes = bytes as f64 / 1e6;
    if megabytes < 1000.0 { format!("{megabytes:.1} MB") } else { format!("{:.1} GB", megabytes / 1e3) }
}

fn span(duration_s: f64) -> String {
    match duration_s {
        s if s < 90.0 => format!("{s:.1} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
