//! Wraps lines to the width of the terminal.

use mapper_report::wrapped;
use terminal_size::{Height, Width};

/// Wraps long lines to the width of the terminal. Without a terminal the text is unchanged, so that other programs get whole lines.
pub fn wrap_for_terminal(text: &str, size: Option<(Width, Height)>) -> String {
    let Some((Width(columns), _)) = size else { return text.to_owned() };
    let columns = usize::from(columns);
    let lines = text.split_inclusive('\n').map(|line| {
        // Coloured lines and rows of tables have their own layout.
        let is_prose = !line.contains('\x1b') && !line.trim().contains("   ");
        if is_prose && line.trim_end().chars().count() > columns {
            wrapped(line, columns, line.len() - line.trim_start().len() + 2)
        } else {
            line.to_owned()
        }
    });
    lines.collect()
}
