//! Makes names safe for files of other programs.

/// Replaces control characters and line separators by blanks, so that a name cannot end a comment.
pub fn one_line(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') { ' ' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::one_line;

    #[test]
    fn no_line_ends_within() {
        assert_eq!(one_line("a\nb\u{2028}c\rd"), "a b c d");
    }
}
