//! A redone figure as data.

/// One figure of the paper, redone.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureResult {
    /// Its number in the paper, e.g. `7`.
    pub number: String,
    /// What it shows.
    pub title: String,
    /// How it was redone here, in a few sentences.
    pub method: String,
    /// The paper's statements, with the results here.
    pub statements: Vec<Statement>,
    /// The numbers behind the picture.
    pub table: Table,
    /// The picture, an SVG document.
    pub svg: String,
}

impl Statement {
    pub(crate) fn new(paper: &str, here: String, verdict: Verdict) -> Self {
        Statement { paper: paper.to_owned(), here, verdict }
    }
}

/// Whether a statement of the paper holds here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It holds.
    Holds,
    /// It holds with an exception that `here` names.
    Partly,
    /// It does not hold.
    Differs,
}

impl Verdict {
    pub(crate) fn holds_if(condition: bool) -> Self {
        if condition { Verdict::Holds } else { Verdict::Differs }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Verdict::Holds => "holds",
            Verdict::Partly => "partly",
            Verdict::Differs => "differs",
        })
    }
}

/// A statement of the paper, and the result here.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// What the paper states.
    pub paper: String,
    /// What came out, with units.
    pub here: String,
    /// Whether it holds.
    pub verdict: Verdict,
}

/// Numbers with their column heads; cells are already formatted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Column heads, units included.
    pub head: Vec<String>,
    /// Rows, as long as `head`.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<const N: usize>(head: [&str; N]) -> Self {
        Table { head: head.map(str::to_owned).to_vec(), rows: Vec::new() }
    }

    pub(crate) fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.to_vec());
    }
}

/// Path of this figure's picture, relative to the page of the figures.
pub fn picture_path(result: &FigureResult) -> String {
    format!("reproduction/figure_{}.svg", result.number)
}
