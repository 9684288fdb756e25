//! A study: the file of its user, its list of items, and one item.

use crate::files::{Durability, StudyFileError, read_at_most, write_whole};
use crate::{FleetError, Hash};
use mapper_yaml::{Document, FindingKind, Findings, Notes, Schema, Source, Tree, steps};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Version of the directory's layout.
pub(crate) const LAYOUT: u32 = 1;
/// Maximum number of items of a study.
pub(crate) const MAX_ITEMS: usize = 1_000_000;
/// Largest file of a study, bytes: a million items.
const MAX_STUDY_BYTES: usize = 256 << 20;

/// One item in the list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ItemEntry {
    /// Its file's name.
    pub hash: Hash,
    /// Its display name.
    pub name: String,
}

/// A study: its kind, the program that made it, the input of merging, its items in the order of the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Layout of the directory.
    pub layout: u32,
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: String,
    /// Program, version and commit.
    pub program: String,
    /// Input of merging.
    pub settings: Value,
    /// The items.
    pub items: Vec<ItemEntry>,
}

impl Study {
    pub(crate) fn read(path: &Path) -> Result<Study, FleetError> {
        let bytes = read_at_most(path, MAX_STUDY_BYTES)?;
        // Checked first: another layout may have other keys.
        #[derive(Deserialize)]
        struct Head {
            layout: u32,
        }
        let head: Head = serde_json::from_slice(&bytes).map_err(FleetError::content(path, "a study"))?;
        if head.layout != LAYOUT {
            return Err(FleetError::Layout { path: path.to_owned(), found: head.layout, known: LAYOUT });
        }
        let study: Study = serde_json::from_slice(&bytes).map_err(FleetError::content(path, "a study"))?;
        study.check()?;
        Ok(study)
    }

    pub(crate) fn write(&self, path: &Path, writer: &str) -> Result<(), FleetError> {
        let bytes = serde_json::to_vec(self).map_err(FleetError::content(path, "a study"))?;
        write_whole(path, &[&bytes, b"\n"], writer, Durability::Synced)
    }

    pub(crate) fn check(&self) -> Result<(), FleetError> {
        if !(1..=MAX_ITEMS).contains(&self.items.len()) {
            return Err(FleetError::Items { items: self.items.len(), most: MAX_ITEMS });
        }
        let mut names: BTreeMap<Hash, &str> = BTreeMap::new();
        for item in &self.items {
            if let Some(first) = names.insert(item.hash, &item.name) {
                return Err(FleetError::DuplicateItem { first: first.to_owned(), second: item.name.clone() });
            }
        }
        Ok(())
    }
}

/// Name of the file in messages.
static DOCUMENT: Document = Document { name: "study", example: "campaigns/fleet/blind.yaml" };
/// Largest file of a study, bytes: some ten thousand names of campaigns.
const MAX_STUDY_FILE_BYTES: usize = 4 << 20;

/// A study file, of which only the name and the kind are read.
#[derive(Debug)]
pub struct StudyFile {
    path: PathBuf,
    tree: Tree,
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: String,
}

impl StudyFile {
    /// A file that it names, relative to its own directory.
    pub fn sibling_path(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// The complete file, read by the kind; name and kind included.
    pub fn read<T: DeserializeOwned + JsonSchema>(&self) -> Result<T, StudyFileError> {
        let mut notes = Notes::default();
        Schema::of::<T>().check(&self.tree, &mut notes);
        if notes.is_empty() {
            match self.tree.deserialise() {
                Ok(file) => return Ok(file),
                Err(finding) => notes.push(finding),
            }
        }
        Err(self.mistakes(notes))
    }

    /// A mistake found by the kind, at a key of the file.
    pub fn mistake(&self, key: &str, message: String, remedy: &str) -> StudyFileError {
        let mut notes = Notes::default();
        notes.push(self.tree.finding(FindingKind::WrongValue, &steps![key], message, remedy));
        self.mistakes(notes)
    }

    fn mistakes(&self, notes: Notes) -> StudyFileError {
        StudyFileError::Mistakes(Box::new(Findings::new(self.tree.source().clone(), notes)))
    }
}

/// Reads name and kind of a study.
pub fn open_study(path: &Path) -> Result<StudyFile, StudyFileError> {
    let mistakes = |findings| StudyFileError::Mistakes(Box::new(findings));
    let text = mapper_yaml::open(&DOCUMENT, path, MAX_STUDY_FILE_BYTES)
        .map_err(|source| StudyFileError::Read(path.to_owned(), source))?
        .map_err(mistakes)?;
    let (tree, mut notes) = mapper_yaml::read(Source::new(&DOCUMENT, path, &text)).map_err(mistakes)?;
    if let Some(finding) = tree.find_other_kind("fleet", &["fleet", "study"]) {
        notes.push(finding);
    }
    if !notes.is_empty() {
        return Err(mistakes(tree.findings(notes)));
    }
    let word = |key: &str| tree.text(&steps![key]).unwrap_or_default().to_owned();
    Ok(StudyFile { path: path.to_owned(), name: word("fleet"), kind: word("study"), tree })
}

/// Largest file of an item, bytes: a campaign with its map file.
const MAX_ITEM_BYTES: usize = 32 << 20;

/// The work, and the program that does it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Item {
    /// Display name; results are listed by it.
    pub name: String,
    /// Kind of the study.
    pub kind: String,
    /// Program, version and commit that made the item; only the same program may process it.
    pub program: String,
    /// Input of the kind: campaign, machine, seed, method or case.
    pub payload: Value,
}

impl Item {
    /// The content of its file.
    pub fn bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// Reads an item and checks that its hash matches its name.
    ///
    /// # Errors
    /// [`FleetError::File`], [`FleetError::Changed`] if the hash differs, [`FleetError::Content`].
    pub fn read(path: &Path, hash: &Hash) -> Result<Item, FleetError> {
        let bytes = read_at_most(path, MAX_ITEM_BYTES)?;
        if Hash::of(&bytes) != *hash {
            return Err(FleetError::Changed(path.to_owned()));
        }
        serde_json::from_slice(&bytes).map_err(FleetError::content(path, "an item"))
    }
}
