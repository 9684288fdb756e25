//! What a night said, as a file beside the history, so that its picture can lead there.

use crate::{Existing, SessionError, write_file};
use mapper_history::{Comparison, ListedRun, Metric, Night, StoredNight};
use mapper_report::{night_text, runs_text};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The report of the night that began then (ms since 1970-01-01 00:00 UTC), e.g. `runs/history.nights/1763942400000.txt`.
pub fn night_report_path(history: &Path, started_ms: i64) -> PathBuf {
    history.with_extension("nights").join(format!("{started_ms}.txt"))
}

/// Writes what the night said, and a row for each of its runs.
///
/// # Errors
/// [`SessionError::File`] where there is no room for it.
pub fn keep_night_report(history: &Path, night: &Night, comparison: &Comparison) -> Result<(), SessionError> {
    let path = night_report_path(history, night.started_ms);
    let folder = path.parent().unwrap_or(history);
    std::fs::create_dir_all(folder).map_err(SessionError::file("create", folder))?;
    let stored = StoredNight {
        id: 0,
        name: night.name.clone(),
        started_ms: night.started_ms,
        duration_s: night.duration_s,
        program: night.program.clone(),
        accepted: night.accepted,
        moved: !comparison.is_quiet(),
    };
    let runs: Vec<ListedRun> =
        night.runs.iter().map(|run| ListedRun { night: stored.clone(), run: run.clone() }).collect();
    let text = format!(
        "{}, {}\n\n{}\n{}",
        night.name,
        night.program,
        night_text(night, comparison, history),
        runs_text(&runs, &Metric::ALL)
    );
    write_file(&path, text.as_bytes(), Existing::Replaced)
}

/// How a picture leads to the report of a night: from beside it, or from the root of the disk. `None` where there is no report.
pub fn night_report_link(picture: &Path, history: &Path, started_ms: i64) -> Option<String> {
    let report = std::fs::canonicalize(night_report_path(history, started_ms)).ok()?;
    let folder = picture.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = std::fs::canonicalize(folder).ok()?;
    match report.strip_prefix(folder) {
        Ok(beside) => Some(escaped(beside)),
        Err(_) => Some(format!("file://{}", escaped(&report))),
    }
}

/// A path as addresses have it.
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
    fn a_picture_leads_to_the_report_beside_it_or_anywhere_on_the_disk() {
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
