//! Where a run's files go: one new directory each, never an old one.

use crate::SessionError;
use crate::files::write_new;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

/// The file names within a run directory.
pub const RECORDING: &str = "recording.mcap";
/// The plan that was run.
pub const PLAN: &str = "plan.json";
/// The steps that a sequence script has made of the run.
pub const EXECUTED: &str = "executed_plan.json";
/// The campaign as it was read.
pub const CAMPAIGN: &str = "campaign.yaml";
/// The sequence script, where there is one.
pub const SEQUENCE: &str = "sequence.rhai";
/// Identified points.
pub const POINTS: &str = "points.json";
/// What of the run is safely recorded.
pub const JOURNAL: &str = "journal.jsonl";
/// The test report.
pub const REPORT: &str = "report.md";

/// The same and more as a page for a browser.
pub const PAGE: &str = "report.html";

/// Whether a file of this name is made from what was recorded: points, map, report, page, and the steps of a script.
pub(crate) fn is_result(name: &str) -> bool {
    [POINTS, REPORT, PAGE, EXECUTED].contains(&name) || name.starts_with("map.")
}

/// Creates `<parent>/<campaign>-<time>`, with `-2`, `-3`, ... behind it where that exists already.
///
/// # Errors
/// [`SessionError::File`] where a directory cannot be made, [`SessionError::TooManyRuns`] after 999 of the same name.
pub fn create(parent: &Path, campaign: &str, time: &str) -> Result<PathBuf, SessionError> {
    std::fs::create_dir_all(parent).map_err(SessionError::file("create", parent))?;
    for attempt in 1..=999 {
        let suffix = if attempt == 1 { String::new() } else { format!("-{attempt}") };
        let path = parent.join(format!("{campaign}-{time}{suffix}"));
        match std::fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(SessionError::file("create", &path)(error)),
        }
    }
    Err(SessionError::TooManyRuns { parent: parent.to_owned() })
}

/// Keeps a file that the campaign names where the campaign of the run directory names it. One outside the campaign's own
/// directory is found where it is, or given with `--campaign` later.
pub(crate) fn keep_beside(directory: &Path, named: &str, text: &str) -> Result<(), SessionError> {
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

/// When the run in this directory was started, as people read it, by the directory's name; `None` for any other name.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_was_made_knows_when_from_its_directory() {
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
