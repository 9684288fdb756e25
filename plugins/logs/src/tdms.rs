//! TDMS: the files of LabVIEW and of National Instruments' loggers. Each group is a table; waveform channels have their own rate.

use crate::clock::HEAD_ROWS;
use crate::table_head::MAX_COLUMNS;
use crate::tables::column_log::{COLUMN_OPTIONS, Chunk, Chunks, ColumnRows};
use crate::tables::long_table::{Part, join_tables};
use crate::tables::table_log::{Origin, Table};
use mapper_recording::logs::{
    Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, ReadSeek, Row, RowSink,
};
use mapper_table::Instant;
use std::io::{Seek as _, SeekFrom};
use tedium::{ChannelPath, PropertyPath, PropertyValue, TdmsError, TdmsFile, TdmsStorageType};

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: None };

const NAME: &str = "TDMS";

/// Maximum number of values in memory: 32 MiB.
const MAX_BUFFERED_VALUES: usize = 1 << 22;

/// Days from LabVIEW's origin, 1904-01-01, to 1970-01-01.
const EPOCH_DAYS: i64 = 24_107;

/// Valid days, 1970 to 2200, which fit into 64 bits as nanoseconds.
const VALID_DAYS: std::ops::Range<i64> = 0..84_000;

fn recognises(head: &[u8]) -> bool {
    head.starts_with(b"TDSm")
}

/// Date and time of day from the file's form: seconds since 1904 and a fraction of one in 2^-64.
fn instant((seconds, fraction): (i64, u64)) -> Option<Instant> {
    let day = seconds.div_euclid(86_400).checked_sub(EPOCH_DAYS)?;
    // Nanoseconds: an f64 of a date has no finer resolution.
    let ns = (u128::from(fraction) * 1_000_000_000) >> 64;
    let ns_of_day = seconds.rem_euclid(86_400) * 1_000_000_000 + i64::try_from(ns).ok()?;
    VALID_DAYS.contains(&day).then_some(Instant { day: Some(day), ns_of_day: Some(ns_of_day) })
}

type Source = TdmsFile<Box<dyn ReadSeek>>;

/// Reads values of a channel from an index on.
type ReadValues = fn(&mut Source, &ChannelPath, u64, usize) -> Result<Chunk, TdmsError>;

fn numbers<T: TdmsStorageType + Copy + Default>(
    source: &mut Source,
    path: &ChannelPath,
    from: u64,
    count: usize,
    number: fn(T) -> f64,
) -> Result<Chunk, TdmsError> {
    let mut values = vec![T::default(); count];
    source.read_channel_from(path, from, &mut values)?;
    Ok(Chunk::Numbers(values.into_iter().map(number).collect()))
}

/// A reader for each supported type, with the size of a value, bytes.
const READERS: [(u64, ReadValues); 11] = [
    (8, |s, p, from, n| numbers::<f64>(s, p, from, n, |v| v)),
    (4, |s, p, from, n| numbers::<f32>(s, p, from, n, f64::from)),
    (2, |s, p, from, n| numbers::<i16>(s, p, from, n, f64::from)),
    (4, |s, p, from, n| numbers::<i32>(s, p, from, n, f64::from)),
    (2, |s, p, from, n| numbers::<u16>(s, p, from, n, f64::from)),
    (4, |s, p, from, n| numbers::<u32>(s, p, from, n, f64::from)),
    (1, |s, p, from, n| numbers::<i8>(s, p, from, n, f64::from)),
    (1, |s, p, from, n| numbers::<u8>(s, p, from, n, f64::from)),
    // Counts beyond 2^53 lose their last digit, as everywhere.
    (8, |s, p, from, n| numbers::<i64>(s, p, from, n, |v| v as f64)),
    (8, |s, p, from, n| numbers::<u64>(s, p, from, n, |v| v as f64)),
    (1, |s, p, from, n| numbers::<bool>(s, p, from, n, |v| f64::from(u8::from(v)))),
];

struct Channel {
    path: ChannelPath,
    unit: String,
    length: u64,
    read: ReadValues,
    waveform: Option<Waveform>,
}

/// The time axis of a waveform channel.
#[derive(Clone, Copy, PartialEq)]
struct Waveform {
    interval_s: f64,
    start_offset_s: f64,
    start: Option<Instant>,
}

struct Tdms {
    file: LogFile,
    layout: Layout,
    source: Source,
    parts: Vec<Part>,
    channels: Vec<Vec<Channel>>,
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    options.allow_only(&COLUMN_OPTIONS).map_err(|why| file.content_error(NAME, why))?;
    let mut bytes = file.open()?;
    let size = bytes.seek(SeekFrom::End(0)).map_err(|error| file.read_error(error))?;
    let mut source = TdmsFile::new(bytes).map_err(|error| failed(file, &error))?;
    let names: Vec<String> = source.list_groups().map(unquoted).collect();
    let (mut found, mut problems, mut channels) = (Vec::new(), Vec::new(), Vec::new());
    let (mut empty, mut seen) = (0usize, 0usize);
    for name in &names {
        let paths: Vec<ChannelPath> = source.list_channels_in_group(&PropertyPath::group(name)).collect();
        seen += paths.len();
        if seen > MAX_COLUMNS {
            return Err(file.content_error(NAME, format!("it has more than {MAX_COLUMNS} channels")));
        }
        let mut of_group: Vec<Channel> = Vec::new();
        for path in paths {
            match channel(&mut source, path, size) {
                Ok(Some(channel)) => of_group.push(channel),
                Ok(None) => empty += 1,
                Err(why) => return Err(file.content_error(NAME, why)),
            }
        }
        for channels_of in by_clock(of_group, options) {
            let waveform = channels_of.first().and_then(|channel| channel.waveform);
            let several = found.iter().any(|(other, _): &(String, Table)| other.starts_with(name.as_str()));
            let title = if several { format!("{name} ({})", found.len() + 1) } else { name.clone() };
            match analyse_table(file, &mut source, &channels_of, waveform, options)? {
                Ok(table) => {
                    found.push((title, table));
                    channels.push(channels_of);
                }
                Err(problem) => problems.push(LogFinding::skipped("group", &title, problem)),
            }
        }
    }
    if empty > 0 {
        problems.push(LogFinding::left_out(empty, "they are empty"));
    }
    let (layout, parts) =
        join_tables("group", found, problems).map_err(|why| file.content_error(NAME, why))?;
    Ok(Box::new(Tdms { file: file.clone(), layout, source, parts, channels }))
}

fn failed(file: &LogFile, error: &TdmsError) -> LogError {
    file.content_error(NAME, error.to_string())
}

fn unquoted(name: &str) -> String {
    name.trim_matches('\'').replace("''", "'")
}

/// Reads the properties of a channel; `None` if it is empty. An unsupported type is an error: the library assumes half the true length
/// of a date, and would read the following channels at wrong positions.
fn channel(source: &mut Source, path: ChannelPath, file_bytes: u64) -> Result<Option<Channel>, String> {
    let Some(length) = source.channel_length(&path).filter(|length| *length > 0) else { return Ok(None) };
    let Some((value_bytes, read)) = READERS.into_iter().find(|(_, read)| read(source, &path, 0, 1).is_ok())
    else {
        let name = path.channel_name();
        return Err(format!(
            "channel `{name}` does not contain plain numbers (e.g. dates): remove it from the file, or export the file as CSV or MDF 4"
        ));
    };
    // A damaged file may declare more values than it has bytes, and the missing ones would be read as zeros.
    if length > file_bytes / value_bytes {
        return Err(format!(
            "channel `{}` has {length} values in a file of {file_bytes} bytes",
            path.channel_name()
        ));
    }
    let of_path = PropertyPath::channel(path.group_name(), path.channel_name());
    let property = |name: &str| source.read_property(&of_path, name).ok().flatten();
    let number = |name: &str| match property(name)? {
        PropertyValue::DoubleFloat(value) => Some(*value),
        PropertyValue::SingleFloat(value) => Some(f64::from(*value)),
        _ => None,
    };
    let unit = ["unit_string", "NI_UnitDescription", "unit", "Unit"].into_iter().find_map(|name| {
        match property(name)? {
            PropertyValue::String(unit) if !unit.trim().is_empty() => Some(unit.trim().to_owned()),
            _ => None,
        }
    });
    let start = match property("wf_start_time") {
        Some(PropertyValue::Timestamp(stamp)) => instant(stamp.to_parts()),
        _ => None,
    };
    let waveform = number("wf_increment")
        .filter(|interval_s| *interval_s > 0.0 && interval_s.is_finite())
        .map(|interval_s| Waveform {
            interval_s,
            start_offset_s: number("wf_start_offset").filter(|offset_s| offset_s.is_finite()).unwrap_or(0.0),
            start,
        });
    Ok(Some(Channel { path, unit: unit.unwrap_or_default(), length, read, waveform }))
}

/// Channels by clock: those of the same waveform, and all those without one. A clock or rate named by the user takes precedence.
fn by_clock(channels: Vec<Channel>, options: &LogOptions) -> Vec<Vec<Channel>> {
    let named = options.rate_hz.is_some()
        || channels.iter().any(|channel| options.time.iter().any(|name| name == channel.path.channel_name()));
    let mut groups: Vec<Vec<Channel>> = Vec::new();
    for mut channel in channels {
        channel.waveform = channel.waveform.filter(|_| !named);
        match groups.iter_mut().find(|group| group.iter().all(|other| other.waveform == channel.waveform)) {
            Some(group) => group.push(channel),
            None => groups.push(vec![channel]),
        }
    }
    groups
}

fn analyse_table(
    file: &LogFile,
    source: &mut Source,
    channels: &[Channel],
    waveform: Option<Waveform>,
    options: &LogOptions,
) -> Result<Result<Table, String>, LogError> {
    let mut options = options.clone();
    if let Some(waveform) = waveform {
        options.rate_hz = Some(1.0 / waveform.interval_s);
        options.time.clear();
    }
    let head = ColumnRows::new(head(channels), GroupChunks::new(file, source, channels, HEAD_ROWS))
        .texts(HEAD_ROWS)?;
    let origin = if waveform.is_some() { Origin::Waveform } else { Origin::Columns };
    let mut table = match Table::analyse(&head, b'.', &options, origin) {
        Ok(table) => table,
        Err(problem) => return Ok(Err(problem)),
    };
    if let Some(waveform) = waveform {
        let findings = &mut table.layout.findings;
        findings.push(LogFinding::Waveform { interval_s: waveform.interval_s });
        let start_ns = waveform.start.map(|start| start.ns() as f64 + 1e9 * waveform.start_offset_s);
        table.layout.start_time_ns =
            start_ns.filter(|ns| *ns > 0.0 && *ns < i64::MAX as f64).map(|ns| ns as u64);
    }
    Ok(Ok(table))
}

fn head(channels: &[Channel]) -> Vec<Vec<String>> {
    let names = channels.iter().map(|channel| channel.path.channel_name().to_owned()).collect();
    if channels.iter().all(|channel| channel.unit.is_empty()) {
        return vec![names];
    }
    vec![names, channels.iter().map(|channel| channel.unit.clone()).collect()]
}

impl Log for Tdms {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        for (part, channels) in self.parts.iter().zip(&self.channels) {
            let own = part.own(wanted);
            if own.is_empty() {
                continue;
            }
            let at_once = (MAX_BUFFERED_VALUES / channels.len().max(1)).max(1);
            let chunks = GroupChunks::new(&self.file, &mut self.source, channels, at_once);
            let mut of_file = |row: Row<'_>| part.forward_row(row, sink);
            let mut rows = ColumnRows::new(head(channels), chunks);
            self.layout.add_finding(part.table.rows(&mut rows, &own, &mut of_file)?);
        }
        Ok(())
    }
}

/// The channels of a group, some rows at a time; shorter ones are empty after their end.
struct GroupChunks<'a> {
    file: &'a LogFile,
    source: &'a mut Source,
    channels: &'a [Channel],
    at_once: usize,
    from: u64,
}

impl<'a> GroupChunks<'a> {
    fn new(file: &'a LogFile, source: &'a mut Source, channels: &'a [Channel], at_once: usize) -> Self {
        GroupChunks { file, source, channels, at_once, from: 0 }
    }
}

impl Chunks for GroupChunks<'_> {
    fn next_chunk(&mut self) -> Result<Option<(usize, Vec<Chunk>)>, LogError> {
        let left = |channel: &Channel| {
            usize::try_from(channel.length.saturating_sub(self.from)).unwrap_or(usize::MAX).min(self.at_once)
        };
        let count = self.channels.iter().map(left).max().unwrap_or(0);
        if count == 0 {
            return Ok(None);
        }
        let mut chunks = Vec::with_capacity(self.channels.len());
        for channel in self.channels {
            let rows = left(channel);
            let chunk = if rows == 0 {
                Ok(Chunk::Numbers(Vec::new()))
            } else {
                (channel.read)(self.source, &channel.path, self.from, rows)
            };
            chunks.push(chunk.map_err(|error| failed(self.file, &error))?);
        }
        self.from += count as u64;
        Ok(Some((count, chunks)))
    }
}
