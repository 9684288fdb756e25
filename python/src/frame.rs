//! The log format in which the package hands a DataFrame over: a line of text, a line of JSON, and the values of each row as 64-bit floats in
//! this computer's order of bytes, the time, s, first.

use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::{
    Column, Group, Layout, Log, LogError, LogFile, LogFormat, LogFormats, LogOptions, Row, RowSink,
};
use serde_json::Value;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::sync::LazyLock;

const NAME: &str = "DataFrame";
const MAGIC: &[u8] = b"mapper DataFrame\n";
const VALUE_BYTES: usize = 8;
/// Largest header, bytes: some hundred names of columns.
const HEADER_LIMIT: u64 = 1 << 20;
const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open };

/// All log formats, DataFrames included.
pub fn log_formats() -> LogFormats {
    static ALL: LazyLock<Vec<LogFormat>> =
        LazyLock::new(|| std::iter::once(FORMAT).chain(LOG_FORMATS.0.iter().copied()).collect());
    LogFormats(&ALL)
}

fn recognises(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

struct Frame {
    file: LogFile,
    layout: Layout,
}

/// The file behind its header, and the header.
fn opened(file: &LogFile) -> Result<(impl Read, Value), LogError> {
    let mut reader = BufReader::new(file.open()?);
    let failed = |error| file.error(error);
    reader.read_exact(&mut [0; MAGIC.len()]).map_err(failed)?;
    let mut header = String::new();
    reader.by_ref().take(HEADER_LIMIT).read_line(&mut header).map_err(failed)?;
    let header = serde_json::from_str(&header).map_err(|error| file.content(NAME, error.to_string()))?;
    Ok((reader, header))
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options.only(&[]).map_err(|why| file.content(NAME, why))?;
    let (_, header) = opened(file)?;
    let names = header["columns"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let column = |name: &str| Column { name: name.to_owned(), header: name.to_owned(), ..Column::default() };
    let layout = Layout {
        groups: vec![Group { name: String::new(), clock: "the time of the rows".to_owned() }],
        columns: names.map(column).collect(),
        findings: Vec::new(),
        start_time_ns: header["start_time_ns"].as_u64(),
    };
    Ok(Box::new(Frame { file: file.clone(), layout }))
}

impl Log for Frame {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let (mut reader, _) = opened(&self.file)?;
        let mut bytes = vec![0; VALUE_BYTES * (1 + self.layout.columns.len())];
        let mut values = vec![f64::NAN; wanted.len()];
        loop {
            match reader.read_exact(&mut bytes) {
                Ok(()) => {}
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(()),
                Err(error) => return Err(self.file.error(error)),
            }
            let value = |column: usize| {
                let cell = bytes.get(VALUE_BYTES * column..)?.first_chunk::<VALUE_BYTES>()?;
                Some(f64::from_ne_bytes(*cell)).filter(|value| value.is_finite())
            };
            // The clock is before the columns. A row without time has no place.
            let Some(t_s) = value(0) else { continue };
            for (value_of, column) in values.iter_mut().zip(wanted) {
                *value_of = value(1 + column).unwrap_or(f64::NAN);
            }
            sink(Row { group: 0, t_s, values: &values })?;
        }
    }
}
