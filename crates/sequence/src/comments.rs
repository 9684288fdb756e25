//! Finds comments that are never closed. The language treats the rest of the script as a comment, so that steps would be lost.

use rhai::Position;

/// Start of a block comment that does not end.
pub(crate) fn find_unclosed_comment(text: &str) -> Option<Position> {
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let rest = bytes.get(at..)?;
        at = match rest {
            [b'/', b'/', ..] => at + length_until(rest, b"\n"),
            [b'/', b'*', ..] => match block_length(rest) {
                Some(length) => at + length,
                None => return Some(position(text, at)),
            },
            [b'"', ..] => at + quoted_length(rest, b'"'),
            [b'\'', ..] => at + quoted_length(rest, b'\''),
            [b'`', ..] => at + 1 + length_until(rest.get(1..)?, b"`"),
            [b'#', ..] => at + raw_length(rest),
            _ => at + 1,
        };
    }
    None
}

/// Number of bytes up to the end of a mark; all bytes if there is no mark.
fn length_until(text: &[u8], mark: &[u8]) -> usize {
    text.windows(mark.len()).position(|window| window == mark).map_or(text.len(), |found| found + mark.len())
}

/// Number of bytes of a block comment, which may contain others; `None` if it does not end.
fn block_length(text: &[u8]) -> Option<usize> {
    let (mut depth, mut at) = (0usize, 0);
    while at + 1 < text.len() {
        match text.get(at..at + 2)? {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

/// Number of bytes of a text in quotes; a backslash escapes the next character.
fn quoted_length(text: &[u8], quote: u8) -> usize {
    let mut at = 1;
    while let Some(byte) = text.get(at) {
        match byte {
            b'\\' => at += 2,
            byte if *byte == quote => return at + 1,
            _ => at += 1,
        }
    }
    text.len()
}

/// Number of bytes of a raw text such as `#"..."#`; 1 for any other `#`.
fn raw_length(text: &[u8]) -> usize {
    let hashes = text.iter().take_while(|byte| **byte == b'#').count();
    if text.get(hashes) != Some(&b'"') {
        return 1;
    }
    let end = [b"\"".as_slice(), &text[..hashes]].concat();
    hashes + 1 + length_until(text.get(hashes + 1..).unwrap_or_default(), &end)
}

fn position(text: &str, at: usize) -> Position {
    let before = text.get(..at).unwrap_or_default();
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
    match (u16::try_from(line), u16::try_from(column)) {
        (Ok(line), Ok(column)) => Position::new(line, column),
        _ => Position::NONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_that_does_not_end_is_found() {
        for (text, at) in [
            ("jump(1);\n/* jump(2);\njump(3);", Some((2, 1))),
            ("a();  /* one /* two */ still open", Some((1, 7))),
            ("/* a */ b(); // /* c", None),
            ("x(\"/* no comment\"); y('/'); z(`/* ${1}`);", None),
            ("x(\"\\\"/*\");", None),
            ("x(#\"/* \"#); /* one */", None),
            ("/*/", Some((1, 1))),
            ("let m = #{a: 1};", None),
        ] {
            let expected = at.map(|(line, column)| Position::new(line, column));
            assert_eq!(find_unclosed_comment(text), expected, "{text}");
        }
    }
}
