//! Submission to a queue by a script template, Slurm's if none is given.

use crate::files::{Durability, Machine, make_directory, read_at_most, write_whole};
use crate::fleet::LOGS;
use crate::{Cost, Fleet, FleetError, Shard, Status};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Options of a submission.
#[derive(Debug, Clone)]
pub struct SubmitOptions {
    /// The queue.
    pub template: Template,
    /// The command that starts the program.
    pub program: PathBuf,
    /// Partition, or queue; the site's default if empty.
    pub partition: String,
    /// Cores of a task.
    pub cpus: usize,
    /// Target duration of a task, minutes.
    pub task_min: f64,
    /// Limits.
    pub limits: Limits,
}

/// Limits of a submission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Time limit of a task, minutes; `None`: twice the target duration plus five minutes.
    pub time_min: Option<u64>,
    /// Number of tasks of an array.
    pub tasks: u64,
    /// Maximum number of concurrent tasks, if limited.
    pub at_once: Option<u64>,
    /// Processor time of all remaining items, h.
    pub hours: Option<f64>,
    /// Memory of a task, MB.
    pub memory_mb: Option<u64>,
}

/// The submission, kept in the directory for a retry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Submission {
    /// Name of the template.
    pub template: String,
    /// Its content.
    pub template_text: String,
    /// Number of tasks that share the items.
    pub tasks: u64,
    /// The submitted tasks, as ranges: 1-8 or 2,5-7.
    pub array: String,
    /// Cores of a task.
    pub cpus: usize,
    /// Time limit of a task, minutes.
    pub minutes: u64,
    /// Memory of a task, MB.
    pub memory_mb: u64,
    /// Partition; empty: the site's default.
    pub partition: String,
    /// Maximum number of concurrent tasks, if limited.
    pub at_once: Option<u64>,
    /// The program.
    pub program: PathBuf,
    /// ID of the array job.
    pub work: String,
    /// ID of the merge job that follows it.
    pub merge: Option<String>,
    /// The queue's answer if it accepted the array and refused the merge job; the study is then merged by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merge_refused: Option<String>,
}

/// Safety factor on the estimated duration of a task. Judgement: nodes of one cluster differ by a third.
const TIME_SAFETY_FACTOR: f64 = 1.5;
/// Memory in addition to the items, with overheads that only queues count, MB.
const MEMORY_OVERHEAD_MB: u64 = 128;

impl Fleet {
    /// Submits the remaining items. The number of tasks is the smallest that keeps each within the target duration.
    pub fn submit(
        &self,
        options: &SubmitOptions,
        cost: &Cost,
        machine: &Machine<'_>,
    ) -> Result<Submission, FleetError> {
        if cost.left == 0 {
            return Err(self.nothing_left_error());
        }
        self.check_not_queued()?;
        let status = self.status();
        let limits = &options.limits;
        let refused = |why: String| Err(FleetError::DoesNotFit(why));
        if let Some(hours) = limits.hours.filter(|hours| cost.left_hours > *hours) {
            return refused(format!(
                "the remaining items take {:.2} processor hours, the limit is {hours}; raise the limit or make the study smaller",
                cost.left_hours
            ));
        }
        let items_mb = (cost.memory_bytes >> 20) + 1;
        let memory_mb = MEMORY_OVERHEAD_MB + items_mb * options.cpus as u64;
        if let Some(most_mb) = limits.memory_mb.filter(|most_mb| memory_mb > *most_mb) {
            return refused(format!(
                "a task of {} cores needs {memory_mb} MB, the limit is {most_mb}; give it fewer cores",
                options.cpus
            ));
        }
        let lasts_min = |tasks: u64| {
            let items = self.largest_shard(&status, tasks) as f64;
            (items * cost.item_s / options.cpus as f64).max(cost.longest_s) / 60.0
        };
        let wanted_min = limits
            .time_min
            .map_or(options.task_min, |max| options.task_min.min(max as f64 / TIME_SAFETY_FACTOR));
        let most_tasks = limits.tasks.min(cost.left as u64).max(1);
        let fair = (cost.left_hours * 60.0 / options.cpus as f64 / wanted_min).ceil() as u64;
        let mut tasks = fair.clamp(1, most_tasks);
        // Shards are equal only on average, so a few tasks are added if the largest is too large.
        while lasts_min(tasks) > 1.25 * wanted_min && tasks < most_tasks {
            tasks = (tasks + tasks.div_ceil(10)).min(most_tasks);
        }
        let longest_min = lasts_min(tasks);
        if let Some(max) = limits.time_min.filter(|max| TIME_SAFETY_FACTOR * longest_min > *max as f64) {
            return refused(format!(
                "the longest of {tasks} tasks takes about {longest_min:.1} min, but the time limit of {max} min must be at least \
                 {TIME_SAFETY_FACTOR} times that; allow more tasks, cores or time"
            ));
        }
        let minutes = limits.time_min.unwrap_or((2.0 * longest_min).ceil() as u64 + 5);
        let submission = Submission {
            template: options.template.name.clone(),
            template_text: options.template.text.clone(),
            tasks,
            array: format!("1-{tasks}"),
            cpus: options.cpus,
            minutes,
            memory_mb,
            partition: options.partition.clone(),
            at_once: limits.at_once,
            program: options.program.clone(),
            work: String::new(),
            merge: None,
            merge_refused: None,
        };
        self.write_and_submit(submission, "", machine)
    }

    /// Submits again the tasks with missing, failed or damaged items, and the merge that follows them.
    pub fn retry(&self, machine: &Machine<'_>) -> Result<Submission, FleetError> {
        let before = self.submission()?;
        self.check_not_queued()?;
        let status = self.status();
        let mut numbers: Vec<u64> =
            status.unfinished_items().map(|item| Shard::holding(&item.hash, before.tasks).number()).collect();
        numbers.sort_unstable();
        numbers.dedup();
        if numbers.is_empty() {
            return Err(self.nothing_left_error());
        }
        self.write_and_submit(Submission { array: number_ranges(&numbers), ..before }, "--again", machine)
    }

    /// The last submission.
    pub fn submission(&self) -> Result<Submission, FleetError> {
        let path = self.directory().join(SUBMITTED);
        if !path.exists() {
            return Err(FleetError::NotSubmitted(self.directory().to_owned()));
        }
        let bytes = read_at_most(&path, 1 << 20)?;
        serde_json::from_slice(&bytes).map_err(FleetError::content(&path, "a submission"))
    }

    /// Refuses a submission while the queue has tasks of the last one: items would be done twice. A silent queue counts as empty.
    fn check_not_queued(&self) -> Result<(), FleetError> {
        let Ok(before) = self.submission() else { return Ok(()) };
        let template = Template { name: before.template, text: before.template_text };
        let tasks: usize = query_task_states(&template, &before.work).unwrap_or_default().into_values().sum();
        match tasks {
            0 => Ok(()),
            tasks => Err(FleetError::StillQueued {
                directory: self.directory().to_owned(),
                job: before.work,
                tasks,
            }),
        }
    }

    fn nothing_left_error(&self) -> FleetError {
        FleetError::NothingLeft { items: self.study.items.len(), directory: self.directory().to_owned() }
    }

    fn largest_shard(&self, status: &Status, tasks: u64) -> usize {
        let mut counts = std::collections::BTreeMap::new();
        for item in status.unfinished_items() {
            *counts.entry(Shard::holding(&item.hash, tasks).number()).or_insert(0) += 1;
        }
        counts.into_values().max().unwrap_or(0)
    }

    fn write_and_submit(
        &self,
        mut submission: Submission,
        again: &str,
        machine: &Machine<'_>,
    ) -> Result<Submission, FleetError> {
        let directory = self.directory();
        let directory = directory.canonicalize().map_err(FleetError::file("find", directory))?;
        make_directory(directory.join(LOGS))?;
        let word = |path: &Path| shell_quote(&path.to_string_lossy());
        let program = word(&submission.program);
        let (cpus, tasks, directory_word) = (submission.cpus, submission.tasks, word(&directory));
        // Limits the threads of each item to its share of the cores.
        let task = format!(
            "# One task: shard $1 of {tasks}.\nexport RAYON_NUM_THREADS={cpus}\n\
             exec {program} fleet work {directory_word} --shard \"$1/{tasks}\" --jobs {cpus} {again}\n"
        );
        let merge = format!("exec {program} fleet merge {directory_word}\n");
        let write = |name: &str, text: &str| -> Result<PathBuf, FleetError> {
            let path = directory.join(name);
            write_whole(&path, &[text.as_bytes()], machine.name, Durability::Unsynced)?;
            Ok(path)
        };
        let values = [
            ("NAME", shell_quote(&self.study.name)),
            ("ARRAY", shell_quote(&submission.array)),
            ("AT_ONCE", submission.at_once.map_or_else(String::new, |max| max.to_string())),
            ("MINUTES", submission.minutes.to_string()),
            ("CPUS", cpus.to_string()),
            ("MEMORY_MB", submission.memory_mb.to_string()),
            ("PARTITION", shell_quote(&submission.partition)),
            ("LOGS", word(&directory.join(LOGS))),
            ("TASK", word(&write("task.sh", &task)?)),
            ("MERGE", word(&write("merge.sh", &merge)?)),
        ];
        let mut text = String::from(
            "#!/bin/sh\n# Made by `mapper fleet`; submits the array job and the merge behind it.\n",
        );
        for (name, value) in values {
            text += &format!("export {name}={value}\n");
        }
        let script = write("submit.sh", &(text + &submission.template_text))?;
        let template = Template { name: submission.template.clone(), text: submission.template_text.clone() };
        let answer = run_submission(&script, &template)?;
        submission.work = answer.work;
        (submission.merge, submission.merge_refused) = match answer.merge {
            Ok(merge) => (merge, None),
            Err(why) => (None, Some(why)),
        };
        let path = directory.join(SUBMITTED);
        let bytes =
            serde_json::to_vec_pretty(&submission).map_err(FleetError::content(&path, "a submission"))?;
        write_whole(&path, &[&bytes, b"\n"], machine.name, Durability::Synced)?;
        Ok(submission)
    }
}

const SUBMITTED: &str = "submitted.json";

/// Sorted numbers in the syntax of queues: 1,4-6.
pub fn number_ranges(numbers: &[u64]) -> String {
    let mut ranges: Vec<(u64, u64)> = Vec::new();
    for number in numbers {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == *number => *last = *number,
            _ => ranges.push((*number, *number)),
        }
    }
    let fields = ranges
        .into_iter()
        .map(|(first, last)| if first == last { first.to_string() } else { format!("{first}-{last}") });
    fields.collect::<Vec<_>>().join(",")
}

/// A template that submits an array of tasks and a merge that follows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Template {
    /// Its name, or its file.
    pub name: String,
    /// The script.
    pub text: String,
}

/// Largest template, bytes.
const MAX_FILE_BYTES: usize = 64 << 10;

impl Template {
    /// Slurm.
    pub fn slurm() -> Template {
        Template { name: "slurm".to_owned(), text: include_str!("../templates/slurm.sh").to_owned() }
    }

    /// Another queue, from a file.
    pub fn read(path: &Path) -> Result<Template, FleetError> {
        let bytes = read_at_most(path, MAX_FILE_BYTES)?;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Ok(Template { name: path.display().to_string(), text })
    }
}

pub(crate) fn shell_quote(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct QueueJobs {
    pub work: String,
    /// ID of the merge job; or, if the queue refused it after it had accepted the array, its answer.
    pub merge: Result<Option<String>, String>,
}

/// Runs the submission. It prints `work ID` and `merge ID`; other lines, e.g. the site's greeting, are ignored.
pub(crate) fn run_submission(script: &Path, template: &Template) -> Result<QueueJobs, FleetError> {
    let failed = |message: String| FleetError::Queue {
        script: PathBuf::from(script),
        answer: message,
        template: template.name.clone(),
    };
    let output = Command::new("sh")
        .arg(script)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| failed(format!("failed to start sh: {error}")))?;
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let answer = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    let fields = printed.lines().filter_map(|line| line.trim().split_once(' '));
    let mut ids: BTreeMap<String, String> = fields
        .map(|(word, id)| (word.to_owned(), id.trim().to_owned()))
        .filter(|(_, id)| !id.is_empty() && !id.contains(char::is_whitespace))
        .collect();
    let merge = ids.remove("merge");
    match (ids.remove("work"), output.status.success()) {
        (Some(work), true) => Ok(QueueJobs { work, merge: Ok(merge) }),
        // The tasks are in the queue, and must not be submitted a second time.
        (Some(work), false) => Ok(QueueJobs { work, merge: Err(answer) }),
        (None, false) => Err(failed(answer)),
        (None, true) => Err(failed(format!("it did not print `work ID`, but {printed:?}"))),
    }
}

/// Number of tasks of a job in each state, for display; `None` if the queue does not answer within some seconds.
pub fn query_task_states(template: &Template, job: &str) -> Option<BTreeMap<String, usize>> {
    let query = template.text.lines().find_map(|line| line.strip_prefix("#states: "))?;
    let mut child = Command::new("sh")
        .args(["-c", query])
        .env("WORK", job)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    for _ in 0..QUERY_ATTEMPTS {
        if child.try_wait().ok()?.is_some() {
            let mut printed = String::new();
            child.stdout.take()?.take(MAX_FILE_BYTES as u64 * 16).read_to_string(&mut printed).ok()?;
            let mut states = BTreeMap::new();
            for state in printed.lines().map(str::trim).filter(|line| !line.is_empty()) {
                *states.entry(state.to_lowercase()).or_insert(0) += 1;
            }
            return Some(states);
        }
        std::thread::sleep(QUERY_INTERVAL);
    }
    let _ = child.kill();
    let _ = child.wait();
    None
}

/// Number and interval of the attempts to reach a queue that does not answer: 5 s.
const QUERY_ATTEMPTS: usize = 100;
const QUERY_INTERVAL: Duration = Duration::from_millis(50);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_ranges() {
        assert_eq!(number_ranges(&[1]), "1");
        assert_eq!(number_ranges(&[1, 2, 3, 7, 9, 10]), "1-3,7,9-10");
    }
}
