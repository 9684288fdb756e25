//! Wraps sentences for a terminal.

/// Wraps text to `columns` characters if words allow it; continuation lines are indented, and a number stays with its unit. Ends with a line
/// end.
pub fn wrapped(text: &str, columns: usize, indent: usize) -> String {
    let mut lines = String::new();
    for line in text.lines() {
        // Keep the indentation of the text.
        let start = line.len() - line.trim_start().len();
        let mut length = start;
        lines.push_str(&line[..start]);
        for (index, phrases) in with_their_units(line).into_iter().enumerate() {
            let word = phrases.join(" ");
            let width = word.chars().count();
            if index > 0 && length + 1 + width > columns {
                lines.push('\n');
                lines.push_str(&" ".repeat(indent));
                length = indent;
            } else if index > 0 {
                lines.push(' ');
                length += 1;
            }
            lines.push_str(&word);
            length += width;
        }
        lines.push('\n');
    }
    lines
}

/// Longest word that is taken for a unit.
const UNIT: usize = 8;

/// The words of a line, each number together with the unit behind it.
fn with_their_units(line: &str) -> Vec<Vec<&str>> {
    let mut groups: Vec<Vec<&str>> = Vec::new();
    for word in line.split_whitespace() {
        let is_number = |word: &str| word.parse::<f64>().is_ok();
        let belongs = |last: &&str| {
            if is_number(word) { *last == "+/-" } else { is_number(last) && word.len() <= UNIT }
        };
        match groups.last_mut().filter(|group| group.last().is_some_and(belongs)) {
            Some(group) => group.push(word),
            None => groups.push(vec![word]),
        }
    }
    groups
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
        assert_eq!(
            wrapped("it takes about 1 h 11 min or +/- 0.5 %", 17, 0),
            "it takes about\n1 h 11 min or\n+/- 0.5 %\n"
        );
    }
}
