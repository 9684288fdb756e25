//! Access to the file and its findings for the checks of the elements.
//!
//! Works on the tree and skips what is missing or unreadable, so that one mistake does not hide another.

use crate::units::{self, Kind};
use mapper_yaml::{FindingKind, Notes, Source};
use mapper_yaml::{Node, Step, path_text};
use std::io;
use std::path::{Path, PathBuf};

/// A way to read a file named in a campaign.
pub(crate) type Files<'a> = &'a dyn Fn(&Path) -> io::Result<String>;

/// The path of a file named in a campaign: relative ones start from the campaign's own directory.
pub(crate) fn beside(origin: &Path, file: &str) -> PathBuf {
    origin.parent().unwrap_or(Path::new("")).join(file)
}

/// A file as far as it could be read, and its list of mistakes.
pub(crate) struct Check<'a> {
    pub source: &'a Source,
    pub root: &'a Node,
    pub files: Files<'a>,
    pub notes: &'a mut Notes,
}

impl<'a> Check<'a> {
    /// The node at a path.
    pub fn get(&self, steps: &[Step]) -> Option<&'a Node> {
        self.root.get(steps)
    }

    /// The text of a scalar.
    pub fn text(&self, steps: &[Step]) -> Option<&'a str> {
        self.root.get(steps)?.text()
    }

    /// The value in the internal unit, and its text.
    pub fn quantity(&self, kind: Kind, steps: &[Step]) -> Option<(f64, &'a str)> {
        let text = self.text(steps)?;
        Some((units::parse(kind, text).ok()?, text))
    }

    /// A plain number.
    pub fn number(&self, steps: &[Step]) -> Option<f64> {
        self.root.get(steps)?.number()
    }

    /// Number of entries of a list; 0 if it is not a list.
    pub fn count(&self, steps: &[Step]) -> usize {
        self.root.get(steps).map_or(0, |node| node.items().len())
    }

    /// The resolved path of a file named in the campaign, and its text.
    pub fn file(&self, name: &str) -> (PathBuf, io::Result<String>) {
        let path = beside(&self.source.origin, name);
        let text = (self.files)(&path);
        (path, text)
    }

    /// A mistake at a value.
    pub fn note(&mut self, kind: FindingKind, steps: &[Step], message: String, remedy: &str) {
        let place = self.root.place(steps);
        let finding = self.source.finding(kind, path_text(steps), place, message, remedy.to_owned());
        self.notes.push(finding);
    }

    /// A mistake at a key, if the key itself is wrong and not its value.
    pub fn note_key(&mut self, kind: FindingKind, parent: &[Step], key: &str, message: String, remedy: &str) {
        let place = self.root.key_place(parent, key);
        let path = format!("{}.{key}", path_text(parent));
        self.notes.push(self.source.finding(kind, path, place, message, remedy.to_owned()));
    }
}
