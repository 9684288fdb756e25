//! A study in its directory: the interface of its kind, and how both are made.

use crate::files::{Durability, make_directory, write_whole};
use crate::study::{LAYOUT, MAX_ITEMS, Part, PartRefusal};
use crate::{FleetError, Hash, Item, ItemEntry, Study, StudyFile};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A study in its directory.
#[derive(Debug, Clone, PartialEq)]
pub struct Fleet {
    directory: PathBuf,
    /// The description of the study.
    pub study: Study,
}

impl Fleet {
    /// Opens a study that was made by `program`.
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
    /// The directory.
    pub directory: PathBuf,
}

impl Output {
    /// Writes a file of the result.
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
    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError>;

    /// Processes one item and returns JSON. Equal payloads give equal results on any computer.
    fn work(&self, payload: &Value, at: WorkContext<'_>) -> Result<String, WorkError>;

    /// Merges the parts, one by one in the order of the study, without missing and failed ones. Returns a one-line description.
    fn merge(&self, settings: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError>;
}

/// The kind of this name; if it is unknown, a mistake at its place in the file.
pub fn kind_of<'a>(study: &StudyFile, kinds: &[&'a dyn Kind]) -> Result<&'a dyn Kind, FleetError> {
    if let Some(kind) = kinds.iter().find(|kind| kind.name() == study.kind) {
        return Ok(*kind);
    }
    let known = kinds.iter().map(|kind| format!("{} ({})", kind.name(), kind.summary()));
    let remedy = format!("write `study: KIND`; the kinds are {}", known.collect::<Vec<_>>().join(", "));
    let message = match study.kind.as_str() {
        "" => "the kind of study is missing".to_owned(),
        other => format!("`{other}` is not a kind of study"),
    };
    Err(study.mistake("study", message, &remedy).into())
}

/// The outcome.
#[derive(Debug)]
pub struct CreatedStudy {
    /// The study in its directory.
    pub fleet: Fleet,
    /// New items.
    pub new: usize,
    /// Items that were removed; their parts stay in the directory and are ignored.
    pub gone: usize,
}

impl CreatedStudy {
    /// Makes the directory of a study, or adds and removes items of an earlier state. Equal studies give equal bytes.
    pub fn create(
        study: &StudyFile,
        kind: &dyn Kind,
        directory: &Path,
        program: &str,
        writer: &str,
    ) -> Result<CreatedStudy, FleetError> {
        let earlier = existing_items(study, directory, program)?;
        let StudyDraft { items, settings } = kind.items(study)?;
        if !(1..=MAX_ITEMS).contains(&items.len()) {
            return Err(FleetError::Items { items: items.len(), most: MAX_ITEMS });
        }
        for folder in [ITEMS, PARTS, BEGUN, LOGS] {
            make_directory(directory.join(folder))?;
        }
        let mut listed = Vec::with_capacity(items.len());
        let mut new = 0;
        for draft in items {
            let item = Item {
                name: draft.name,
                kind: kind.name().to_owned(),
                program: program.to_owned(),
                payload: draft.payload,
            };
            let folder = directory.join(ITEMS);
            let bytes = item.bytes().map_err(FleetError::content(&folder, "an item"))?;
            let hash = Hash::of(&bytes);
            if !earlier.contains(&hash) {
                write_whole(&folder.join(format!("{hash}.json")), &[&bytes], writer, Durability::Unsynced)?;
                new += 1;
            }
            listed.push(ItemEntry { hash, name: item.name });
        }
        let study = Study {
            layout: LAYOUT,
            name: study.name.clone(),
            kind: kind.name().to_owned(),
            program: program.to_owned(),
            settings,
            items: listed,
        };
        study.check()?;
        // Written last, so that the listed items exist.
        study.write(&directory.join(STUDY), writer)?;
        let kept = study.items.iter().filter(|item| earlier.contains(&item.hash)).count();
        Ok(CreatedStudy {
            fleet: Fleet { directory: directory.to_owned(), study },
            new,
            gone: earlier.len() - kept,
        })
    }
}

fn existing_items(study: &StudyFile, directory: &Path, program: &str) -> Result<BTreeSet<Hash>, FleetError> {
    match Fleet::open(directory, program) {
        Ok(Fleet { study: found, .. }) if found.name == study.name && found.kind == study.kind => {
            Ok(found.items.into_iter().map(|item| item.hash).collect())
        }
        Ok(Fleet { study: found, .. }) => Err(FleetError::OtherStudy {
            directory: directory.to_owned(),
            found: found.name,
            kind: found.kind,
        }),
        Err(FleetError::NoStudy(_)) => Ok(BTreeSet::new()),
        Err(error) => Err(error),
    }
}
