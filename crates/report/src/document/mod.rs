//! What people read about one subject, as data: headings, sentences, tables and figures.
//!
//! Each subject has one function that makes its [`Document`]. Terminal, Markdown and HTML follow from it by one renderer each, so that the
//! three say the same. Text between backticks is code in all of them.

mod html;
mod model;
mod sentence;
mod terminal;

pub use html::{markdown_table, markdown_text};
pub(crate) use model::verdict_word;
pub use model::{Cell, Describe, Document, Table};
pub(crate) use sentence::{Sentence, number, sentence, signed};
pub use terminal::{Paint, wrapped};
