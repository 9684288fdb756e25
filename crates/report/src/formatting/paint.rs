//! Terminal colours for verdicts.

use mapper_core::{Verdict, coloured_text};

/// Whether words are coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Paint {
    /// Uncoloured.
    #[default]
    Plain,
    /// In the terminal's own colours.
    Coloured,
}

/// Words in the colour of a verdict: green, yellow, red.
pub fn paint_verdict(verdict: Verdict, text: &str, paint: Paint) -> String {
    let code = match verdict {
        Verdict::Good => 32,
        Verdict::Doubtful => 33,
        Verdict::Unusable => 31,
    };
    match paint {
        Paint::Plain => text.to_owned(),
        Paint::Coloured => coloured_text(text, code),
    }
}
