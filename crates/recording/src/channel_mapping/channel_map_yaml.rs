//! Channel maps in YAML with units.

use crate::channel_mapping::channel_map::{SCHEMA, UNKNOWN_WORD};
use crate::logs::{LogOptions, OPTION_KEYS};
use crate::topics::TRUTH_PREFIX;
use crate::{
    AmbientPressure, Barometer, ChannelMap, ChannelSource, MachineConstants, RecordError, WindowLimits,
};
use mapper_core::{Channel, DeclaredUncertainty, Element, NoiseColour, RedundantSensors, ReferenceState};
use mapper_table::{difference, kind_of, parse_quantity, remedy, unit};
use mapper_yaml::keys::KeyError;
use mapper_yaml::units::{Kind, UnitError};
use mapper_yaml::{Document, FindingKind, Findings, Notes, Source, Step, Tree, steps};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Maximum size of a channel map, bytes. Bound: memory; a map has some kilobytes.
const MAX_BYTES: usize = 1 << 20;

/// Name of the file in messages.
pub(crate) static DOCUMENT: Document =
    Document { name: "channel map", example: "examples/channels/gap_rig.yaml" };

/// Errors of reading a channel map.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ChannelMapError {
    #[error("failed to read the channel map {}: {source}", .path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

impl ChannelMap {
    /// Reads and checks the file of a channel map.
    pub fn load(path: &Path) -> Result<ChannelMap, ChannelMapError> {
        let mistakes = |findings| ChannelMapError::Mistakes(Box::new(findings));
        let text = mapper_yaml::open(&DOCUMENT, path, MAX_BYTES)
            .map_err(|source| ChannelMapError::Read { path: path.to_owned(), source })?
            .map_err(mistakes)?;
        ChannelMap::from_yaml(&text, path).map_err(mistakes)
    }

    /// Reads a channel map; `origin` names it in messages.
    pub fn from_yaml(text: &str, origin: &Path) -> Result<ChannelMap, Findings> {
        let (tree, mut notes) = mapper_yaml::read(Source::new(&DOCUMENT, origin, text))?;
        SCHEMA.check(&tree, &mut notes);
        let map = Reader { tree: &tree, notes: &mut notes }.map();
        if notes.is_empty() { Ok(map) } else { Err(tree.findings(notes)) }
    }
}

/// Converts the tree to values and collects mistakes. The check against the schema has already reported missing values and wrong
/// types, so they are skipped here.
struct Reader<'a> {
    tree: &'a Tree,
    notes: &'a mut Notes,
}

impl<'a> Reader<'a> {
    fn map(&mut self) -> ChannelMap {
        let (mut channels, mut elements) = (BTreeMap::new(), BTreeMap::new());
        // Channel, topic and field. Two quantities of one side are never one column: P2 from the column of P1 would make each pressure ratio 1.
        let mut used: Vec<(Channel, String, String)> = Vec::new();
        for channel in self.channels_below("channels") {
            let (topic, unit, gauge) = self.topic_unit_and_gauge(channel);
            let source = |field: &String| ChannelSource {
                topic: topic.clone(),
                field: field.clone(),
                unit: unit.clone(),
                gauge,
            };
            let fields = self.fields(channel);
            for field in &fields {
                let is_same = |(other, of_topic, of_field): &&(Channel, String, String)| {
                    *other != channel
                        && other.info().group == channel.info().group
                        && (of_topic, of_field) == (&topic, field)
                };
                if let Some((other, ..)) = used.iter().find(is_same) {
                    let message = format!("`{field}` is already the field of {other}; {channel} has its own");
                    let here = steps!["channels", channel.symbol(), "field"];
                    self.note(
                        FindingKind::Conflict,
                        &here,
                        message,
                        "name the field that contains this quantity",
                    );
                }
                used.push((channel, topic.clone(), field.clone()));
            }
            if let [field] = fields.as_slice() {
                channels.insert(channel, source(field));
            }
            for (index, field) in fields.iter().enumerate().filter(|_| fields.len() > 1) {
                elements.insert(Element { channel, number: index + 1 }, source(field));
            }
        }
        let mut constants = BTreeMap::new();
        for channel in self.channels_below("constants") {
            let here = steps!["constants", channel.symbol()];
            let several = Element { channel, number: 1 };
            if channels.contains_key(&channel) || elements.contains_key(&several) {
                let message = format!("{channel} is also under `channels`");
                self.note(FindingKind::Conflict, &here, message, "keep one of the two");
            }
            constants.insert(channel, self.quantity(&here, kind_of(channel)).unwrap_or(f64::NAN));
        }
        let (mut sensors, mut redundant) = (BTreeMap::new(), BTreeMap::new());
        for channel in self.channels_below("sensors") {
            let (each, common_offset_sigma) = self.sensor(channel);
            let names: Vec<String> = self.fields(channel);
            let mut several = RedundantSensors::alike(channel, names.len().max(1), each);
            several.common_offset_sigma = common_offset_sigma;
            for (element, name) in several.elements.iter_mut().zip(names) {
                element.name = name;
            }
            sensors.insert(channel, several.fused(|_| true));
            if several.elements.len() > 1 {
                redundant.insert(channel, several);
            }
        }
        let ambient_pressure = self.ambient_pressure();
        let gauge = channels.values().chain(elements.values()).any(|source| source.gauge);
        if gauge && !self.has("ambient_pressure") {
            let message = "a gauge pressure is mapped without an ambient pressure".to_owned();
            let remedy = "write the barometer's reading, e.g. `ambient_pressure: 99.2 kPa`, the altitude of the stand: `ambient_pressure: {altitude: 300 m}`, \
                 or the column that holds it: `ambient_pressure: {field: P_amb, unit: kPa}`; `ambient_pressure: unknown` widens the intervals";
            self.note(FindingKind::MissingKey, &steps!["channels"], message, remedy);
        }
        ChannelMap {
            ambient_pressure,
            log: self.log(),
            text: Some((self.tree.source().origin.clone(), self.tree.source().text().to_owned())),
            channels,
            elements,
            redundant,
            constants,
            sensors,
            machine: self.has("machine").then(|| self.machine()),
            reference: self.reference(),
            window: self.has("window").then(|| self.window()),
            noise_colour: self.has("noise_colour").then(|| self.noise_colour()),
            ..ChannelMap::default()
        }
    }

    fn ambient_pressure(&mut self) -> Option<AmbientPressure> {
        let here = steps!["ambient_pressure"];
        if self.tree.text(&here) == Some(UNKNOWN_WORD) {
            return Some(AmbientPressure::Constant(Barometer::unknown()));
        }
        if !self.tree.get(&here)?.is_object() {
            return self
                .positive(&here, Kind::Pressure)
                .map(Barometer::from_reading)
                .map(AmbientPressure::Constant);
        }
        if let Some(barometer) = self.barometer() {
            return Some(AmbientPressure::Constant(barometer));
        }
        let text = |key: &str| self.tree.text(&steps!["ambient_pressure", key]).map(str::to_owned);
        let (topic, field, written) = (text("topic").unwrap_or_default(), text("field")?, text("unit"));
        if let Some(Err(error)) = written.as_deref().map(|name| unit(Kind::Pressure, name)) {
            self.note_unit(&steps!["ambient_pressure", "unit"], Kind::Pressure, &error);
        }
        Some(AmbientPressure::Source(ChannelSource { topic, field, unit: written, gauge: false }))
    }

    /// A value or an altitude, with its uncertainty.
    fn barometer(&mut self) -> Option<Barometer> {
        let of = |key: &str| steps!["ambient_pressure", key];
        let found = match self.tree.get(&of("value")) {
            Some(_) => Barometer::from_reading(self.positive(&of("value"), Kind::Pressure)?),
            None => Barometer::at_altitude(self.quantity(&of("altitude"), Kind::Length)?),
        };
        let stated = self.tree.get(&of("uncertainty")).is_some();
        let sigma_pa = self.not_negative(&of("uncertainty"), difference(Kind::Pressure));
        Some(if stated { Barometer { sigma_pa, ..found } } else { found })
    }

    fn log(&mut self) -> LogOptions {
        let mut options = LogOptions::default();
        for key in self.tree.keys(&steps!["log"]) {
            let here = steps!["log", key];
            let Some(text) = self.text_or_number(&here) else { continue };
            // The check against the schema has already reported an unknown key.
            if let Err(error @ KeyError::Value { .. }) = options.set(key, &text) {
                let remedy =
                    OPTION_KEYS.iter().find(|known| known.name == key).map_or("", |known| known.description);
                self.note(FindingKind::WrongValue, &here, error.to_string(), remedy);
            }
        }
        options
    }

    fn topic_unit_and_gauge(&mut self, channel: Channel) -> (String, Option<String>, bool) {
        let of = |key: &str| steps!["channels", channel.symbol(), key];
        let topic = self.tree.text(&of("topic")).unwrap_or_default().to_owned();
        let written = self.tree.text(&of("unit")).map(str::to_owned);
        if topic.starts_with(TRUTH_PREFIX) {
            let message = "topics below /truth are for scoring and cannot be mapped".to_owned();
            let remedy = "name a topic of measured values";
            self.note(FindingKind::WrongValue, &of("topic"), message, remedy);
        }
        let kind = kind_of(channel);
        if let Some(Err(error)) = written.as_deref().map(|name| unit(kind, name)) {
            self.note_unit(&of("unit"), kind, &error);
        }
        let gauge = self.tree.get(&of("gauge")) == Some(&Value::Bool(true));
        if gauge && kind != Kind::Pressure {
            let message = format!("{channel} is not a pressure; only pressures can be gauge readings");
            self.note(FindingKind::Conflict, &of("gauge"), message, "remove `gauge`");
        }
        (topic, written, gauge)
    }

    /// The field of a channel, or the fields of its redundant sensors.
    fn fields(&self, channel: Channel) -> Vec<String> {
        let here = steps!["channels", channel.symbol(), "field"];
        let listed = self.tree.items(&here).iter().filter_map(Value::as_str);
        listed.chain(self.tree.text(&here)).map(str::to_owned).collect()
    }

    fn machine(&mut self) -> MachineConstants {
        let of = |key: &str| steps!["machine", key];
        MachineConstants {
            compressor_internal_area_m2: self
                .positive(&of("compressor_internal_area"), Kind::Area)
                .unwrap_or(f64::NAN),
            alpha_area_ratio: self.share(&of("alpha_area")).unwrap_or(0.0),
            compressor_inlet_diameter_m: self.positive(&of("compressor_inlet_diameter"), Kind::Length),
            compressor_outlet_diameter_m: self.positive(&of("compressor_outlet_diameter"), Kind::Length),
            t2_probe_diameter_m: self.not_negative(&of("t2_probe_diameter"), Kind::Length),
        }
    }

    fn reference(&mut self) -> Option<ReferenceState> {
        if let Some(name) = self.tree.text(&steps!["reference"]) {
            return ReferenceState::named(name);
        }
        let t_ref_k = self.positive(&steps!["reference", "temperature"], Kind::Temperature)?;
        let p_ref_pa = self.positive(&steps!["reference", "pressure"], Kind::Pressure)?;
        Some(ReferenceState { t_ref_k, p_ref_pa })
    }

    fn window(&mut self) -> WindowLimits {
        let end = steps!["window", "end"];
        let start_s = self.not_negative(&steps!["window", "start"], Kind::Duration);
        let end_s = self.positive(&end, Kind::Duration).unwrap_or(f64::INFINITY);
        if end_s <= start_s {
            let message = format!("the window ends at {end_s} s, not after its start at {start_s} s");
            self.note(FindingKind::Conflict, &end, message, "`end` must be after `start`");
        }
        WindowLimits { start_s, end_s }
    }

    /// The declared uncertainty of each sensor of a channel, and their common offset.
    fn sensor(&mut self, channel: Channel) -> (DeclaredUncertainty, f64) {
        let of = |key: &str| steps!["sensors", channel.symbol(), key];
        let kind = difference(kind_of(channel));
        let declared = DeclaredUncertainty {
            noise_sigma: self.not_negative(&of("noise"), kind),
            offset_sigma: self.not_negative(&of("offset"), kind),
            gain_sigma_ratio: self.not_negative(&of("gain"), Kind::Fraction),
        };
        (declared, self.not_negative(&of("common_offset"), kind))
    }

    fn noise_colour(&mut self) -> NoiseColour {
        let time_constant = steps!["noise_colour", "time_constant"];
        NoiseColour {
            first_order_share_ratio: self.share(&steps!["noise_colour", "share"]).unwrap_or(f64::NAN),
            time_constant_s: self.positive(&time_constant, Kind::Duration).unwrap_or(f64::NAN),
        }
    }

    fn share(&mut self, steps: &[Step]) -> Option<f64> {
        let ratio = self.quantity(steps, Kind::Fraction)?;
        if !(0.0..=1.0).contains(&ratio) {
            self.note(FindingKind::Range, steps, format!("{ratio} is not a share"), "it must be from 0 to 1");
        }
        Some(ratio)
    }

    fn positive(&mut self, steps: &[Step], kind: Kind) -> Option<f64> {
        let value = self.quantity(steps, kind)?;
        if value <= 0.0 {
            let message = format!("{} of 0 or less", kind.name());
            self.note(FindingKind::Range, steps, message, "it must be above 0");
        }
        Some(value)
    }

    /// 0 if it is not given.
    fn not_negative(&mut self, steps: &[Step], kind: Kind) -> f64 {
        let value = self.quantity(steps, kind).unwrap_or(0.0);
        if value < 0.0 {
            let message = format!("{} below 0", kind.name());
            self.note(FindingKind::Range, steps, message, "it must be at least 0");
        }
        value
    }

    fn quantity(&mut self, steps: &[Step], kind: Kind) -> Option<f64> {
        let text = self.text_or_number(steps)?;
        parse_quantity(kind, &text).map_err(|error| self.note_unit(steps, kind, &error)).ok()
    }

    fn has(&self, key: &str) -> bool {
        self.tree.get(&steps![key]).is_some()
    }

    fn text_or_number(&self, steps: &[Step]) -> Option<String> {
        let value = self.tree.get(steps)?;
        value.as_str().map(str::to_owned).or_else(|| value.as_f64().map(|number| number.to_string()))
    }

    fn channels_below(&self, key: &str) -> Vec<Channel> {
        self.tree.keys(&steps![key]).filter_map(|symbol| symbol.parse().ok()).collect()
    }

    fn note_unit(&mut self, steps: &[Step], kind: Kind, error: &UnitError) {
        self.note(FindingKind::Unit, steps, error.to_string(), &remedy(kind, error));
    }

    fn note(&mut self, kind: FindingKind, steps: &[Step], message: String, remedy: &str) {
        self.notes.push(self.tree.finding(kind, steps, message, remedy));
    }
}

#[derive(Debug, Default)]
pub(crate) struct MapMistakes {
    list: Vec<(FindingKind, Vec<Step>, String, String)>,
}

impl MapMistakes {
    pub(crate) fn add(&mut self, kind: FindingKind, place: &[Step], message: String, remedy: String) {
        self.list.push((kind, place.to_owned(), message, remedy));
    }

    pub(crate) fn into_result(self, map: &ChannelMap) -> Result<(), RecordError> {
        if self.list.is_empty() {
            return Ok(());
        }
        let nowhere = (Path::new("channel map").to_owned(), "{}".to_owned());
        let (path, text) = map.text.as_ref().unwrap_or(&nowhere);
        let findings = match mapper_yaml::read(Source::new(&DOCUMENT, path, text)) {
            Ok((tree, mut notes)) => {
                for (kind, steps, message, remedy) in self.list {
                    notes.push(tree.finding(kind, &steps, message, remedy));
                }
                tree.findings(notes)
            }
            Err(findings) => findings,
        };
        Err(RecordError::ChannelMap(Box::new(findings)))
    }
}
