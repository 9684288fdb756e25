//! What a study is about: how it becomes items, how one is done, how parts become a result.

use crate::{FleetError, StudyFile};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// An item before it is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Draft {
    /// Name for people, unique within the study.
    pub name: String,
    /// What the kind needs to do it.
    pub payload: Value,
}

/// The items of a study, and what merging needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Drafts {
    /// In the order of the result.
    pub items: Vec<Draft>,
    /// What merging needs beside the parts.
    pub settings: Value,
}

/// What an item is done with.
#[derive(Clone, Copy)]
pub struct At<'a> {
    /// A directory of its own that is gone afterwards.
    pub scratch: &'a Path,
    /// Set from outside to stop.
    pub stop: &'a AtomicBool,
}

/// Why an item has no result.
#[derive(Debug, Clone, PartialEq)]
pub enum WorkError {
    /// Stopped by the operator: it is as if it had not begun.
    Interrupted,
    /// It failed; why, in a sentence.
    Failed(String),
}

impl<E: std::error::Error> From<E> for WorkError {
    fn from(error: E) -> Self {
        WorkError::Failed(error.to_string())
    }
}

/// Where a result goes: files by their name, in a directory that is made whole.
#[derive(Debug)]
pub struct Output {
    directory: PathBuf,
}

impl Output {
    pub(crate) fn new(directory: PathBuf) -> Self {
        Output { directory }
    }

    /// The directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Writes a file of the result.
    ///
    /// # Errors
    /// [`FleetError::File`].
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FleetError> {
        let path = self.directory.join(name);
        std::fs::write(&path, bytes).map_err(FleetError::file("write", &path))
    }
}

/// Name and result of each item in the order of the study; `Err`: why there is none.
pub type Results<'a> = dyn Iterator<Item = (String, Result<String, String>)> + 'a;

/// A kind of study.
pub trait Kind: Sync {
    /// As `study:` names it.
    fn name(&self) -> &'static str;

    /// What it is, in a line.
    fn summary(&self) -> &'static str;

    /// The items of a study.
    ///
    /// # Errors
    /// [`FleetError::Kind`] with all that is wrong with the study.
    fn items(&self, study: &StudyFile) -> Result<Drafts, FleetError>;

    /// Does one item; what it returns is JSON. Equal payloads give equal results on any machine.
    ///
    /// # Errors
    /// [`WorkError`].
    fn work(&self, payload: &Value, at: At<'_>) -> Result<String, WorkError>;

    /// Makes the result from the parts, which come one by one in the order of the study. Says what it is, in a line. What is
    /// missing or failed is left out.
    ///
    /// # Errors
    /// [`FleetError`] where a file cannot be written or a part's result is not what [`Kind::work`] makes.
    fn merge(&self, settings: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError>;
}
