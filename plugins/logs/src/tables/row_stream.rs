//! Reads the lines of a delimited file one after the other.

use crate::notation::encoding::DecodingReader;
use crate::notation::table_row::{Cell, Cells, Rows};
use mapper_recording::logs::{LogError, LogFile, TextEncoding};
use std::cell;
use std::io::{self, Read};
use std::ops::Range;
use std::rc::Rc;

/// Maximum length of a line, bytes: an unclosed quote would otherwise extend to the end of the file.
const MAX_LINE_BYTES: usize = 1 << 20;

/// Notation of a delimited file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dialect {
    pub(crate) encoding: TextEncoding,
    /// Bytes of the byte order mark.
    pub(crate) mark: usize,
    pub(crate) separator: u8,
    pub(crate) decimal: u8,
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

/// The rows of a delimited file.
pub(crate) struct RowStream {
    file: LogFile,
    reader: csv::Reader<Box<dyn Read>>,
    left: Rc<cell::Cell<usize>>,
    dialect: Dialect,
    record: csv::ByteRecord,
    /// With blanks as separators, the cells that are not empty.
    filled: Vec<usize>,
}

impl RowStream {
    pub(crate) fn open(file: &LogFile, dialect: Dialect) -> Result<Self, LogError> {
        Ok(Self::over(file, Box::new(file.open()?), dialect))
    }

    /// The rows in a range of the file.
    pub(crate) fn over(file: &LogFile, mut bytes: Box<dyn Read>, dialect: Dialect) -> Self {
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
        RowStream {
            file: file.clone(),
            reader,
            left,
            dialect,
            record: csv::ByteRecord::new(),
            filled: Vec::new(),
        }
    }

    fn bytes(&self, column: usize) -> &[u8] {
        let at = if self.dialect.separator == b' ' { self.filled.get(column).copied() } else { Some(column) };
        at.and_then(|at| self.record.get(at)).unwrap_or_default()
    }

    /// Start and end of each cell of a row between blanks, bytes from the start of the line.
    pub(crate) fn spans(&self) -> Vec<Range<usize>> {
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

    /// The cells of the row as text.
    pub(crate) fn texts(&self) -> Vec<String> {
        let count = if self.dialect.separator == b' ' { self.filled.len() } else { self.record.len() };
        (0..count).map(|column| String::from_utf8_lossy(self.bytes(column)).trim().to_owned()).collect()
    }
}

impl Cells for RowStream {
    fn cell(&self, column: usize) -> Cell<'_> {
        Cell::Text(self.bytes(column))
    }

    fn decimal(&self) -> u8 {
        self.dialect.decimal
    }
}

impl Rows for RowStream {
    /// Skips rows without any cell.
    fn advance(&mut self) -> Result<bool, LogError> {
        loop {
            self.left.set(MAX_LINE_BYTES);
            let more = self.reader.read_byte_record(&mut self.record).map_err(|error| {
                self.file.read_error(match error.into_kind() {
                    csv::ErrorKind::Io(error) => error,
                    other => io::Error::other(format!("{other:?}")),
                })
            })?;
            if !more {
                return Ok(false);
            }
            if self.dialect.separator == b' ' {
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
}
