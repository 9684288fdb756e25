//! Reads a log of another program with a channel map.

use crate::channel_mapping::channel_map::{MappedQuantity, source_of, sources};
use crate::channel_mapping::channel_map_yaml::MapMistakes;
use crate::logs::{Layout, LogFile, Row};
use crate::samples::log_clock::{BlockAverager, LogClock};
use crate::samples::series_builder::SeriesBuilder;
use crate::{AmbientPressure, ChannelMap, ChannelSource, ReadOptions, ReadWarning, RecordError};
use mapper_core::Channel;
use mapper_core::unit_factors::NS_PER_S;
use mapper_table::{Reference, header_unit, kind_of, remedy, unit};
use mapper_yaml::units::{Kind, Unit};
use mapper_yaml::{FindingKind, Step, closest, steps};
use std::collections::BTreeMap;
use std::path::Path;

/// Time 0 of a log on the clock of [`SeriesBuilder`]; it leaves room for negative times. Bound: room for negative times.
const LOG_ZERO_NS: u64 = 1 << 62;

#[derive(Debug, Default)]
pub(crate) struct LogContent {
    pub(crate) builders: BTreeMap<MappedQuantity, SeriesBuilder>,
    pub(crate) ambient: Option<SeriesBuilder>,
    pub(crate) ambient_unit: Option<&'static Unit>,
    pub(crate) units: BTreeMap<MappedQuantity, &'static Unit>,
    pub(crate) zero_ns: u64,
    /// Time 0 in nanoseconds since 1970, if the log gives it.
    pub(crate) start_time_ns: Option<u64>,
    pub(crate) warnings: Vec<ReadWarning>,
    pub(crate) averaged: bool,
    kept: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    MappedQuantity(MappedQuantity),
    Ambient,
}

struct WantedColumn {
    target: Target,
    column: usize,
    unit: &'static Unit,
}

pub(crate) fn read_log(
    file: &LogFile,
    map: &ChannelMap,
    options: &ReadOptions,
) -> Result<LogContent, RecordError> {
    let (format, mut log) = options.logs.open(file, &map.log)?;
    let layout = log.layout().clone();
    let wanted = resolve_columns(map, &layout)?;
    // Each column once, in the order of the layout: several channels may read one.
    let mut columns: Vec<usize> = wanted.iter().map(|wanted| wanted.column).collect();
    columns.sort_unstable();
    columns.dedup();
    let members: Vec<Vec<usize>> =
        (0..layout.groups.len()).map(|group| layout.members(group, &columns)).collect();
    // Index of each wanted column among the values of its group.
    let places: Vec<Vec<(usize, Target, &'static Unit)>> = members
        .iter()
        .map(|members| {
            let place = |wanted: &WantedColumn| {
                let at = members.iter().position(|column| *column == wanted.column)?;
                Some((at, wanted.target, wanted.unit))
            };
            wanted.iter().filter_map(place).collect()
        })
        .collect();
    let mut read = LogContent {
        zero_ns: LOG_ZERO_NS,
        start_time_ns: layout.start_time_ns,
        warnings: find_unit_conflicts(map, &layout, &wanted),
        ambient_unit: wanted.iter().find(|wanted| wanted.target == Target::Ambient).map(|found| found.unit),
        units: wanted
            .iter()
            .filter_map(|wanted| match wanted.target {
                Target::MappedQuantity(reads) => Some((reads, wanted.unit)),
                Target::Ambient => None,
            })
            .collect(),
        ..LogContent::default()
    };
    let averager = || if options.averages { BlockAverager::default() } else { BlockAverager::never() };
    let mut blocks: Vec<BlockAverager> = members.iter().map(|_| averager()).collect();
    let mut clocks: Vec<LogClock> = members.iter().map(|_| LogClock::default()).collect();
    let mut rows = 0u64;
    let mut take_row = |row: Row<'_>| {
        rows += 1;
        if rows > options.max_messages {
            let message =
                format!("it has more than {} rows; split it into shorter logs", options.max_messages);
            return Err(file.content_error(format.name, message));
        }
        if read.kept > options.max_values {
            let message = format!(
                "its mapped columns hold more than {} values; map fewer columns, or split it into shorter logs",
                options.max_values
            );
            return Err(file.content_error(format.name, message));
        }
        let of_group = (clocks.get_mut(row.group), blocks.get_mut(row.group), places.get(row.group));
        let (Some(clock), Some(blocks), Some(places)) = of_group else { return Ok(()) };
        let mut keep = |t_s: f64, values: &[f64]| read.take(places, t_s, values);
        let took = clock.push(row.t_s, row.values, &mut |t_s, values| blocks.push(t_s, values, &mut keep));
        let name = layout.groups.get(row.group).map_or("", |group| group.name.as_str());
        let of = if name.is_empty() { String::new() } else { format!(" of `{name}`") };
        took.map_err(|restart| file.content_error(format.name, restart.describe(&of)))
    };
    log.rows(&columns, &mut take_row)?;
    let found_later = log.layout().findings.iter().filter(|finding| !layout.findings.contains(finding));
    read.warnings.extend(found_later.map(|finding| ReadWarning::Log { finding: finding.clone() }));
    for ((clock, blocks), places) in clocks.iter_mut().zip(&mut blocks).zip(&places) {
        let mut keep = |t_s: f64, values: &[f64]| read.take(places, t_s, values);
        clock.finish(&mut |t_s, values| blocks.push(t_s, values, &mut keep));
        if clock.strays > 0 {
            read.warnings.push(ReadWarning::StrayTimes { count: clock.strays, first_s: clock.stray_s });
        }
        blocks.finish(&mut |t_s, values| read.take(places, t_s, values));
        read.averaged |= blocks.is_averaging();
    }
    Ok(read)
}

impl LogContent {
    fn take(&mut self, places: &[(usize, Target, &'static Unit)], t_s: f64, values: &[f64]) {
        let time_ns = LOG_ZERO_NS.saturating_add_signed((t_s * NS_PER_S).round() as i64);
        for (at, target, unit) in places {
            // An empty cell is not a sample: slow and fast columns share rows.
            let Some(value) = values.get(*at).copied().filter(|value| value.is_finite()) else { continue };
            let builder = match target {
                Target::MappedQuantity(reads) => self.builders.entry(*reads).or_default(),
                Target::Ambient => self.ambient.get_or_insert_default(),
            };
            builder.push(time_ns, unit.to_inside(value));
            self.kept += 1;
        }
    }
}

/// The columns that the map names, with their units; or all mistakes of the map for this log.
fn resolve_columns(map: &ChannelMap, layout: &Layout) -> Result<Vec<WantedColumn>, RecordError> {
    let mut mistakes = MapMistakes::default();
    let mut list = Vec::new();
    let mut add = |target: Target, source: &ChannelSource, at: &dyn Fn(&str) -> Vec<Step>| {
        let Some(column) = column_of(layout, source, at, &mut mistakes) else { return };
        let channel = match target {
            Target::MappedQuantity(quantity) => Some(quantity.channel()),
            Target::Ambient => None,
        };
        let unit = unit_of(layout, column, source, channel, at, &mut mistakes);
        list.extend(unit.map(|unit| WantedColumn { target, column, unit }));
    };
    for (quantity, source) in sources(map) {
        let symbol = quantity.channel().symbol();
        add(Target::MappedQuantity(quantity), source, &|key| steps!["channels", symbol, key].to_vec());
    }
    if let Some(AmbientPressure::Source(source)) = &map.ambient_pressure {
        add(Target::Ambient, source, &|key| steps!["ambient_pressure", key].to_vec());
    }
    mistakes.into_result(map)?;
    Ok(list)
}

fn find_unit_conflicts(map: &ChannelMap, layout: &Layout, wanted: &[WantedColumn]) -> Vec<ReadWarning> {
    let contradiction = |wanted: &WantedColumn| {
        let Target::MappedQuantity(reads) = wanted.target else { return None };
        let recorded = layout.columns.get(wanted.column)?.unit.clone()?;
        let known = header_unit(&recorded);
        let agrees = known.is_some_and(|known| known.unit.converts_like(wanted.unit));
        let mapped = source_of(map, reads)?.unit.clone()?;
        (!agrees).then(|| ReadWarning::UnitContradiction { channel: reads.channel(), mapped, recorded })
    };
    wanted.iter().filter_map(contradiction).collect()
}

fn column_of(
    layout: &Layout,
    source: &ChannelSource,
    at: &dyn Fn(&str) -> Vec<Step>,
    mistakes: &mut MapMistakes,
) -> Option<usize> {
    let columns = layout.find(&source.topic, &source.field);
    if let [column] = columns.as_slice() {
        return Some(*column);
    }
    if !source.topic.is_empty() && !layout.groups.iter().any(|group| group.name == source.topic) {
        let names: Vec<&str> =
            layout.groups.iter().map(|group| group.name.as_str()).filter(|name| !name.is_empty()).collect();
        let remedy = if names.is_empty() {
            "the log has one group without a name: leave `topic` out".to_owned()
        } else {
            format!("its groups are {}", names.join(", "))
        };
        mistakes.add(
            FindingKind::WrongValue,
            &at("topic"),
            format!("the log has no group `{}`", source.topic),
            remedy,
        );
        return None;
    }
    let (message, remedy) = if columns.is_empty() {
        let names: Vec<&str> = layout.columns.iter().map(|column| column.name.as_str()).collect();
        let guess = closest(&source.field, &names).map(|name| format!("did you mean `{name}`? "));
        let shown: Vec<&str> = names.iter().copied().take(30).collect();
        let more = if names.len() > shown.len() {
            format!(" and {} more", names.len() - shown.len())
        } else {
            String::new()
        };
        (
            format!("the log has no column `{}`", source.field),
            format!("{}its columns are {}{more}", guess.unwrap_or_default(), shown.join(", ")),
        )
    } else {
        let groups: Vec<&str> = columns
            .iter()
            .filter_map(|column| layout.groups.get(layout.columns.get(*column)?.group))
            .map(|group| group.name.as_str())
            .collect();
        (
            format!("the log has `{}` in several groups", source.field),
            format!("name one with `topic`: {}", groups.join(", ")),
        )
    };
    mistakes.add(FindingKind::WrongValue, &at("field"), message, remedy);
    None
}

/// The unit of the map, or else that of the log. `channel` is `None` for the ambient pressure.
fn unit_of(
    layout: &Layout,
    column: usize,
    source: &ChannelSource,
    channel: Option<Channel>,
    at: &dyn Fn(&str) -> Vec<Step>,
    mistakes: &mut MapMistakes,
) -> Option<&'static Unit> {
    let kind = channel.map_or(Kind::Pressure, kind_of);
    let name = channel.map_or("the ambient pressure", Channel::symbol);
    let recorded = layout.columns.get(column).and_then(|column| column.unit.as_deref());
    if let Some((message, remedy)) =
        recorded.and_then(|text| describe_reference_conflict(name, text, source, channel))
    {
        mistakes.add(FindingKind::Unit, &at("field"), message, remedy);
        return None;
    }
    // The values of the map were checked when it was read.
    if let Some(written) = &source.unit {
        return unit(kind, written).ok();
    }
    let Some(recorded) = recorded else {
        let message = format!("neither the channel map nor the log gives the unit of {name}");
        let example = channel.map_or("kPa", |channel| channel.unit());
        mistakes.add(FindingKind::Unit, &at("field"), message, format!("add e.g. `unit: {example}`"));
        return None;
    };
    if let Some(known) = header_unit(recorded).filter(|known| known.kind == kind) {
        return Some(known.unit);
    }
    match unit(kind, recorded) {
        Ok(unit) => Some(unit),
        Err(error) => {
            let message =
                format!("the log gives {name} in `{recorded}`, which is not a unit of {}", kind.name());
            let remedy = format!("{}; write `unit`", remedy(kind, &error));
            mistakes.add(FindingKind::Unit, &at("field"), message, remedy);
            None
        }
    }
}

/// If the log and the map give different references of a pressure: a message and the remedy.
fn describe_reference_conflict(
    name: &str,
    recorded: &str,
    source: &ChannelSource,
    channel: Option<Channel>,
) -> Option<(String, String)> {
    let known = header_unit(recorded).filter(|known| known.kind == Kind::Pressure)?;
    let (reference, remedy) = match (known.reference, source.gauge, channel) {
        (Reference::Gauge, _, None) => {
            ("a gauge pressure", "name a column of the absolute ambient pressure, or write its value")
        }
        (Reference::Gauge, false, Some(_)) => {
            ("a gauge pressure", "write `gauge: true`, and `ambient_pressure`")
        }
        (Reference::Absolute, true, _) => ("an absolute pressure", "delete `gauge: true`"),
        _ => return None,
    };
    Some((format!("the log gives {name} in {recorded}, {reference}"), remedy.to_owned()))
}

/// Whether a file that starts with these bytes is MCAP, or too short to be anything else; an empty file is neither.
pub(crate) fn is_mcap(head: &[u8]) -> bool {
    head.starts_with(b"\x89MCAP") || !head.is_empty() && head.len() < 5 && b"\x89MCAP".starts_with(head)
}

/// The file as a log, if it is not MCAP and there are log formats.
pub(crate) fn log_of_path(path: &Path, options: &ReadOptions) -> Result<Option<LogFile>, RecordError> {
    if options.logs.0.is_empty() {
        return Ok(None);
    }
    let file = LogFile::from_path(path);
    Ok((!is_mcap(&file.head(8)?)).then_some(file))
}
