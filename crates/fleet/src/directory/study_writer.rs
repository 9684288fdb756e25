//! Writes a study's drafts to its directory.

use crate::directory::fleet::{BEGUN, ITEMS, LOGS, PARTS, STUDY};
use crate::directory::shared_files::{Durability, make_directory, write_whole};
use crate::directory::study::{LAYOUT, MAX_ITEMS};
use crate::{Fleet, FleetError, Hash, Item, ItemEntry, Kind, Study, StudyDraft, StudyFile};
use std::collections::BTreeSet;
use std::path::Path;

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
    /// Makes the directory of a study. If it holds an earlier state of the same study, items are added and removed, and the parts
    /// stay. Equal studies give equal bytes.
    ///
    /// # Errors
    /// [`FleetError`]: the study has mistakes, the directory holds another study or that of another version, a file cannot be
    /// written.
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
        Ok(CreatedStudy { fleet: Fleet::new(directory.to_owned(), study), new, gone: earlier.len() - kept })
    }
}

/// The items already in the directory.
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
