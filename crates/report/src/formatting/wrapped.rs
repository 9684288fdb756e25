//! Wraps sentences for a terminal.

/// Wraps text to `columns` characters if words allow it; continuation lines are indented. Ends with a line end.
pub fn wrapped(text: &str, columns: usize, indent: usize) -> String {
    let mut lines = String::new();
    for line in text.lines() {
        // Keep the indentation of the text.
        let start = line.len() - line.trim_start().len();
        let mut length = start;
        lines.push_str(&line[..start]);
        for (index, word) in line.split_whitespace().enumerate() {
            let width = word.chars().count();
            if index > 0 && length + 1 + width > columns {
                lines.push('\n');
                lines.push_str(&" ".repeat(indent));
                length = indent;
            } else if index > 0 {
                lines.push(' ');
                length += 1;
            }
            lines.push_str(word);
            length += width;
        }
        lines.push('\n');
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_line_is_longer_and_no_word_is_lost() {
        let text = "  a sentence of some words that goes on and on until it is over";
        let lines = wrapped(text, 20, 4);
        assert!(lines.lines().all(|line| line.chars().count() <= 20), "{lines}");
        assert!(lines.starts_with("  a sentence") && lines.lines().nth(1).unwrap().starts_with("    "));
        assert_eq!(lines.split_whitespace().collect::<Vec<_>>(), text.split_whitespace().collect::<Vec<_>>());
        assert_eq!(wrapped("unbreakable", 4, 2), "unbreakable\n");
    }
}
