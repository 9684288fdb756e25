//! Reads a recording of this or another program.

use crate::channel_mapping::channel_map::{MappedQuantity, source_of, sources};
use crate::channel_mapping::channel_map_yaml::MapMistakes;
use crate::channel_mapping::plausibility;
use crate::channel_mapping::plausibility::Readings;
use crate::jump_steps::{drop_rest_steps, hold_at_step_ends, reversal_share};
use crate::log_reader::{is_mcap, log_of_path, read_log};
use crate::logs::{LogError, LogFile};
use crate::samples::clock_steps::{repair_gaps, repair_set_back, repair_set_forward};
use crate::samples::rig_sink::{PositionedMessage, RigSink};
use crate::samples::series_builder::{SeriesBuilder, run_time_s};
use crate::scan::{ReadOptions, ScanResult, scan};
use crate::steps::{find_steps, hollow_steps, span_s, steps_from_markers};
use crate::topics::OriginMessage;
use crate::{AmbientPressure, ChannelMap, ChannelSource, FormatVersion, ReadWarning, RecordError};
use mapper_core::unit_factors::PERCENT;
use mapper_core::{
    Channel, Element, Event, Group, Quality, ReadingOrigin, Recording, RedundantSensors, Series, StepMarker,
};
use mapper_yaml::units::Unit;
use mapper_yaml::{FindingKind, steps};
use std::collections::BTreeMap;
use std::io;
use std::io::{BufReader, Read};
use std::path::Path;

/// A recording with its warnings, attachments and metadata.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadReport {
    /// Samples, steps and events in SI units; no truth.
    pub recording: Recording,
    /// Problems of the file; empty for an intact one.
    pub warnings: Vec<ReadWarning>,
    /// The campaign as attached.
    pub campaign_text: Option<String>,
    /// The plan as attached, JSON.
    pub plan_json: Option<Vec<u8>>,
    /// Metadata of the run: campaign, seed, program version and so on.
    pub metadata: BTreeMap<String, String>,
    /// Format version; `None` for recordings made by others.
    pub format: Option<FormatVersion>,
    /// Time of run time 0 in nanoseconds since 1970-01-01 UTC: that of the run's start, or of the first mapped
    /// message in recordings made by others.
    pub start_time_ns: u64,
}

/// Reads a recording; [`ChannelMap::native`] for those of this program.
///
/// Steps come from the recording's own markers; if it has none, from changes of the command channels. For a file that
/// is truncated or damaged, returns the recoverable data with warnings.
pub fn read_recording(
    path: &Path,
    map: &ChannelMap,
    options: &ReadOptions,
) -> Result<ReadReport, RecordError> {
    match log_of_path(path, options)? {
        Some(file) => read_as_log(&file, map, options),
        None => read(path, map, options, &|| open(path)),
    }
}

/// Reads only the steps, from their markers, and the events of a recording of this program. A step without an end and without a
/// following step ends where it begins.
pub fn read_marks(path: &Path, options: &ReadOptions) -> Result<(Vec<StepMarker>, Vec<Event>), RecordError> {
    let map = ChannelMap { channels: BTreeMap::new(), elements: BTreeMap::new(), ..ChannelMap::native() };
    let recording = read(path, &map, options, &|| open(path))?.recording;
    Ok((recording.steps, recording.events))
}

/// Reads a recording from memory; messages call it `name`. Otherwise as [`read_recording`].
pub fn read_recording_from(
    bytes: &[u8],
    name: &Path,
    map: &ChannelMap,
    options: &ReadOptions,
) -> Result<ReadReport, RecordError> {
    if !options.logs.0.is_empty() && !is_mcap(bytes) {
        return read_as_log(&LogFile::from_bytes(name, bytes), map, options);
    }
    // The reader owns its source, so the bytes are copied once.
    let shared: std::sync::Arc<[u8]> = bytes.into();
    read(name, map, options, &|| Ok(Box::new(io::Cursor::new(shared.clone()))))
}

pub(crate) fn open(path: &Path) -> io::Result<Box<dyn Read>> {
    Ok(Box::new(BufReader::with_capacity(1 << 16, mapper_yaml::open_file(path)?)))
}

fn read_as_log(file: &LogFile, map: &ChannelMap, options: &ReadOptions) -> Result<ReadReport, RecordError> {
    if map.is_native() {
        // Ask for a channel map only if the file can be read as a log.
        return Err(match options.logs.open(file, &map.log) {
            Ok(_) => RecordError::LogWithoutMap { path: file.path().to_owned() },
            Err(LogError::Content { path, message, .. }) => RecordError::Neither { path, message },
            Err(error) => error.into(),
        });
    }
    let mut log = read_log(file, map, options)?;
    let mut warnings = log.warnings;
    repair_gaps(&mut log.builders, &mut log.ambient, &mut warnings);
    if log.averaged {
        warnings.push(ReadWarning::Averaged);
    }
    warnings.extend(find_missing_fields(map, &log.builders));
    let ambient = log.ambient.map(|builder| builder.build(Channel::P1, log.zero_ns, &mut warnings));
    let mut gathered = gather(map, log.builders, log.zero_ns, ambient.as_ref(), &mut warnings);
    let ambient = ambient.as_ref().zip(log.ambient_unit);
    add_derived(map, &mut gathered, &log.units, ambient)?;
    let steps = detect_steps(map, &mut gathered.series, &mut warnings);
    warnings.extend(hollow_steps(&steps, &gathered.series));
    let RunSeries { series, elements, .. } = gathered;
    Ok(ReadReport {
        recording: Recording { series, elements, steps, ..Recording::default() },
        warnings,
        start_time_ns: log.start_time_ns.unwrap_or(0),
        ..ReadReport::default()
    })
}

fn read(
    path: &Path,
    map: &ChannelMap,
    options: &ReadOptions,
    open: &dyn Fn() -> io::Result<Box<dyn Read>>,
) -> Result<ReadReport, RecordError> {
    check_fits_mcap(map)?;
    let (mut sink, scanned) = scan(path, open, options, || RigSink::new(path, map, options.averages))?;
    if let Some(error) = sink.failure.take() {
        return Err(error);
    }
    if let Some(warning) = scanned.unknown_compression().cloned() {
        return Err(RecordError::NothingReadable { path: path.to_owned(), warning });
    }
    let builders = sink.take_builders();
    if sink.is_averaged() {
        sink.warnings.push(ReadWarning::Averaged);
    }
    // A command alone may match a name by chance: a recording without measurements is useless.
    let measured = builders.keys().any(|reads| reads.channel().info().group != Group::Command);
    let has_rig_topics = sink.topic_names.iter().any(|topic| !is_own_topic(topic));
    if !measured && sink.format.is_none() && has_rig_topics {
        let damaged = |warning: &ReadWarning| matches!(warning, ReadWarning::DamagedChunk { .. });
        if let Some(warning) = scanned.warnings.into_iter().find(damaged) {
            return Err(RecordError::NothingReadable { path: path.to_owned(), warning });
        }
        let topics = sink.topic_names.into_iter().collect();
        return Err(RecordError::NothingMapped { path: path.to_owned(), topics });
    }
    report(map, sink, builders, scanned)
}

/// Refuses settings of a channel map that apply to logs only.
fn check_fits_mcap(map: &ChannelMap) -> Result<(), RecordError> {
    let mut mistakes = MapMistakes::default();
    for (reads, source) in sources(map).filter(|(_, source)| source.topic.is_empty()) {
        let message = format!(
            "`{}` has no `topic`, and every field of an MCAP recording belongs to a topic",
            source.field
        );
        let remedy = "write `topic: /name`, as in the recording".to_owned();
        mistakes.add(FindingKind::MissingKey, &steps!["channels", reads.channel().symbol()], message, remedy);
    }
    if let Some(AmbientPressure::Source(_)) = &map.ambient_pressure {
        let message = "only logs can have a column of the ambient pressure".to_owned();
        let remedy = "write the barometer's reading, e.g. `101.3 kPa`".to_owned();
        mistakes.add(FindingKind::Unsupported, &steps!["ambient_pressure"], message, remedy);
    }
    mistakes.into_result(map)
}

fn is_own_topic(topic: &str) -> bool {
    use crate::topics::{EVENT_TOPIC, STEP_TOPIC, TRUTH_PREFIX};
    topic == STEP_TOPIC || topic == EVENT_TOPIC || topic.starts_with(TRUTH_PREFIX)
}

fn report(
    map: &ChannelMap,
    mut sink: RigSink<'_>,
    mut builders: BTreeMap<MappedQuantity, SeriesBuilder>,
    scanned: ScanResult,
) -> Result<ReadReport, RecordError> {
    let mut warnings = scanned.warnings;
    warnings.append(&mut sink.warnings);
    warnings.extend(sink.damaged_messages());
    if !map.is_native() {
        warnings.extend(find_missing_fields(map, &builders));
    }
    repair_set_back(&mut builders, &mut sink.steps, &mut sink.events, &mut warnings);
    if let Some(start_time_ns) = &mut sink.start_time_ns {
        repair_set_forward(&mut builders, &mut sink.steps, start_time_ns, &mut warnings);
    }
    if sink.steps.is_empty() {
        repair_gaps(&mut builders, None, &mut warnings);
    }
    let strays: Vec<(u64, u64)> = builders.values_mut().filter_map(SeriesBuilder::drop_strays).collect();
    let first_sample_ns = builders.values().filter_map(SeriesBuilder::first_time_ns).min();
    let zero_ns = sink.start_time_ns.or(first_sample_ns).unwrap_or(0);
    if let Some((_, first_ns)) = strays.first() {
        let count = strays.iter().map(|(count, _)| count).sum();
        warnings.push(ReadWarning::StrayTimes { count, first_s: run_time_s(*first_ns, zero_ns) });
    }
    let mut gathered = gather(map, builders, zero_ns, None, &mut warnings);
    add_derived(map, &mut gathered, &sink.units, None)?;
    let steps = if sink.format.is_some() || !sink.steps.is_empty() {
        let markers = sink.steps.into_iter().map(|PositionedMessage { log_time_ns, mut message, .. }| {
            if sink.start_time_ns.is_none() {
                message.t_s = run_time_s(log_time_ns, zero_ns);
            }
            message
        });
        let last_s = span_s(&gathered.series).map_or(0.0, |(_, last_s)| last_s);
        steps_from_markers(markers, last_s, &mut warnings)
    } else {
        detect_steps(map, &mut gathered.series, &mut warnings)
    };
    warnings.extend(hollow_steps(&steps, &gathered.series));
    let events =
        sink.events.into_iter().map(|PositionedMessage { log_time_ns, message: mut event, .. }| {
            if sink.start_time_ns.is_none() {
                event.t_s = run_time_s(log_time_ns, zero_ns);
            }
            event
        });
    let RunSeries { mut series, elements, .. } = gathered;
    let origins = origins_of(sink.origins, zero_ns);
    drop_bad_readings(&mut series, &origins, &mut warnings);
    Ok(ReadReport {
        recording: Recording { events: events.collect(), series, elements, origins, steps },
        warnings,
        campaign_text: sink.campaign_text,
        plan_json: sink.plan_json,
        metadata: sink.metadata,
        format: sink.format,
        start_time_ns: zero_ns,
    })
}

fn find_missing_fields(
    map: &ChannelMap,
    builders: &BTreeMap<MappedQuantity, SeriesBuilder>,
) -> Vec<ReadWarning> {
    let absent = sources(map).filter(|(reads, _)| !builders.contains_key(reads));
    let warning = |(reads, source): (MappedQuantity, &ChannelSource)| ReadWarning::MissingChannel {
        channel: reads.channel(),
        topic: source.topic.clone(),
        field: source.field.clone(),
    };
    absent.map(warning).collect()
}

struct RunSeries {
    series: BTreeMap<Channel, Series>,
    elements: BTreeMap<Element, Series>,
}

/// Series over run time, gauge pressures made absolute.
fn gather(
    map: &ChannelMap,
    builders: BTreeMap<MappedQuantity, SeriesBuilder>,
    zero_ns: u64,
    ambient: Option<&Series>,
    warnings: &mut Vec<ReadWarning>,
) -> RunSeries {
    let mut gathered = RunSeries { series: BTreeMap::new(), elements: BTreeMap::new() };
    let ambient_pa = |t_s: f64| match (&map.ambient_pressure, ambient) {
        (Some(AmbientPressure::Constant(barometer)), _) => Some(barometer.pressure_pa),
        (_, Some(series)) => series.interpolate(t_s),
        _ => None,
    };
    for (reads, builder) in builders {
        let mut built = builder.build(reads.channel(), zero_ns, warnings);
        if built.t_s.is_empty() {
            continue;
        }
        if source_of(map, reads).is_some_and(|source| source.gauge) {
            if built.t_s.first().is_none_or(|t_s| ambient_pa(*t_s).is_none()) {
                warnings.push(ReadWarning::NoAmbient { channel: reads.channel() });
                continue;
            }
            for (t_s, value) in built.t_s.iter().zip(&mut built.values) {
                *value += ambient_pa(*t_s).unwrap_or(f64::NAN);
            }
        }
        match reads {
            MappedQuantity::Channel(channel) => drop(gathered.series.insert(channel, built)),
            MappedQuantity::Element(element) => drop(gathered.elements.insert(element, built)),
        }
    }
    gathered
}

/// Checks the readings against what is possible, and adds derived data: channels with several sensors, constants.
fn add_derived(
    map: &ChannelMap,
    gathered: &mut RunSeries,
    units: &BTreeMap<MappedQuantity, &'static Unit>,
    ambient: Option<(&Series, &'static Unit)>,
) -> Result<(), RecordError> {
    if !map.is_native() {
        let mut mistakes = MapMistakes::default();
        let (column, unit) = ambient.unzip();
        if let Some(pressure) = &map.ambient_pressure {
            plausibility::check_ambient(pressure, column, unit, &mut mistakes);
        }
        let ambient_pa = match (&map.ambient_pressure, column) {
            (Some(AmbientPressure::Constant(barometer)), _) => Some(barometer.pressure_pa),
            (_, Some(series)) => mapper_numerics::statistics::median(&series.values),
            _ => None,
        };
        for (reads, source) in sources(map) {
            let series = match reads {
                MappedQuantity::Channel(channel) => gathered.series.get(&channel),
                MappedQuantity::Element(element) => gathered.elements.get(&element),
            };
            if let (Some(series), Some(unit)) = (series, units.get(&reads)) {
                let channel = reads.channel();
                let readings = Readings { channel, source, unit, series, ambient_pa };
                plausibility::check(&readings, &mut mistakes);
            }
        }
        mistakes.into_result(map)?;
    }
    combine_sensors(map, &mut gathered.series, &gathered.elements);
    if let Some((first_s, last_s)) = span_s(&gathered.series) {
        for (channel, value) in &map.constants {
            gathered.series.entry(*channel).or_insert_with(|| constant_series(first_s, last_s, *value));
        }
    }
    Ok(())
}

/// Unusual provenance of readings, by channel.
fn origins_of(found: Vec<(u64, OriginMessage)>, zero_ns: u64) -> BTreeMap<Channel, Vec<ReadingOrigin>> {
    let mut origins: BTreeMap<Channel, Vec<ReadingOrigin>> = BTreeMap::new();
    for (log_time_ns, message) in found {
        for (channel, origin) in message {
            let t_s = run_time_s(log_time_ns, zero_ns);
            origins.entry(channel).or_default().push(ReadingOrigin { t_s, ..origin });
        }
    }
    origins.values_mut().for_each(|list| list.sort_by(|a, b| a.t_s.total_cmp(&b.t_s)));
    origins
}

fn drop_bad_readings(
    series: &mut BTreeMap<Channel, Series>,
    origins: &BTreeMap<Channel, Vec<ReadingOrigin>>,
    warnings: &mut Vec<ReadWarning>,
) {
    for (channel, list) in origins {
        let Some(series) = series.get_mut(channel) else { continue };
        let mut count = 0;
        for origin in list.iter().filter(|origin| origin.quality == Quality::Bad) {
            let at = series.t_s.binary_search_by(|t_s| t_s.total_cmp(&origin.t_s));
            if let Some(value) = at.ok().and_then(|at| series.values.get_mut(at)) {
                (*value, count) = (f64::NAN, count + 1);
            }
        }
        if count > 0 {
            warnings.push(ReadWarning::BadReadings { channel: *channel, count });
        }
    }
}

fn detect_steps(
    map: &ChannelMap,
    series: &mut BTreeMap<Channel, Series>,
    warnings: &mut Vec<ReadWarning>,
) -> Vec<StepMarker> {
    let turns = series.get(&Channel::ValveCommand).and_then(reversal_share);
    warnings.extend(turns.map(|share| ReadWarning::MeasuredValve { turns_percent: PERCENT * share }));
    // Neither a position nor a constant command marks steps.
    let marks = |channel: &Channel| {
        series.contains_key(channel)
            && !map.constants.contains_key(channel)
            && (turns.is_none() || *channel != Channel::ValveCommand)
    };
    let commands: Vec<Channel> =
        [Channel::P3Command, Channel::ValveCommand].into_iter().filter(marks).collect();
    let steps = find_steps(series, &commands, turns.is_some(), warnings);
    if let Some(position) = series.get_mut(&Channel::ValveCommand).filter(|_| turns.is_some()) {
        hold_at_step_ends(position, &steps);
    }
    drop_rest_steps(steps, series)
}

/// Adds the readings of channels of which the recording has only single sensors, at the times of the first sensor, as the rig would have
/// shown them. Identification checks and fuses the sensors itself.
fn combine_sensors(
    map: &ChannelMap,
    series: &mut BTreeMap<Channel, Series>,
    elements: &BTreeMap<Element, Series>,
) {
    let mut by_channel: BTreeMap<Channel, Vec<(Element, &Series)>> = BTreeMap::new();
    for (element, readings) in elements.iter().filter(|(element, _)| !series.contains_key(&element.channel)) {
        by_channel.entry(element.channel).or_default().push((*element, readings));
    }
    for (channel, members) in by_channel {
        let Some((_, first)) = members.first() else { continue };
        let count = members.iter().map(|(element, _)| element.number).max().unwrap_or(0);
        let alike = || {
            RedundantSensors::alike(channel, count, map.sensors.get(&channel).copied().unwrap_or_default())
        };
        let declared = map.redundant.get(&channel).filter(|declared| declared.elements.len() == count);
        let declared = declared.cloned().unwrap_or_else(alike);
        let at = |t_s: &f64| {
            let mut readings = vec![f64::NAN; count];
            for (element, series) in &members {
                readings[element.number - 1] = series.interpolate(*t_s).unwrap_or(f64::NAN);
            }
            declared.live(channel, &readings)
        };
        let together = Series { t_s: first.t_s.clone(), values: first.t_s.iter().map(at).collect() };
        series.insert(channel, together);
    }
}

fn constant_series(first_s: f64, last_s: f64, value: f64) -> Series {
    if first_s < last_s {
        Series { t_s: vec![first_s, last_s], values: vec![value; 2] }
    } else {
        Series { t_s: vec![first_s], values: vec![value] }
    }
}
