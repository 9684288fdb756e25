//! Standard error: messages for people, wrapped to the width of the terminal.

use mapper_core::terminal_text;
use mapper_report::wrapped;
use std::io::Write;
use terminal_size::{Height, Width};

/// Writes text to standard error. A failure to write is ignored.
pub fn say(text: &str) {
    say_rendered(&terminal_text(text));
}

/// Writes coloured text whose file names and keys are already free of control characters.
pub fn say_rendered(text: &str) {
    let _ = write!(std::io::stderr().lock(), "{text}");
}

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
