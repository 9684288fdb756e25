//! A study file: name and kind are read here, everything else by the kind.

use mapper_yaml::{Document, FindingKind, Findings, Notes, Schema, Source, Tree, steps};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Name of the file in messages.
static DOCUMENT: Document = Document { name: "study", example: "campaigns/fleet/blind.yaml" };
/// Largest file of a study, bytes: some ten thousand names of campaigns.
const MAX_FILE_BYTES: usize = 4 << 20;

/// Errors of reading a study file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum StudyFileError {
    #[error("failed to read the study {}: {}", .0.display(), .1)]
    Read(PathBuf, #[source] std::io::Error),
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

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
    ///
    /// # Errors
    /// [`StudyFileError::Mistakes`] with all mistakes.
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
///
/// # Errors
/// [`StudyFileError`].
pub fn open_study(path: &Path) -> Result<StudyFile, StudyFileError> {
    let mistakes = |findings| StudyFileError::Mistakes(Box::new(findings));
    let text = mapper_yaml::open(&DOCUMENT, path, MAX_FILE_BYTES)
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
