//! Encodings of text files; rows of a delimited text, its separator and decimal sign.

use crate::column_name::is_known_word;
use crate::instant::{DateOrder, parse_instant};
use crate::number::{is_missing, read_number};
use encoding_rs::{
    Decoder, Encoding, GB18030, SHIFT_JIS, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1250, WINDOWS_1251,
    WINDOWS_1252,
};
use std::cell;
use std::io::{self, Cursor, Read};
use std::ops::Range;
use std::rc::Rc;

/// The encoding of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TextEncoding(&'static Encoding);

/// Maximum number of evaluated bytes. Bound: effort.
const MAX_SAMPLE_BYTES: usize = 1 << 16;
/// Maximum number of evaluated lines with letters outside ASCII. Bound: effort; some ten words identify an encoding.
const MAX_LINES: usize = 200;

impl TextEncoding {
    /// UTF-8.
    pub const UTF_8: TextEncoding = TextEncoding(UTF_8);

    /// The encoding of a file that starts with these bytes, and the length of its byte order mark.
    pub fn guess(head: &[u8]) -> (TextEncoding, usize) {
        let marked = Encoding::for_bom(head);
        let (encoding, mark) = marked.unwrap_or_else(|| match std::str::from_utf8(head) {
            _ if looks_like_utf16(head, 1) => (UTF_16LE, 0),
            _ if looks_like_utf16(head, 0) => (UTF_16BE, 0),
            Err(error) if error.error_len().is_some() => (guess_before_utf8(head), 0),
            // UTF-8, possibly truncated in the middle of a character.
            _ => (UTF_8, 0),
        });
        (TextEncoding(encoding), mark)
    }

    /// The encoding of a name such as `latin-1`, `gbk` or `cp1251`.
    pub fn of_name(name: &str) -> Option<TextEncoding> {
        let name = name.to_ascii_lowercase().replace("latin-1", "latin1");
        Encoding::for_label_no_replacement(name.as_bytes()).map(TextEncoding)
    }

    /// Name.
    pub fn name(self) -> &'static str {
        if self.0 == WINDOWS_1252 { "Latin-1" } else { self.0.name() }
    }

    /// Whether the encoding is a form of UTF-16.
    pub fn is_utf16(self) -> bool {
        [UTF_16LE, UTF_16BE].contains(&self.0)
    }

    /// The text of bytes without a byte order mark.
    pub fn decode(self, bytes: &[u8]) -> String {
        self.0.decode_without_bom_handling(bytes).0.into_owned()
    }

    /// Decodes piece by piece.
    pub fn decoder(self) -> Decoder {
        self.0.new_decoder_without_bom_handling()
    }
}

/// Whether the bytes are UTF-16 without a byte order mark: in most letters only the high byte (at offset `high`) is 0.
fn looks_like_utf16(head: &[u8], high: usize) -> bool {
    let pairs = head.len() / 2;
    let latin = head.chunks_exact(2).filter(|pair| pair[high] == 0 && pair[1 - high] != 0).count();
    pairs >= 8 && latin * 10 >= pairs * 9
}

/// The encoding in which most words outside ASCII are known in names of quantities; Windows-1252, of which Latin-1 is a part, if none is.
fn guess_before_utf8(bytes: &[u8]) -> &'static Encoding {
    let sample = bytes.get(..MAX_SAMPLE_BYTES).unwrap_or(bytes);
    let lines = sample.split(|byte| *byte == b'\n').filter(|line| !line.is_ascii()).take(MAX_LINES);
    let lines: Vec<&[u8]> = lines.collect();
    let known_words = |encoding: &'static Encoding| {
        let count = |line: &&[u8]| {
            let (text, _) = encoding.decode_without_bom_handling(line);
            let words = text.split(|c: char| !c.is_alphabetic());
            words.filter(|word| !word.is_ascii() && is_known_word(word)).count()
        };
        lines.iter().map(count).sum::<usize>()
    };
    // Of equal counts, `max_by_key` returns the last.
    let all = [WINDOWS_1250, WINDOWS_1251, SHIFT_JIS, GB18030, WINDOWS_1252];
    all.into_iter().max_by_key(|encoding| known_words(encoding)).unwrap_or(WINDOWS_1252)
}

/// Converts text to UTF-8.
pub struct DecodingReader<R> {
    inner: R,
    decoder: Decoder,
    decoded: io::Cursor<String>,
    is_finished: bool,
}

impl<R: Read> DecodingReader<R> {
    /// The text of a reader of bytes, decoded piece by piece.
    pub fn new(inner: R, decoder: Decoder) -> Self {
        DecodingReader { inner, decoder, decoded: io::Cursor::default(), is_finished: false }
    }
}

impl<R: Read> Read for DecodingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.decoded.read(buffer)?;
            if count > 0 || self.is_finished || buffer.is_empty() {
                return Ok(count);
            }
            let mut block = [0u8; 8192];
            let count = self.inner.read(&mut block)?;
            self.is_finished = count == 0;
            let mut text = String::with_capacity(self.decoder.max_utf8_buffer_length(count).unwrap_or(0));
            let _ = self.decoder.decode_to_string(&block[..count], &mut text, self.is_finished);
            self.decoded = io::Cursor::new(text);
        }
    }
}

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
        let text: Box<dyn Read> = match dialect.encoding.0 == UTF_8 {
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
    let mut best: Option<([f64; 2], u8, Vec<Vec<String>>)> = None;
    for separator in given.map_or(SEPARATORS.to_vec(), |separator| vec![separator]) {
        let rows = rows_by(separator)?;
        let score = score(&rows, separator);
        if best.as_ref().is_none_or(|(other, ..)| score > *other) {
            best = Some((score, separator, rows));
        }
    }
    Ok(best.filter(|(score, ..)| *score > [0.0; 2]).map(|(_, separator, rows)| (separator, rows)))
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

/// Score of rows as a table: cells with numbers or times in a typical row, times the share of rows of that length; and the same of the fullest
/// row, for tables with more rows of headings than of numbers.
fn score(rows: &[Vec<String>], separator: u8) -> [f64; 2] {
    let length = typical_length(rows);
    if length == 0 || rows.is_empty() {
        return [0.0; 2];
    }
    let fitting: Vec<&Vec<String>> = rows.iter().filter(|row| row.len() == length).collect();
    let useful = |row: &Vec<String>| row.iter().filter(|cell| is_value(cell, separator)).count() as f64;
    let mut counts: Vec<f64> = fitting.iter().map(|row| useful(row)).collect();
    counts.sort_by(f64::total_cmp);
    let share = fitting.len() as f64 / rows.len() as f64;
    [counts.get(counts.len() / 2), counts.last()].map(|count| {
        let count = count.copied().unwrap_or(0.0);
        count * (count / length as f64) * share * share
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_quantities_show_the_encoding() {
        for (encoding, text) in [
            (GB18030, "时间,转速(r/min),流量(kg/s)\n1,60000,0.05\n"),
            (WINDOWS_1251, "Время;Давление;Температура\n1;100;20\n"),
            (SHIFT_JIS, "時間,回転数,圧力比\n"),
            (WINDOWS_1252, "Zeit;Öltemperatur [°C];Massenstrom\n1;90;2\n"),
            (WINDOWS_1252, "time;T2 [°C];p2 [mbar]\n"),
            (UTF_8, "time;T2 [°C];p2 [mbar]\n"),
        ] {
            let (bytes, _, _) = encoding.encode(text);
            let (found, mark) = TextEncoding::guess(&bytes);
            assert_eq!((found, mark), (TextEncoding(encoding), 0), "{text}");
            assert_eq!(found.decode(&bytes), text);
        }
        assert_eq!(TextEncoding::guess(b"\xEF\xBB\xBFT2"), (TextEncoding(UTF_8), 3));
        let utf16: Vec<u8> = "time;T2 [°C]".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(TextEncoding::guess(&utf16), (TextEncoding(UTF_16LE), 0));
        assert_eq!(TextEncoding::guess(&utf16[1..]).0, TextEncoding(UTF_16BE));
        assert_eq!(TextEncoding::of_name("gbk").map(TextEncoding::name), Some("GBK"));
        assert_eq!(TextEncoding::of_name("Latin-1").map(TextEncoding::name), Some("Latin-1"));
        assert_eq!(TextEncoding::of_name("morse"), None);
    }

    #[test]
    fn any_encoding_becomes_the_same_text() {
        let text = "T2 [°C];Drehzahl ATL 𝄞\n".repeat(1500);
        let wide = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
        for (bytes, encoding) in [
            (wide(u16::to_le_bytes), encoding_rs::UTF_16LE),
            (wide(u16::to_be_bytes), encoding_rs::UTF_16BE),
            (encoding_rs::GB18030.encode(&text).0.into_owned(), encoding_rs::GB18030),
        ] {
            let mut read = String::new();
            let decoder = encoding.new_decoder_without_bom_handling();
            DecodingReader::new(bytes.as_slice(), decoder).read_to_string(&mut read).unwrap();
            assert!(read == text);
        }
    }
}
