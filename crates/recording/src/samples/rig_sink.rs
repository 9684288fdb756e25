//! Collects samples, steps and events of a recording, and ignores truth.

use crate::channel_mapping::channel_map::{MappedQuantity, MappedTopic, map_topic};
use crate::mcap::{ChannelDefinition, FieldValue, Sink, read_fields};
use crate::samples::log_clock::BlockAverager;
use crate::samples::series_builder::{SeriesBuilder, run_time_s};
use crate::steps::StepMessage;
use crate::topics::{
    CAMPAIGN_NAME, EVENT_TOPIC, FORMAT_KEY, METADATA_NAME, OriginMessage, PLAN_NAME, PROVENANCE_TOPIC,
    START_KEY, STEP_TOPIC, read_origins,
};
use crate::{ChannelMap, FormatVersion, ReadWarning, RecordError};
use mapper_core::Event;
use mapper_core::unit_factors::NS_PER_S;
use mapper_yaml::units::Unit;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

enum Topic {
    /// Readings, with the index of each output's series, averaged if they are fast.
    Mapped(MappedTopic, Vec<usize>, BlockAverager),
    Step,
    Event,
    Provenance,
}

impl Topic {
    fn name(&self) -> &str {
        match self {
            Topic::Mapped(mapped, ..) => &mapped.topic,
            Topic::Step => STEP_TOPIC,
            Topic::Event => EVENT_TOPIC,
            Topic::Provenance => PROVENANCE_TOPIC,
        }
    }
}

pub(crate) enum SinkMessage {
    /// A value for each output of its topic, in internal units.
    Samples(Vec<FieldValue>),
    Step(StepMessage),
    /// Unusual provenance, with the size of the message in bytes.
    Origins(OriginMessage, usize),
    Event(Event, usize),
    Damaged,
}

#[derive(Debug)]
pub(crate) struct PositionedMessage<T> {
    pub(crate) position: u64,
    pub(crate) log_time_ns: u64,
    pub(crate) message: T,
}

/// Collects everything of a recording that [`crate::read_recording`] returns.
pub(crate) struct RigSink<'a> {
    path: &'a Path,
    map: &'a ChannelMap,
    averages: bool,
    topics: BTreeMap<u16, Topic>,
    pub(crate) topic_names: BTreeSet<String>,
    /// The topics to read, in the order in which the file defines them.
    series: Vec<(MappedQuantity, SeriesBuilder)>,
    /// Unit of each field that was mapped.
    pub(crate) units: BTreeMap<MappedQuantity, &'static Unit>,
    pub(crate) steps: Vec<PositionedMessage<StepMessage>>,
    pub(crate) events: Vec<PositionedMessage<Event>>,
    pub(crate) origins: Vec<(u64, OriginMessage)>,
    pub(crate) metadata: BTreeMap<String, String>,
    pub(crate) format: Option<FormatVersion>,
    pub(crate) start_time_ns: Option<u64>,
    pub(crate) plan_json: Option<Vec<u8>>,
    pub(crate) campaign_text: Option<String>,
    pub(crate) warnings: Vec<ReadWarning>,
    pub(crate) failure: Option<RecordError>,
    damaged: BTreeMap<String, u64>,
    value_count: u64,
    position: u64,
    /// Time of the first readings, from which those of blocks count.
    first_time_ns: Option<u64>,
}

impl<'a> RigSink<'a> {
    pub(crate) fn new(path: &'a Path, map: &'a ChannelMap, averages: bool) -> Self {
        RigSink {
            path,
            map,
            averages,
            topics: BTreeMap::new(),
            topic_names: BTreeSet::new(),
            series: Vec::new(),
            units: BTreeMap::new(),
            steps: Vec::new(),
            events: Vec::new(),
            origins: Vec::new(),
            metadata: BTreeMap::new(),
            format: None,
            start_time_ns: None,
            plan_json: None,
            campaign_text: None,
            warnings: Vec::new(),
            failure: None,
            damaged: BTreeMap::new(),
            value_count: 0,
            position: 0,
            first_time_ns: None,
        }
    }

    pub(crate) fn damaged_messages(&self) -> impl Iterator<Item = ReadWarning> + '_ {
        self.damaged
            .iter()
            .map(|(topic, count)| ReadWarning::DamagedMessages { topic: topic.clone(), count: *count })
    }

    pub(crate) fn is_averaged(&self) -> bool {
        self.topics.values().any(|topic| matches!(topic, Topic::Mapped(.., blocks) if blocks.is_averaging()))
    }

    pub(crate) fn take_builders(&mut self) -> BTreeMap<MappedQuantity, SeriesBuilder> {
        let (position, zero_ns) = (self.position, self.first_time_ns.unwrap_or(0));
        for topic in self.topics.values_mut() {
            if let Topic::Mapped(_, builders, blocks) = topic {
                blocks.finish(&mut |t_s, means| {
                    push_means(&mut self.series, builders, position, (zero_ns, t_s), means);
                });
            }
        }
        std::mem::take(&mut self.series).into_iter().filter(|(_, builder)| !builder.is_empty()).collect()
    }

    /// The series that collects the samples of a channel or sensor; several topics may have the same one.
    fn builder(&mut self, reads: MappedQuantity) -> usize {
        let known = self.series.iter().position(|(known, _)| *known == reads);
        known.unwrap_or_else(|| {
            self.series.push((reads, SeriesBuilder::default()));
            self.series.len() - 1
        })
    }

    fn mapped(&mut self, definition: &ChannelDefinition) -> Option<Topic> {
        match map_topic(self.path, self.map, definition, &mut self.warnings) {
            Ok(mapped) => {
                let outputs = mapped.iter().flat_map(|topic| &topic.outputs);
                self.units.extend(outputs.map(|(_, reads, unit)| (*reads, *unit)));
                let mapped = mapped?;
                let builders = mapped.outputs.iter().map(|(_, reads, _)| self.builder(*reads)).collect();
                let blocks = if self.averages { BlockAverager::unbuffered() } else { BlockAverager::never() };
                Some(Topic::Mapped(mapped, builders, blocks))
            }
            Err(error) => {
                self.failure.get_or_insert(error);
                None
            }
        }
    }
}

impl Sink for RigSink<'_> {
    type SinkMessage = SinkMessage;

    fn define(&mut self, definition: &ChannelDefinition) {
        self.topic_names.insert(definition.topic.clone());
        let topic = match definition.topic.as_str() {
            STEP_TOPIC => Some(Topic::Step),
            EVENT_TOPIC => Some(Topic::Event),
            PROVENANCE_TOPIC => Some(Topic::Provenance),
            _ => self.mapped(definition),
        };
        let Some(topic) = topic else { return };
        if definition.encoding != "json" {
            let (topic, encoding) = (definition.topic.clone(), definition.encoding.clone());
            self.warnings.push(ReadWarning::UnknownEncoding { topic, encoding });
            return;
        }
        self.topics.insert(definition.id, topic);
    }

    fn read(&self, channel_id: u16, data: &[u8]) -> Option<SinkMessage> {
        let content = match self.topics.get(&channel_id)? {
            Topic::Mapped(mapped, ..) => {
                let mut values = Vec::new();
                read_fields(data, &mapped.fields, &mut values).then(|| {
                    let inside = |(index, _, unit): &(usize, MappedQuantity, &'static Unit)| match values
                        .get(*index)
                    {
                        Some(FieldValue::Number(value)) => FieldValue::Number(unit.to_inside(*value)),
                        Some(other) => *other,
                        None => FieldValue::Absent,
                    };
                    SinkMessage::Samples(mapped.outputs.iter().map(inside).collect())
                })
            }
            Topic::Step => serde_json::from_slice(data).map(SinkMessage::Step).ok(),
            Topic::Provenance => read_origins(data).map(|origins| SinkMessage::Origins(origins, data.len())),
            Topic::Event => {
                serde_json::from_slice(data).map(|event| SinkMessage::Event(event, data.len())).ok()
            }
        };
        Some(content.unwrap_or(SinkMessage::Damaged))
    }

    fn take(&mut self, channel_id: u16, log_time_ns: u64, content: SinkMessage) {
        let Some(topic) = self.topics.get_mut(&channel_id) else { return };
        self.position += 1;
        let position = self.position;
        match (content, topic) {
            (SinkMessage::Samples(values), Topic::Mapped(_, builders, blocks)) => {
                for (value, builder) in values.iter().zip(&*builders) {
                    if let (FieldValue::Other, Some((_, builder))) = (value, self.series.get_mut(*builder)) {
                        builder.non_numeric_count += 1;
                    }
                }
                let zero_ns = *self.first_time_ns.get_or_insert(log_time_ns);
                let numbers: Vec<f64> = values
                    .iter()
                    .map(|value| if let FieldValue::Number(number) = value { *number } else { f64::NAN })
                    .collect();
                let is_averaged = blocks.is_averaging();
                let mut count = 0;
                blocks.push(run_time_s(log_time_ns, zero_ns), &numbers, &mut |t_s, means| {
                    if is_averaged {
                        count += push_means(&mut self.series, builders, position, (zero_ns, t_s), means);
                        return;
                    }
                    for (value, builder) in values.iter().zip(&*builders) {
                        let Some((_, builder)) = self.series.get_mut(*builder) else { continue };
                        match value {
                            FieldValue::Number(value) => builder.push_at(position, log_time_ns, *value),
                            FieldValue::Other => builder.push_at(position, log_time_ns, f64::NAN),
                            FieldValue::Absent => continue,
                        }
                        count += 1;
                    }
                });
                self.value_count += count;
            }
            (SinkMessage::Step(step), _) => {
                self.value_count += values_of(size_of::<StepMessage>());
                self.steps.push(PositionedMessage { position, log_time_ns, message: step });
            }
            (SinkMessage::Origins(origins, bytes), _) => {
                self.value_count += values_of(bytes);
                self.origins.push((log_time_ns, origins));
            }
            (SinkMessage::Event(event, bytes), _) => {
                self.value_count += values_of(size_of::<Event>() + bytes);
                self.events.push(PositionedMessage { position, log_time_ns, message: event });
            }
            (SinkMessage::Damaged | SinkMessage::Samples(_), topic) => {
                *self.damaged.entry(topic.name().to_owned()).or_default() += 1;
            }
        }
    }

    fn value_count(&self) -> u64 {
        self.value_count
    }

    fn metadata(&mut self, name: String, mut pairs: BTreeMap<String, String>) {
        if name != METADATA_NAME || self.format.is_some() {
            return;
        }
        let mut take = |key| pairs.remove(key).and_then(|text| text.parse().ok());
        let format = take(FORMAT_KEY).and_then(|version| u32::try_from(version).ok()).map(FormatVersion);
        let start_time_ns: Option<u64> = take(START_KEY);
        if let Some(found) = format.filter(|found| *found > FormatVersion::CURRENT) {
            let path = self.path.to_owned();
            self.failure.get_or_insert(RecordError::NewerFormat { path, found });
        }
        (self.format, self.start_time_ns, self.metadata) = (format, start_time_ns, pairs);
    }

    fn attachment(&mut self, name: String, data: &[u8]) {
        match name.as_str() {
            PLAN_NAME => self.plan_json = Some(data.to_owned()),
            CAMPAIGN_NAME => self.campaign_text = Some(String::from_utf8_lossy(data).into_owned()),
            _ => {}
        }
    }
}

/// Adds the means of a block, at a run time, to their series; returns the number of values.
fn push_means(
    series: &mut [(MappedQuantity, SeriesBuilder)],
    builders: &[usize],
    position: u64,
    (zero_ns, t_s): (u64, f64),
    means: &[f64],
) -> u64 {
    let time_ns = zero_ns.saturating_add_signed((t_s * NS_PER_S).round() as i64);
    let mut count = 0;
    for (mean, builder) in means.iter().zip(builders).filter(|(mean, _)| mean.is_finite()) {
        if let Some((_, builder)) = series.get_mut(*builder) {
            builder.push_at(position, time_ns, *mean);
            count += 1;
        }
    }
    count
}

/// Number of values of a series, with their times, that take the same memory.
fn values_of(bytes: usize) -> u64 {
    u64::try_from(bytes / 16 + 1).unwrap_or(u64::MAX)
}
