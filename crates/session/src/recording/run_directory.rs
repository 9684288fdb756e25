//! Run directories: each run gets a new one.

use crate::SessionError;
use crate::recording::files::write_new;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

/// File names in a run directory: the recording.
pub const RECORDING: &str = "recording.mcap";
/// The executed plan.
pub const PLAN: &str = "plan.json";
/// The executed steps of a sequence script.
pub const EXECUTED: &str = "executed_plan.json";
/// The campaign as it was read.
pub const CAMPAIGN: &str = "campaign.yaml";
/// The sequence script, if any.
pub const SEQUENCE: &str = "sequence.rhai";
/// Identified points.
pub const POINTS: &str = "points.json";
/// The map of the turbine, without its extension.
pub const TURBINE_MAP: &str = "turbine_map";
/// Uncertainty budgets of the points.
pub const BUDGET: &str = "budget.csv";
/// The journal of safely recorded steps.
pub const JOURNAL: &str = "journal.jsonl";
/// The test report.
pub const REPORT: &str = "report.md";

/// The extended report as a page for a browser.
pub const PAGE: &str = "report.html";

pub(crate) fn further_recording(part: usize) -> String {
    format!("recording-{part}.mcap")
}

pub(crate) fn is_recording(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let number = name.strip_prefix("recording-").and_then(|rest| rest.strip_suffix(".mcap"));
    name == RECORDING || number.is_some_and(|number| number.parse::<usize>().is_ok())
}

pub(crate) fn is_result(name: &str) -> bool {
    [POINTS, BUDGET, REPORT, PAGE, EXECUTED].contains(&name)
        || name.starts_with("map.")
        || name.starts_with("turbine_map.")
}

/// Creates `<parent>/<campaign>-<time>`, with suffix `-2`, `-3`, ... if it already exists.
pub fn create(parent: &Path, campaign: &str, time: &str) -> Result<PathBuf, SessionError> {
    std::fs::create_dir_all(parent).map_err(|error| match error.kind() {
        // A file, or a link to a place that does not exist.
        ErrorKind::AlreadyExists => {
            let why =
                "the directory for runs is a file or a broken link; remove it, or choose another directory";
            SessionError::file("create", parent)(std::io::Error::new(ErrorKind::NotADirectory, why))
        }
        _ => SessionError::file("create", parent)(error),
    })?;
    for attempt in 1..=999 {
        let suffix = if attempt == 1 { String::new() } else { format!("-{attempt}") };
        let path = parent.join(format!("{campaign}-{time}{suffix}"));
        match std::fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(SessionError::file("create", &path)(error)),
        }
    }
    Err(SessionError::TooManyRuns(parent.to_owned()))
}

/// Stores a file named by the campaign under the same relative path in the run directory. A file outside the campaign's directory is not copied.
pub(crate) fn keep_copy(directory: &Path, named: &str, text: &str) -> Result<(), SessionError> {
    let named = Path::new(named);
    if !named.components().all(|part| matches!(part, Component::Normal(_))) {
        return Ok(());
    }
    let path = directory.join(named);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(SessionError::file("create", folder))?;
    }
    write_new(&path, text.as_bytes())
}

/// Start time for people, from the name of the run directory; `None` for any other name.
pub(crate) fn started(directory: &Path) -> Option<String> {
    directory.file_name()?.to_str()?.rsplit('-').find_map(instant)
}

/// `20261124T110618Z` as `2026-11-24 11:06:18 UTC`.
fn instant(stamp: &str) -> Option<String> {
    let (day, time) = stamp.strip_suffix('Z')?.split_once('T')?;
    let is_number =
        |text: &str, digits: usize| text.len() == digits && text.bytes().all(|b| b.is_ascii_digit());
    (is_number(day, 8) && is_number(time, 6)).then(|| {
        let (date, clock) = ([&day[..4], &day[4..6], &day[6..]], [&time[..2], &time[2..4], &time[4..]]);
        format!("{} {} UTC", date.join("-"), clock.join(":"))
    })
}

/// The recording of a run directory, or the file itself.
pub fn recording_of(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(RECORDING) } else { path.to_owned() }
}

/// The error of a directory without a recording; it names a run in the directory, if any.
pub(crate) fn no_recording_in(directory: &Path) -> std::io::Error {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let runs = entries.map(|entry| entry.path()).filter(|path| path.join(RECORDING).exists());
    let why = match runs.max() {
        Some(run) => {
            format!("it contains runs, but no recording; give one of the runs, e.g. {}", run.display())
        }
        None => format!("it has no {RECORDING}; give the directory of a run, or a file"),
    };
    std::io::Error::new(ErrorKind::NotFound, why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_directory_of_runs_names_the_last_run() {
        let parent = tempfile::tempdir().unwrap();
        assert!(!no_recording_in(parent.path()).to_string().contains("e.g."));
        for day in [24, 25] {
            let run = create(parent.path(), "a", &format!("202611{day}T110618Z")).unwrap();
            std::fs::write(run.join(RECORDING), "").unwrap();
        }
        assert!(no_recording_in(parent.path()).to_string().contains("a-20261125T110618Z"));
    }

    #[test]
    fn the_start_time_of_a_run_is_read_from_the_name_of_its_directory() {
        let parent = tempfile::tempdir().unwrap();
        for _ in 0..2 {
            let made = create(parent.path(), "a-b", "20261124T110618Z").unwrap();
            assert_eq!(started(&made).as_deref(), Some("2026-11-24 11:06:18 UTC"), "{}", made.display());
        }
        for other in ["runs/a", "a-2026T1Z", "a-20261124T11061éZ", "/"] {
            assert_eq!(started(Path::new(other)), None, "{other}");
        }
    }
}
