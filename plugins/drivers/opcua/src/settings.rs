//! The settings of the driver as a campaign writes them below `opcua`.

use mapper_controller::{
    AcceptedRanges, LimitError, SafeSettings, Stand, Target, WriteSettings, check_range, check_scale,
};
use mapper_core::{BackendError, Channel, Dimension};
use mapper_driver::{SecretError, secret};
use mapper_yaml::units::{Duration, Frequency, Kind, Quantity};
use opcua::types::NodeId;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::str::FromStr;

/// Name of the driver.
pub(crate) const NAME: &str = "opcua";

/// Below `opcua`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Settings {
    /// Address of the server, `opc.tcp://HOST:PORT/...`.
    pub(crate) endpoint: String,
    #[serde(default)]
    pub(crate) security: Security,
    /// User name: `{env: NAME}`. Default: anonymous.
    #[serde(default)]
    user: Value,
    /// Password of the user: `{env: NAME}`.
    #[serde(default)]
    password: Value,
    /// Unique name of the rig; default: its endpoint.
    pub(crate) rig: Option<String>,
    /// Polling rate; default 10 Hz.
    pub(crate) rate: Option<Quantity<Frequency>>,
    /// Timeout of each read; default 300 ms.
    pub(crate) timeout: Option<Quantity<Duration>>,
    /// The time that defines the age of a reading.
    #[serde(default)]
    pub(crate) timestamps: Timestamps,
    #[serde(deserialize_with = "mapper_driver::by_channel")]
    pub(crate) read: BTreeMap<Channel, NodeSettings>,
    pub(crate) write: WriteSettings<NodeSettings>,
    pub(crate) accepts: AcceptedRanges,
    pub(crate) safe: SafeSettings,
}

pub(crate) fn is_endpoint(text: &str) -> bool {
    text.strip_prefix("opc.tcp://").is_some_and(|server| !server.is_empty())
}

/// Signed and encrypted, or, if stated, without security.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Security {
    /// Basic256Sha256, signed and encrypted.
    #[default]
    Basic256Sha256,
    /// Aes128-Sha256-RsaOaep, signed and encrypted.
    Aes128Sha256RsaOaep,
    /// Aes256-Sha256-RsaPss, signed and encrypted.
    Aes256Sha256RsaPss,
    /// None: anyone on the network can read and write.
    None,
}

/// The time that defines the age of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Timestamps {
    /// The server's source timestamp.
    #[default]
    Source,
    /// Time of arrival: for servers that stamp a value only when it changes.
    Arrival,
}

/// A node; its SI value is its value times `scale` plus `offset`, or it is in `unit`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NodeSettings {
    /// As `ns=2;s=Stand.P3` or `ns=3;i=1001`.
    #[serde(deserialize_with = "node_id")]
    pub(crate) node: NodeId,
    /// Unit of the node's value.
    unit: Option<String>,
    scale: Option<f64>,
    offset: Option<f64>,
}

fn node_id<'de, D: serde::Deserializer<'de>>(from: D) -> Result<NodeId, D::Error> {
    let text = String::deserialize(from)?;
    NodeId::from_str(&text).map_err(|_| {
        let message =
            format!("`{text}` is not a node id; they are written as ns=2;s=Stand.P3 or ns=3;i=1001");
        serde::de::Error::custom(message)
    })
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum SettingError {
    #[error("{0}; docs/how-to/rig.md has an example of all settings")]
    Form(serde_json::Error),
    #[error(transparent)]
    Limit(#[from] LimitError),
    #[error(transparent)]
    Secret(#[from] SecretError),
    #[error("an endpoint begins with opc.tcp:// and is written as opc.tcp://HOST:PORT, not `{0}`")]
    Endpoint(String),
    #[error("{channel} is not given in `{unit}`; its units are {units}")]
    Unit { channel: Channel, unit: String, units: String },
    #[error("write `unit`, or `scale` and `offset`, not both")]
    TwoScales,
    #[error("two values are written to the node {0}")]
    Shared(NodeId),
    #[error("{other} reads the node {node} too; give each channel its own node, or remove one of them")]
    ReadTwice { node: NodeId, other: Channel },
    #[error("`write.{key}` writes the node {node}: the setpoint would be read instead of a measurement")]
    ReadsSetpoint { node: NodeId, key: &'static str },
    #[error("give `user` and `password`, or neither")]
    IncompleteUser,
    #[error(
        "with `security: none` the password would be sent unencrypted; choose another `security`, or remove user and password"
    )]
    PasswordInClear,
    #[error("{0}")]
    Store(String),
}

pub(crate) fn settings_error(path: impl Into<String>, error: impl Into<SettingError>) -> BackendError {
    BackendError::Settings { backend: NAME.to_owned(), path: path.into(), source: Box::new(error.into()) }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    scale: f64,
    offset: f64,
}

impl Scale {
    pub(crate) fn inside(self, number: f64) -> f64 {
        let value = number * self.scale + self.offset;
        if value.is_finite() { value } else { f64::NAN }
    }

    /// Increment of a whole number, SI.
    pub(crate) fn step(self) -> f64 {
        self.scale
    }

    pub(crate) fn outside(self, value: f64) -> f64 {
        (value - self.offset) / self.scale
    }
}

fn kind(channel: Channel) -> Option<Kind> {
    match channel.info().dimension {
        Dimension::RotationalSpeed => Some(Kind::Speed),
        Dimension::MassFlow => Some(Kind::MassFlow),
        Dimension::Pressure => Some(Kind::Pressure),
        Dimension::Temperature => Some(Kind::Temperature),
        Dimension::Ratio => None,
    }
}

impl NodeSettings {
    fn scale(&self, channel: Channel) -> Result<Scale, SettingError> {
        let Some(unit) = &self.unit else {
            let scale = check_scale(self.scale.unwrap_or(1.0))?;
            let offset = check_range(self.offset.unwrap_or(0.0), "", -1e12, 1e12)?;
            return Ok(Scale { scale, offset });
        };
        if self.scale.is_some() || self.offset.is_some() {
            return Err(SettingError::TwoScales);
        }
        let kind = kind(channel);
        let Some(known_unit) = kind.and_then(|kind| kind.unit(unit)) else {
            let units = kind.map_or_else(|| "none".to_owned(), Kind::unit_list);
            return Err(SettingError::Unit { channel, unit: unit.clone(), units });
        };
        let offset = known_unit.to_inside(0.0);
        Ok(Scale { scale: known_unit.to_inside(1.0) - offset, offset })
    }
}

/// A user with password. It is never printed.
pub(crate) struct User {
    pub(crate) name: String,
    pub(crate) password: String,
}

pub(crate) struct CheckedSettings {
    pub(crate) settings: Settings,
    pub(crate) user: Option<User>,
    pub(crate) reads: Vec<(Channel, NodeId, Scale)>,
    writes: BTreeMap<Target, (NodeId, Scale)>,
}

impl Settings {
    pub(crate) fn read(value: &Value) -> Result<CheckedSettings, BackendError> {
        let settings: Settings = serde_path_to_error::deserialize(value).map_err(|error| {
            let path = error.path().to_string();
            settings_error(path.trim_start_matches('.'), SettingError::Form(error.into_inner()))
        })?;
        settings.check()
    }

    fn check(self) -> Result<CheckedSettings, BackendError> {
        if !is_endpoint(&self.endpoint) {
            return Err(settings_error("endpoint", SettingError::Endpoint(self.endpoint.clone())));
        }
        check_range(self.timeout_s(), "s", 0.01, 0.8).map_err(|error| settings_error("timeout", error))?;
        self.stand().check().map_err(|(path, error)| settings_error(path, error))?;
        let user = secret(&self.user).map_err(|error| settings_error("user", error))?;
        let password = secret(&self.password).map_err(|error| settings_error("password", error))?;
        let user = match (user, password) {
            (None, None) => None,
            (Some(name), Some(password)) => Some(User { name, password }),
            _ => return Err(settings_error("user", SettingError::IncompleteUser)),
        };
        if user.is_some() && self.security == Security::None {
            return Err(settings_error("security", SettingError::PasswordInClear));
        }
        let mut reads: Vec<(Channel, NodeId, Scale)> = Vec::new();
        for (channel, entry) in &self.read {
            let scale =
                entry.scale(*channel).map_err(|error| settings_error(format!("read.{channel}"), error))?;
            let node = entry.node.clone();
            let at = |error: SettingError| settings_error(format!("read.{channel}.node"), error);
            if let Some((other, ..)) = reads.iter().find(|(_, other_node, _)| *other_node == node) {
                return Err(at(SettingError::ReadTwice { node, other: *other }));
            }
            if let Some(target) = Target::ALL.into_iter().find(|target| self.write.of(*target).node == node) {
                return Err(at(SettingError::ReadsSetpoint { node, key: target.name() }));
            }
            reads.push((*channel, node, scale));
        }
        let mut writes: BTreeMap<Target, (NodeId, Scale)> = BTreeMap::new();
        for target in Target::ALL {
            let entry = self.write.of(target);
            let path = format!("write.{}", target.name());
            let scale =
                entry.scale(unit_channel(target)).map_err(|error| settings_error(path.clone(), error))?;
            if writes.values().any(|(node, _)| *node == entry.node) {
                return Err(settings_error(path, SettingError::Shared(entry.node.clone())));
            }
            writes.insert(target, (entry.node.clone(), scale));
        }
        Ok(CheckedSettings { settings: self, user, reads, writes })
    }

    pub(crate) fn timeout_s(&self) -> f64 {
        self.timeout.as_ref().map_or(0.3, |timeout| timeout.value)
    }

    pub(crate) fn stand(&self) -> Stand {
        Stand {
            backend: NAME,
            version: env!("CARGO_PKG_VERSION"),
            rig: self.rig.clone().unwrap_or_else(|| format!("opcua {}", self.endpoint)),
            reached_at: crate::store::server(&self.endpoint).to_ascii_lowercase(),
            rate_hz: self.rate.as_ref().map_or(10.0, |rate| rate.value),
            channels: self.read.keys().copied().collect(),
            accepts: self.accepts,
            safe: self.safe,
        }
    }
}

/// The channel that defines the permitted units of a target.
fn unit_channel(target: Target) -> Channel {
    match target {
        Target::P3 => Channel::P3,
        Target::T3 => Channel::T3,
        Target::OilTemperature => Channel::TOil,
        Target::Valve | Target::Air | Target::Heartbeat => Channel::ValveCommand,
    }
}

impl CheckedSettings {
    pub(crate) fn unit(&self, channel: Channel) -> String {
        let Some(entry) = self.settings.read.get(&channel) else { return String::new() };
        match &entry.unit {
            Some(unit) => format!("`unit: {unit}`"),
            None => {
                format!("scale {}, offset {}", entry.scale.unwrap_or(1.0), entry.offset.unwrap_or(0.0))
            }
        }
    }

    /// Node and scale of a target. All targets have an entry.
    pub(crate) fn write(&self, target: Target) -> Option<&(NodeId, Scale)> {
        self.writes.get(&target)
    }

    pub(crate) fn written(&self) -> impl Iterator<Item = (Target, &NodeId)> {
        self.writes.iter().map(|(target, (node, _))| (*target, node))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn settings() -> Value {
        json!({
            "endpoint": "opc.tcp://127.0.0.1:4840",
            "read": {"N": {"node": "ns=2;s=N"}, "P3": {"node": "ns=2;i=3", "unit": "kPa"}, "T3": {"node": "ns=2;s=T3", "unit": "degC"}},
            "write": {
                "p3": {"node": "ns=2;s=p3", "scale": 1000.0}, "t3": {"node": "ns=2;s=t3"}, "valve": {"node": "ns=2;s=v"},
                "oil_temperature": {"node": "ns=2;s=oil"}, "air": {"node": "ns=2;s=air"}, "heartbeat": {"node": "ns=2;s=beat"}
            },
            "accepts": {"p3": ["105 kPa", "400 kPa"], "t3": ["280 K", "900 K"], "valve": [0.1, 2.5], "oil_temperature": ["280 K", "400 K"]},
            "safe": {"opening": 1.0, "within": "20 s"}
        })
    }

    /// 300 kPa are 300 000 Pa, 26.85 degC are 300 K; writes use the inverse conversion.
    #[test]
    fn units_and_scales_convert_to_si_and_back() {
        let checked = Settings::read(&settings()).ok().unwrap();
        let scale = |channel| checked.reads.iter().find(|(one, ..)| *one == channel).unwrap().2;
        assert_eq!(scale(Channel::P3).inside(300.0), 300e3);
        assert!((scale(Channel::T3).inside(26.85) - 300.0).abs() < 1e-9);
        assert!(scale(Channel::P3).inside(f64::INFINITY).is_nan());
        assert_eq!(checked.write(Target::P3).unwrap().1.outside(300e3), 300.0);
    }

    #[test]
    fn wrong_settings_are_refused_with_their_path() {
        let path = |change: &dyn Fn(&mut Value)| {
            let mut value = settings();
            change(&mut value);
            match Settings::read(&value) {
                Err(BackendError::Settings { path, source, .. }) => (path, source.to_string()),
                _ => panic!("{value}"),
            }
        };
        assert_eq!(path(&|value| value["endpoint"] = json!("127.0.0.1:4840")).0, "endpoint");
        assert_eq!(path(&|value| value["security"] = json!("weak")).0, "security");
        assert_eq!(path(&|value| value["rate"] = json!("1 Hz")).0, "rate");
        let (at, message) = path(&|value| value["read"]["P3"]["node"] = json!("N"));
        assert!(at == "read.P3.node" && message.contains("ns=2;s=Stand.P3"), "{at}: {message}");
        assert_eq!(
            path(&|value| drop(value["read"]["P3"].as_object_mut().unwrap().remove("node"))).0,
            "read.P3"
        );
        let (at, message) = path(&|value| value["read"]["P9"] = json!({"node": "ns=2;s=P9"}));
        assert!(at == "read.P9" && message.contains("no channel is called `P9`"), "{at}: {message}");
        assert!(path(&|value| value["read"]["P3"]["unit"] = json!("degC")).1.contains("kPa"));
        assert_eq!(path(&|value| value["write"]["t3"] = json!({"node": "ns=2;s=p3"})).0, "write.t3");
        assert_eq!(path(&|value| value["user"] = json!("plain")).0, "user");
        // PATH is set wherever tests run.
        assert_eq!(path(&|value| value["user"] = json!({"env": "PATH"})).0, "user");
        let exposed = path(&|value| {
            value["security"] = json!("none");
            (value["user"], value["password"]) = (json!({"env": "PATH"}), json!({"env": "PATH"}));
        });
        assert_eq!(exposed.0, "security");
        let (at, message) = path(&|value| value["read"]["T3"] = json!({"node": "ns=2;i=3"}));
        assert!(at == "read.T3.node" && message.contains("P3 reads the node ns=2;i=3"), "{at}: {message}");
        let (at, message) = path(&|value| value["read"]["P3"] = json!({"node": "ns=2;s=p3"}));
        assert!(at == "read.P3.node" && message.contains("`write.p3`"), "{at}: {message}");
        let (at, message) = path(&|value| value["write"]["p3"]["scale"] = json!(0.0));
        assert!(at == "write.p3" && message.contains("a scale of 0 loses the value"), "{at}: {message}");
        let unmeasured = path(&|value| drop(value["read"].as_object_mut().unwrap().remove("P3")));
        assert_eq!(unmeasured.0, "read");
    }
}
