//! Access to the file and its findings for the checks of the elements.
//!
//! Reads the tree and skips missing or invalid values, so that one mistake does not hide another.

use crate::units::{self, Kind};
use mapper_yaml::{FindingKind, Notes, Step, Tree};
use serde_json::Value;
use std::io;
use std::path::{Path, PathBuf};

/// Reads a file named in a campaign.
pub(crate) type Files<'a> = &'a dyn Fn(&Path) -> io::Result<String>;

/// The path of a file named in a campaign: relative ones start from the campaign's own directory.
pub(crate) fn resolve_path(origin: &Path, file: &str) -> PathBuf {
    origin.parent().unwrap_or(Path::new("")).join(file)
}

/// A campaign file with its list of mistakes.
pub(crate) struct Check<'a> {
    pub tree: &'a Tree,
    pub files: Files<'a>,
    pub notes: &'a mut Notes,
}

impl<'a> Check<'a> {
    /// The value at a path.
    pub fn get(&self, steps: &[Step]) -> Option<&'a Value> {
        self.tree.get(steps)
    }

    /// The text of a scalar.
    pub fn text(&self, steps: &[Step]) -> Option<&'a str> {
        self.tree.text(steps)
    }

    /// The value in the internal unit, and its text.
    pub fn quantity(&self, kind: Kind, steps: &[Step]) -> Option<(f64, &'a str)> {
        let text = self.text(steps)?;
        Some((units::parse(kind, text).ok()?, text))
    }

    /// A plain number.
    pub fn number(&self, steps: &[Step]) -> Option<f64> {
        self.tree.get(steps)?.as_f64()
    }

    /// Number of entries of a list; 0 if it is not a list.
    pub fn count(&self, steps: &[Step]) -> usize {
        self.tree.items(steps).len()
    }

    /// The resolved path of a file named in the campaign, and its text.
    pub fn file(&self, name: &str) -> (PathBuf, io::Result<String>) {
        let path = resolve_path(&self.tree.source().origin, name);
        let text = (self.files)(&path);
        (path, text)
    }

    /// Notes a mistake at a value.
    pub fn note(&mut self, kind: FindingKind, steps: &[Step], message: String, remedy: &str) {
        self.notes.push(self.tree.finding(kind, steps, message, remedy));
    }

    /// Notes a mistake about a key, not its value.
    pub fn note_key(&mut self, kind: FindingKind, parent: &[Step], key: &str, message: String, remedy: &str) {
        let steps = [parent, &[Step::from(key)]].concat();
        self.notes.push(self.tree.key_finding(kind, &steps, message, remedy));
    }
}
