//! Channel maps, and the topics that they name.
//!
//! Messages quote the descriptions of the JSON schema, so they describe what to write. Its quantities are plain strings or numbers: recordings of
//! other programs spell units in more ways than campaigns may, and a ratio may be written without a unit.
//! [`crate::channel_mapping::channel_map_yaml`] parses them.

use crate::logs::finding::STANDARD_ATMOSPHERE_PA;
use crate::logs::{LogOptions, OPTION_KEYS};
use crate::mcap::ChannelDefinition;
use crate::topics::ELEMENTS_TOPIC;
use crate::{ReadWarning, RecordError};
use mapper_core::{
    CHANNELS, Channel, DeclaredUncertainty, Element, Group, MAX_ELEMENTS, NAMED_REFERENCES, NoiseColour,
    RedundantSensors, ReferenceState,
};
use mapper_table::{kind_of, unit};
use mapper_yaml::Schema;
use mapper_yaml::keys::Key;
use mapper_yaml::units::{Kind, Unit};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Temperature of the standard atmosphere at sea level, K. Source: ISO 2533.
const SEA_LEVEL_K: f64 = 288.15;
/// Its gradient, K/m. Source: ISO 2533.
const GRADIENT_K_M: f64 = 6.5e-3;
/// Gravity over the gas constant and the gradient. Source: ISO 2533.
const BAROMETRIC_EXPONENT: f64 = 5.255_88;

/// Maps a recording's topics and fields onto channels. SI inside; written with units in YAML.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChannelMap {
    /// Topic, field and unit of each channel.
    pub channels: BTreeMap<Channel, ChannelSource>,
    /// Topic, field and unit of each sensor of the channels that have several; such a channel need not be listed in
    /// `channels`: its reading is then computed from theirs.
    pub elements: BTreeMap<Element, ChannelSource>,
    /// Channels with a constant known value that the recording does not contain; SI, in the channel's unit.
    pub constants: BTreeMap<Channel, f64>,
    /// Machine data for the identification without a campaign.
    pub machine: Option<MachineConstants>,
    /// Reference state of corrected quantities.
    pub reference: Option<ReferenceState>,
    /// Window of identification within each step.
    pub window: Option<WindowLimits>,
    /// Declared uncertainty of the sensors.
    pub sensors: BTreeMap<Channel, DeclaredUncertainty>,
    /// Declared uncertainty of each sensor of the channels that have several; `sensors` then has that of the combined reading.
    pub redundant: BTreeMap<Channel, RedundantSensors>,
    /// Correlation of the sensors' noise in time.
    pub noise_colour: Option<NoiseColour>,
    /// Ambient pressure that is added to gauge pressures.
    pub ambient_pressure: Option<AmbientPressure>,
    /// Settings for reading a log of another program, if they cannot be detected.
    pub log: LogOptions,
    /// File and text of the map, for messages with line and caret.
    pub(crate) text: Option<(PathBuf, String)>,
    pub(crate) native: bool,
}

/// The reference of gauge pressures.
#[derive(Debug, Clone, PartialEq)]
pub enum AmbientPressure {
    /// A known value.
    Constant(Barometer),
    /// A column of the log.
    Source(ChannelSource),
}

/// A constant ambient pressure with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barometer {
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// One standard deviation, Pa.
    pub sigma_pa: f64,
}

pub(crate) const UNKNOWN_WORD: &str = "unknown";
/// Uncertainty of a barometer's reading, Pa. Bound: the weather changes it by some hectopascal while a test runs.
const READING_SIGMA_PA: f64 = 100.0;
/// Uncertainty of the pressure at a known altitude, Pa. Bound: the weather of the middle latitudes.
const ALTITUDE_SIGMA_PA: f64 = 1e3;
/// Uncertainty of the pressure at an unknown place, Pa. Bound: weather, and altitudes of up to some 500 m.
const UNKNOWN_SIGMA_PA: f64 = 3e3;

impl Barometer {
    /// A barometer's reading, with the uncertainty of the weather during a test.
    pub fn from_reading(pressure_pa: f64) -> Self {
        Barometer { pressure_pa, sigma_pa: READING_SIGMA_PA }
    }

    /// The standard atmosphere (ISO 2533) at an altitude below 11 km.
    pub fn at_altitude(altitude_m: f64) -> Self {
        let ratio = (1.0 - GRADIENT_K_M * altitude_m / SEA_LEVEL_K).max(0.0);
        Barometer {
            pressure_pa: STANDARD_ATMOSPHERE_PA * ratio.powf(BAROMETRIC_EXPONENT),
            sigma_pa: ALTITUDE_SIGMA_PA,
        }
    }

    /// The standard atmosphere, for a stand of unknown altitude.
    pub fn unknown() -> Self {
        Barometer { pressure_pa: STANDARD_ATMOSPHERE_PA, sigma_pa: UNKNOWN_SIGMA_PA }
    }
}

/// One field of one topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelSource {
    /// Topic, e.g. `/rig/compressor`, or group of a log; empty for any group of a log.
    pub topic: String,
    /// Field of the topic's messages.
    pub field: String,
    /// Unit of the field; `None` to take it from the recording.
    pub unit: Option<String>,
    /// Whether the field is a gauge pressure.
    pub gauge: bool,
}

/// Machine data for the identification.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MachineConstants {
    /// Internal area of the compressor that exchanges heat with the gas, m2, > 0.
    pub compressor_internal_area_m2: f64,
    /// Share of that area before compression, alpha_A, 0..1.
    pub alpha_area_ratio: f64,
    /// Diameter of the compressor's inlet pipe, m, > 0; only for static taps.
    pub compressor_inlet_diameter_m: Option<f64>,
    /// Diameter of the compressor's outlet pipe, m, > 0; only for static taps.
    pub compressor_outlet_diameter_m: Option<f64>,
    /// Diameter of the T2 probe's tip, m; 0 is an ideal probe.
    pub t2_probe_diameter_m: f64,
}

/// A window after the start of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowLimits {
    /// Start after the start of the step, s, >= 0.
    pub start_s: f64,
    /// End after the start of the step, s, > `start_s`.
    pub end_s: f64,
}

impl ChannelMap {
    /// The map of this program's own recordings.
    pub fn native() -> ChannelMap {
        let source = |row: &mapper_core::ChannelInfo| ChannelSource {
            topic: row.group.topic().to_owned(),
            field: row.field.to_owned(),
            unit: Some(row.dimension.unit().to_owned()),
            gauge: false,
        };
        let channels = CHANNELS.iter().map(|row| (row.channel, source(row))).collect();
        let several = |row: &'static mapper_core::ChannelInfo| {
            (1..=MAX_ELEMENTS).map(|number| {
                let element = Element { channel: row.channel, number };
                let unit = Some(row.dimension.unit().to_owned());
                (
                    element,
                    ChannelSource {
                        topic: ELEMENTS_TOPIC.to_owned(),
                        field: element.field(),
                        unit,
                        gauge: false,
                    },
                )
            })
        };
        let measured = CHANNELS.iter().filter(|row| row.group != Group::Command);
        let elements = measured.flat_map(several).collect();
        ChannelMap { channels, elements, native: true, ..ChannelMap::default() }
    }

    /// Whether a channel is mapped as a gauge pressure.
    pub fn is_gauge(&self, channel: Channel) -> bool {
        let elements = self.elements.iter().filter(|(element, _)| element.channel == channel);
        let own = self.channels.get(&channel).into_iter();
        own.chain(elements.map(|(_, source)| source)).any(|source| source.gauge)
    }

    /// Whether this is [`ChannelMap::native`]: missing channels are then expected.
    pub fn is_native(&self) -> bool {
        self.native
    }
}

pub(crate) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| Schema::new(schema()));

fn schema() -> Value {
    let source = closed(
        &["field"],
        json!({
            "topic": text("Topic of the recording, or group of a log; a log with one group needs none.", "/rig/compressor"),
            "field": {
                "description": "Field of the topic's messages; a list of fields if several sensors measure the channel.",
                "examples": ["outlet_temperature"],
                "anyOf": [
                    {"type": "string", "minLength": 1},
                    {"type": "array", "minItems": 1, "maxItems": MAX_ELEMENTS, "uniqueItems": true, "items": {"type": "string", "minLength": 1}},
                ],
            },
            "unit": text("Unit of the field; the recording's own if none is given.", "degC"),
            "gauge": {"type": "boolean", "description": "Whether a pressure is read over `ambient_pressure`; absolute if not given.", "examples": [true]},
        }),
    );
    let sensor = closed(
        &[],
        json!({
            "noise": quantity("Noise of one sample; 0 if none is given.", "0.1 K"),
            "offset": quantity("Fixed offset left after calibration; 0 if none is given.", "0.25 K"),
            "gain": quantity("Fixed error of the gain; 0 if none is given.", "0.5 %"),
            "common_offset": quantity("Offset that several sensors of the channel share and that does not average out; 0 if none is given.", "0.05 K"),
        }),
    );
    let constant = quantity("Constant value of a channel that the recording does not contain.", "100 kPa");
    let mut channels = by_channel("Topic, field and unit of each channel, by the channel's symbol.", &source);
    channels.insert("minProperties".to_owned(), json!(1));
    closed(
        &["channels"],
        json!({
            "channels": channels,
            "constants": by_channel("Channels with a known constant value, by symbol.", &constant),
            "machine": machine(),
            "reference": reference(),
            "window": window(),
            "sensors": by_channel("Declared uncertainty of the sensors, one standard deviation, by symbol; if a channel has several sensors, that of each one.", &sensor),
            "noise_colour": noise_colour(),
            "ambient_pressure": ambient_pressure(),
            "log": log(),
        }),
    )
}

fn ambient_pressure() -> Value {
    let source = closed(
        &["field"],
        json!({
            "topic": text("Group of the log; a log with one group needs none.", "/rig/ambient"),
            "field": text("Column of the log.", "P_amb"),
            "unit": text("Unit of the column; the log's own if none is given.", "kPa"),
        }),
    );
    let uncertainty = || {
        quantity(
            "One standard deviation; 100 Pa for a reading and 1 kPa for an altitude if none is given.",
            "50 Pa",
        )
    };
    let value = || quantity("Reading of the barometer.", "99.2 kPa");
    let read = closed(&["value"], json!({"value": value(), "uncertainty": uncertainty()}));
    let altitude = quantity("Altitude of the stand above the sea.", "300 m");
    let place = closed(&["altitude"], json!({"altitude": altitude, "uncertainty": uncertainty()}));
    let unknown = json!({"type": "string", "enum": [UNKNOWN_WORD]});
    json!({
        "description": "Ambient pressure, which is added to gauge pressures: the reading of a barometer, the altitude of the stand, the column of a log, or `unknown`, which counts as 101.3 kPa with an uncertainty of 3 kPa.",
        "examples": ["99.2 kPa"],
        "anyOf": [value(), unknown, source, read, place],
    })
}

fn log() -> Value {
    let key = |key: &Key<LogOptions>| (key.name.to_owned(), quantity(key.description, key.example));
    let keys: Map<String, Value> = OPTION_KEYS.iter().map(key).collect();
    closed(&[], keys.into())
}

fn machine() -> Value {
    closed(
        &["compressor_internal_area"],
        json!({
            "compressor_internal_area":
                quantity("Internal area of the compressor that exchanges heat with the gas.", "29e-3 m^2"),
            "alpha_area": quantity("Share of that area before compression, 0 to 1; 0 if none is given.", "0.2"),
            "compressor_inlet_diameter": quantity("Diameter of the inlet pipe; for a static tap.", "40 mm"),
            "compressor_outlet_diameter": quantity("Diameter of the outlet pipe; for a static tap.", "35 mm"),
            "t2_probe_diameter":
                quantity("Diameter of the tip of the T2 probe; 0 mm, the default, has no inertia.", "1.5 mm"),
        }),
    )
}

fn reference() -> Value {
    let names: Vec<&str> = NAMED_REFERENCES.iter().map(|row| row.name).collect();
    let state = closed(
        &["temperature", "pressure"],
        json!({
            "temperature": quantity("Reference temperature.", "298 K"),
            "pressure": quantity("Reference pressure.", "100 kPa"),
        }),
    );
    json!({
        "description": "State to which corrected flow and speed refer: a name, or `temperature` and `pressure`.",
        "examples": ["SAE"],
        "anyOf": [{"type": "string", "enum": names}, state],
    })
}

fn window() -> Value {
    closed(
        &["start", "end"],
        json!({
            "start": quantity("Start of the window after the start of the step.", "10 s"),
            "end": quantity("End of the window after the start of the step.", "110 s"),
        }),
    )
}

fn noise_colour() -> Value {
    closed(
        &["share", "time_constant"],
        json!({
            "share": quantity("Share of the noise that is first-order, in quadrature, 0 to 1.", "60 %"),
            "time_constant": quantity("Its time constant.", "2 s"),
        }),
    )
}

fn closed(required: &[&str], properties: Value) -> Value {
    json!({"type": "object", "required": required, "properties": properties, "additionalProperties": false})
}

fn by_channel(description: &str, inner: &Value) -> Map<String, Value> {
    let properties: Map<String, Value> =
        CHANNELS.iter().map(|row| (row.symbol.to_owned(), inner.clone())).collect();
    let mut schema = Map::new();
    schema.insert("type".to_owned(), json!("object"));
    schema.insert("description".to_owned(), json!(description));
    schema.insert("properties".to_owned(), properties.into());
    schema.insert("additionalProperties".to_owned(), json!(false));
    schema
}

fn text(description: &str, example: &str) -> Value {
    json!({"type": "string", "minLength": 1, "description": description, "examples": [example]})
}

fn quantity(description: &str, example: &str) -> Value {
    json!({"type": ["string", "number"], "description": description, "examples": [example]})
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum MappedQuantity {
    Channel(Channel),
    Element(Element),
}

impl MappedQuantity {
    pub(crate) fn channel(self) -> Channel {
        match self {
            MappedQuantity::Channel(channel) | MappedQuantity::Element(Element { channel, .. }) => channel,
        }
    }
}

pub(crate) fn sources(map: &ChannelMap) -> impl Iterator<Item = (MappedQuantity, &ChannelSource)> {
    let channels = map.channels.iter().map(|(channel, source)| (MappedQuantity::Channel(*channel), source));
    channels.chain(map.elements.iter().map(|(element, source)| (MappedQuantity::Element(*element), source)))
}

pub(crate) fn source_of(map: &ChannelMap, reads: MappedQuantity) -> Option<&ChannelSource> {
    match reads {
        MappedQuantity::Channel(channel) => map.channels.get(&channel),
        MappedQuantity::Element(element) => map.elements.get(&element),
    }
}

#[derive(Debug)]
pub(crate) struct MappedTopic {
    pub(crate) topic: String,
    /// Fields to read, each once.
    pub(crate) fields: Vec<String>,
    /// Index of the field, its quantity, unit of the field.
    pub(crate) outputs: Vec<(usize, MappedQuantity, &'static Unit)>,
}

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
