//! A study: its items, and the parts of its result.

use crate::files::{Durability, Machine, StudyFileError, read_at_most, write_whole};
use crate::{FleetError, Hash};
use mapper_yaml::{Document, FindingKind, Findings, Notes, Schema, Source, Tree, steps};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
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
    /// Its kind.
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
    /// Kind.
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
    pub fn read(path: &Path, hash: &Hash) -> Result<Item, FleetError> {
        let bytes = read_at_most(path, MAX_ITEM_BYTES)?;
        if Hash::of(&bytes) != *hash {
            return Err(FleetError::Changed(path.to_owned()));
        }
        serde_json::from_slice(&bytes).map_err(FleetError::content(path, "an item"))
    }
}

/// Largest first line, bytes.
const MAX_HEADER_BYTES: usize = 4096;
/// Largest result of one item, bytes.
const MAX_BODY_BYTES: u64 = 64 << 20;

/// The outcome of an item.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    Done,
    Failed,
}

/// The first line of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    pub item: Hash,
    /// Program, version and commit that did it.
    pub program: String,
    pub outcome: Outcome,
    /// How long it took on one core, s.
    pub duration_s: f64,
    /// Peak memory of the process divided by its number of workers, bytes; 0 if unknown.
    pub memory_bytes: u64,
    pub body_bytes: u64,
    /// SHA-256 of the body.
    pub body_sha256: Hash,
}

/// Reason why a file is not a valid part of the study.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum PartRefusal {
    #[error("cannot be read: {0}")]
    Unread(String),
    #[error("is not a part")]
    NotAPart,
    #[error("contains the item {0}")]
    OtherItem(Hash),
    #[error("was made by {0}")]
    OtherProgram(String),
    #[error("has {found} bytes instead of {stated}")]
    Length { found: u64, stated: u64 },
    #[error("has {found} bytes, more than the {limit} that are read")]
    TooLarge { found: u64, limit: u64 },
    #[error("has been changed: its checksum is wrong")]
    Checksum,
}

impl Part {
    pub(crate) fn write(
        path: &Path,
        (hash, item): (&Hash, &Item),
        (outcome, body): (Outcome, &str),
        (duration_s, memory_bytes): (f64, u64),
        machine: &Machine<'_>,
    ) -> Result<Part, FleetError> {
        let part = Part {
            item: *hash,
            program: item.program.clone(),
            outcome,
            // Zero if the clock went backwards.
            duration_s: if duration_s.is_finite() { duration_s.max(0.0) } else { 0.0 },
            memory_bytes,
            body_bytes: body.len() as u64,
            body_sha256: Hash::of(body.as_bytes()),
        };
        let header = serde_json::to_vec(&part).map_err(FleetError::content(path, "a part"))?;
        write_whole(path, &[&header, b"\n", body.as_bytes()], machine.name, Durability::Synced)?;
        Ok(part)
    }

    /// The part of the item `hash` by `program`, with its body, whose checksum is checked; `None` without a file.
    pub(crate) fn read(
        path: &Path,
        hash: &Hash,
        program: &str,
    ) -> Option<Result<(Part, String), PartRefusal>> {
        match std::fs::symlink_metadata(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => Some(Err(PartRefusal::Unread(error.to_string()))),
            // A pipe would hang, and a link may lead anywhere.
            Ok(metadata) if !metadata.is_file() => Some(Err(PartRefusal::NotAPart)),
            Ok(_) => Some(read_body(path, hash, program)),
        }
    }
}

fn unread(error: impl std::fmt::Display) -> PartRefusal {
    PartRefusal::Unread(error.to_string())
}

/// The header, the file, and the bytes of the body that were read with the header.
fn open(path: &Path, hash: &Hash, program: &str) -> Result<(Part, File, Vec<u8>), PartRefusal> {
    let mut file = mapper_yaml::open_file(path).map_err(unread)?;
    let length = file.metadata().map_err(unread)?.len();
    let mut bytes = Vec::with_capacity(MAX_HEADER_BYTES);
    (&mut file).take(MAX_HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(unread)?;
    let end = bytes.iter().position(|byte| *byte == b'\n').ok_or(PartRefusal::NotAPart)?;
    let part: Part = serde_json::from_slice(&bytes[..end]).map_err(|_| PartRefusal::NotAPart)?;
    if part.item != *hash {
        return Err(PartRefusal::OtherItem(part.item));
    }
    if part.program != program {
        return Err(PartRefusal::OtherProgram(part.program));
    }
    if part.body_bytes > MAX_BODY_BYTES {
        return Err(PartRefusal::TooLarge { found: part.body_bytes, limit: MAX_BODY_BYTES });
    }
    let found = length.saturating_sub(end as u64 + 1);
    if found != part.body_bytes {
        return Err(PartRefusal::Length { found, stated: part.body_bytes });
    }
    Ok((part, file, bytes.split_off(end + 1)))
}

fn read_body(path: &Path, hash: &Hash, program: &str) -> Result<(Part, String), PartRefusal> {
    let (part, file, mut body) = open(path, hash, program)?;
    file.take(MAX_BODY_BYTES + 1).read_to_end(&mut body).map_err(unread)?;
    if Hash::of(&body) != part.body_sha256 {
        return Err(PartRefusal::Checksum);
    }
    let body = String::from_utf8(body).map_err(|_| PartRefusal::Checksum)?;
    Ok((part, body))
}
