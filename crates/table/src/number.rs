//! Numbers in the notations of logs.

use crate::units::header_unit;

/// Maximum length of a number's text, bytes. Bound: a double in full, with unit and blanks.
const MAX_NUMBER_BYTES: usize = 48;

/// Digits before the first thousands separator. Source: thousands.
const FIRST_GROUP_DIGITS: std::ops::RangeInclusive<usize> = 1..=3;

/// Minimum value that marks a missing reading. Source: instruments write 9.9e37 for an overload and 9.91e37 for no reading (SCPI-99,
/// section 7.2.1.4 and 7.2.1.5), others 1e30 or the largest number of single precision.
pub const NO_READING: f64 = 1e30;

/// The number in a cell; `None` for anything else, including words for infinity and not-a-number, and the
/// numbers with which instruments mark missing readings.
///
/// Blanks may follow the sign (`+   98.61`) and separate thousands (`60 000`), and a Fortran `D` may mark the exponent.
pub fn parse_number(cell: &[u8], decimal: u8) -> Option<f64> {
    let cell = cell.trim_ascii();
    let (negative, digits) = match cell.split_first()? {
        (b'-', rest) => (true, rest.trim_ascii_start()),
        (b'+', rest) => (false, rest.trim_ascii_start()),
        _ => match cell.strip_prefix("\u{2212}".as_bytes()) {
            Some(rest) => (true, rest.trim_ascii_start()),
            None => (false, cell),
        },
    };
    let value = parse_digits(digits, decimal)
        .or_else(|| parse_digits(without_blanks(digits, decimal)?.as_bytes(), decimal))?;
    Some(if negative { -value } else { value }).filter(|value| value.abs() < NO_READING)
}

/// Digits whose thousands blanks separate: `60 000`.
fn without_blanks(cell: &[u8], decimal: u8) -> Option<String> {
    let text = std::str::from_utf8(cell).ok().filter(|text| text.contains(char::is_whitespace))?;
    let whole = text.split(char::from(decimal)).next()?;
    let mut groups = whole.split(char::is_whitespace);
    let is_digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    let is_first =
        groups.next().is_some_and(|group| FIRST_GROUP_DIGITS.contains(&group.len()) && is_digits(group));
    let is_grouped = is_first && groups.all(|group| group.len() == 3 && is_digits(group));
    is_grouped.then(|| text.split_whitespace().collect())
}

/// A number without a sign.
fn parse_digits(cell: &[u8], decimal: u8) -> Option<f64> {
    let starts = cell.first()?;
    if !(starts.is_ascii_digit() || *starts == decimal) || cell.len() > MAX_NUMBER_BYTES {
        return None;
    }
    let plain = |bytes: &[u8]| {
        let text = std::str::from_utf8(bytes).ok()?;
        let value = text.parse::<f64>().ok().or_else(|| fortran(text))?;
        Some(value).filter(|value| value.is_finite())
    };
    if decimal == b'.' && !cell.contains(&b',') {
        return plain(cell);
    }
    // The other sign separates thousands.
    let thousands = if decimal == b',' { b'.' } else { b',' };
    let mut text = [0u8; MAX_NUMBER_BYTES];
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
        if *byte == decimal || matches!(byte, b'e' | b'E' | b'd' | b'D') {
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

/// A number whose exponent follows a `D`; without a decimal sign it may be a name such as `12D3`.
fn fortran(text: &str) -> Option<f64> {
    let (mantissa, exponent) = text.split_once(['d', 'D'])?;
    if !mantissa.contains('.') {
        return None;
    }
    format!("{mantissa}e{exponent}").parse().ok()
}

/// A number followed by its unit, as in `98.75 kPa`.
pub fn number_with_unit(cell: &str, decimal: u8) -> Option<(f64, &str)> {
    let cell = cell.trim();
    // `1/min` begins with a digit.
    let apart = cell.split_once(' ').filter(|(_, unit)| header_unit(unit.trim()).is_some());
    if let Some((number, unit)) = apart
        && let Some(number) = parse_number(number.as_bytes(), decimal)
    {
        return Some((number, unit.trim()));
    }
    let end = cell.rfind(|letter: char| letter.is_ascii_digit())? + 1;
    let (number, unit) = (cell.get(..end)?, cell.get(end..)?.trim());
    // `kg/cm2` and the like end in a digit.
    let (number, unit) = match unit {
        "" => number.split_once(' ').map(|(number, unit)| (number, unit.trim()))?,
        unit => (number, unit),
    };
    header_unit(unit)?;
    Some((parse_number(number.as_bytes(), decimal)?, unit))
}

/// The number in a cell, with or without a unit after it.
pub fn read_number(cell: &str, decimal: u8) -> Option<f64> {
    parse_number(cell.as_bytes(), decimal)
        .or_else(|| number_with_unit(cell, decimal).map(|(number, _)| number))
}

/// The number before a unit; NaN for anything else.
pub fn number_in(cell: &str, decimal: u8, unit: &str) -> f64 {
    number_with_unit(cell, decimal).filter(|(_, found)| *found == unit).map_or(f64::NAN, |(number, _)| number)
}

/// Whether the text before the first thousands separator is one to three digits of a number that is not 0.
fn starts_as_thousands(text: &[u8]) -> bool {
    FIRST_GROUP_DIGITS.contains(&text.len())
        && text.iter().all(u8::is_ascii_digit)
        && text.first() != Some(&b'0')
}

/// Whether a cell marks a missing value.
pub fn is_missing(cell: &[u8]) -> bool {
    std::str::from_utf8(cell).is_ok_and(is_missing_mark)
}

/// Words of data loggers, spreadsheets and meters for a missing value, in lower case.
const MARKS: &str = "nan na n/a n.a. #n/a #na #nv #div/0! #value! #wert! #ref! #bezug! #num! #zahl! #null! #name? null none inf +inf -inf \
    1.#qnan 1.#inf -1.#ind ol o.l. over ovld overload overflow overrange err error fault invalid open";

/// Whether a cell marks a missing value, by a word or by dashes or stars only.
pub fn is_missing_mark(cell: &str) -> bool {
    let cell = cell.trim();
    MARKS.split(' ').any(|mark| cell.eq_ignore_ascii_case(mark))
        || cell.chars().all(|c| matches!(c, '-' | '\u{2013}' | '\u{2014}' | '*'))
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
            ("+   98.61", b'.', Some(98.61)),
            ("- 0,25", b',', Some(-0.25)),
            ("60 000", b'.', Some(6e4)),
            ("-1 234 567,5", b',', Some(-1_234_567.5)),
            ("60 00", b'.', None),
            ("\u{2212}0.5", b'.', Some(-0.5)),
            ("9.860732D+01", b'.', Some(98.60732)),
            ("1,5d-2", b',', Some(0.015)),
            ("12D3", b'.', None),
            ("9.9e37", b'.', None),
            ("-9.91E+37", b'.', None),
            ("--5", b'.', None),
            ("12:30", b'.', None),
            ("", b'.', None),
        ] {
            assert_eq!(parse_number(text.as_bytes(), decimal), value, "{text}");
        }
    }

    #[test]
    fn a_unit_may_follow_the_number() {
        for (text, decimal, found) in [
            ("98.75 kPa", b'.', Some((98.75, "kPa"))),
            ("22,3°C", b',', Some((22.3, "°C"))),
            ("-3 %", b'.', Some((-3.0, "%"))),
            ("1.02 kgf/cm2", b'.', Some((1.02, "kgf/cm2"))),
            ("12 Nov", b'.', None),
            ("step 3", b'.', None),
            ("98.75", b'.', None),
        ] {
            assert_eq!(number_with_unit(text, decimal), found, "{text}");
        }
    }
}
