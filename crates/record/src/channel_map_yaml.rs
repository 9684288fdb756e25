//! Channel maps as people write them: YAML with units.

use crate::format::TRUTH_PREFIX;
use crate::units::{difference, kind_of, parse_quantity, remedy, unit};
use crate::{ChannelMap, ChannelSource, MachineConstants, WindowLimits};
use mapper_core::{Channel, DeclaredUncertainty, NoiseColour, ReferenceState};
use mapper_units::{Kind, UnitError};
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor, value::MapAccessDeserializer};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

/// One fault of a channel map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelMapIssue {
    /// Line of the fault, from 1, where it is known.
    pub line: Option<usize>,
    /// Key path, e.g. `channels.T2.unit`; empty where it is not known.
    pub path: String,
    /// What is wrong and what would be right.
    pub message: String,
}

impl fmt::Display for ChannelMapIssue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if !self.path.is_empty() {
            write!(f, "`{}`: ", self.path)?;
        }
        f.write_str(&self.message)
    }
}

/// A channel map that cannot be used; lists every fault that was found.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("failed to read the channel map: {}", .issues.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct ChannelMapError {
    /// The faults, in order of the file.
    pub issues: Vec<ChannelMapIssue>,
}

impl ChannelMap {
    /// Reads a channel map.
    ///
    /// # Errors
    /// [`ChannelMapError`] with every wrong unit and value; with the first fault alone where the text is no YAML, or
    /// has unknown or missing keys.
    pub fn from_yaml(text: &str) -> Result<ChannelMap, ChannelMapError> {
        let raw: RawMap = serde_yaml::from_str(text).map_err(|error| {
            let line = error.location().map(|location| location.line());
            ChannelMapError {
                issues: vec![ChannelMapIssue { line, path: String::new(), message: error.to_string() }],
            }
        })?;
        let mut check = Check { text, issues: Vec::new() };
        let map = check.map(raw);
        check.issues.sort_by_key(|issue| issue.line);
        if check.issues.is_empty() { Ok(map) } else { Err(ChannelMapError { issues: check.issues }) }
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    channels: ByChannel<RawSource>,
    #[serde(default)]
    constants: ByChannel<Quantity>,
    machine: Option<RawMachine>,
    reference: Option<RawReference>,
    window: Option<RawWindow>,
    #[serde(default)]
    sensors: ByChannel<RawSensor>,
    noise_colour: Option<RawNoiseColour>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSource {
    topic: String,
    field: String,
    unit: Option<String>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMachine {
    compressor_internal_area: Quantity,
    alpha_area: Option<Quantity>,
    compressor_inlet_diameter: Option<Quantity>,
    compressor_outlet_diameter: Option<Quantity>,
    t2_probe_diameter: Option<Quantity>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWindow {
    start: Quantity,
    end: Quantity,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSensor {
    noise: Option<Quantity>,
    offset: Option<Quantity>,
    gain: Option<Quantity>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawNoiseColour {
    share: Quantity,
    time_constant: Quantity,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct RawState {
    temperature: Quantity,
    pressure: Quantity,
}

enum RawReference {
    Named(String),
    State(RawState),
}

/// A number with its unit, not looked at yet.
struct Quantity(String);

/// Values by channel; a channel given twice is an error, which a plain map would hide.
struct ByChannel<T>(BTreeMap<Channel, T>);

impl<T> Default for ByChannel<T> {
    fn default() -> Self {
        ByChannel(BTreeMap::new())
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;
        impl Visitor<'_> for Text {
            type Value = Quantity;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number with its unit, e.g. \"25 degC\"")
            }
            fn visit_str<E>(self, text: &str) -> Result<Quantity, E> {
                Ok(Quantity(text.to_owned()))
            }
            fn visit_f64<E>(self, number: f64) -> Result<Quantity, E> {
                Ok(Quantity(number.to_string()))
            }
            fn visit_u64<E>(self, number: u64) -> Result<Quantity, E> {
                Ok(Quantity(number.to_string()))
            }
            fn visit_i64<E>(self, number: i64) -> Result<Quantity, E> {
                Ok(Quantity(number.to_string()))
            }
        }
        deserializer.deserialize_any(Text)
    }
}

impl<'de> Deserialize<'de> for RawReference {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrState;
        impl<'de> Visitor<'de> for NameOrState {
            type Value = RawReference;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"SAE\", or temperature and pressure")
            }
            fn visit_str<E>(self, name: &str) -> Result<RawReference, E> {
                Ok(RawReference::Named(name.to_owned()))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RawReference, A::Error> {
                RawState::deserialize(MapAccessDeserializer::new(map)).map(RawReference::State)
            }
        }
        deserializer.deserialize_any(NameOrState)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for ByChannel<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = ByChannel<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("entries by channel, e.g. `T2: ...`")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<ByChannel<T>, A::Error> {
                let mut entries = BTreeMap::new();
                while let Some((channel, value)) = map.next_entry::<Channel, T>()? {
                    if entries.insert(channel, value).is_some() {
                        return Err(de::Error::custom(format_args!("{channel} is given twice")));
                    }
                }
                Ok(ByChannel(entries))
            }
        }
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

/// Turns text into values and collects what is wrong.
struct Check<'a> {
    text: &'a str,
    issues: Vec<ChannelMapIssue>,
}

impl Check<'_> {
    fn map(&mut self, raw: RawMap) -> ChannelMap {
        if raw.channels.0.is_empty() {
            self.issue("channels", "is empty; name at least one channel".to_owned());
        }
        let channels: BTreeMap<_, _> = raw
            .channels
            .0
            .into_iter()
            .map(|(channel, source)| (channel, self.source(channel, source)))
            .collect();
        let mut constants = BTreeMap::new();
        for (channel, quantity) in raw.constants.0 {
            let path = format!("constants.{channel}");
            if channels.contains_key(&channel) {
                self.issue(&path, "is also under `channels`; keep one of the two".to_owned());
            }
            constants.insert(channel, self.quantity(&path, &quantity, kind_of(channel)));
        }
        let sensors =
            raw.sensors.0.into_iter().map(|(channel, sensor)| (channel, self.sensor(channel, &sensor)));
        ChannelMap {
            sensors: sensors.collect(),
            channels,
            constants,
            machine: raw.machine.map(|machine| self.machine(&machine)),
            reference: raw.reference.and_then(|reference| self.reference(&reference)),
            window: raw.window.map(|window| self.window(&window)),
            noise_colour: raw.noise_colour.map(|colour| self.noise_colour(&colour)),
            native: false,
        }
    }

    fn source(&mut self, channel: Channel, raw: RawSource) -> ChannelSource {
        let path = format!("channels.{channel}");
        if raw.topic.starts_with(TRUTH_PREFIX) {
            let message = "topics below /truth are for scoring and cannot be mapped".to_owned();
            self.issue(&format!("{path}.topic"), message);
        }
        if let Some(Err(error)) = raw.unit.as_deref().map(|name| unit(kind_of(channel), name)) {
            self.issue(&format!("{path}.unit"), explained(kind_of(channel), &error));
        }
        ChannelSource { topic: raw.topic, field: raw.field, unit: raw.unit }
    }

    fn machine(&mut self, raw: &RawMachine) -> MachineConstants {
        let area_path = "machine.compressor_internal_area";
        let mut diameter = |name: &str, raw: &Option<Quantity>| {
            let path = format!("machine.{name}");
            raw.as_ref().map(|raw| self.positive(&path, raw, Kind::Length))
        };
        let compressor_inlet_diameter_m =
            diameter("compressor_inlet_diameter", &raw.compressor_inlet_diameter);
        let compressor_outlet_diameter_m =
            diameter("compressor_outlet_diameter", &raw.compressor_outlet_diameter);
        let alpha_area_ratio =
            raw.alpha_area.as_ref().map_or(0.0, |raw| self.share("machine.alpha_area", raw));
        MachineConstants {
            compressor_internal_area_m2: self.positive(area_path, &raw.compressor_internal_area, Kind::Area),
            alpha_area_ratio,
            compressor_inlet_diameter_m,
            compressor_outlet_diameter_m,
            t2_probe_diameter_m: self.not_negative(
                "machine.t2_probe_diameter",
                raw.t2_probe_diameter.as_ref(),
                Kind::Length,
            ),
        }
    }

    fn reference(&mut self, raw: &RawReference) -> Option<ReferenceState> {
        match raw {
            RawReference::Named(name) if name == "SAE" => Some(ReferenceState::SAE),
            RawReference::Named(name) => {
                let message = format!("`{name}` is not known; write SAE, or temperature and pressure");
                self.issue("reference", message);
                None
            }
            RawReference::State(state) => Some(ReferenceState {
                t_ref_k: self.positive("reference.temperature", &state.temperature, Kind::Temperature),
                p_ref_pa: self.positive("reference.pressure", &state.pressure, Kind::Pressure),
            }),
        }
    }

    fn window(&mut self, raw: &RawWindow) -> WindowLimits {
        let start_s = self.not_negative("window.start", Some(&raw.start), Kind::Duration);
        let end_s = self.positive("window.end", &raw.end, Kind::Duration);
        if end_s <= start_s {
            self.issue("window.end", format!("is {end_s} s, not after the start at {start_s} s"));
        }
        WindowLimits { start_s, end_s }
    }

    fn sensor(&mut self, channel: Channel, raw: &RawSensor) -> DeclaredUncertainty {
        let mut sigma = |key: &str, raw: &Option<Quantity>, kind| {
            self.not_negative(&format!("sensors.{channel}.{key}"), raw.as_ref(), kind)
        };
        let kind = difference(kind_of(channel));
        DeclaredUncertainty {
            noise_sigma: sigma("noise", &raw.noise, kind),
            offset_sigma: sigma("offset", &raw.offset, kind),
            gain_sigma_ratio: sigma("gain", &raw.gain, Kind::Fraction),
        }
    }

    fn noise_colour(&mut self, raw: &RawNoiseColour) -> NoiseColour {
        NoiseColour {
            first_order_share_ratio: self.share("noise_colour.share", &raw.share),
            time_constant_s: self.positive("noise_colour.time_constant", &raw.time_constant, Kind::Duration),
        }
    }

    fn share(&mut self, path: &str, raw: &Quantity) -> f64 {
        let ratio = self.quantity(path, raw, Kind::Fraction);
        if ratio.is_finite() && !(0.0..=1.0).contains(&ratio) {
            self.issue(path, format!("is {ratio}; it is a share from 0 to 1"));
        }
        ratio
    }

    fn positive(&mut self, path: &str, raw: &Quantity, kind: Kind) -> f64 {
        let value = self.quantity(path, raw, kind);
        if value <= 0.0 {
            self.issue(path, format!("is {}; it has to be more than 0", raw.0));
        }
        value
    }

    fn not_negative(&mut self, path: &str, raw: Option<&Quantity>, kind: Kind) -> f64 {
        let Some(raw) = raw else { return 0.0 };
        let value = self.quantity(path, raw, kind);
        if value < 0.0 {
            self.issue(path, format!("is {}; it cannot be negative", raw.0));
        }
        value
    }

    /// NaN, with an issue, for what is no quantity: NaN passes every further check.
    fn quantity(&mut self, path: &str, raw: &Quantity, kind: Kind) -> f64 {
        parse_quantity(kind, &raw.0).unwrap_or_else(|error| {
            self.issue(path, explained(kind, &error));
            f64::NAN
        })
    }

    fn issue(&mut self, path: &str, message: String) {
        self.issues.push(ChannelMapIssue { line: locate(self.text, path), path: path.to_owned(), message });
    }
}

fn explained(kind: Kind, error: &UnitError) -> String {
    format!("{error}; {}", remedy(kind, error))
}

/// Line of a key path: that of the first mention of each key after the one before it. Values are not parsed, which is
/// enough for a map's block and flow style.
fn locate(text: &str, path: &str) -> Option<usize> {
    let mut position = 0;
    for key in path.split('.') {
        let rest = text.get(position..)?;
        let found = rest.match_indices(key).find(|(at, _)| {
            let before = rest[..*at].chars().next_back();
            rest[at + key.len()..].trim_start_matches(['"', '\'']).trim_start_matches(' ').starts_with(':')
                && before.is_none_or(|c| !(c.is_alphanumeric() || c == '_'))
        })?;
        position += found.0 + key.len();
    }
    Some(text.get(..position)?.matches('\n').count() + 1)
}
