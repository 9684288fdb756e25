//! Errors of a fleet directory.

use crate::Hash;
use std::path::{Path, PathBuf};

/// Errors of a fleet directory.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// The study's file cannot be read, or has mistakes.
    #[error(transparent)]
    StudyFile(#[from] crate::StudyFileError),
    /// A file or directory cannot be read or written.
    #[error("failed to {action} {}: {source}", .path.display())]
    File {
        /// The attempted operation.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A file has the wrong content.
    #[error("{} is not {what}: {source}", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The expected content.
        what: &'static str,
        /// The cause.
        source: serde_json::Error,
    },
    /// The directory has no study.
    #[error("there is no study in {}; make one", .0.display())]
    NoStudy(PathBuf),
    /// The directory has the layout of another program.
    #[error("{} has layout {found}; this program reads {known}", .path.display())]
    Layout {
        /// The study's file.
        path: PathBuf,
        /// The layout found.
        found: u32,
        /// The supported layout.
        known: u32,
    },
    /// The directory holds another study.
    #[error("{} already contains the study `{found}` ({kind}); choose another directory", .directory.display())]
    OtherStudy {
        /// The directory.
        directory: PathBuf,
        /// Name of the study found.
        found: String,
        /// Its kind.
        kind: String,
    },
    /// Study and program are of different versions.
    #[error(
        "{} was made by {made_by}, but this is {program}, and results of two versions are never mixed; use {made_by}, or make a new study in \
         another directory", .directory.display()
    )]
    OtherProgram {
        /// The directory.
        directory: PathBuf,
        /// The program that made it.
        made_by: String,
        /// The program that reads it.
        program: String,
    },
    /// An unknown kind of study.
    #[error("`{kind}` is not a kind of study; the kinds are {known}")]
    UnknownKind {
        /// The kind written.
        kind: String,
        /// The known kinds.
        known: String,
    },
    /// A study has no items, or too many.
    #[error("the study has {items} items; 1 to {most} are allowed")]
    Items {
        /// Number of items.
        items: usize,
        /// Maximum number of items.
        most: usize,
    },
    /// Two items of a study are the same.
    #[error("the items {first} and {second} are identical; list each once")]
    DuplicateItem {
        /// One.
        first: String,
        /// The other.
        second: String,
    },
    /// An item's file was changed.
    #[error("{} has been changed: its hash differs from its name; make the study again", .0.display())]
    Changed(PathBuf),
    /// An item that the study does not have.
    #[error("the study has no item {0}; choose one from its list of items")]
    NoItem(Hash),
    /// The cost of an item is unknown.
    #[error("the cost is unknown, because every item so far has failed; the first failed with: {0}")]
    UnknownCost(String),
    /// The study does not fit: what, with numbers and the remedy.
    #[error("not submitted: {0}")]
    DoesNotFit(String),
    /// No item is left to do.
    #[error("all {items} items are done; merge the study {}", .directory.display())]
    NothingLeft {
        /// Number of items.
        items: usize,
        /// The directory.
        directory: PathBuf,
    },
    /// A retry without an earlier submission.
    #[error("{} has not been submitted yet; submit it", .0.display())]
    NotSubmitted(PathBuf),
    /// Tasks of an earlier submission are still in the queue.
    #[error(
        "{} is already in the queue: job {job} has {tasks} waiting or running tasks; wait until they end, or cancel the job, and then retry",
        .directory.display()
    )]
    StillQueued {
        /// The directory.
        directory: PathBuf,
        /// The job.
        job: String,
        /// Its tasks.
        tasks: usize,
    },
    /// The queue rejected the submission.
    #[error("the queue rejected {}: {answer}; check the template {template}", .script.display())]
    Queue {
        /// The command.
        script: PathBuf,
        /// Its output.
        answer: String,
        /// The template.
        template: String,
    },
    /// Making or merging a study failed, in the words of its kind.
    #[error(transparent)]
    Kind(Box<dyn std::error::Error + Send + Sync>),
    /// Stopped by the operator.
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
