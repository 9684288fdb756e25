//! Safe text for terminals and files of other programs, and numbers with their units.

pub(crate) mod one_line;
pub(crate) mod probability_text;
pub(crate) mod terminal_text;
pub(crate) mod with_unit;
