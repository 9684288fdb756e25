//! The description of a study in its directory.

use crate::directory::shared_files::{Durability, read_at_most, write_whole};
use crate::{FleetError, Hash};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the directory's layout.
pub(crate) const LAYOUT: u32 = 1;
/// Maximum number of items of a study.
pub(crate) const MAX_ITEMS: usize = 1_000_000;
/// Largest file of a study, bytes: a million items.
const MAX_FILE_BYTES: usize = 256 << 20;

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
        let bytes = read_at_most(path, MAX_FILE_BYTES)?;
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
