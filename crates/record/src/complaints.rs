//! Mistakes of a channel map for one recording, shown in the map's own text.

use crate::channel_map_yaml::DOCUMENT;
use crate::{ChannelMap, RecordError};
use mapper_yaml::{FindingKind, Findings, Node, Notes, Source, Step, path_text};
use std::path::Path;

/// Collects mistakes, so that all are reported at once.
#[derive(Debug, Default)]
pub(crate) struct Complaints {
    list: Vec<(FindingKind, Vec<Step>, String, String)>,
}

impl Complaints {
    /// Adds a mistake at a place of the map, with its remedy.
    pub(crate) fn add(&mut self, kind: FindingKind, place: &[Step], message: String, remedy: String) {
        self.list.push((kind, place.to_owned(), message, remedy));
    }

    /// All mistakes as an error; nothing if there are none.
    ///
    /// # Errors
    /// [`RecordError::ChannelMap`] if there is any.
    pub(crate) fn result(self, map: &ChannelMap) -> Result<(), RecordError> {
        if self.list.is_empty() {
            return Ok(());
        }
        let nowhere = (Path::new("channel map").to_owned(), String::new());
        let (path, text) = map.text.as_ref().unwrap_or(&nowhere);
        let source = Source::new(&DOCUMENT, path, text);
        let root: Option<Node> = mapper_yaml::read(&source, &mut Notes::default());
        let mut notes = Notes::default();
        for (kind, steps, message, remedy) in self.list {
            let place = root.as_ref().map_or(0..0, |root| root.place(&steps));
            notes.push(source.finding(kind, path_text(&steps), place, message, remedy));
        }
        Err(RecordError::ChannelMap(Box::new(Findings::new(source, notes))))
    }
}
