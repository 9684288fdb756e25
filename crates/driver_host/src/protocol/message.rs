//! The messages. SI units; the name of a number contains its unit. Unknown fields are ignored.

use mapper_core::SafeTrajectory;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// One message: a request (`id` and `method`), its answer (`id` and `result` or `error`), or a note (`method` alone).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Message {
    /// Number of a request and of its answer; the sender increments it with each request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<u64>,
    /// The session, as named in the driver's hello; required in every later message of the host.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    /// Time after which the host no longer waits for the answer, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deadline_s: Option<f64>,
    /// Name of the request or note.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<String>,
    /// Parameters of the request or note.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    pub params: Value,
    /// Result of a successful request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<Value>,
    /// Error of a refused request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<Failure>,
}

impl Message {
    /// A note, which gets no answer.
    pub fn note(method: &str, params: Value) -> Message {
        Message { method: Some(method.to_owned()), params, ..Message::default() }
    }

    /// The answer to a request.
    pub fn answer(id: u64, answer: Result<Value, Box<Failure>>) -> Message {
        let (result, error) = match answer {
            Ok(result) => (Some(result), None),
            Err(error) => (None, Some(*error)),
        };
        Message { id: Some(id), result, error, ..Message::default() }
    }
}

/// Error of a refused request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Failure {
    /// Kind of the failure.
    pub code: Code,
    /// One sentence for people: the fault with value and unit, and its remedy. No secrets.
    pub message: String,
    /// `settings`: key path below the driver's settings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// `setpoint_out_of_range`: key of the setpoint in `set`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setpoint: Option<String>,
    /// `setpoint_out_of_range`: requested value, SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// `setpoint_out_of_range`: lowest accepted value, SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// `setpoint_out_of_range`: highest accepted value, SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// `lost` and `simulation`: run time of the failure, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub t_s: Option<f64>,
}

impl Failure {
    /// A failure with a message alone.
    pub fn new(code: Code, message: impl Into<String>) -> Failure {
        Failure {
            code,
            message: message.into(),
            path: None,
            setpoint: None,
            value: None,
            low: None,
            high: None,
            t_s: None,
        }
    }
}

/// Kind of a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// The request is not allowed in the state of the rig.
    OutOfOrder,
    /// A setpoint is outside the range of the rig; nothing was changed.
    SetpointOutOfRange,
    /// The settings are wrong.
    Settings,
    /// A simulation failed.
    Simulation,
    /// The rig was lost.
    Lost,
    /// The driver has no such method.
    UnknownMethod,
    /// The parameters are invalid for the method.
    Params,
    /// Wrong version of the protocol, or wrong session.
    Refused,
    /// The lease has ended and the rig was made safe; disarm and arm again.
    LeaseEnded,
    /// Anything else.
    #[serde(other)]
    Failed,
}

/// A version of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Version {
    /// A different major version is refused.
    pub major: u32,
    /// A higher minor version has additional fields, which are ignored.
    pub minor: u32,
}

/// `hello`: the first request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Hello {
    /// `mapper-backend`.
    pub magic: String,
    /// Version of the protocol.
    pub protocol: Version,
    /// Name of the program.
    pub name: String,
    /// Version of the program.
    pub version: String,
    /// Largest frame that it accepts, bytes.
    pub frame_limit_bytes: u32,
}

/// Answer to `hello`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Welcome {
    /// The driver's own hello; its name is the name in campaigns.
    #[serde(flatten)]
    pub hello: Hello,
    /// Name of this session: any text that no other session of this driver has had.
    pub session: String,
}

/// `configure`: the settings below the driver's name in the campaign. The rig is not touched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Configure {
    /// The settings; `null` if the campaign has none. A secret is `{env: NAME}`, the name of an environment variable.
    #[serde(default)]
    pub settings: Value,
}

/// Answer to `describe`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DescribeResult {
    /// The rig.
    pub description: Description,
    /// Any text that changes with the description; the helper libraries use SHA-256.
    pub identity: String,
}

/// Description of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Description {
    /// Measured channels.
    pub channels: Vec<ChannelDescription>,
    /// Samples per second, Hz, > 0.
    pub sample_rate_hz: f64,
    /// Whether time is simulated: samples are then sent on `poll`, otherwise unrequested.
    pub simulated_time: bool,
    /// Whether setpoints have an effect.
    #[serde(default = "default_true")]
    pub controls: bool,
    /// Unique name of the rig; two runs cannot use it at the same time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exclusive: Option<String>,
    /// Its address, e.g. host and port of its controller; two runs cannot use it at the same time, whatever name they give the rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached_at: Option<String>,
    /// Guards that the run must have, by their keys in campaigns.
    #[serde(default)]
    pub needs_guarded: Vec<String>,
    /// Setpoints that it accepts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accepts: Option<Ranges>,
    /// Its safe shutdown.
    pub safe: SafeTrajectory,
}

fn default_true() -> bool {
    true
}

/// A channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChannelDescription {
    /// Symbol, e.g. `T2`.
    pub name: String,
    /// Unit: the one of the channel, in SI, e.g. `K`.
    pub unit: String,
    /// Number of sensors that measure it; 1 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensors: Option<usize>,
}

/// Lowest and highest of each setpoint, SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ranges {
    /// Turbine inlet total pressure, Pa.
    pub p3_pa: (f64, f64),
    /// Turbine inlet total temperature, K.
    pub t3_k: (f64, f64),
    /// Opening of the back-pressure valve, ratio.
    pub valve_opening_ratio: (f64, f64),
    /// Oil inlet temperature, K.
    pub oil_temperature_k: (f64, f64),
}

/// `poll`: advances simulated time. The samples are sent as notes before the answer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Poll {
    /// Time since arming to which it advances, s.
    pub until_s: f64,
}

/// Answer to `poll`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LastSample {
    /// Sequence number of the next sample, that is the number of samples since arming.
    pub next_sequence: u64,
}
