//! Why something cannot be done in a fleet directory.

use crate::Hash;
use std::path::{Path, PathBuf};

/// Why something cannot be done in a fleet directory.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// The study's file cannot be read, or has mistakes.
    #[error(transparent)]
    StudyFile(#[from] crate::StudyFileError),
    /// A file or directory cannot be read or written.
    #[error("failed to {action} {}: {source}", .path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file does not hold what it should.
    #[error("{} is not {what}: {source}", .path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What it should be.
        what: &'static str,
        /// Why it is not.
        source: serde_json::Error,
    },
    /// There is no study in the directory.
    #[error("there is no study in {}; make one with `mapper fleet make STUDY.yaml --out DIR`", .directory.display())]
    NoStudy {
        /// The directory.
        directory: PathBuf,
    },
    /// The layout of the directory is that of another program.
    #[error("{} has layout {found}; this program reads {known}", .path.display())]
    Layout {
        /// The study's file.
        path: PathBuf,
        /// What was found.
        found: u32,
        /// What is read.
        known: u32,
    },
    /// The directory holds another study.
    #[error("{} holds the study `{found}` ({kind}) already; choose another directory", .directory.display())]
    OtherStudy {
        /// The directory.
        directory: PathBuf,
        /// Name of the study that is there.
        found: String,
        /// Its kind.
        kind: String,
    },
    /// Study and program are of different versions.
    #[error(
        "{} was made by {made_by}; this is {program}. Results of two versions are never mixed; use the first, or make the \
         study again in a new directory", .directory.display()
    )]
    OtherProgram {
        /// The directory.
        directory: PathBuf,
        /// Who made it.
        made_by: String,
        /// Who reads it.
        program: String,
    },
    /// A kind of study that does not exist.
    #[error("`{kind}` is not a kind of study; the kinds are {known}")]
    UnknownKind {
        /// What was written.
        kind: String,
        /// What there is.
        known: String,
    },
    /// A study has no items, or too many.
    #[error("the study asks for {items} items; 1 to {most} are allowed")]
    Items {
        /// How many.
        items: usize,
        /// How many are allowed.
        most: usize,
    },
    /// Two items of a study are the same.
    #[error("the items {first} and {second} are the same work; name each once")]
    Twice {
        /// One.
        first: String,
        /// The other.
        second: String,
    },
    /// An item's file is not what it was.
    #[error("{} has been changed: its hash is not its name; make the study again with `mapper fleet make`", .path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// An item that the study does not have.
    #[error("the study has no item {hash}; `mapper fleet status DIR --items` lists them")]
    NoItem {
        /// The item asked for.
        hash: Hash,
    },
    /// Nothing is known of what an item costs.
    #[error("nothing was tried yet: every item that was tried failed, the first with: {why}")]
    NothingTried {
        /// Why.
        why: String,
    },
    /// The study does not fit.
    #[error("not submitted: {why}")]
    DoesNotFit {
        /// What does not fit, with numbers and what to do.
        why: String,
    },
    /// Nothing is left to do.
    #[error("all {items} items are done; merge with `mapper fleet merge {}`", .directory.display())]
    NothingLeft {
        /// Number of items.
        items: usize,
        /// The directory.
        directory: PathBuf,
    },
    /// A retry without a submission before it.
    #[error("{} was not submitted yet; submit it with `mapper fleet submit`", .directory.display())]
    NotSubmitted {
        /// The directory.
        directory: PathBuf,
    },
    /// The queue did not take it.
    #[error("the queue did not take {}: {said}; its template is {template}", .script.display())]
    Queue {
        /// What was run.
        script: PathBuf,
        /// What it said.
        said: String,
        /// The template.
        template: String,
    },
    /// What merges or makes a study failed, in the words of its kind.
    #[error(transparent)]
    Kind(Box<dyn std::error::Error + Send + Sync>),
    /// Stopped by the operator.
    #[error("stopped by the operator; what is done is kept, and the same command goes on from there")]
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
