//! Progress and cost of a study, as text.

use mapper_fleet::{Cost, MergeOutcome, Status, Submission, UnfinishedItem};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Maximum number of listed items; the rest is counted.
const SHOWN: usize = 20;

/// Done, in progress, failed, missing, remaining time.
pub fn status_text(name: &str, status: &Status, queue: Option<&BTreeMap<String, usize>>) -> String {
    let mut text = format!("{name}: {} of {} items done", status.done, status.items);
    let in_progress = status.started_items();
    for (count, state) in [
        (status.failed.len(), "failed"),
        (status.refused.len(), "with an invalid part"),
        (in_progress, "in progress"),
        (status.missing.len() - in_progress, "not started"),
    ] {
        if count > 0 {
            let _ = write!(text, ", {count} {state}");
        }
    }
    text += "\n";
    if let Some(left_s) = status.left_s().filter(|left_s| *left_s > 0.0) {
        let _ = writeln!(text, "about {} of one core left", span(left_s));
    }
    if let Some(states) = queue {
        let states: Vec<String> = states.iter().map(|(state, count)| format!("{count} {state}")).collect();
        let states = if states.is_empty() { "no tasks left".to_owned() } else { states.join(", ") };
        let _ = writeln!(text, "the queue has {states}");
    }
    text + lacking_text(status, |item| item.why.is_some()).as_str()
}

/// Every item without a result, and the files that were left out.
fn lacking_text(status: &Status, shown: impl Fn(&UnfinishedItem) -> bool) -> String {
    let mut text = String::new();
    for (items, state) in [(&status.failed, "failed"), (&status.refused, "invalid part")] {
        list(&mut text, items, |item| {
            format!("{state}: {} ({}): {}", item.name, item.hash.short(), item.why.as_deref().unwrap_or("-"))
        });
    }
    let missing: Vec<&UnfinishedItem> = status.missing.iter().filter(|item| shown(item)).collect();
    list(&mut text, &missing, |item| {
        let worker = item.why.as_ref().map_or_else(String::new, |who| format!(", started by {who}"));
        format!("missing: {} ({}){worker}", item.name, item.hash.short())
    });
    list(&mut text, &status.unrelated_parts, |name| {
        format!("omitted: parts/{name} belongs to no item of this study")
    });
    text
}

fn list<T>(text: &mut String, items: &[T], line: impl Fn(&T) -> String) {
    for item in items.iter().take(SHOWN) {
        let _ = writeln!(text, "  {}", line(item));
    }
    if items.len() > SHOWN {
        let _ = writeln!(text, "  and {} more; `--json` has all", items.len() - SHOWN);
    }
}

/// The merged result and the missing items.
pub fn merged_text(merged: &MergeOutcome) -> String {
    let status = &merged.status;
    let mut text = lacking_text(status, |_| true);
    match &merged.result {
        Some((path, description)) => {
            let note = if status.unfinished() > 0 { " (incomplete)" } else { "" };
            let _ = writeln!(
                text,
                "merged {} of {} items{note} in {}\n{description}",
                status.done,
                status.items,
                path.display()
            );
        }
        None => {
            let _ = writeln!(text, "nothing merged: {} of {} items have a result", status.done, status.items);
        }
    }
    text
}

/// Items, processor hours, memory, disk.
pub fn cost_text(cost: &Cost) -> String {
    let memory = match cost.memory_bytes {
        0 => "unknown memory".to_owned(),
        bytes => format!("{} of memory", bytes_text(bytes)),
    };
    format!(
        "{} items, {} of them left\n{} of one core an item on average, {} the longest, from {} that are done\n\
         {:.2} processor hours in total, {:.2} left\n{memory} for an item at a time, {} on the disk in total\n",
        cost.items,
        cost.left,
        span(cost.item_s),
        span(cost.longest_s),
        cost.from,
        cost.hours,
        cost.left_hours,
        bytes_text(cost.disk_bytes),
    )
}

/// Job numbers, tasks, limits.
pub fn submission_text(submission: &Submission) -> String {
    let merge = match (&submission.merge, &submission.merge_refused) {
        (Some(id), _) => format!(", then the merge: job {id}"),
        (None, Some(why)) => format!(
            "\nthe queue refused the merge job: {}\nrun `mapper fleet merge` when the tasks have ended",
            why.lines().next_back().unwrap_or("no reason given")
        ),
        (None, None) => String::new(),
    };
    format!(
        "tasks {} of {}: job {}{merge}\n{} cores, {} min and {} MB a task at most\n",
        submission.array,
        submission.tasks,
        submission.work,
        submission.cpus,
        submission.minutes,
        submission.memory_mb
    )
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
