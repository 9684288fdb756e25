//! Sealed answers: their hash is printed before the diagnosis.

use crate::blind::cases::equations::Laboratory;
use crate::blind::cases::truth::Truth;
use crate::blind::error::BlindError;
use serde::de::DeserializeOwned;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;

/// File of the answers, within the directory of the cases.
pub const ANSWERS_NAME: &str = "answers.json";
/// File that describes the content of the directory.
pub const MANIFEST_NAME: &str = "manifest.json";

/// Description of a directory of cases. It contains only the hash of the answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name of the campaign.
    pub campaign: String,
    /// The simulator of the cases.
    #[serde(default)]
    pub laboratory: Laboratory,
    /// Whether each rig was also recorded on a night without its causes, as NAME.baseline.mcap.
    #[serde(default)]
    pub baseline: bool,
    /// The former key of `baseline`.
    #[serde(default, skip_serializing, rename = "healthy", deserialize_with = "former_key")]
    pub(crate) former: (),
    /// Names of the cases; each has a recording NAME.mcap.
    pub cases: Vec<String>,
    /// SHA-256 of the file of answers.
    pub answers_sha256: String,
}

/// Refuses the key of earlier programs.
fn former_key<'de, D: Deserializer<'de>>(_: D) -> Result<(), D::Error> {
    Err(Error::custom(
        "`healthy` is now `baseline`, and NAME.healthy.mcap is NAME.baseline.mcap: rename them, or make the cases again",
    ))
}

impl Manifest {
    /// Heading that distinguishes its score from those of other cases.
    pub fn title(&self) -> String {
        let recording = if self.baseline { ", with a baseline" } else { "" };
        format!("{}{recording}", self.laboratory.name())
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// [`BlindError`] if it is missing or invalid.
    pub fn read(path: &Path) -> Result<Manifest, BlindError> {
        read_json(path, "manifest of blind cases")
    }
}

/// Maximum size of a file that is read, bytes: far more than any number of answers.
const MAX_BYTES: u64 = 256 << 20;

pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

pub(crate) fn read_json<T: DeserializeOwned>(path: &Path, what: &'static str) -> Result<T, BlindError> {
    let bytes = read(path)?;
    serde_json::from_slice(&bytes).map_err(|source| BlindError::Content {
        path: path.to_owned(),
        what,
        source,
    })
}

fn read(path: &Path) -> Result<Vec<u8>, BlindError> {
    let mut bytes = Vec::new();
    let file = mapper_yaml::open_file(path).map_err(BlindError::file(path))?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(BlindError::file(path))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(BlindError::TooLarge { path: path.to_owned(), limit: MAX_BYTES });
    }
    Ok(bytes)
}

/// Reads the answers if they are unchanged.
///
/// # Errors
/// [`BlindError::Seal`] if they were changed.
pub(crate) fn open(directory: &Path, manifest: &Manifest) -> Result<Vec<Truth>, BlindError> {
    let path = directory.join(ANSWERS_NAME);
    let bytes = read(&path)?;
    let actual = sha256(&bytes);
    if actual != manifest.answers_sha256 {
        return Err(BlindError::Seal { path, actual, expected: manifest.answers_sha256.clone() });
    }
    serde_json::from_slice(&bytes).map_err(|source| BlindError::Content { path, what: "answers", source })
}
