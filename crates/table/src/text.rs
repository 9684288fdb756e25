//! Rows of a delimited text, and its separator and decimal sign.

use crate::encoding::{DecodingReader, TextEncoding};
use crate::instant::{DateOrder, parse_instant};
use crate::number::{is_missing, read_number};
use std::cell;
use std::io::{self, Cursor, Read};
use std::ops::Range;
use std::rc::Rc;

/// Maximum length of a line, bytes. Bound: an unclosed quote would otherwise extend to the end of the file.
const MAX_LINE_BYTES: usize = 1 << 20;

/// Notation of a delimited file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dialect {
    /// Encoding of the letters.
    pub encoding: TextEncoding,
    /// Bytes of the byte order mark.
    pub mark: usize,
    /// Byte between the cells; a blank stands for any number of blanks.
    pub separator: u8,
    /// Decimal sign of numbers.
    pub decimal: u8,
}

/// Counts bytes since the last complete line.
struct LineLimiter<R> {
    inner: R,
    left: Rc<cell::Cell<usize>>,
}

impl<R: Read> Read for LineLimiter<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        let left = self.left.get().checked_sub(count);
        self.left.set(left.ok_or_else(|| {
            io::Error::other("a line is longer than 1 MiB; look for a quote without an end")
        })?);
        Ok(count)
    }
}

/// The rows of a delimited text, one after the other; rows without any cell are skipped.
pub struct TextRows {
    reader: csv::Reader<Box<dyn Read>>,
    left: Rc<cell::Cell<usize>>,
    separator: u8,
    record: csv::ByteRecord,
    /// With blanks as separators, the cells that are not empty.
    filled: Vec<usize>,
}

impl TextRows {
    /// The rows of bytes that begin with the byte order mark of the dialect.
    pub fn new(mut bytes: Box<dyn Read>, dialect: Dialect) -> Self {
        let left = Rc::new(cell::Cell::new(MAX_LINE_BYTES));
        let mark = u64::try_from(dialect.mark).unwrap_or(0);
        // An error in the mark appears at the first line.
        drop(io::copy(&mut bytes.by_ref().take(mark), &mut io::sink()));
        let text: Box<dyn Read> = match dialect.encoding.is_utf8() {
            true => bytes,
            false => Box::new(DecodingReader::new(bytes, dialect.encoding.decoder())),
        };
        let limited: Box<dyn Read> = Box::new(LineLimiter { inner: text, left: left.clone() });
        let reader = csv::ReaderBuilder::new()
            .delimiter(dialect.separator)
            .has_headers(false)
            .flexible(true)
            .buffer_capacity(1 << 16)
            .from_reader(limited);
        let (record, filled) = (csv::ByteRecord::new(), Vec::new());
        TextRows { reader, left, separator: dialect.separator, record, filled }
    }

    /// Advances to the next row with a cell; `false` after the last one.
    ///
    /// # Errors
    /// An error of the file, and a line that is too long.
    pub fn advance(&mut self) -> io::Result<bool> {
        loop {
            self.left.set(MAX_LINE_BYTES);
            let more =
                self.reader.read_byte_record(&mut self.record).map_err(|error| match error.into_kind() {
                    csv::ErrorKind::Io(error) => error,
                    other => io::Error::other(format!("{other:?}")),
                })?;
            if !more {
                return Ok(false);
            }
            if self.separator == b' ' {
                self.filled.clear();
                let record = &self.record;
                self.filled.extend(
                    (0..record.len()).filter(|at| record.get(*at).is_some_and(|cell| !cell.is_empty())),
                );
            }
            if self.record.iter().any(|cell| !cell.trim_ascii().is_empty()) {
                return Ok(true);
            }
        }
    }

    /// The bytes of a cell of the row; empty after the last cell.
    #[inline]
    pub fn bytes(&self, column: usize) -> &[u8] {
        let at = if self.separator == b' ' { self.filled.get(column).copied() } else { Some(column) };
        at.and_then(|at| self.record.get(at)).unwrap_or_default()
    }

    /// The cells of the row as text.
    pub fn texts(&self) -> Vec<String> {
        let count = if self.separator == b' ' { self.filled.len() } else { self.record.len() };
        (0..count).map(|column| String::from_utf8_lossy(self.bytes(column)).trim().to_owned()).collect()
    }

    /// The cells of the row as text. Between blanks, names of several words above `width` columns are joined.
    pub fn texts_below(&self, width: Option<usize>) -> Vec<String> {
        let texts = self.texts();
        width.map_or(texts.clone(), |width| joined_names(texts, &self.spans(), width))
    }

    /// Line of the row, from 1, in a text whose lines end in a line feed.
    pub fn line(&self) -> usize {
        let inside = self.record.as_slice().iter().filter(|byte| **byte == b'\n').count();
        (self.reader.position().line() as usize).saturating_sub(1 + inside).max(1)
    }

    /// Start and end of each cell of a row between blanks, bytes from the start of the line.
    fn spans(&self) -> Vec<Range<usize>> {
        let mut start = 0;
        let mut spans = Vec::new();
        for cell in &self.record {
            if !cell.is_empty() {
                spans.push(start..start + cell.len());
            }
            start += cell.len() + 1;
        }
        spans
    }
}

/// The separator of a text and its first rows, at most `max_rows`; `None` for text without a table of numbers.
///
/// # Errors
/// A line that is too long.
pub fn detect_text(
    head: &[u8],
    (encoding, mark): (TextEncoding, usize),
    given: Option<u8>,
    (max_rows, is_whole): (usize, bool),
) -> io::Result<Option<(u8, Vec<Vec<String>>)>> {
    let rows_by = |separator: u8| -> io::Result<Vec<Vec<String>>> {
        let dialect = Dialect { encoding, mark, separator, decimal: b'.' };
        let mut text = TextRows::new(Box::new(Cursor::new(head.to_vec())), dialect);
        let (mut rows, mut spans) = (Vec::new(), Vec::new());
        while rows.len() < max_rows && text.advance()? {
            rows.push(text.texts());
            spans.push(text.spans());
        }
        // The last line of the sample may be truncated.
        if !is_whole && rows.len() < max_rows && rows.len() > 1 {
            rows.pop();
        }
        if separator == b' ' {
            let width = typical_length(&rows);
            rows = rows.into_iter().zip(&spans).map(|(row, spans)| joined_names(row, spans, width)).collect();
        }
        Ok(rows)
    };
    let mut best: Option<(f64, u8, Vec<Vec<String>>)> = None;
    for separator in given.map_or(SEPARATORS.to_vec(), |separator| vec![separator]) {
        let rows = rows_by(separator)?;
        let score = score(&rows, separator);
        if best.as_ref().is_none_or(|(other, ..)| score > *other) {
            best = Some((score, separator, rows));
        }
    }
    Ok(best.filter(|(score, ..)| *score > 0.0).map(|(_, separator, rows)| (separator, rows)))
}

/// Joins names of several words above columns between blanks: single blanks are within a name, and a unit in brackets belongs to the name
/// before it. If there are not as many names as columns, the assignment is unknown and the row is text.
fn joined_names(row: Vec<String>, spans: &[Range<usize>], width: usize) -> Vec<String> {
    let (row, spans) = with_closed_brackets(row, spans, width);
    let is_word = |cell: &String| cell.chars().any(char::is_alphabetic) && cell.parse::<f64>().is_err();
    if width == 0
        || row.len() <= width
        || !row.iter().all(|cell| is_word(cell) || cell.starts_with(['[', '(']))
    {
        return row;
    }
    let join = |is_joined: &dyn Fn(&str, bool) -> bool| {
        let mut names: Vec<String> = Vec::new();
        let mut end = None;
        for (word, span) in row.iter().zip(&spans) {
            let is_next = end.is_some_and(|end: usize| end + 1 == span.start);
            match names.last_mut().filter(|_| is_joined(word, is_next)) {
                Some(name) => *name = format!("{name} {word}"),
                None => names.push(word.clone()),
            }
            end = Some(span.end);
        }
        (names.len() == width).then_some(names)
    };
    let by_bracket = join(&|word, _| word.starts_with(['[', '(']));
    by_bracket.or_else(|| join(&|_, is_next| is_next)).unwrap_or_else(|| vec![row.join(" ")])
}

/// The cells with those in one bracket joined, if there are more than columns: `[deg C]`.
fn with_closed_brackets(
    row: Vec<String>,
    spans: &[Range<usize>],
    width: usize,
) -> (Vec<String>, Vec<Range<usize>>) {
    let count = |cell: &str, marks: [char; 2]| cell.matches(marks).count();
    let is_open = |cell: &String| count(cell, ['[', '(']) > count(cell, [']', ')']);
    if row.len() <= width || !row.iter().any(is_open) {
        return (row, spans.to_vec());
    }
    let (mut cells, mut places): (Vec<String>, Vec<Range<usize>>) = (Vec::new(), Vec::new());
    for (cell, span) in row.into_iter().zip(spans) {
        match (cells.last_mut().filter(|last| is_open(last)), places.last_mut()) {
            (Some(last), Some(place)) => {
                *last = format!("{last} {cell}");
                place.end = span.end;
            }
            _ => {
                cells.push(cell);
                places.push(span.clone());
            }
        }
    }
    (cells, places)
}

/// Candidate separators, in order of preference for equal scores.
pub const SEPARATORS: [u8; 5] = [b'\t', b';', b',', b'|', b' '];

/// Score of rows as a table: cells with numbers or times in a typical row, times the share of rows of that length.
fn score(rows: &[Vec<String>], separator: u8) -> f64 {
    let length = typical_length(rows);
    if length == 0 || rows.is_empty() {
        return 0.0;
    }
    let fitting: Vec<&Vec<String>> = rows.iter().filter(|row| row.len() == length).collect();
    let useful = |row: &Vec<String>| row.iter().filter(|cell| is_value(cell, separator)).count() as f64;
    let mut counts: Vec<f64> = fitting.iter().map(|row| useful(row)).collect();
    counts.sort_by(f64::total_cmp);
    let typical = counts.get(counts.len() / 2).copied().unwrap_or(0.0);
    let share = fitting.len() as f64 / rows.len() as f64;
    typical * (typical / length as f64) * share * share
}

/// The most frequent number of cells in a row.
pub fn typical_length(rows: &[Vec<String>]) -> usize {
    let mut lengths: Vec<usize> = rows.iter().map(Vec::len).collect();
    lengths.sort_unstable();
    lengths.chunk_by(|a, b| a == b).max_by_key(|same| (same.len(), same[0])).map_or(0, |same| same[0])
}

fn is_value(cell: &str, separator: u8) -> bool {
    let bytes = cell.as_bytes();
    read_number(cell, b'.').is_some()
        || separator != b',' && read_number(cell, b',').is_some()
        || is_missing(bytes) && !cell.is_empty()
        || parse_instant(cell, DateOrder::DayFirst).is_some()
        || parse_instant(cell, DateOrder::MonthFirst).is_some()
}

/// The decimal sign of the cells; the second value is whether any cell contains it.
pub fn decimal_sign(rows: &[Vec<String>]) -> (u8, bool) {
    let (mut points, mut commas) = (0usize, 0usize);
    for cell in rows.iter().flatten() {
        let (point, comma) = (cell.rfind('.'), cell.rfind(','));
        match (point, comma) {
            (Some(point), Some(comma)) if comma > point => {
                commas += 100 * usize::from(read_number(cell, b',').is_some())
            }
            (Some(_), Some(_)) => points += 100 * usize::from(read_number(cell, b'.').is_some()),
            (Some(_), None) => points += usize::from(read_number(cell, b'.').is_some()),
            (None, Some(_)) => commas += usize::from(read_number(cell, b',').is_some()),
            (None, None) => {}
        }
    }
    if commas <= points { (b'.', points > 0) } else { (b',', true) }
}
