//! The report of a night, stored next to the history so that its picture can link to it.

use crate::{Existing, SessionError, write_file};
use mapper_history::{Comparison, ListedRun, Metric, Night, StoredNight};
use mapper_report::{Document, listed_runs, night_comparison};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Report path of the night that began at this time (ms since 1970-01-01 00:00 UTC), e.g. `runs/history.nights/1763942400000.txt`.
pub fn night_report_path(history: &Path, started_ms: i64) -> PathBuf {
    history.with_extension("nights").join(format!("{started_ms}.txt"))
}

/// Writes the report of the night, with a row for each run.
///
/// # Errors
/// [`SessionError::File`] if it cannot be written.
pub fn write_night_report(
    history: &Path,
    night: &Night,
    comparison: &Comparison,
) -> Result<(), SessionError> {
    let path = night_report_path(history, night.started_ms);
    let folder = path.parent().unwrap_or(history);
    std::fs::create_dir_all(folder).map_err(SessionError::file("create", folder))?;
    let text = format!(
        "{}, {}\n\n{}\n{}",
        night.name,
        night.program,
        night_comparison(night, comparison, history),
        night_runs(night, !comparison.is_quiet())
    );
    write_file(&path, text.as_bytes(), Existing::Replaced)
}

/// A row for each run of a night that may not be in a history.
pub fn night_runs(night: &Night, moved: bool) -> Document {
    let stored = StoredNight {
        id: 0,
        name: night.name.clone(),
        started_ms: night.started_ms,
        duration_s: night.duration_s,
        program: night.program.clone(),
        accepted: night.accepted,
        moved,
    };
    let runs: Vec<ListedRun> =
        night.runs.iter().map(|run| ListedRun { night: stored.clone(), run: run.clone() }).collect();
    listed_runs(&runs, &Metric::ALL)
}

/// Link from a picture to the report of a night, relative if possible and absolute otherwise. `None` without a report.
pub fn night_report_link(picture: &Path, history: &Path, started_ms: i64) -> Option<String> {
    let report = std::fs::canonicalize(night_report_path(history, started_ms)).ok()?;
    let folder = picture.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = std::fs::canonicalize(folder).ok()?;
    match report.strip_prefix(folder) {
        Ok(relative) => Some(escaped(relative)),
        Err(_) => Some(format!("file://{}", escaped(&report))),
    }
}

/// A path with URL escapes.
fn escaped(path: &Path) -> String {
    let mut text = String::new();
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => {
                text.push(char::from(byte));
            }
            // Writing to a string cannot fail.
            _ => drop(write!(text, "%{byte:02X}")),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_links_to_the_report_next_to_it_or_anywhere_on_the_disk() {
        let scratch = tempfile::tempdir().unwrap();
        let runs = scratch.path().join("my runs");
        let history = runs.join("history.db");
        std::fs::create_dir_all(runs.join("history.nights")).unwrap();
        std::fs::write(night_report_path(&history, 5), "").unwrap();
        let link = |picture: PathBuf| night_report_link(&picture, &history, 5).unwrap();
        assert_eq!(link(runs.join("a.svg")), "history.nights/5.txt");
        assert_eq!(link(scratch.path().join("a.svg")), "my%20runs/history.nights/5.txt");
        std::fs::create_dir(scratch.path().join("other")).unwrap();
        let far = link(scratch.path().join("other/a.svg"));
        assert!(far.starts_with("file:///") && far.ends_with("my%20runs/history.nights/5.txt"), "{far}");
        assert_eq!(night_report_link(&runs.join("a.svg"), &history, 6), None);
    }
}
