//! The directory of a study and its layout.

use crate::directory::part::{Part, PartRefusal};
use crate::{FleetError, Hash, ItemEntry, Kind, Study};
use std::path::{Path, PathBuf};

/// A study in its directory.
#[derive(Debug, Clone, PartialEq)]
pub struct Fleet {
    directory: PathBuf,
    /// The description of the study.
    pub study: Study,
}

impl Fleet {
    pub(crate) fn new(directory: PathBuf, study: Study) -> Self {
        Fleet { directory, study }
    }

    /// Opens a study that was made by `program`.
    ///
    /// # Errors
    /// [`FleetError::NoStudy`], [`FleetError::OtherProgram`] if another version made it, [`FleetError::Content`].
    pub fn open(directory: &Path, program: &str) -> Result<Fleet, FleetError> {
        let path = directory.join(STUDY);
        if !path.exists() {
            return Err(FleetError::NoStudy(directory.to_owned()));
        }
        let study = Study::read(&path)?;
        if study.program != program {
            return Err(FleetError::OtherProgram {
                directory: directory.to_owned(),
                made_by: study.program,
                program: program.to_owned(),
            });
        }
        Ok(Fleet { directory: directory.to_owned(), study })
    }

    /// Its directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The kind of the study, from the known kinds.
    ///
    /// # Errors
    /// [`FleetError::UnknownKind`].
    pub fn kind<'a>(&self, kinds: &[&'a dyn Kind]) -> Result<&'a dyn Kind, FleetError> {
        kinds.iter().find(|kind| kind.name() == self.study.kind).copied().ok_or_else(|| {
            let known: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
            FleetError::UnknownKind { kind: self.study.kind.clone(), known: known.join(", ") }
        })
    }

    /// Directory of the result.
    pub fn result(&self) -> PathBuf {
        self.directory.join("result")
    }

    pub(crate) fn item(&self, hash: &Hash) -> PathBuf {
        self.directory.join(ITEMS).join(format!("{hash}.json"))
    }

    pub(crate) fn parts(&self) -> PathBuf {
        self.directory.join(PARTS)
    }

    pub(crate) fn part(&self, hash: &Hash) -> PathBuf {
        self.parts().join(part_name(hash))
    }

    /// File that marks the item as in progress; contains the name of the worker.
    pub(crate) fn progress_marker(&self, hash: &Hash) -> PathBuf {
        self.directory.join(BEGUN).join(hash.to_string())
    }

    /// State of an item's part, damage of its body included; `None` without a part.
    pub(crate) fn read_part_header(&self, item: &ItemEntry) -> Option<Result<Part, PartRefusal>> {
        Some(self.read_part(item)?.map(|(part, _)| part))
    }

    /// An item's part with its body; `None` without a part.
    pub(crate) fn read_part(&self, item: &ItemEntry) -> Option<Result<(Part, String), PartRefusal>> {
        Part::read(&self.part(&item.hash), &item.hash, &self.study.program)
    }
}

pub(crate) const STUDY: &str = "study.json";
pub(crate) const ITEMS: &str = "items";
pub(crate) const PARTS: &str = "parts";
pub(crate) const BEGUN: &str = "begun";
pub(crate) const LOGS: &str = "log";

pub(crate) fn part_name(hash: &Hash) -> String {
    format!("{hash}.part")
}
