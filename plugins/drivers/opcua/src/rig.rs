//! The rig over OPC UA, with its commands.

use crate::link::{Answer, Link, LinkError, endpoints};
use crate::settings::{CheckedSettings, SettingError, Settings, Timestamps, is_endpoint, settings_error};
use crate::store::{
    Store, StoreError, describe_status, fingerprint, is_number, is_whole, number, quality, same_type,
    type_name, valid,
};
use clap::{Parser, Subcommand};
use mapper_controller::{Controller, Reading, Target, check_resolution, rig};
use mapper_core::{Backend, BackendError, Channel, Quality, terminal_text};
use opcua::crypto::X509;
use opcua::types::{AttributeId, DataValue, DateTime, NodeId, StatusCode, Variant};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

/// Clock difference above which a message is given, s.
const MAX_CLOCK_DIFFERENCE_S: f64 = 1.0;
/// Write bit of an access level.
const WRITABLE: u8 = 2;

pub(crate) fn open(value: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let mut checked = Settings::read(value)?;
    let within = Duration::from_secs_f64(checked.settings.timeout_s());
    let (endpoint, user) = (checked.settings.endpoint.clone(), checked.user.take());
    let link = Link::new(endpoint, checked.settings.security, user, within)
        .map_err(|error| settings_error("", SettingError::Store(error.to_string())))?;
    let nodes = checked.reads.iter().map(|(_, node, _)| node.clone()).collect();
    let stand = checked.settings.stand();
    let (types, kinds) = (BTreeMap::new(), BTreeMap::new());
    Ok(rig(stand, Nodes { checked, link, nodes, types, kinds, remark: None }))
}

struct Nodes {
    checked: CheckedSettings,
    link: Link,
    /// Nodes to read, in the order of `checked.reads`.
    nodes: Vec<NodeId>,
    types: BTreeMap<Target, Variant>,
    /// Type of the first number of each node that is read.
    kinds: BTreeMap<Channel, String>,
    remark: Option<String>,
}

/// Age of a reading above which it is uncertain, s: by default, guards take an older one for none.
const MAX_AGE_S: f64 = 3.0;
/// Maximum lead of a source timestamp over the answer, s: clocks of controllers on one network agree within milliseconds to some tenths
/// (NTP), and a reading must not be older than 3 s.
const MAX_LEAD_S: f64 = 1.0;

fn between_s(earlier: &DateTime, later: &DateTime) -> f64 {
    // A tick is 100 ns.
    (later.ticks() - earlier.ticks()) as f64 * 1e-7
}

fn is_permanent(status: StatusCode) -> bool {
    [
        StatusCode::BadNodeIdUnknown,
        StatusCode::BadNodeIdInvalid,
        StatusCode::BadAttributeIdInvalid,
        StatusCode::BadNotReadable,
        StatusCode::BadUserAccessDenied,
    ]
    .contains(&status)
}

impl Nodes {
    fn compare_clocks(&mut self, sent: &DateTime) {
        let off_s = between_s(&DateTime::now(), sent);
        if off_s.abs() > MAX_CLOCK_DIFFERENCE_S && !sent.is_null() {
            let side = if off_s > 0.0 { "ahead" } else { "behind" };
            self.remark = Some(format!(
                "the server's clock is {:.1} s {side}; the age of readings is taken from its clock",
                off_s.abs()
            ));
        }
    }

    /// When the source took a value, s since arming, for a sample at `t_s`. The age of the value is taken by the server's own clock.
    fn source_t_s(&self, value: &DataValue, sent: &DateTime, t_s: f64) -> Option<f64> {
        let source_time = value
            .source_timestamp
            .as_ref()
            .filter(|source_time| !source_time.is_null() && !sent.is_null())?;
        (self.checked.settings.timestamps == Timestamps::Source).then(|| t_s - between_s(source_time, sent))
    }

    /// Quality of a value, and its reason if it is not good. `first`: the type of the node's first number.
    fn judge(&self, value: &DataValue, first: Option<String>, sent: &DateTime) -> (Quality, String) {
        let kind = value.value.as_ref().map_or_else(|| "empty".to_owned(), type_name);
        let by_type = match first {
            None => Some((Quality::Bad, format!("no number: {kind}"))),
            Some(first) if first != kind => {
                Some((Quality::Bad, format!("its type changed from {first} to {kind}")))
            }
            Some(_) => None,
        };
        let is_stamped = self.checked.settings.timestamps == Timestamps::Source && !sent.is_null();
        let by_time = match self.source_t_s(value, sent, 0.0) {
            Some(source_t_s) if source_t_s > MAX_LEAD_S => {
                Some((Quality::Bad, "its source timestamp is later than the server's clock".to_owned()))
            }
            Some(source_t_s) if source_t_s < -MAX_AGE_S => {
                Some((Quality::Uncertain, format!("its source timestamp is more than {MAX_AGE_S} s old")))
            }
            None if is_stamped => {
                let reason = "no source timestamp; `timestamps: arrival` does without";
                Some((Quality::Uncertain, reason.to_owned()))
            }
            _ => None,
        };
        // Of equal qualities the first has the reason.
        let by_status = match quality(value) {
            Quality::Good => (Quality::Good, String::new()),
            quality => (quality, value.status.map(describe_status).unwrap_or_default()),
        };
        [by_type, by_time]
            .into_iter()
            .flatten()
            .fold(by_status, |worst, other| if other.0 > worst.0 { other } else { worst })
    }

    /// The type of a node that is written: values of another type would be refused.
    fn type_of(&mut self, node: &NodeId, value: &DataValue) -> Result<Variant, LinkError> {
        if let Some(status) = value.status.filter(|status| is_permanent(*status)) {
            return Err(LinkError::Node {
                node: node.clone(),
                message: format!("cannot be read: {}", describe_status(status)),
            });
        }
        match &value.value {
            Some(value)
                if !number(value).is_nan() || matches!(value, Variant::Float(_) | Variant::Double(_)) =>
            {
                return Ok(value.clone());
            }
            Some(value) if !value.is_empty() => {
                return Err(LinkError::Node {
                    node: node.clone(),
                    message: format!("holds no number: {value}"),
                });
            }
            _ => {}
        }
        // Without a value yet, the declared data type counts.
        let answer = self.link.read(std::slice::from_ref(node), AttributeId::DataType)?;
        let data_type = answer.values.into_iter().next().and_then(|answer| answer.value);
        let built_in = match data_type {
            Some(Variant::NodeId(id)) if id.namespace == 0 => id.as_u32(),
            _ => None,
        };
        // Part 6 of the specification, table 1.
        Ok(match built_in {
            Some(1) => Variant::Boolean(false),
            Some(2) => Variant::SByte(0),
            Some(3) => Variant::Byte(0),
            Some(4) => Variant::Int16(0),
            Some(5) => Variant::UInt16(0),
            Some(6) => Variant::Int32(0),
            Some(7) => Variant::UInt32(0),
            Some(8) => Variant::Int64(0),
            Some(9) => Variant::UInt64(0),
            Some(10) => Variant::Float(0.0),
            Some(11) => Variant::Double(0.0),
            _ => return Err(LinkError::Node { node: node.clone(), message: "holds no number".to_owned() }),
        })
    }

    /// Whether this type can hold every accepted setpoint.
    fn check_node_range(&self, target: Target, node: &NodeId, variant: &Variant) -> Result<(), LinkError> {
        let node_error = |message: String| Err(LinkError::Node { node: node.clone(), message });
        let Some((_, scale)) = self.checked.write(target) else { return Err(LinkError::Unknown(target)) };
        let range = self.checked.settings.accepts.range(target);
        let key = target.name();
        let name = type_name(variant);
        // Only air may be a Boolean.
        let is_bool = matches!(variant, Variant::Boolean(_)) && target != Target::Air;
        if let Some(value) = [range.high, range.low]
            .into_iter()
            .find(|value| is_bool || same_type(variant, scale.outside(*value)).is_none())
        {
            return node_error(format!(
                "({name}) cannot hold {} for `write.{key}`; check the node and its `unit`, or `scale` and `offset`",
                scale.outside(value)
            ));
        }
        match check_resolution(target, scale.step(), range) {
            Err(error) if is_whole(variant) => node_error(format!("({name}, `write.{key}`) {error}")),
            _ => Ok(()),
        }
    }

    fn read_types(&mut self) -> Result<(), LinkError> {
        let written: Vec<(Target, NodeId)> =
            self.checked.written().map(|(target, node)| (target, node.clone())).collect();
        let nodes: Vec<NodeId> = written.iter().map(|(_, node)| node.clone()).collect();
        let values = self.link.read(&nodes, AttributeId::Value)?.values;
        for ((target, node), value) in written.into_iter().zip(values) {
            let variant = self.type_of(&node, &value)?;
            self.check_node_range(target, &node, &variant)?;
            self.types.insert(target, variant);
        }
        let levels = self.link.read(&nodes, AttributeId::UserAccessLevel)?.values;
        let locked = nodes
            .iter()
            .zip(levels)
            .find(|(_, level)| matches!(level.value, Some(Variant::Byte(level)) if level & WRITABLE == 0));
        match locked {
            None => Ok(()),
            Some((node, _)) => {
                let message = "is not writable for this user".to_owned();
                Err(LinkError::Node { node: node.clone(), message })
            }
        }
    }
}

/// Targets of equal rank go into one request: the valve before pressures, the air last.
fn write_rank(target: Target) -> u8 {
    match target {
        Target::Valve => 0,
        Target::P3 | Target::T3 | Target::OilTemperature => 1,
        Target::Air => 2,
        Target::Heartbeat => 3,
    }
}

impl Controller for Nodes {
    type Error = LinkError;

    fn open(&mut self) -> Result<(), LinkError> {
        self.link.open()?;
        self.kinds.clear();
        let answer = self.link.read(&self.nodes, AttributeId::Value)?;
        self.compare_clocks(&answer.sent);
        for ((channel, node, _), value) in self.checked.reads.iter().zip(answer.values) {
            if let Some(status) = value.status.filter(|status| is_permanent(*status)) {
                let message = format!("cannot be read: {}", describe_status(status));
                return Err(LinkError::Node { node: node.clone(), message });
            }
            if let Some(variant) = value.value.filter(|variant| !variant.is_empty() && !is_number(variant)) {
                let message = format!("holds no number, as `read.{channel}` needs: {variant}");
                return Err(LinkError::Node { node: node.clone(), message });
            }
        }
        self.read_types()
    }

    fn read(&mut self, t_s: f64) -> (BTreeMap<Channel, Reading>, Option<LinkError>) {
        let Answer { values, sent } = match self.link.read(&self.nodes, AttributeId::Value) {
            Ok(answer) => answer,
            Err(error) => return (BTreeMap::new(), Some(error)),
        };
        let mut readings = BTreeMap::new();
        for (index, value) in values.into_iter().enumerate() {
            let Some((channel, _, scale)) = self.checked.reads.get(index) else { break };
            let (channel, scale) = (*channel, *scale);
            let kind = value.value.as_ref().filter(|variant| is_number(variant)).map(type_name);
            let first = kind.map(|kind| self.kinds.entry(channel).or_insert(kind).clone());
            let (quality, reason) = self.judge(&value, first, &sent);
            let number = value.value.as_ref().filter(|variant| is_number(variant)).map_or(f64::NAN, number);
            let source_t_s = self.source_t_s(&value, &sent, t_s);
            readings.insert(channel, Reading { value: scale.inside(number), source_t_s, quality, reason });
        }
        (readings, None)
    }

    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), LinkError> {
        let is_heartbeat = values.iter().all(|(target, _)| *target == Target::Heartbeat);
        let until = self.link.deadline(is_heartbeat);
        for group in values.chunk_by(|(a, _), (b, _)| write_rank(*a) == write_rank(*b)) {
            let mut request = Vec::with_capacity(group.len());
            for (target, value) in group {
                let Some(((node, scale), variant)) = self.checked.write(*target).zip(self.types.get(target))
                else {
                    // Every target has a node, and a type once the rig is armed.
                    return Err(LinkError::Unknown(*target));
                };
                let outside = scale.outside(*value);
                let fits = same_type(variant, outside);
                let fits =
                    fits.ok_or_else(|| LinkError::DoesNotFit { node: node.clone(), value: outside })?;
                request.push((node.clone(), fits, outside));
            }
            self.link.write(&request, until).map_err(|error| match error {
                // The number of a heartbeat does not matter.
                LinkError::Refused { server, node, message, .. } if is_heartbeat => {
                    LinkError::Failed { server, message: format!("refuses the node {node}: {message}") }
                }
                error => error,
            })?;
        }
        Ok(())
    }

    fn remark(&mut self) -> Option<String> {
        self.remark.take()
    }

    fn describe_source(&self, channel: Channel) -> String {
        let node = self.checked.reads.iter().find(|(one, ..)| *one == channel);
        let Some((_, node, _)) = node else { return "no node".to_owned() };
        format!("the node {node} (with {})", self.checked.unit(channel))
    }

    fn remedy(&self) -> String {
        "Check `node` and `unit`, or `scale` and `offset`, of the channel".to_owned()
    }

    fn close(&mut self) {
        self.link.close();
    }
}

/// Drive a gas stand behind a PLC or another controller that speaks OPC UA. `mapper` starts this driver without arguments for a campaign with
/// `backend: {opcua: ...}`; docs/how-to/rig.md, "Over OPC UA", has its settings. With `--socket PATH` it serves the hosts that connect there,
/// docs/reference/protocol.md. The commands below are for manual use.
#[derive(Parser)]
#[command(name = "mapper-backend-opcua", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Pin the server's current certificate; any other certificate is refused from then on.
    ///
    /// Compare the fingerprint with the one that the server itself shows.
    Trust {
        /// As in the campaign: opc.tcp://HOST:PORT
        endpoint: String,
        /// Pin it only if this is its SHA-256.
        #[arg(long, value_name = "SHA256")]
        fingerprint: Option<String>,
        /// Replace a different pinned certificate.
        #[arg(long)]
        replace: bool,
    },
    /// Print the path of this program's own certificate, which the server must trust; create it if missing.
    Certificate,
}

#[derive(Debug, thiserror::Error)]
enum CommandError {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("{0} has no certificate: it offers no encryption")]
    NoCertificate(String),
    #[error("the certificate has the fingerprint {found}, not {wanted}; nothing was pinned")]
    OtherFingerprint { found: String, wanted: String },
}

pub(crate) fn run() -> ExitCode {
    match Arguments::parse().command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // If standard error is closed, the message is lost.
            let _ = writeln!(std::io::stderr(), "error: {}", terminal_text(&error.to_string()));
            ExitCode::FAILURE
        }
    }
}

impl Command {
    fn run(self) -> Result<(), CommandError> {
        let store = Store::of_environment()?;
        match self {
            Command::Certificate => print(&store.own()?.display().to_string()),
            Command::Trust { endpoint, fingerprint, replace } => {
                trust(&store, &endpoint, fingerprint, replace)
            }
        }
    }
}

fn print(words: &str) -> Result<(), CommandError> {
    // The names in a certificate are those of the server.
    Ok(writeln!(std::io::stdout(), "{}", terminal_text(words))?)
}

fn trust(store: &Store, endpoint: &str, wanted: Option<String>, replace: bool) -> Result<(), CommandError> {
    if !is_endpoint(endpoint) {
        return Err(SettingError::Endpoint(endpoint.to_owned()).into());
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let offered = runtime.block_on(endpoints(store, endpoint))?;
    let der = offered.iter().map(|offer| offer.server_certificate.as_ref()).find(|der| !der.is_empty());
    let der = der.ok_or_else(|| CommandError::NoCertificate(endpoint.to_owned()))?;
    let certificate = X509::from_der(der).map_err(|_| CommandError::NoCertificate(endpoint.to_owned()))?;
    let found = fingerprint(der);
    print(&format!("{endpoint}\nsubject      {}", certificate.subject_name()))?;
    if let (Ok(from), Ok(to)) = (certificate.not_before(), certificate.not_after()) {
        print(&format!("valid        {} to {}", from.format("%Y-%m-%d"), to.format("%Y-%m-%d")))?;
    }
    print(&format!("fingerprint  SHA-256 {found}"))?;
    valid(endpoint, &certificate)?;
    let plain = |text: &str| text.replace([':', ' '], "").to_ascii_uppercase();
    if let Some(wanted) = wanted.filter(|wanted| plain(wanted) != plain(&found)) {
        return Err(CommandError::OtherFingerprint { found, wanted });
    }
    if let Some(pinned_certificate) = store.trusted(endpoint)? {
        let pinned = fingerprint(&crate::link::der(&pinned_certificate));
        if pinned != found && !replace {
            return Err(StoreError::Changed { server: endpoint.to_owned(), found, pinned }.into());
        }
    }
    let file = store.trust(endpoint, der)?;
    print(&format!("trusted from now on: {}", file.display()))?;
    print(&format!("our own certificate, for the server to trust: {}", store.own()?.display()))
}
