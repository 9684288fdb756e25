//! A study file: name and kind are read here, everything else by the kind.

use mapper_yaml::{
    Document, FindingKind, Findings, Node, Notes, ReadError, Schema, Source, path_text, steps,
};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Name of the file in messages.
static DOCUMENT: Document = Document { name: "study", example: "campaigns/fleet/blind.yaml" };
/// Largest file of a study, bytes: some ten thousand names of campaigns.
const LARGEST_BYTES: usize = 4 << 20;

/// Errors of reading a study file.
#[derive(Debug, thiserror::Error)]
pub enum StudyFileError {
    /// The file cannot be read.
    #[error("failed to read the study {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file has mistakes.
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

/// A study file, of which only the name and the kind are read.
#[derive(Debug)]
pub struct StudyFile {
    path: PathBuf,
    source: Source,
    root: Node,
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: String,
}

impl StudyFile {
    /// A file that it names, relative to its own directory.
    pub fn beside(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// The complete file, read by the kind; name and kind included.
    ///
    /// # Errors
    /// [`StudyFileError::Mistakes`] with all mistakes.
    pub fn read<T: DeserializeOwned + JsonSchema>(&self) -> Result<T, StudyFileError> {
        let mut notes = Notes::default();
        Schema::of::<T>().check(&self.source, &self.root, &mut notes);
        if notes.is_empty() {
            match self.root.deserialise::<T>() {
                Ok(file) => return Ok(file),
                Err(ReadError { steps, source: error }) => notes.push(self.source.finding(
                    FindingKind::WrongValue,
                    path_text(&steps),
                    self.root.place(&steps),
                    error.to_string(),
                    "write it in a simpler form".to_owned(),
                )),
            }
        }
        Err(StudyFileError::Mistakes(Box::new(Findings::new(self.source.clone(), notes))))
    }

    /// A mistake found by the kind, at a key of the file.
    pub fn mistake(&self, key: &str, message: String, remedy: &str) -> StudyFileError {
        let steps = steps![key];
        let place = self.root.place(&steps);
        let (kind, remedy) = (FindingKind::WrongValue, remedy.to_owned());
        let finding = self.source.finding(kind, path_text(&steps), place, message, remedy);
        let mut notes = Notes::default();
        notes.push(finding);
        StudyFileError::Mistakes(Box::new(Findings::new(self.source.clone(), notes)))
    }
}

/// Reads name and kind of a study.
///
/// # Errors
/// [`StudyFileError`].
pub fn open_study(path: &Path) -> Result<StudyFile, StudyFileError> {
    let mistakes = |findings| StudyFileError::Mistakes(Box::new(findings));
    let text = mapper_yaml::open(&DOCUMENT, path, LARGEST_BYTES)
        .map_err(|source| StudyFileError::Read { path: path.to_owned(), source })?
        .map_err(mistakes)?;
    let source = Source::new(&DOCUMENT, path, &text);
    let mut notes = Notes::default();
    let Some(root) = mapper_yaml::read(&source, &mut notes).filter(|_| notes.is_empty()) else {
        return Err(mistakes(Findings::new(source, notes)));
    };
    let word = |key: &str| root.get(&steps![key]).and_then(Node::text).map(str::to_owned);
    let (name, kind) = (word("fleet").unwrap_or_default(), word("study").unwrap_or_default());
    Ok(StudyFile { path: path.to_owned(), name, kind, source, root })
}
