//! CSV and similar formats: cells with a separator between them.

use crate::columns::sample::HEAD_ROWS;
use crate::notation::separator::{SEPARATORS, decimal, score, typical_length};
use crate::notation::table_row::Rows;
use crate::tables::long_table::{LongForm, LongRows};
use crate::tables::row_stream::{Dialect, RowStream};
use crate::tables::table_log::{Origin, Table};
use mapper_recording::logs::{
    Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, RowSink, TextEncoding,
};
use std::io::Cursor;
use std::ops::Range;

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open };

const NAME: &str = "CSV";

/// Size of the sample of a file, bytes.
const HEAD_BYTES: usize = 1 << 18;

/// Text without control characters that has a separator or a line end.
fn recognises(head: &[u8]) -> bool {
    let (encoding, _) = TextEncoding::guess(head);
    let control =
        head.iter().filter(|byte| **byte < 0x20 && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0C)).count();
    encoding.is_utf16()
        || !head.is_empty()
            && control == 0
            && head.iter().any(|byte| SEPARATORS.contains(byte) || *byte == b'\n')
}

struct Delimited {
    file: LogFile,
    dialect: Dialect,
    table: Table,
    /// Set if the table is in long form.
    long: Option<LongForm>,
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options.refuse_keys(&["sheet"]).map_err(|why| file.content_error(NAME, why))?;
    let head = file.head(HEAD_BYTES)?;
    let (found, mark) = TextEncoding::guess(&head);
    let encoding = options.encoding.unwrap_or(found);
    let is_whole_file = head.len() < HEAD_BYTES;
    let rows_by = |separator: u8| -> Result<Vec<Vec<String>>, LogError> {
        let dialect = Dialect { encoding, mark, separator, decimal: b'.' };
        let mut stream = RowStream::over(file, Box::new(Cursor::new(head.clone())), dialect);
        let (mut rows, mut spans) = (Vec::new(), Vec::new());
        while rows.len() < HEAD_ROWS && stream.advance()? {
            rows.push(stream.texts());
            spans.push(stream.spans());
        }
        // The last line of the sample may be truncated.
        if !is_whole_file && rows.len() < HEAD_ROWS && rows.len() > 1 {
            rows.pop();
        }
        if separator == b' ' {
            join_names(&mut rows, &spans);
        }
        Ok(rows)
    };
    let given = options.separator.and_then(|separator| u8::try_from(separator).ok());
    let mut best: Option<(f64, u8, Vec<Vec<String>>)> = None;
    for separator in given.map_or(SEPARATORS.to_vec(), |separator| vec![separator]) {
        let rows = rows_by(separator)?;
        let score = score(&rows, separator);
        if best.as_ref().is_none_or(|(other, ..)| score > *other) {
            best = Some((score, separator, rows));
        }
    }
    let Some((_, separator, rows)) = best.filter(|(score, ..)| *score > 0.0) else {
        return Err(file.content_error(
            NAME,
            match head.trim_ascii_start().first() {
                Some(b'{') => "it is JSON; write its values as CSV, e.g. with `pandas.read_json(FILE, lines=True).to_csv(NEW)`",
                Some(b'<') => "it is XML, but not ATFX; export it as CSV",
                _ => "it is text without a table of numbers",
            },
        ));
    };
    let (found_decimal, is_seen) = decimal(&rows);
    let decimal = options.decimal.and_then(|sign| u8::try_from(sign).ok()).unwrap_or(found_decimal);
    let mut table = Table::analyse(&rows, decimal, options, Origin::Rows)
        .map_err(|message| file.content_error(NAME, message))?;
    let long = LongForm::find(&rows, &table, decimal);
    if let Some(form) = &long {
        // The wide table has its header in the first row.
        let gathered = LogOptions { names_row: None, units_row: None, data_row: None, ..options.clone() };
        table = Table::analyse(&form.wide(&rows), decimal, &gathered, Origin::Rows)
            .map_err(|message| file.content_error(NAME, message))?;
        table.layout.findings.insert(0, form.finding(&rows));
    }
    let dialect = Dialect { encoding, mark, separator, decimal };
    let found = LogFinding::Dialect {
        separator: char::from(separator),
        decimal: char::from(decimal),
        is_decimal_assumed: !is_seen && options.decimal.is_none(),
        encoding: encoding.name().to_owned(),
    };
    table.layout.findings.insert(0, found);
    Ok(Box::new(Delimited { file: file.clone(), dialect, table, long }))
}

/// Joins names of several words above columns between blanks: single blanks are within a name. If there are not as many names as columns,
/// the assignment is unknown and the row is text.
fn join_names(rows: &mut [Vec<String>], spans: &[Vec<Range<usize>>]) {
    let length = typical_length(rows);
    for (row, spans) in rows.iter_mut().zip(spans) {
        let is_word = |cell: &String| cell.chars().any(char::is_alphabetic) && cell.parse::<f64>().is_err();
        if length == 0 || row.len() <= length || !row.iter().all(is_word) {
            continue;
        }
        let mut names: Vec<String> = Vec::new();
        let mut end = None;
        for (word, span) in row.iter().zip(spans) {
            match names.last_mut().filter(|_| end.is_some_and(|end: usize| end + 1 == span.start)) {
                Some(name) => *name = format!("{name} {word}"),
                None => names.push(word.clone()),
            }
            end = Some(span.end);
        }
        *row = if names.len() == length { names } else { vec![row.join(" ")] };
    }
}

impl Log for Delimited {
    fn layout(&self) -> &Layout {
        &self.table.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let mut stream = RowStream::open(&self.file, self.dialect)?;
        let remark = match &self.long {
            None => self.table.rows(&mut stream, wanted, sink)?,
            Some(form) => {
                let mut rows = LongRows::new(stream, form.clone(), self.dialect.decimal);
                self.table.rows(&mut rows, wanted, sink)?
            }
        };
        self.table.layout.add_finding(remark);
        Ok(())
    }
}
