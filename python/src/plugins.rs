//! What the package adds to the plug-ins: DataFrames as a log format, and rigs in Python as a driver.
//!
//! A DataFrame is handed over in memory: a line of text, a line of JSON, and the values of each column as 64-bit floats in this computer's
//! order of bytes, the time, s, first.

use mapper::Registry;
use mapper_core::{Backend, BackendError};
use mapper_driver_host::{DEFAULT_TIMEOUTS, Driver, SearchPath};
use mapper_recording::logs::{
    Column, Group, Layout, Log, LogError, LogFile, LogFormat, LogFormats, LogOptions, Row, RowSink,
};
use serde_json::Value;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

const NAME: &str = "DataFrame";
const MAGIC: &[u8] = b"mapper DataFrame\n";
const VALUE_BYTES: usize = 8;
const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: None };

/// Every plug-in of the package. It starts no drivers: a rig in real time is run by the command, which handles all signals.
pub fn plugins() -> Registry {
    static LOGS: LazyLock<Vec<LogFormat>> = LazyLock::new(|| {
        let others = mapper::plugins().logs;
        std::iter::once(FORMAT).chain(others.0.iter().copied()).collect()
    });
    Registry { driver: None, logs: LogFormats(&LOGS), ..mapper::plugins() }
}

/// The plug-ins for a run on a rig in Python, of this name in the campaign and at this socket. No other driver is found.
pub fn plugins_with_rig(rig: String, socket: PathBuf) -> Registry {
    let connect = move |name: &str, settings: &Value| -> Result<Box<dyn Backend>, BackendError> {
        Ok(Box::new(match name == rig {
            true => Driver::connect_socket(&socket, name, settings, DEFAULT_TIMEOUTS)?,
            false => Driver::find(&SearchPath::default(), name, settings, "", "")?,
        }))
    };
    Registry { driver: Some(Arc::new(connect)), ..plugins() }
}

fn recognises(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

struct Frame {
    file: LogFile,
    layout: Layout,
}

/// The header, and the values after it, column by column, the time first.
fn parts(file: &LogFile) -> Result<(Value, &[[u8; VALUE_BYTES]]), LogError> {
    let bytes = file.bytes().and_then(|bytes| bytes.strip_prefix(MAGIC));
    let bytes = bytes.ok_or_else(|| file.content_error(NAME, "it exists in memory only"))?;
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
    let (header, values) = bytes.split_at(end);
    let header =
        serde_json::from_slice(header).map_err(|error| file.content_error(NAME, error.to_string()))?;
    Ok((header, values.get(1..).unwrap_or_default().as_chunks().0))
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options.allow_only(&[]).map_err(|why| file.content_error(NAME, why))?;
    let (header, _) = parts(file)?;
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
        let (_, values) = parts(&self.file)?;
        let rows = values.len() / (1 + self.layout.columns.len());
        let value = |column: usize, row: usize| {
            let cell = values.get(column * rows + row)?;
            Some(f64::from_ne_bytes(*cell)).filter(|value| value.is_finite())
        };
        let mut read = vec![f64::NAN; wanted.len()];
        for row in 0..rows {
            // A row without time has no place.
            let Some(t_s) = value(0, row) else { continue };
            for (value_of, column) in read.iter_mut().zip(wanted) {
                *value_of = value(1 + column, row).unwrap_or(f64::NAN);
            }
            sink(Row { group: 0, t_s, values: &read })?;
        }
        Ok(())
    }
}
