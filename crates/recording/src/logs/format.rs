//! Interface of log formats: a format recognises a file, or bytes in memory, and opens it as groups, columns and rows.

use crate::logs::limits::{MAX_UNPACKED_BYTES, max_memory_bytes};
use crate::logs::{LogFinding, LogOptions};
use serde::Serialize;
use std::fs::File;
use std::io::{self, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// A row of one group.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    /// Index of the group.
    pub group: usize,
    /// Time, s, on the clock that all groups share; any finite number.
    pub t_s: f64,
    /// Values of the requested columns of the group, in the order of the request; NaN for an empty cell.
    pub values: &'a [f64],
}

/// Receives rows; an error ends the reading.
pub type RowSink<'a> = dyn FnMut(Row<'_>) -> Result<(), LogError> + 'a;

/// An open log.
pub trait Log {
    /// Groups and columns of the log.
    fn layout(&self) -> &Layout;

    /// Passes the rows of the requested columns (indices of [`Layout::columns`]) to `sink`, each group in the order of the file.
    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError>;
}

/// Opens a file as a log.
pub type OpenLog = fn(&LogFile, &LogOptions) -> Result<Box<dyn Log>, LogError>;

/// Samples as a table, for writing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleTable {
    /// Times, s, strictly increasing.
    pub times_s: Vec<f64>,
    /// The columns behind that of the times.
    pub columns: Vec<SampleColumn>,
}

/// A column of a [`SampleTable`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleColumn {
    /// Name, e.g. `T2`.
    pub name: String,
    /// Unit of its values; empty for a number.
    pub unit: String,
    /// One value per time, NaN where there is none.
    pub values: Vec<f64>,
}

impl SampleColumn {
    /// Name and unit as a heading, e.g. `T2 [K]`.
    pub fn heading(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} [{}]", self.name, self.unit) }
    }
}

impl SampleTable {
    /// Heading of the times.
    pub const TIME: &'static str = "time [s]";
}

/// Writes a table as a file.
pub type WriteSamples = fn(&SampleTable) -> io::Result<Vec<u8>>;

/// One format of logs.
#[derive(Debug, Clone, Copy)]
pub struct LogFormat {
    /// Name in messages, e.g. `CSV`.
    pub name: &'static str,
    /// Whether the first bytes of a file (up to [`LogFormats::HEAD_BYTES`]) are of this format.
    pub recognises: fn(&[u8]) -> bool,
    /// Opens a file of this format.
    pub open: OpenLog,
    /// Extension and function of a format that can be written.
    pub write: Option<(&'static str, WriteSamples)>,
}

/// The log formats of a program, in the order in which they are tried.
#[derive(Debug, Clone, Copy, Default)]
pub struct LogFormats(pub &'static [LogFormat]);

impl LogFormats {
    /// Size of the start of a file by which formats recognise it, bytes. Bound: effort; every format shows itself earlier.
    pub const HEAD_BYTES: usize = 4096;

    /// Opens a log.
    pub fn open(
        self,
        file: &LogFile,
        options: &LogOptions,
    ) -> Result<(&'static LogFormat, Box<dyn Log>), LogError> {
        let unpacked = file.unpack()?;
        let file = unpacked.as_ref().unwrap_or(file);
        let head = file.head(Self::HEAD_BYTES)?;
        let is_other = head.starts_with(FAMOS);
        let found = self.0.iter().find(|format| !is_other && (format.recognises)(&head));
        let format = found.ok_or_else(|| LogError::Unknown {
            path: file.path().to_owned(),
            found: describe_unknown(&head),
            known: self.names(),
        })?;
        Ok((format, (format.open)(file, options)?))
    }

    /// The function that writes files with this extension.
    pub fn writer(self, extension: &str) -> Option<WriteSamples> {
        self.0
            .iter()
            .filter_map(|format| format.write)
            .find(|(own, _)| *own == extension)
            .map(|(_, write)| write)
    }

    /// Extensions of the formats that can be written.
    pub fn extensions(self) -> impl Iterator<Item = &'static str> {
        self.0.iter().filter_map(|format| format.write).map(|(extension, _)| extension)
    }

    /// Names of the formats, for messages.
    pub fn names(self) -> String {
        let names: Vec<&str> = self.0.iter().map(|format| format.name).collect();
        names.join(", ")
    }
}

/// Common formats that cannot be read, by their first bytes, with a remedy.
const UNSUPPORTED_FORMATS: [(&[u8], &str); 8] = [
    (
        b"\x89MCAP",
        "it is an MCAP recording, not a log; identify it directly, with a channel map for its topics and fields if another program wrote it",
    ),
    (
        b"TDSm",
        "it is TDMS, which this program was built without: `cargo build --release --locked --features tdms`, or export it as CSV or MDF 4",
    ),
    (
        b"PAR1",
        "it is Parquet, which this program was built without: `cargo build --release --locked --features parquet`, or export it as CSV, e.g. \
         with `polars.read_parquet(FILE).write_csv(NEW)`",
    ),
    (
        b"ARROW1",
        "it is Arrow, which this program was built without: `cargo build --release --locked --features parquet`, or export it as CSV, e.g. \
         with `polars.read_ipc(FILE).write_csv(NEW)`",
    ),
    (b"\x89HDF", "it is HDF5, which this program was built without (`--features hdf5`); export it as CSV"),
    (FAMOS, "it is imc FAMOS; save it in FAMOS as MDF 4, MATLAB or text"),
    (
        b"MATLAB 7.3",
        "it is MATLAB data of version 7.3, which this program was built without (`--features hdf5`); save it by `save -v7`",
    ),
    (b"PK", "it is a zip archive but not a complete Excel workbook; unpack it, or save the workbook again"),
];

/// The first key of an imc FAMOS file, whose start is text. Source: imc, FAMOS file format.
const FAMOS: &[u8] = b"|CF,";

fn describe_unknown(head: &[u8]) -> String {
    if head.is_empty() {
        return "it is empty".to_owned();
    }
    let other = UNSUPPORTED_FORMATS.iter().find(|(magic, _)| head.starts_with(magic));
    let start = || format!("it starts with {:?}", String::from_utf8_lossy(head.get(..8).unwrap_or(head)));
    other.map_or_else(start, |(_, words)| (*words).to_owned())
}

/// Groups and columns of a log.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Layout {
    /// Columns that share a clock, in the order of the file.
    pub groups: Vec<Group>,
    /// Columns without the clocks, in the order of the file.
    pub columns: Vec<Column>,
    /// Detected properties.
    pub findings: Vec<LogFinding>,
    /// Time 0 of all groups in nanoseconds since 1970-01-01 in the log's time zone; `None` if the log has no dates.
    pub start_time_ns: Option<u64>,
}

/// Columns that share a clock.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Group {
    /// Name: a sheet, a group of the format, the clock's column; empty if the log has one group without a name.
    pub name: String,
    /// Description of the clock.
    pub clock: String,
}

/// One column.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Column {
    /// Name without its unit; distinct within a group.
    pub name: String,
    /// The header's cell as written, with the unit.
    pub header: String,
    /// Unit as written; `None` if the log gives none.
    pub unit: Option<String>,
    /// Long name or comment; empty if there is none.
    pub description: String,
    /// Index of its group.
    pub group: usize,
}

impl Layout {
    /// Adds a finding unless it is there already.
    pub fn add_finding(&mut self, finding: Option<LogFinding>) {
        let is_new = |finding: &LogFinding| !self.findings.contains(finding);
        self.findings.extend(finding.filter(is_new));
    }

    /// The columns of `wanted` that belong to a group.
    pub fn members(&self, group: usize, wanted: &[usize]) -> Vec<usize> {
        let belongs = |index: &usize| self.columns.get(*index).is_some_and(|column| column.group == group);
        wanted.iter().copied().filter(belongs).collect()
    }

    /// Columns of that name, or with that header as a whole, in a group of that name (any if `topic` is empty).
    pub fn find(&self, topic: &str, field: &str) -> Vec<usize> {
        let in_group = |column: &Column| {
            topic.is_empty() || self.groups.get(column.group).is_some_and(|group| group.name == topic)
        };
        let by = |text: fn(&Column) -> &str| -> Vec<usize> {
            let rows = self.columns.iter().enumerate();
            rows.filter(|(_, column)| in_group(column) && text(column) == field)
                .map(|(index, _)| index)
                .collect()
        };
        let named = by(|column| &column.name);
        if named.is_empty() { by(|column| &column.header) } else { named }
    }
}

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LogError {
    #[error("failed to read the log `{}`: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// `found`: what the file is instead, and what to do.
    #[error("failed to read `{}`: {found}; logs are read from {known}", path.display())]
    Unknown { path: PathBuf, found: String, known: String },
    #[error("failed to read `{}` as {format}: {message}", path.display())]
    Content { path: PathBuf, format: &'static str, message: String },
}

/// Input of a log format.
pub trait ReadSeek: Read + Seek {}

impl<T: Read + Seek> ReadSeek for T {}

/// The first bytes of a file compressed by gzip.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The name of standard input. Source: POSIX, utility conventions.
const STANDARD_INPUT: &str = "-";
/// What standard input had, which can be read only once.
static INPUT: OnceLock<Arc<[u8]>> = OnceLock::new();

/// A log on disk, in memory or on standard input, which may be read several times.
#[derive(Debug, Clone)]
pub struct LogFile {
    path: PathBuf,
    bytes: Option<Arc<[u8]>>,
}

impl LogFile {
    /// A file.
    pub fn from_path(path: &Path) -> Self {
        LogFile { path: path.to_owned(), bytes: None }
    }

    /// Bytes in memory; messages call them `name`.
    pub fn from_bytes(name: &Path, bytes: &[u8]) -> Self {
        LogFile { path: name.to_owned(), bytes: Some(bytes.into()) }
    }

    /// The content of a file compressed by gzip, in memory; `None` for any other.
    pub(crate) fn unpack(&self) -> Result<Option<LogFile>, LogError> {
        if self.head(GZIP.len())? != GZIP {
            return Ok(None);
        }
        let limit = max_memory_bytes(self.size_bytes()?);
        let mut content = Vec::new();
        flate2::read::MultiGzDecoder::new(self.open()?)
            .take(limit + 1)
            .read_to_end(&mut content)
            .map_err(|error| self.read_error(error))?;
        if content.len() as u64 > limit {
            let why =
                format!("it unpacks to more than {} MiB; unpack it and give the unpacked file", limit >> 20);
            return Err(self.read_error(io::Error::new(io::ErrorKind::FileTooLarge, why)));
        }
        Ok(Some(LogFile { path: self.path.clone(), bytes: Some(content.into()) }))
    }

    /// The file, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes, if they are in memory.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.bytes
            .as_deref()
            .or_else(|| INPUT.get().filter(|_| self.is_standard_input()).map(|bytes| &**bytes))
    }

    fn is_standard_input(&self) -> bool {
        self.path == Path::new(STANDARD_INPUT)
    }

    /// The bytes that are in memory, those of standard input too; `None` for a file.
    fn content(&self) -> Result<Option<Arc<[u8]>>, LogError> {
        if self.bytes.is_some() || !self.is_standard_input() {
            return Ok(self.bytes.clone());
        }
        if let Some(bytes) = INPUT.get() {
            return Ok(Some(bytes.clone()));
        }
        let mut bytes = Vec::new();
        let limit = MAX_UNPACKED_BYTES;
        io::stdin().lock().take(limit + 1).read_to_end(&mut bytes).map_err(|error| self.read_error(error))?;
        if bytes.len() as u64 > limit {
            let why = format!("standard input has more than {} MiB; give a file", limit >> 20);
            return Err(self.read_error(io::Error::new(io::ErrorKind::FileTooLarge, why)));
        }
        Ok(Some(INPUT.get_or_init(|| bytes.into()).clone()))
    }

    /// The bytes from the start.
    pub fn open(&self) -> Result<Box<dyn ReadSeek>, LogError> {
        match self.content()? {
            Some(bytes) => Ok(Box::new(Cursor::new(bytes))),
            None => Ok(Box::new(self.open_path()?)),
        }
    }

    /// The file on disk.
    pub fn open_path(&self) -> Result<File, LogError> {
        mapper_yaml::open_file(&self.path).map_err(|error| self.read_error(error))
    }

    /// Its size, bytes.
    pub fn size_bytes(&self) -> Result<u64, LogError> {
        match self.content()? {
            Some(bytes) => Ok(bytes.len() as u64),
            None => Ok(std::fs::metadata(&self.path).map_err(|error| self.read_error(error))?.len()),
        }
    }

    /// At most the first `count` bytes.
    pub fn head(&self, count: usize) -> Result<Vec<u8>, LogError> {
        let mut head = Vec::new();
        let limit = u64::try_from(count).unwrap_or(u64::MAX);
        self.open()?.take(limit).read_to_end(&mut head).map_err(|error| self.read_error(error))?;
        Ok(head)
    }

    /// The error for a file that could not be read.
    pub fn read_error(&self, source: io::Error) -> LogError {
        LogError::Read { path: self.path.clone(), source }
    }

    /// The error for content that cannot be used.
    pub fn content_error(&self, format: &'static str, message: impl Into<String>) -> LogError {
        LogError::Content { path: self.path.clone(), format, message: message.into() }
    }
}
