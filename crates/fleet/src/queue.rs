//! Interface to a cluster's queue: a template with a shell script that submits, and one line in it that queries the state.

use crate::FleetError;
use crate::directory::shared_files::read_at_most;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

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
    ///
    /// # Errors
    /// [`FleetError::File`].
    pub fn read(path: &Path) -> Result<Template, FleetError> {
        let bytes = read_at_most(path, MAX_FILE_BYTES)?;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        Ok(Template { name: path.display().to_string(), text })
    }

    /// The line that prints the state of each task of the job `$WORK`.
    fn state_query(&self) -> Option<&str> {
        self.text.lines().find_map(|line| line.strip_prefix("#states: "))
    }
}

/// Text quoted as one word of a shell.
pub(crate) fn shell_quote(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// The queue's answer to a submission.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct QueueJobs {
    /// ID of the array job.
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

/// Number of tasks of a job in each state, as the queue reports it; `None` if it does not answer within some seconds.
/// Nothing depends on the answer.
pub fn query_task_states(template: &Template, job: &str) -> Option<BTreeMap<String, usize>> {
    let query = template.state_query()?;
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
