//! Mistakes of a channel map for one recording, shown in the map's own text.

use crate::channel_mapping::channel_map_yaml::DOCUMENT;
use crate::{ChannelMap, RecordError};
use mapper_yaml::{FindingKind, Source, Step};
use std::path::Path;

/// Collects mistakes, so that all are reported at once.
#[derive(Debug, Default)]
pub(crate) struct MapMistakes {
    list: Vec<(FindingKind, Vec<Step>, String, String)>,
}

impl MapMistakes {
    /// Adds a mistake at a place of the map, with its remedy.
    pub(crate) fn add(&mut self, kind: FindingKind, place: &[Step], message: String, remedy: String) {
        self.list.push((kind, place.to_owned(), message, remedy));
    }

    /// # Errors
    /// [`RecordError::ChannelMap`] with all mistakes, if there are any.
    pub(crate) fn into_result(self, map: &ChannelMap) -> Result<(), RecordError> {
        if self.list.is_empty() {
            return Ok(());
        }
        let nowhere = (Path::new("channel map").to_owned(), "{}".to_owned());
        let (path, text) = map.text.as_ref().unwrap_or(&nowhere);
        let findings = match mapper_yaml::read(Source::new(&DOCUMENT, path, text)) {
            Ok((tree, mut notes)) => {
                for (kind, steps, message, remedy) in self.list {
                    notes.push(tree.finding(kind, &steps, message, remedy));
                }
                tree.findings(notes)
            }
            Err(findings) => findings,
        };
        Err(RecordError::ChannelMap(Box::new(findings)))
    }
}
