//! The document model: headings, sentences, tables and figures as data.

use crate::formatting::margins_text;
use mapper_chart::Figure;
use mapper_core::{Margins, Verdict};
use maud::Markup;

/// What people read about one subject.
#[derive(Debug, Clone, Default)]
pub struct Document {
    pub(super) blocks: Vec<Block>,
}

/// Data about one subject that people read.
pub trait Describe {
    /// Its document, in the usual units.
    fn document(&self) -> Document;
}

#[derive(Debug, Clone)]
pub(super) enum Block {
    Paragraph(String, Tone),
    List { items: Vec<String>, numbered: bool },
    Facts(Facts),
    Table(Table),
    Figures { caption: String, figures: Vec<Figure> },
    Code(String),
    Section(Section),
    Widget(Widget),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Tone {
    Plain,
    Strong,
    /// The words have the colour of a verdict.
    Verdict(Verdict),
}

#[derive(Debug, Clone)]
pub(super) struct Facts {
    pub(super) caption: String,
    pub(super) rows: Vec<(String, String)>,
}

#[derive(Debug, Clone)]
pub(super) struct Section {
    pub(super) heading: String,
    pub(super) id: Option<&'static str>,
    /// A page shows it when its heading is clicked.
    pub(super) folded: bool,
    pub(super) body: Document,
}

#[derive(Debug, Clone)]
pub(super) struct Widget {
    pub(super) html: Markup,
    pub(super) markdown: String,
}

/// A table with units in its heads. Its first column is text, the others are numbers unless declared otherwise.
#[derive(Debug, Clone)]
pub struct Table {
    pub(super) caption: String,
    pub(super) heads: Vec<String>,
    pub(super) texts: Vec<bool>,
    pub(super) rows: Vec<Row>,
}

#[derive(Debug, Clone)]
pub(super) struct Row {
    /// Index of the step whose transient a page shows after a click.
    pub(super) step: Option<usize>,
    pub(super) cells: Vec<Cell>,
}

/// A cell as displayed.
#[derive(Debug, Clone)]
pub struct Cell {
    pub(super) text: String,
    pub(super) value: Option<f64>,
    pub(super) look: Look,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Look {
    Plain,
    Verdict(Verdict),
    /// On a ground from white (0) to red (1).
    Heat(f64),
    /// With a bar of this share of the full length.
    Bar(f64),
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Cell { text, value: None, look: Look::Plain }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl Cell {
    pub(crate) fn number(text: impl Into<String>, value: f64) -> Self {
        Cell { value: Some(value).filter(|value| value.is_finite()), ..text.into().into() }
    }

    pub(crate) fn optional(value: Option<f64>, text: impl FnOnce(f64) -> String) -> Self {
        match value.filter(|value| value.is_finite()) {
            Some(value) => Cell::number(text(value), value),
            None => "-".into(),
        }
    }

    /// The distances to the ends of an interval, sorted by the farther one.
    pub(crate) fn margins(margins: Option<Margins>, decimals: usize) -> Self {
        match margins.filter(|margins| margins.farther().is_finite()) {
            Some(margins) => Cell::number(margins_text(margins, decimals), margins.farther()),
            None => "-".into(),
        }
    }

    pub(crate) fn verdict(verdict: Verdict) -> Self {
        Cell { look: Look::Verdict(verdict), ..verdict_word(verdict).into() }
    }

    pub(crate) fn heat(self, share: f64) -> Self {
        Cell { look: Look::Heat(share.clamp(0.0, 1.0)), ..self }
    }

    pub(crate) fn bar(self, share: f64) -> Self {
        Cell { look: Look::Bar(share.clamp(0.0, 1.0)), ..self }
    }
}

impl Table {
    /// A table without rows.
    pub fn new<H: AsRef<str>>(heads: impl IntoIterator<Item = H>) -> Self {
        let heads: Vec<String> = heads.into_iter().map(|head| head.as_ref().to_owned()).collect();
        let texts = (0..heads.len()).map(|column| column == 0).collect();
        Table { caption: String::new(), heads, texts, rows: Vec::new() }
    }

    pub(crate) fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// The same table with text in these columns too.
    pub fn with_texts(mut self, columns: impl IntoIterator<Item = usize>) -> Self {
        columns.into_iter().for_each(|column| self.texts[column] = true);
        self
    }

    /// The same table with all columns as text.
    pub fn all_texts(mut self) -> Self {
        self.texts.fill(true);
        self
    }

    /// The same table with all columns as numbers.
    pub fn all_numbers(mut self) -> Self {
        self.texts.fill(false);
        self
    }

    /// The same table with these rows added.
    pub fn rows<C: Into<Cell>, R: IntoIterator<Item = C>>(
        mut self,
        rows: impl IntoIterator<Item = R>,
    ) -> Self {
        rows.into_iter().for_each(|row| self.row(row));
        self
    }

    /// Adds a row.
    pub fn row<C: Into<Cell>>(&mut self, cells: impl IntoIterator<Item = C>) {
        self.rows.push(Row { step: None, cells: cells.into_iter().map(Into::into).collect() });
    }

    pub(crate) fn row_of_step(&mut self, step: Option<usize>, cells: Vec<Cell>) {
        self.rows.push(Row { step, cells });
    }
}

impl Section {
    pub(super) fn is_for_browsers(&self) -> bool {
        let is_hidden = |block: &Block| matches!(block, Block::Widget(widget) if widget.markdown.is_empty());
        self.body.blocks.iter().all(is_hidden)
    }
}

impl Document {
    /// Without content.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Adds a paragraph; an empty one is not added.
    pub fn text(&mut self, text: impl Into<String>) {
        self.paragraph(text.into(), Tone::Plain);
    }

    pub(crate) fn strong(&mut self, text: impl Into<String>) {
        self.paragraph(text.into(), Tone::Strong);
    }

    pub(crate) fn verdict(&mut self, verdict: Verdict, text: impl Into<String>) {
        self.paragraph(text.into(), Tone::Verdict(verdict));
    }

    fn paragraph(&mut self, text: String, tone: Tone) {
        let text = text.trim_end();
        if !text.is_empty() {
            self.blocks.push(Block::Paragraph(text.to_owned(), tone));
        }
    }

    /// Adds a list; an empty one is not added.
    pub fn list<T: Into<String>>(&mut self, items: impl IntoIterator<Item = T>) {
        self.items(items, false);
    }

    pub(crate) fn numbered<T: Into<String>>(&mut self, items: impl IntoIterator<Item = T>) {
        self.items(items, true);
    }

    fn items<T: Into<String>>(&mut self, items: impl IntoIterator<Item = T>, numbered: bool) {
        let items: Vec<String> = items.into_iter().map(Into::into).collect();
        if !items.is_empty() {
            self.blocks.push(Block::List { items, numbered });
        }
    }

    /// Adds names and values; without rows nothing is added.
    pub fn facts<N: Into<String>>(&mut self, caption: &str, rows: impl IntoIterator<Item = (N, String)>) {
        let rows: Vec<(String, String)> =
            rows.into_iter().map(|(name, value)| (name.into(), value)).collect();
        if !rows.is_empty() {
            self.blocks.push(Block::Facts(Facts { caption: caption.to_owned(), rows }));
        }
    }

    /// Adds a table; one without rows is not added.
    pub fn table(&mut self, table: Table) {
        if !table.rows.is_empty() {
            self.blocks.push(Block::Table(table));
        }
    }

    pub(crate) fn figures(&mut self, caption: &str, figures: Vec<Figure>) {
        if !figures.is_empty() {
            self.blocks.push(Block::Figures { caption: caption.to_owned(), figures });
        }
    }

    pub(crate) fn code(&mut self, lines: impl Into<String>) {
        self.blocks.push(Block::Code(lines.into()));
    }

    /// Adds a part that works only in a browser; `markdown` shows its content as a picture.
    pub(crate) fn widget(&mut self, html: Markup, markdown: impl Into<String>) {
        self.blocks.push(Block::Widget(Widget { html, markdown: markdown.into() }));
    }

    /// Adds a section; one without content is not added.
    pub fn section(&mut self, heading: impl Into<String>, body: Document) {
        self.push_section(heading.into(), None, false, body);
    }

    pub(crate) fn named_section(&mut self, id: &'static str, heading: &str, body: Document) {
        self.push_section(heading.to_owned(), Some(id), false, body);
    }

    pub(crate) fn folded_section(&mut self, heading: &str, body: Document) {
        self.push_section(heading.to_owned(), None, true, body);
    }

    fn push_section(&mut self, heading: String, id: Option<&'static str>, folded: bool, body: Document) {
        if !body.is_empty() {
            self.blocks.push(Block::Section(Section { heading, id, folded, body }));
        }
    }

    /// Adds the content of another document.
    pub fn append(&mut self, other: Document) {
        self.blocks.extend(other.blocks);
    }

    pub(crate) fn contents(&self) -> Vec<(&'static str, &str)> {
        let named = self.blocks.iter().filter_map(|block| match block {
            Block::Section(section) => Some((section.id?, section.heading.as_str())),
            _ => None,
        });
        named.collect()
    }
}

pub(crate) fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Unusable => "unusable",
    }
}
