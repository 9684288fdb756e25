//! All mistakes of a file.

use crate::mistakes::finding::{Finding, FindingKind, SHOWN_LIMIT};
use crate::mistakes::notes::Notes;
use crate::mistakes::source::Source;
use std::path::Path;

/// All mistakes of a file, in the order of the text.
///
/// [`Display`](std::fmt::Display) renders them without colours; see [`Findings::render`].
#[derive(Debug, Clone)]
pub struct Findings {
    pub(crate) source: Box<Source>,
    /// At most [`Findings::LIMIT`] mistakes.
    pub list: Vec<Finding>,
    /// Number of further mistakes.
    pub omitted: usize,
}

impl Findings {
    /// Maximum number of findings that are kept; further ones are counted.
    pub const LIMIT: usize = SHOWN_LIMIT;

    /// The notes about a text, in the order of the text.
    pub fn new(source: Source, notes: Notes) -> Self {
        let (mut list, overflow) = notes.into_parts();
        list.sort_by_key(|finding| finding.span.start);
        let omitted = list.len().saturating_sub(Self::LIMIT) + overflow;
        list.truncate(Self::LIMIT);
        Findings { source: Box::new(source), list, omitted }
    }

    /// A single mistake, at a byte of the text.
    pub fn single(source: Source, kind: FindingKind, at: usize, message: String, remedy: String) -> Self {
        let mut notes = Notes::default();
        notes.push(source.finding(kind, String::new(), at..at, message, remedy));
        Findings::new(source, notes)
    }

    /// The file with the mistakes.
    pub fn origin(&self) -> &Path {
        &self.source.origin
    }

    /// Number of mistakes, the omitted ones included.
    pub fn count(&self) -> usize {
        self.list.len() + self.omitted
    }
}

impl std::error::Error for Findings {}
