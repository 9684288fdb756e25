//! What is wrong with a channel map for one recording, shown in the map's own text.

use crate::channel_map_yaml::DOCUMENT;
use crate::{ChannelMap, RecordError};
use mapper_yaml::{FindingKind, Findings, Node, Notes, Source, Step, path_text};
use std::path::Path;

/// Complaints as they are collected: all mistakes come at once.
#[derive(Debug, Default)]
pub(crate) struct Complaints {
    list: Vec<(FindingKind, Vec<Step>, String, String)>,
}

impl Complaints {
    /// Adds what is wrong at a place of the map, and what would be right.
    pub(crate) fn add(&mut self, kind: FindingKind, place: &[Step], message: String, remedy: String) {
        self.list.push((kind, place.to_owned(), message, remedy));
    }

    /// All of them as an error; nothing where there are none.
    ///
    /// # Errors
    /// [`RecordError::ChannelMap`] where there is any.
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
