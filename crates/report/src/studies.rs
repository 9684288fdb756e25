//! Studies in many pieces: progress, cost, submission, merge.

use crate::document::{Describe, Document};
use mapper_fleet::{Cost, MergeOutcome, Status, Submission, UnfinishedItem};
use std::collections::BTreeMap;

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

/// Every item without a result, and the files that were left out.
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

/// The merged result and the missing items.
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

/// Items, processor hours, memory, disk.
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

/// Job numbers, tasks, limits.
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
