//! Makes text safe for terminals, which interpret control characters.

use std::borrow::Cow;

/// Escape codes that this program writes itself: normal, bold, the eight colours.
const OWN_CODES: [&str; 11] = ["0", "1", "30", "31", "32", "33", "34", "35", "36", "37", "39"];

/// Replaces control characters except line ends and tabs, escape sequences except colours, and marks for right-to-left text. Names of files,
/// channels and units, and messages of drivers, are foreign text and could otherwise control the terminal or hide text.
pub fn terminal_text(text: &str) -> Cow<'_, str> {
    let unsafe_char = |c: char| {
        c.is_control() && !matches!(c, '\n' | '\t')
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(unsafe_char) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let length = if letter == '\u{1b}' { own_colour(rest) } else { None };
        let length = length.unwrap_or_else(|| letter.len_utf8());
        let (this, after) = rest.split_at(length);
        rest = after;
        let ends_line = letter == '\r' && rest.starts_with('\n');
        if !ends_line && unsafe_char(letter) && length == letter.len_utf8() {
            safe.push('\u{fffd}')
        } else {
            safe.push_str(this)
        }
    }
    Cow::Owned(safe)
}

/// Length of a sequence for a colour at the start of a text.
fn own_colour(text: &str) -> Option<usize> {
    let codes = text.strip_prefix("\u{1b}[")?;
    let end = codes.find('m').filter(|end| *end <= 8)?;
    let known = codes[..end].split(';').all(|code| OWN_CODES.contains(&code));
    known.then_some(end + "\u{1b}[m".len())
}

#[cfg(test)]
mod tests {
    use crate::terminal_text;

    #[test]
    fn only_colours_reach_the_terminal() {
        for (text, safe) in [
            ("p2 in kPa\n\tgood", "p2 in kPa\n\tgood"),
            ("\u{1b}[1;31mred\u{1b}[0m", "\u{1b}[1;31mred\u{1b}[0m"),
            // Title, cleared screen, hidden text, a carriage return, a backspace, C1, a name that reads backwards.
            ("\u{1b}]0;x\u{7}", "\u{fffd}]0;x\u{fffd}"),
            ("\u{1b}[2J", "\u{fffd}[2J"),
            ("\u{1b}[8mhidden", "\u{fffd}[8mhidden"),
            ("good\rbad", "good\u{fffd}bad"),
            ("good\r\nbad\r", "good\r\nbad\u{fffd}"),
            ("a\u{8}b\u{9b}c", "a\u{fffd}b\u{fffd}c"),
            ("x\u{202e}lmay", "x\u{fffd}lmay"),
        ] {
            assert_eq!(terminal_text(text), safe);
        }
    }
}
