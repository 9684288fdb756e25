//! The nodes of the rig.

use crate::link::{Link, LinkError};
use crate::settings::{CheckedSettings, SettingError, Settings, Timestamps, settings_error};
use crate::value::{describe_status, is_number, is_whole, number, quality, same_type, type_name};
use mapper_controller::{Controller, Reading, Target, check_resolution, rig};
use mapper_core::{Backend, BackendError, Channel, Quality};
use opcua::types::{AttributeId, DataValue, DateTime, NodeId, StatusCode, Variant};
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;

/// Clock difference above which a message is given, s.
const MAX_CLOCK_DIFFERENCE_S: f64 = 1.0;
/// Write bit of an access level.
const WRITABLE: u8 = 2;

/// Makes the rig without connecting.
pub(crate) fn open(value: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let mut checked = Settings::read(value)?;
    let within = Duration::from_secs_f64(checked.settings.timeout_s());
    let (endpoint, user) = (checked.settings.endpoint.clone(), checked.user.take());
    let link = Link::new(endpoint, checked.settings.security, user, within)
        .map_err(|error| settings_error("", SettingError::Store(error.to_string())))?;
    let nodes = checked.reads.iter().map(|(_, node, _)| node.clone()).collect();
    Ok(rig(checked.settings.stand(), Nodes { checked, link, nodes, types: BTreeMap::new(), remark: None }))
}

struct Nodes {
    checked: CheckedSettings,
    link: Link,
    /// Nodes to read, in the order of `checked.reads`.
    nodes: Vec<NodeId>,
    /// Types of the written nodes.
    types: BTreeMap<Target, Variant>,
    remark: Option<String>,
}

/// Maximum lead of a source timestamp over the answer, s: clocks of controllers on one network agree within milliseconds to some tenths
/// (NTP), and a reading must not be older than 3 s.
const MAX_LEAD_S: f64 = 1.0;

fn between_s(earlier: &DateTime, later: &DateTime) -> f64 {
    // A tick is 100 ns.
    (later.ticks() - earlier.ticks()) as f64 * 1e-7
}

/// Whether the status means that the node is missing permanently.
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
    /// Reports a difference of the server's clock.
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

    /// Whether a value is stamped later than the server's own answer; its age is unknown then.
    fn is_from_the_future(&self, value: &DataValue, sent: &DateTime) -> bool {
        let age_s = self.source_t_s(value, sent, 0.0).map_or(0.0, |source_t_s| -source_t_s);
        age_s < -MAX_LEAD_S
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
        let key = target.key();
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

    /// Learns types and access of the written nodes.
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

    fn read(&mut self, t_s: f64) -> BTreeMap<Channel, Reading> {
        let Ok(answer) = self.link.read(&self.nodes, AttributeId::Value) else { return BTreeMap::new() };
        let reading =
            |((channel, _, scale), value): (&(Channel, NodeId, crate::settings::Scale), DataValue)| {
                let mut quality = quality(&value);
                let mut reason = value
                    .status
                    .map(describe_status)
                    .filter(|_| quality != Quality::Good)
                    .unwrap_or_default();
                // A node may change its type at run time: a Boolean is not a reading.
                let variant = value.value.as_ref().filter(|variant| is_number(variant));
                let inside = variant.map_or(f64::NAN, |variant| scale.inside(number(variant)));
                let from_the_future = self.is_from_the_future(&value, &answer.sent);
                if inside.is_nan() || from_the_future {
                    quality = Quality::Bad;
                }
                if reason.is_empty() && from_the_future {
                    reason = "its source timestamp is later than the server's clock".to_owned();
                } else if let Some(variant) =
                    value.value.as_ref().filter(|variant| reason.is_empty() && !is_number(variant))
                {
                    reason = format!("no number: {}", type_name(variant));
                }
                (
                    *channel,
                    Reading {
                        value: inside,
                        source_t_s: self.source_t_s(&value, &answer.sent, t_s),
                        quality,
                        reason,
                    },
                )
            };
        self.checked.reads.iter().zip(answer.values).map(reading).collect()
    }

    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), LinkError> {
        let until = self.link.deadline(values.iter().all(|(target, _)| *target == Target::Heartbeat));
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
            self.link.write(&request, until)?;
        }
        Ok(())
    }

    fn remark(&mut self) -> Option<String> {
        self.remark.take().or_else(|| self.link.remark())
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
