//! Numbers in the notations of logs.

/// Maximum length of a number's text, bytes.
const LIMIT: usize = 48;

/// Digits before the first thousands separator.
const FIRST_GROUP: std::ops::RangeInclusive<usize> = 1..=3;

/// The number in a cell; `None` for anything else, including words for infinity and not-a-number.
pub(crate) fn parse_number(cell: &[u8], decimal: u8) -> Option<f64> {
    let cell = cell.trim_ascii();
    let starts = cell.iter().find(|byte| !matches!(byte, b'+' | b'-'))?;
    if !(starts.is_ascii_digit() || *starts == decimal) || cell.len() > LIMIT {
        return None;
    }
    let plain =
        |bytes: &[u8]| std::str::from_utf8(bytes).ok()?.parse::<f64>().ok().filter(|value| value.is_finite());
    if decimal == b'.' && !cell.contains(&b',') {
        return plain(cell);
    }
    // The other of the two separates thousands.
    let thousands = if decimal == b',' { b'.' } else { b',' };
    let mut text = [0u8; LIMIT];
    let mut length = 0;
    let mut digits_in_group = None;
    let mut fraction = false;
    for byte in cell {
        if *byte == thousands {
            let well_placed = match digits_in_group {
                Some(count) => count == 3,
                // In `0.100` or `1234.567` the sign is a decimal sign.
                None => starts_as_thousands(text.get(..length)?),
            };
            if fraction || !well_placed {
                return None;
            }
            digits_in_group = Some(0);
            continue;
        }
        if *byte == decimal || matches!(byte, b'e' | b'E') {
            fraction = true;
        } else if let Some(count) = digits_in_group.as_mut().filter(|_| !fraction) {
            *count += 1;
        }
        *text.get_mut(length)? = if *byte == decimal { b'.' } else { *byte };
        length += 1;
    }
    if digits_in_group.is_some_and(|count| count != 3) {
        return None;
    }
    plain(text.get(..length)?)
}

/// Whether the text before the first thousands separator is one to three digits of a number that is not 0.
fn starts_as_thousands(text: &[u8]) -> bool {
    let digits = text.strip_prefix(b"-").or_else(|| text.strip_prefix(b"+")).unwrap_or(text);
    FIRST_GROUP.contains(&digits.len())
        && digits.iter().all(u8::is_ascii_digit)
        && digits.first() != Some(&b'0')
}

/// Whether a cell marks a missing value.
pub(crate) fn is_missing(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    let words: [&[u8]; 14] = [
        b"", b"-", b"--", b"---", b"nan", b"na", b"n/a", b"#n/a", b"#nv", b"null", b"none", b"inf", b"-inf",
        b"1.#qnan",
    ];
    words.iter().any(|word| cell.eq_ignore_ascii_case(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_with_either_decimal_sign() {
        for (text, decimal, value) in [
            ("1.5", b'.', Some(1.5)),
            (" -3e-4 ", b'.', Some(-3e-4)),
            ("+0,25", b',', Some(0.25)),
            (",5", b',', Some(0.5)),
            ("1.234.567,8", b',', Some(1_234_567.8)),
            ("12,345.6", b'.', Some(12_345.6)),
            ("-1.234", b',', Some(-1234.0)),
            ("0.100", b',', None),
            ("-0.100", b',', None),
            ("1234.567", b',', None),
            ("1234,567", b'.', None),
            ("01.234", b',', None),
            ("1.23", b',', None),
            ("1,2,3", b',', None),
            ("nan", b'.', None),
            ("inf", b'.', None),
            ("1e999", b'.', None),
            ("12:30", b'.', None),
            ("", b'.', None),
        ] {
            assert_eq!(parse_number(text.as_bytes(), decimal), value, "{text}");
        }
    }
}
