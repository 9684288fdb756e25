//! Publishes the topics of the recording during the run with Foxglove's WebSocket protocol.
//!
//! The library keeps a queue for each viewer and drops the oldest message if the viewer is slow, so publishing never waits. Viewers have no
//! write access: the server offers no services, parameters or client topics.

use crate::request::parse_address;
use foxglove::{
    ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServer,
};
use mapper_core::{Channel, Group, IdentifiedPoint, step_number};
use mapper_recording::{StepPhase, Topic, event_message, readings_message, step_message};
use mapper_session::SessionEvent;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;

/// Queue length of one viewer, messages: three minutes of rig time.
const MAX_QUEUED_MESSAGES: usize = 1024;

/// Topic of points identified separately during the run.
const POINT_TOPIC: &str = "/point";

/// Fields of a point with units and descriptions.
const POINT_FIELDS: [(&str, &str, &str); 9] = [
    ("step", "1", "number of the step, from 1"),
    ("speed_corrected_rpm", "rpm", "corrected shaft speed"),
    ("flow_corrected_kg_s", "kg/s", "corrected compressor mass flow"),
    ("pressure_ratio", "1", "total pressure ratio P2/P1"),
    ("eta", "1", "isentropic efficiency, total to total"),
    ("eta_low", "1", "lower end of its 95 % interval"),
    ("eta_high", "1", "upper end of its 95 % interval"),
    ("h_w_m2k", "W/(m2 K)", "heat-transfer coefficient between gas and compressor housing"),
    ("residual_rms_k", "K", "T2 residual of the fit"),
];

/// Why the stream cannot be served.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FoxgloveStreamError {
    #[error("the Foxglove stream cannot be served at {0}: {1}; choose another address")]
    Serve(SocketAddr, #[source] FoxgloveError),
}

/// The address of a stream on this computer, from a command line.
///
/// # Errors
/// The reason and the remedy, for any other text.
pub fn parse_local_address(text: &str) -> Result<SocketAddr, String> {
    let address = parse_address(text)?;
    let is_local = address.ip().is_loopback();
    is_local.then_some(address).ok_or_else(|| {
        "write an address of this computer, such as localhost:8765, because Foxglove sends no token; other computers can connect by a \
         tunnel (`ssh -L 8765:127.0.0.1:8765 STAND`)"
            .to_owned()
    })
}

/// A stream of readings for Foxglove and Lichtblick.
pub struct FoxgloveStream {
    address: SocketAddr,
    start_time_ns: u64,
    topics: BTreeMap<&'static str, Arc<RawChannel>>,
    /// Its topics are closed when this is dropped.
    _context: Arc<Context>,
}

impl FoxgloveStream {
    /// Serves readings of these channels at a local address. `start_time_ns`: epoch time of run time 0, as in the
    /// recording.
    ///
    /// # Errors
    /// [`FoxgloveStreamError`] if the address is in use.
    pub fn open(
        mut address: SocketAddr,
        start_time_ns: u64,
        channels: &[Channel],
    ) -> Result<FoxgloveStream, FoxgloveStreamError> {
        let context = Context::new();
        // All topics must exist before a viewer connects. The library announces a new topic slightly before it accepts subscriptions, and a fast
        // viewer would miss it.
        let measured = |group: &Group| channels.iter().any(|channel| channel.info().group == *group);
        let groups = Group::ALL.into_iter().filter(measured);
        let topics = groups
            .map(|group| Topic::of_group(group, channels.iter().copied()))
            .chain([Topic::of_steps(), Topic::of_events(), point_topic()])
            .filter_map(|topic| Some((topic.name, define_topic(&context, topic)?)))
            .collect();
        let server = WebSocketServer::new()
            .name("mapper")
            .bind(address.ip().to_string(), address.port())
            .message_backlog_size(MAX_QUEUED_MESSAGES)
            .context(&context)
            .start_blocking()
            .map_err(|source| FoxgloveStreamError::Serve(address, source))?;
        // The server lives until the process ends.
        address.set_port(server.port());
        Ok(FoxgloveStream { address, start_time_ns, topics, _context: context })
    }

    /// URL for a viewer.
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }

    /// Forwards a session event. Never waits for a viewer.
    pub fn show(&self, event: &SessionEvent) {
        match event {
            SessionEvent::Readings { t_s, values } => {
                for group in Group::ALL {
                    self.publish(group.topic(), *t_s, &readings_message(group, values));
                }
            }
            SessionEvent::StepStarted { marker, .. } => {
                let (t_s, message) = step_message(marker, StepPhase::Start);
                self.publish("/step", t_s, &message);
            }
            SessionEvent::StepEnded(marker) => {
                let (t_s, message) = step_message(marker, StepPhase::End);
                self.publish("/step", t_s, &message);
            }
            SessionEvent::Reported(event) => {
                self.publish("/event", event.t_s, &event_message(event));
            }
            SessionEvent::PointEstimated(point) => {
                let t_s = point.window.map_or(0.0, |window| window.end_s);
                self.publish(POINT_TOPIC, t_s, &point_message(point));
            }
            SessionEvent::RunStarted { .. }
            | SessionEvent::RigTime { .. }
            | SessionEvent::PointIdentified(_)
            | SessionEvent::RigReleased
            | SessionEvent::Progress { .. }
            | SessionEvent::PiecesDone { .. } => {}
        }
    }

    fn publish(&self, topic: &str, t_s: f64, message: &Value) {
        let Some(channel) = self.topics.get(topic) else { return };
        // A run lasts days at most, so its nanoseconds fit.
        let log_time = self.start_time_ns.saturating_add((t_s.max(0.0) * 1e9).round() as u64);
        channel.log_with_meta(message.to_string().as_bytes(), PartialMetadata::with_log_time(log_time));
    }
}

/// Defines a topic; `None` if the library refuses it.
fn define_topic(context: &Arc<Context>, topic: Topic) -> Option<Arc<RawChannel>> {
    let name = topic.name.trim_start_matches('/').replace('/', ".");
    ChannelBuilder::new(topic.name)
        .message_encoding("json")
        .schema(Schema::new(name, "jsonschema", topic.schema))
        .metadata(topic.units)
        .context(context)
        .build_raw()
        .ok()
}

fn point_topic() -> Topic {
    let property = |(name, unit, description): (&str, &str, &str)| {
        (name.to_owned(), json!({"type": "number", "description": description, "unit": unit}))
    };
    let properties: serde_json::Map<String, Value> = POINT_FIELDS.into_iter().map(property).collect();
    let schema = json!({"title": "point", "type": "object", "properties": properties});
    let units = POINT_FIELDS.into_iter().map(|(name, unit, _)| (name.to_owned(), unit.to_owned())).collect();
    Topic { name: POINT_TOPIC, schema: schema.to_string().into_bytes(), units }
}

fn point_message(point: &IdentifiedPoint) -> Value {
    json!({
        "step": step_number(point.step),
        "speed_corrected_rpm": point.speed_corrected_rpm,
        "flow_corrected_kg_s": point.flow_corrected_kg_s,
        "pressure_ratio": point.pressure_ratio,
        "eta": point.eta,
        "eta_low": point.eta_low,
        "eta_high": point.eta_high,
        "h_w_m2k": point.h_w_m2k,
        "residual_rms_k": point.residual_rms_k,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_is_served() {
        for text in ["0.0.0.0:0", "192.0.2.7:8765", "nonsense", "[::]:0"] {
            assert!(parse_local_address(text).is_err(), "{text}");
        }
        let stream = FoxgloveStream::open(parse_local_address("localhost:0").unwrap(), 0, &[]).unwrap();
        assert!(stream.url().starts_with("ws://127.0.0.1:") && !stream.url().ends_with(":0"));
    }
}
