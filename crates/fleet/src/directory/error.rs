//! Errors of a fleet directory.

use crate::Hash;
use std::path::{Path, PathBuf};

/// Errors of a fleet directory.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FleetError {
    #[error(transparent)]
    StudyFile(#[from] crate::StudyFileError),
    #[error("failed to {action} {}: {source}", .path.display())]
    File { action: &'static str, path: PathBuf, source: std::io::Error },
    #[error("{} is not {what}: {source}", .path.display())]
    Content { path: PathBuf, what: &'static str, source: serde_json::Error },
    #[error("there is no study in {}; make one", .0.display())]
    NoStudy(PathBuf),
    #[error("{} has layout {found}; this program reads {known}", .path.display())]
    Layout { path: PathBuf, found: u32, known: u32 },
    #[error("{} already contains the study `{found}` ({kind}); choose another directory", .directory.display())]
    OtherStudy { directory: PathBuf, found: String, kind: String },
    #[error(
        "{} was made by {made_by}, but this is {program}, and results of two versions are never mixed; use {made_by}, or make a new study in \
         another directory", .directory.display()
    )]
    OtherProgram { directory: PathBuf, made_by: String, program: String },
    #[error("`{kind}` is not a kind of study; the kinds are {known}")]
    UnknownKind { kind: String, known: String },
    #[error("the study has {items} items; 1 to {most} are allowed")]
    Items { items: usize, most: usize },
    #[error("the items {first} and {second} are identical; list each once")]
    DuplicateItem { first: String, second: String },
    #[error("{} has been changed: its hash differs from its name; make the study again", .0.display())]
    Changed(PathBuf),
    #[error("the study has no item {0}; choose one from its list of items")]
    NoItem(Hash),
    #[error("the cost is unknown, because every item so far has failed; the first failed with: {0}")]
    UnknownCost(String),
    /// What does not fit, with numbers and the remedy.
    #[error("not submitted: {0}")]
    DoesNotFit(String),
    #[error("all {items} items are done; merge the study {}", .directory.display())]
    NothingLeft { items: usize, directory: PathBuf },
    #[error("{} has not been submitted yet; submit it", .0.display())]
    NotSubmitted(PathBuf),
    #[error(
        "{} is already in the queue: job {job} has {tasks} waiting or running tasks; wait until they end, or cancel the job, and then retry",
        .directory.display()
    )]
    StillQueued { directory: PathBuf, job: String, tasks: usize },
    /// `answer`: its output.
    #[error("the queue rejected {}: {answer}; check the template {template}", .script.display())]
    Queue { script: PathBuf, answer: String, template: String },
    /// Making or merging a study failed, in the words of its kind.
    #[error(transparent)]
    Kind(Box<dyn std::error::Error + Send + Sync>),
    #[error(
        "stopped by the operator; finished items are kept, and the same command continues with the others"
    )]
    Interrupted,
}

impl FleetError {
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| FleetError::File { action, path, source }
    }

    pub(crate) fn content(path: &Path, what: &'static str) -> impl FnOnce(serde_json::Error) -> Self {
        let path = path.to_owned();
        move |source| FleetError::Content { path, what, source }
    }

    /// The error of a kind.
    pub fn kind(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        FleetError::Kind(error.into())
    }
}
