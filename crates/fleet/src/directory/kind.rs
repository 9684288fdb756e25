//! Kinds of study: the split of a study into items, the work on an item, and the merge of its parts.

use crate::{FleetError, StudyFile};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// An item before it is written.
#[derive(Debug, Clone, PartialEq)]
pub struct ItemDraft {
    /// Display name, unique within the study.
    pub name: String,
    /// Input of the work.
    pub payload: Value,
}

/// The items of a study, and the input of merging.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyDraft {
    /// In the order of the result.
    pub items: Vec<ItemDraft>,
    /// Input of merging in addition to the parts.
    pub settings: Value,
}

/// Environment of an item's work.
#[derive(Clone, Copy)]
pub struct WorkContext<'a> {
    /// A temporary directory of its own.
    pub scratch: &'a Path,
    /// Set by the caller to stop.
    pub stop: &'a AtomicBool,
}

/// Why an item has no result.
#[derive(Debug, Clone, PartialEq)]
pub enum WorkError {
    /// Stopped by the operator; the item counts as not started.
    Interrupted,
    /// It failed; the cause, in a sentence.
    Failed(String),
}

impl<E: std::error::Error> From<E> for WorkError {
    fn from(error: E) -> Self {
        WorkError::Failed(error.to_string())
    }
}

/// Writes a result: named files in a directory that appears only when complete.
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

/// Name and result of each item in the order of the study; `Err`: the reason why an item has none.
pub type Results<'a> = dyn Iterator<Item = (String, Result<String, String>)> + 'a;

/// A kind of study.
pub trait Kind: Sync {
    /// Its name in `study:`.
    fn name(&self) -> &'static str;

    /// A one-line description.
    fn summary(&self) -> &'static str;

    /// The items of a study.
    ///
    /// # Errors
    /// [`FleetError::Kind`] with all mistakes of the study.
    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError>;

    /// Processes one item and returns JSON. Equal payloads give equal results on any computer.
    ///
    /// # Errors
    /// [`WorkError`].
    fn work(&self, payload: &Value, at: WorkContext<'_>) -> Result<String, WorkError>;

    /// Merges the parts, which come one by one in the order of the study, into the result. Returns a one-line description. Missing
    /// and failed parts are omitted.
    ///
    /// # Errors
    /// [`FleetError`] if a file cannot be written, or a part's result was not made by [`Kind::work`].
    fn merge(&self, settings: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError>;
}
