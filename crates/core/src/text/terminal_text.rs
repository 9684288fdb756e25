//! Makes text safe for terminals, which interpret control characters.

use crate::text::with_unit::shorten_numbers;
use std::fmt::Write;
use std::hash::{BuildHasher, RandomState};
use std::sync::LazyLock;

/// Represents the escape character in our own text until [`terminal_text`] replaces it. Foreign text cannot contain it, because it differs in
/// each process.
static OWN_ESCAPE: LazyLock<String> =
    LazyLock::new(|| format!("\u{fdd0}{:016x}", RandomState::new().hash_one(0)));

/// Text in a colour of the terminal (SGR code) once it has passed [`terminal_text`].
pub fn coloured_text(text: &str, code: u8) -> String {
    let escape = OWN_ESCAPE.as_str();
    format!("{escape}[{code}m{text}{escape}[0m")
}

/// Whether a terminal interprets this character: control characters except line ends and tabs, and marks for right-to-left text.
fn is_interpreted(c: char) -> bool {
    c.is_control() && !matches!(c, '\n' | '\t')
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Replaces characters that a terminal interprets, except the colours of [`coloured_text`]. Names of files, channels and units, and
/// messages of drivers, are foreign text and could otherwise control the terminal or hide text.
pub fn terminal_text(text: &str) -> String {
    let safe = text.replace("\r\n", "\n").replace(is_interpreted, "\u{fffd}");
    shorten_numbers(&safe).replace(OWN_ESCAPE.as_str(), "\u{1b}")
}

/// The same JSON without characters that a terminal interprets: JSON itself escapes only those below U+0020.
pub fn terminal_json(json: &str) -> String {
    let mut safe = String::with_capacity(json.len());
    for c in json.chars() {
        // A string takes every fragment.
        let _ = if is_interpreted(c) { write!(safe, "\\u{:04x}", u32::from(c)) } else { safe.write_char(c) };
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_own_colours_reach_the_terminal() {
        for (text, safe) in [
            ("p2 in kPa\n\tgood", "p2 in kPa\n\tgood"),
            // A colour, title, cleared screen, hidden text, a carriage return, a backspace, C1, a name that reads backwards.
            ("\u{1b}[1;31mred\u{1b}[0m", "\u{fffd}[1;31mred\u{fffd}[0m"),
            ("\u{1b}]0;x\u{7}", "\u{fffd}]0;x\u{fffd}"),
            ("\u{1b}[2J", "\u{fffd}[2J"),
            ("\u{1b}[8mhidden", "\u{fffd}[8mhidden"),
            ("good\rbad", "good\u{fffd}bad"),
            ("good\r\nbad\r", "good\nbad\u{fffd}"),
            ("a\u{8}b\u{9b}c", "a\u{fffd}b\u{fffd}c"),
            ("x\u{202e}lmay", "x\u{fffd}lmay"),
        ] {
            assert_eq!(terminal_text(text), safe);
        }
        assert_eq!(terminal_text(&coloured_text("good", 32)), "\u{1b}[32mgood\u{1b}[0m");
    }

    #[test]
    fn json_keeps_its_meaning() {
        let name = "a\u{1b}[31m\u{9b}2J\u{202e}\u{7f} °\n";
        let json = terminal_json(&serde_json::to_string_pretty(&[name]).unwrap());
        assert!(!json.contains(is_interpreted), "{json}");
        assert_eq!(serde_json::from_str::<Vec<String>>(&json).unwrap(), [name]);
    }
}
