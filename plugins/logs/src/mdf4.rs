//! ASAM MDF, version 4: the format of measuring systems on engine test beds.

use crate::mdf::{MdfSource, check_channel_count, column, forward_rows, wanted_channels};
use falcon_mdf::{Channel, ChannelGroup, Conversion, Mf4File, Mf4Writer, OpenOptions, Signal};
use mapper_recording::Kind;
use mapper_recording::logs::limits::{MAX_BLOCK_BYTES, max_unpacked_bytes};
use mapper_recording::logs::{
    Group, Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, RowSink, SampleTable,
};
use std::collections::BTreeSet;
use std::io;

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: Some(("mf4", write)) };

const NAME: &str = "MDF4";

/// Rows decoded at once.
const CHUNK: usize = 4096;

/// Size of a decoded value, bytes.
const VALUE_BYTES: u64 = 8;

fn recognises(head: &[u8]) -> bool {
    head.starts_with(b"MDF     ") || head.starts_with(b"UnFinMF ")
}

/// One group; a channel without a sample at a time is invalid there. Time 0 is that of the table.
fn write(table: &SampleTable) -> io::Result<Vec<u8>> {
    let write = || -> Result<Vec<u8>, falcon_mdf::error::Mf4Error> {
        let mut writer = Mf4Writer::with_start_time_ns(0);
        let group = writer.add_group(&table.times_s)?;
        for column in &table.columns {
            let valid: Vec<bool> = column.values.iter().map(|value| value.is_finite()).collect();
            let some = valid.contains(&false);
            group.add_channel_with_validity(&column.name, &column.unit, &column.values, some.then_some(&valid))?;
        }
        let mut bytes = Vec::new();
        writer.write(&mut bytes)?;
        Ok(bytes)
    };
    write().map_err(io::Error::other)
}

struct Mdf4 {
    path: LogFile,
    file: Mf4File,
    layout: Layout,
    /// The clock of each group, and its unit in seconds.
    masters: Vec<(Channel, f64)>,
    channels: Vec<Channel>,
    missing: Vec<f64>,
}

fn open(path: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    let failed = |error: falcon_mdf::error::Mf4Error| path.content_error(NAME, error.to_string());
    options.allow_only(&["time", "time_unit", "missing"]).map_err(|why| path.content_error(NAME, why))?;
    let limits = OpenOptions { max_decompressed: MAX_BLOCK_BYTES + 1, ..OpenOptions::default() };
    let file = Mf4File::from_source_with_options(MdfSource::open(path, NAME)?, limits).map_err(failed)?;
    check_channel_count(path, NAME, file.channel_count())?;
    let mut log = Mdf4 {
        path: path.clone(),
        layout: Layout::default(),
        masters: Vec::new(),
        channels: Vec::new(),
        missing: options.missing.clone(),
        file,
    };
    // A list of blocks may name the same compressed block many times.
    let samples_max = max_unpacked_bytes(path.size_bytes()?) / VALUE_BYTES;
    let (mut left_out, mut without_clock, mut has_frames) = (0usize, 0usize, false);
    for (index, group) in log.file.data_groups().iter().flat_map(|data| &data.channel_groups).enumerate() {
        let is_frame = |channel: &Channel| FRAMES.iter().any(|frame| channel.name.starts_with(frame));
        if group.channels.iter().any(is_frame) {
            has_frames = true;
            continue;
        }
        let named = |channel: &&Channel| options.time.contains(&channel.name);
        let clock = group
            .channels
            .iter()
            .find(named)
            .or_else(|| group.master_channel().filter(|master| master.is_time_channel()));
        let readable = |channel: &&Channel| {
            // Without its conversion, a channel has no value.
            let converts = !matches!(channel.conversion, Conversion::Unsupported { .. });
            converts
                && channel.unreadable().is_none()
                && channel.is_numeric()
                && !channel.is_array()
                && !channel.is_master()
        };
        let Some(clock) = clock else {
            without_clock += group.channels.len();
            continue;
        };
        let columns: Vec<Channel> =
            group.channels.iter().filter(readable).filter(|c| c.name != clock.name).cloned().collect();
        left_out += group.channels.len().saturating_sub(columns.len() + 1);
        if columns.is_empty() || group.sample_count == 0 {
            continue;
        }
        if group.sample_count > samples_max {
            let message = format!(
                "a group states {} samples; a file of this size may have {samples_max}",
                group.sample_count
            );
            return Err(path.content_error(NAME, message));
        }
        let number = log.layout.groups.len();
        log.layout.groups.push(Group { name: name_of(group, index), clock: describe_clock(clock) });
        let mut names = BTreeSet::new();
        log.layout.columns.extend(
            columns.iter().map(|channel| {
                column(&mut names, [&*channel.name, &*channel.unit, &*channel.comment], number)
            }),
        );
        log.masters.push((clock.clone(), options.time_unit_s.or(unit_s(clock)).unwrap_or(1.0)));
        log.channels.extend(columns);
    }
    number_group_names(&mut log.layout);
    let findings = &mut log.layout.findings;
    findings.push(LogFinding::Clocks { groups: log.masters.len() });
    if has_frames {
        findings.push(LogFinding::BusFrames);
    }
    if left_out > 0 {
        findings.push(LogFinding::left_out(left_out, "texts, arrays, or unreadable"));
    }
    if without_clock > 0 {
        findings
            .push(LogFinding::left_out(without_clock, "their groups have no clock; name one with `time`"));
    }
    log.layout.start_time_ns = u64::try_from(log.file.start_time().timestamp_ns).ok().filter(|ns| *ns > 0);
    if log.layout.groups.is_empty() {
        let without_clock = "it has no group of numbers with a clock; name the clock's channel with `time`";
        let frames = LogFinding::BusFrames.to_string();
        return Err(path.content_error(NAME, if has_frames { frames.as_str() } else { without_clock }));
    }
    Ok(Box::new(log))
}

/// Channels of undecoded frames (ASAM MDF, bus logging): their numbers are identifiers and bytes.
const FRAMES: [&str; 5] = ["CAN_DataFrame", "CAN_RemoteFrame", "LIN_Frame", "FLX_Frame", "ETH_Frame"];

fn name_of(group: &ChannelGroup, index: usize) -> String {
    let source = group.source.as_ref().map(|source| source.name.clone());
    [Some(group.acquisition_name.clone()), source]
        .into_iter()
        .flatten()
        .find(|name| !name.trim().is_empty())
        .unwrap_or_else(|| format!("group {}", index + 1))
}

/// The unit of a clock in seconds; `None` if its unit is unknown. The standard prescribes seconds.
fn unit_s(clock: &Channel) -> Option<f64> {
    Some(Kind::Duration.unit(clock.unit.trim())?.to_inside(1.0))
}

fn describe_clock(clock: &Channel) -> String {
    let unit = clock.unit.trim();
    if unit.is_empty() { format!("`{}`", clock.name) } else { format!("`{}`, counts {unit}", clock.name) }
}

fn number_group_names(layout: &mut Layout) {
    if let [only] = layout.groups.as_mut_slice() {
        only.name = String::new();
    }
    for index in 1..layout.groups.len() {
        let (before, rest) = layout.groups.split_at_mut(index);
        if let Some(group) =
            rest.first_mut().filter(|group| before.iter().any(|other| other.name == group.name))
        {
            group.name = format!("{} ({})", group.name, index + 1);
        }
    }
}

impl Log for Mdf4 {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let failed = |error: falcon_mdf::error::Mf4Error| self.path.content_error(NAME, error.to_string());
        for (group, (master, unit_s)) in self.masters.iter().enumerate() {
            let mut channels = wanted_channels(&self.layout, wanted, &self.channels, group);
            if channels.is_empty() {
                continue;
            }
            channels.insert(0, master);
            for chunk in self.file.signals_chunks(&channels, CHUNK).map_err(failed)? {
                let columns: Vec<Vec<f64>> = chunk
                    .map_err(failed)?
                    .iter()
                    .map(valid_values)
                    .collect::<Result<_, _>>()
                    .map_err(failed)?;
                let Some((counts, columns)) = columns.split_first() else { continue };
                let times_s = counts.iter().map(|count| count * unit_s);
                forward_rows(group, times_s, columns, &self.missing, sink)?;
            }
        }
        Ok(())
    }
}

/// Values, with NaN for those declared invalid in the file.
fn valid_values(signal: &Signal) -> Result<Vec<f64>, falcon_mdf::error::Mf4Error> {
    let mut values = signal.values_f64()?;
    if let Some(validity) = signal.validity() {
        for (value, _) in values.iter_mut().zip(validity).filter(|(_, valid)| !valid) {
            *value = f64::NAN;
        }
    }
    Ok(values)
}
