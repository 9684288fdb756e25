//! One piece of work: a small file with everything needed to do it.

use crate::directory::shared_files::read_at_most;
use crate::{FleetError, Hash};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Largest file of an item, bytes: a campaign with its map file.
const MAX_FILE_BYTES: usize = 32 << 20;

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
    ///
    /// # Errors
    /// The serialiser's: none in practice.
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
        let bytes = read_at_most(path, MAX_FILE_BYTES)?;
        if Hash::of(&bytes) != *hash {
            return Err(FleetError::Changed(path.to_owned()));
        }
        serde_json::from_slice(&bytes).map_err(FleetError::content(path, "an item"))
    }
}
