//! CSV and similar formats: cells with a separator between them.

use crate::clock::HEAD_ROWS;
use crate::tables::long_table::{LongForm, LongRows};
use crate::tables::table_log::{Origin, Table};
use crate::tables::table_row::RowStream;
use mapper_recording::logs::{
    Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, RowSink, SampleColumn, SampleTable,
};
use mapper_table::{Dialect, SEPARATORS, TextEncoding, decimal_sign, detect_text};
use std::io;

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: Some(("csv", write)) };

const NAME: &str = "CSV";

/// A table with its headings in the first row, separated by commas; an empty cell where there is no value.
fn write(table: &SampleTable) -> io::Result<Vec<u8>> {
    let mut text = csv::Writer::from_writer(Vec::new());
    let headings = table.columns.iter().map(SampleColumn::heading);
    text.write_record(std::iter::once(SampleTable::TIME.to_owned()).chain(headings))?;
    let mut cells = Vec::with_capacity(table.columns.len() + 1);
    for (row, t_s) in table.times_s.iter().enumerate() {
        cells.clear();
        cells.push(t_s.to_string());
        cells.extend(table.columns.iter().map(|column| {
            let value = column.values.get(row).filter(|value| value.is_finite());
            value.map_or_else(String::new, f64::to_string)
        }));
        text.write_record(&cells)?;
    }
    text.into_inner().map_err(|error| error.into_error())
}

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
    long: Option<LongForm>,
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options.refuse_keys(&["sheet"]).map_err(|why| file.content_error(NAME, why))?;
    let head = file.head(HEAD_BYTES)?;
    let (found, mark) = TextEncoding::guess(&head);
    let encoding = options.encoding.unwrap_or(found);
    let given = options.separator.and_then(|separator| u8::try_from(separator).ok());
    let found = detect_text(&head, (encoding, mark), given, (HEAD_ROWS, head.len() < HEAD_BYTES));
    let found = found.map_err(|error| file.read_error(error))?;
    let Some((separator, rows)) = found else {
        return Err(file.content_error(
            NAME,
            match head.trim_ascii_start().first() {
                Some(b'{') => "it is JSON; write its values as CSV, e.g. with `pandas.read_json(FILE, lines=True).to_csv(NEW)`",
                Some(b'<') => "it is XML, but not ATFX; export it as CSV",
                _ => "it is text without a table of numbers",
            },
        ));
    };
    let (found_decimal, is_seen) = decimal_sign(&rows);
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
