//! Cells that mark a missing value.

/// Words of data loggers, spreadsheets and meters for a missing value, in lower case.
const MARKS: &str = "nan na n/a n.a. #n/a #na #nv #div/0! #value! #wert! #ref! #bezug! #num! #zahl! #null! #name? null none inf +inf -inf \
    1.#qnan 1.#inf -1.#ind ol o.l. over ovld overload overflow overrange err error fault invalid open";

/// Whether a cell marks a missing value, by a word or by dashes or stars only.
pub fn is_missing_mark(cell: &str) -> bool {
    let cell = cell.trim();
    MARKS.split(' ').any(|mark| cell.eq_ignore_ascii_case(mark))
        || cell.chars().all(|c| matches!(c, '-' | '\u{2013}' | '\u{2014}' | '*'))
}
