//! Takes samples, steps and events out of a recording, and leaves truth where it is.

use crate::definitions::{MappedTopic, Reads, map_topic};
use crate::format::{
    CAMPAIGN_NAME, EVENT_TOPIC, FORMAT_KEY, METADATA_NAME, PLAN_NAME, PROVENANCE_TOPIC, START_KEY, STEP_TOPIC,
};
use crate::message::{FieldValue, read_fields};
use crate::provenance::{OriginMessage, read_origins};
use crate::records::ChannelDefinition;
use crate::scan::Sink;
use crate::series_builder::SeriesBuilder;
use crate::steps::StepMessage;
use crate::{ChannelMap, FormatVersion, ReadWarning, RecordError};
use mapper_core::Event;
use mapper_logs::Unit;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What a topic means to this reader.
enum Topic {
    Mapped(MappedTopic),
    Step,
    Event,
    Provenance,
}

/// See the module.
pub(crate) struct RigSink<'a> {
    path: &'a Path,
    map: &'a ChannelMap,
    topics: BTreeMap<u16, Topic>,
    pub(crate) topic_names: BTreeSet<String>,
    pub(crate) builders: BTreeMap<Reads, SeriesBuilder>,
    /// Unit of each field that was mapped.
    pub(crate) units: BTreeMap<Reads, &'static Unit>,
    pub(crate) steps: Vec<(u64, StepMessage)>,
    pub(crate) events: Vec<(u64, Event)>,
    pub(crate) origins: Vec<(u64, OriginMessage)>,
    pub(crate) metadata: BTreeMap<String, String>,
    pub(crate) format: Option<FormatVersion>,
    pub(crate) start_time_ns: Option<u64>,
    pub(crate) plan_json: Option<Vec<u8>>,
    pub(crate) campaign_text: Option<String>,
    pub(crate) warnings: Vec<ReadWarning>,
    pub(crate) failure: Option<RecordError>,
    damaged: BTreeMap<String, u64>,
    values: Vec<FieldValue>,
    kept: u64,
}

impl<'a> RigSink<'a> {
    pub(crate) fn new(path: &'a Path, map: &'a ChannelMap) -> Self {
        RigSink {
            path,
            map,
            topics: BTreeMap::new(),
            topic_names: BTreeSet::new(),
            builders: BTreeMap::new(),
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
            values: Vec::new(),
            kept: 0,
        }
    }

    /// Warnings about messages that could not be read.
    pub(crate) fn damaged_messages(&self) -> impl Iterator<Item = ReadWarning> + '_ {
        self.damaged
            .iter()
            .map(|(topic, count)| ReadWarning::DamagedMessages { topic: topic.clone(), count: *count })
    }

    fn mapped(&mut self, definition: &ChannelDefinition) -> Option<Topic> {
        match map_topic(self.path, self.map, definition, &mut self.warnings) {
            Ok(mapped) => {
                let outputs = mapped.iter().flat_map(|topic| &topic.outputs);
                self.units.extend(outputs.map(|(_, reads, unit)| (*reads, *unit)));
                mapped.map(Topic::Mapped)
            }
            Err(error) => {
                self.failure.get_or_insert(error);
                None
            }
        }
    }
}

impl Sink for RigSink<'_> {
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

    fn message(&mut self, channel_id: u16, log_time_ns: u64, data: &[u8]) {
        let whole = match self.topics.get(&channel_id) {
            None => return,
            Some(Topic::Mapped(mapped)) => {
                let whole = read_fields(data, &mapped.fields, &mut self.values);
                for (index, reads, unit) in mapped.outputs.iter().filter(|_| whole) {
                    let builder = self.builders.entry(*reads).or_default();
                    match self.values.get(*index) {
                        Some(FieldValue::Number(value)) => {
                            self.kept += 1;
                            builder.push(log_time_ns, unit.to_inside(*value));
                        }
                        Some(FieldValue::Other) => {
                            self.kept += 1;
                            builder.push(log_time_ns, f64::NAN);
                            builder.not_numbers += 1;
                        }
                        Some(FieldValue::Absent) | None => {}
                    }
                }
                if whole { Ok(()) } else { Err(mapped.topic.clone()) }
            }
            Some(Topic::Step) => {
                self.kept += values_of(size_of::<StepMessage>());
                serde_json::from_slice(data)
                    .map(|step| self.steps.push((log_time_ns, step)))
                    .map_err(|_| STEP_TOPIC.to_owned())
            }
            Some(Topic::Provenance) => {
                let origins = read_origins(data);
                self.kept += values_of(data.len());
                let whole = origins.ok_or_else(|| PROVENANCE_TOPIC.to_owned());
                whole.map(|origins| self.origins.push((log_time_ns, origins)))
            }
            Some(Topic::Event) => {
                self.kept += values_of(size_of::<Event>() + data.len());
                serde_json::from_slice(data)
                    .map(|event| self.events.push((log_time_ns, event)))
                    .map_err(|_| EVENT_TOPIC.to_owned())
            }
        };
        if let Err(topic) = whole {
            *self.damaged.entry(topic).or_default() += 1;
        }
    }

    fn kept(&self) -> u64 {
        self.kept
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

/// How many values of a series, with their times, take as much memory.
fn values_of(bytes: usize) -> u64 {
    u64::try_from(bytes / 16 + 1).unwrap_or(u64::MAX)
}
