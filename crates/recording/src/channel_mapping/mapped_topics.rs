//! Assigns fields of topics to channels, with their units.

use crate::mcap::records::ChannelDefinition;
use crate::{ChannelMap, ChannelSource, ReadWarning, RecordError};
use mapper_core::{Channel, Element};
use mapper_table::{kind_of, unit};
use mapper_yaml::units::{Kind, Unit};
use serde_json::Value;
use std::path::Path;

/// The quantity of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum MappedQuantity {
    /// A channel.
    Channel(Channel),
    /// One of several sensors of a channel.
    Element(Element),
}

impl MappedQuantity {
    pub(crate) fn channel(self) -> Channel {
        match self {
            MappedQuantity::Channel(channel) | MappedQuantity::Element(Element { channel, .. }) => channel,
        }
    }
}

/// All channels and sensors of the map, with their sources.
pub(crate) fn sources(map: &ChannelMap) -> impl Iterator<Item = (MappedQuantity, &ChannelSource)> {
    let channels = map.channels.iter().map(|(channel, source)| (MappedQuantity::Channel(*channel), source));
    channels.chain(map.elements.iter().map(|(element, source)| (MappedQuantity::Element(*element), source)))
}

/// Topic and field of a channel or sensor in the map.
pub(crate) fn source_of(map: &ChannelMap, reads: MappedQuantity) -> Option<&ChannelSource> {
    match reads {
        MappedQuantity::Channel(channel) => map.channels.get(&channel),
        MappedQuantity::Element(element) => map.elements.get(&element),
    }
}

/// A mapped topic of a recording.
#[derive(Debug)]
pub(crate) struct MappedTopic {
    pub(crate) topic: String,
    /// Fields to read, each once.
    pub(crate) fields: Vec<String>,
    /// Index of the field, its quantity, unit of the field.
    pub(crate) outputs: Vec<(usize, MappedQuantity, &'static Unit)>,
}

/// The mapped channels of a topic; `None` if the map has none on it.
pub(crate) fn map_topic(
    path: &Path,
    map: &ChannelMap,
    definition: &ChannelDefinition,
    warnings: &mut Vec<ReadWarning>,
) -> Result<Option<MappedTopic>, RecordError> {
    let mut mapped = MappedTopic { topic: definition.topic.clone(), fields: Vec::new(), outputs: Vec::new() };
    let schema: Value = serde_json::from_slice(&definition.schema).unwrap_or(Value::Null);
    for (reads, source) in sources(map).filter(|(_, source)| source.topic == definition.topic) {
        if map.is_native() && !definition.metadata.contains_key(&source.field) {
            // The run did not measure this field.
            continue;
        }
        let channel = reads.channel();
        let recorded = recorded_unit(definition, &schema, source, kind_of(channel));
        let unit = resolve(path, channel, source, recorded, warnings)?;
        let index = mapped.fields.iter().position(|field| *field == source.field).unwrap_or_else(|| {
            mapped.fields.push(source.field.clone());
            mapped.fields.len() - 1
        });
        mapped.outputs.push((index, reads, unit));
    }
    Ok((!mapped.outputs.is_empty()).then_some(mapped))
}

/// Places where programs store a unit: the topic's metadata, `unit` in the schema, or the description in the schema.
fn recorded_unit(
    definition: &ChannelDefinition,
    schema: &Value,
    source: &ChannelSource,
    kind: Kind,
) -> Option<String> {
    let property = schema.get("properties").and_then(|properties| properties.get(&source.field));
    let text = |key| property.and_then(|property: &Value| property.get(key)).and_then(Value::as_str);
    definition
        .metadata
        .get(&source.field)
        .map(String::as_str)
        .or_else(|| text("unit"))
        // A description may be any text: it counts only if the whole of it is a unit of the channel.
        .or_else(|| text("description").filter(|description| unit(kind, description).is_ok()))
        .map(str::to_owned)
}

fn resolve(
    path: &Path,
    channel: Channel,
    source: &ChannelSource,
    recorded: Option<String>,
    warnings: &mut Vec<ReadWarning>,
) -> Result<&'static Unit, RecordError> {
    let kind = kind_of(channel);
    let parse = |name: &str| {
        unit(kind, name).map_err(|error| RecordError::BadUnit {
            path: path.to_owned(),
            channel,
            topic: source.topic.clone(),
            field: source.field.clone(),
            source: Box::new(error),
        })
    };
    match (&source.unit, recorded) {
        (Some(mapped), recorded) => {
            let used = parse(mapped)?;
            let agrees = |recorded: &String| unit(kind, recorded).is_ok_and(|unit| unit.converts_like(used));
            if let Some(recorded) = recorded.filter(|recorded| !agrees(recorded)) {
                let mapped = mapped.clone();
                warnings.push(ReadWarning::UnitContradiction { channel, mapped, recorded });
            }
            Ok(used)
        }
        (None, Some(recorded)) => parse(&recorded),
        (None, None) => Err(RecordError::MissingUnit {
            path: path.to_owned(),
            channel,
            topic: source.topic.clone(),
            field: source.field.clone(),
        }),
    }
}
