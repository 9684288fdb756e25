//! Frames and their messages. A frame is a length of four bytes, most significant first, and a message in MessagePack or JSON, which its first
//! byte distinguishes. SI units; the name of a number contains its unit. Unknown fields are ignored.

use mapper_core::SafeTrajectory;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::{Read, Write};

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

/// Maximum nesting of a message, so that it cannot exhaust the stack. Settings are the most deeply nested part.
const MAX_DEPTH: usize = 64;

/// Encoding of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoding {
    /// MessagePack, maps with names.
    #[default]
    MessagePack,
    /// JSON, for debugging and for languages without MessagePack.
    Json,
}

impl Encoding {
    /// Detects the encoding by the first byte: `{` means JSON. In MessagePack this byte would be a number, which is not a message.
    pub fn of(body: &[u8]) -> Encoding {
        if body.first() == Some(&b'{') { Encoding::Json } else { Encoding::MessagePack }
    }
}

/// A frame that cannot be read, or its content.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FrameError {
    #[error("a frame of {bytes} bytes; at most {limit} may be sent")]
    TooLarge { bytes: u64, limit: u32 },
    #[error(
        "text that begins with `{begins}` instead of a frame: write only frames to standard output, and text to standard error"
    )]
    Text { begins: String },
    #[error("an empty frame")]
    Empty,
    #[error("the stream ended after {got} of {wanted} bytes of a frame")]
    Truncated { got: usize, wanted: usize },
    #[error("not a message: {0}")]
    Content(String),
    #[error(transparent)]
    Stream(#[from] std::io::Error),
}

/// Reads the next frame; `None` if the stream ends between two frames. Allocates at most `limit_bytes`, whatever length is declared.
pub fn read_frame(stream: &mut impl Read, limit_bytes: u32) -> Result<Option<Vec<u8>>, FrameError> {
    let mut length = Vec::with_capacity(4);
    stream.take(4).read_to_end(&mut length)?;
    let length: [u8; 4] = match length.len() {
        0 => return Ok(None),
        got => length.try_into().map_err(|_| FrameError::Truncated { got, wanted: 4 })?,
    };
    let bytes = u32::from_be_bytes(length);
    match bytes {
        0 => return Err(FrameError::Empty),
        // Letters, read as a length, are at least half a gigabyte.
        _ if bytes > limit_bytes
            && length.iter().all(|byte| matches!(byte, b' '..=b'~' | b'\n' | b'\r' | b'\t')) =>
        {
            let begins = String::from_utf8_lossy(&length).escape_debug().to_string();
            return Err(FrameError::Text { begins });
        }
        _ if bytes > limit_bytes => {
            return Err(FrameError::TooLarge { bytes: bytes.into(), limit: limit_bytes });
        }
        _ => {}
    }
    let (mut body, wanted) = (Vec::new(), bytes as usize);
    stream.take(bytes.into()).read_to_end(&mut body)?;
    if body.len() < wanted {
        return Err(FrameError::Truncated { got: body.len(), wanted });
    }
    Ok(Some(body))
}

/// Writes one frame and flushes it.
pub fn write_frame(stream: &mut impl Write, body: &[u8], limit_bytes: u32) -> Result<(), FrameError> {
    let length = u32::try_from(body.len()).ok().filter(|length| *length <= limit_bytes);
    let Some(length) = length else {
        return Err(FrameError::TooLarge { bytes: body.len() as u64, limit: limit_bytes });
    };
    stream.write_all(&length.to_be_bytes())?;
    stream.write_all(body)?;
    Ok(stream.flush()?)
}

/// Encodes the body of a frame.
pub fn encode(message: &Message, encoding: Encoding) -> Result<Vec<u8>, FrameError> {
    match encoding {
        Encoding::Json => serde_json::to_vec(message).map_err(|error| FrameError::Content(error.to_string())),
        Encoding::MessagePack => {
            rmp_serde::to_vec_named(message).map_err(|error| FrameError::Content(error.to_string()))
        }
    }
}

/// Decodes the message in the body of a frame. Unknown fields are ignored.
pub fn decode(body: &[u8]) -> Result<Message, FrameError> {
    match Encoding::of(body) {
        Encoding::Json => {
            serde_json::from_slice(body).map_err(|error| FrameError::Content(error.to_string()))
        }
        Encoding::MessagePack => {
            let mut reader = rmp_serde::Deserializer::from_read_ref(body);
            reader.set_max_depth(MAX_DEPTH);
            Message::deserialize(&mut reader).map_err(|error| FrameError::Content(error.to_string()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn message() -> Message {
        Message {
            id: Some(7),
            session: Some("s".to_owned()),
            method: Some("set".to_owned()),
            params: json!({"p3_pa": 150_000.125, "t3_k": null, "nested": [1, -2, "x", {"y": true}]}),
            ..Message::default()
        }
    }

    #[test]
    fn both_encodings_return_the_written_message() {
        for encoding in [Encoding::Json, Encoding::MessagePack] {
            let body = encode(&message(), encoding).unwrap();
            assert_eq!(Encoding::of(&body), encoding);
            assert_eq!(decode(&body).unwrap(), message());
        }
    }

    /// One key whose value is nested deeper than any stack.
    #[test]
    fn deeply_nested_messages_are_refused() {
        for depth in [1_000, 100_000] {
            let json = format!("{{\"params\":{}{}}}", "[".repeat(depth), "]".repeat(depth));
            assert!(decode(json.as_bytes()).is_err(), "{depth}");
            // Also in an unknown field.
            for field in ["params", "fields"] {
                let mut packed = vec![0x81, 0xa6];
                packed.extend(field.bytes());
                packed.extend(std::iter::repeat_n(0x91, depth));
                packed.push(0xc0);
                assert!(decode(&packed).is_err(), "{depth}");
            }
        }
    }

    #[test]
    fn invalid_lengths_are_refused() {
        let mut bytes = u32::MAX.to_be_bytes().to_vec();
        bytes.extend(b"{}");
        assert!(matches!(read_frame(&mut &bytes[..], 100), Err(FrameError::TooLarge { limit: 100, .. })));
        assert!(matches!(read_frame(&mut &[0u8, 0, 0, 0][..], 100), Err(FrameError::Empty)));
        assert!(matches!(
            read_frame(&mut &[0u8, 0, 0, 9, b'{'][..], 100),
            Err(FrameError::Truncated { got: 1, wanted: 9 })
        ));
        assert!(matches!(
            read_frame(&mut &[0u8, 0][..], 100),
            Err(FrameError::Truncated { got: 2, wanted: 4 })
        ));
        assert!(read_frame(&mut &[][..], 100).unwrap().is_none());
        assert!(write_frame(&mut Vec::new(), &[b'{'; 101], 100).is_err());
        let text = read_frame(&mut &b"\nWelcome!"[..], 1 << 20).unwrap_err().to_string();
        assert!(text.contains("`\\nWel`"), "{text}");
    }

    proptest! {
        #[test]
        fn any_number_of_frames_is_read_back(bodies in prop::collection::vec(prop::collection::vec(any::<u8>(), 1..50), 0..8)) {
            let mut stream = Vec::new();
            for body in &bodies {
                write_frame(&mut stream, body, 50).unwrap();
            }
            let mut stream = &stream[..];
            for body in &bodies {
                let read = read_frame(&mut stream, 50).unwrap();
                prop_assert_eq!(read.as_ref(), Some(body));
            }
            prop_assert!(read_frame(&mut stream, 50).unwrap().is_none());
        }

        /// Neither a panic nor more than the limit in memory, whatever comes.
        #[test]
        fn any_bytes_are_a_message_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut stream = &bytes[..];
            while let Ok(Some(body)) = read_frame(&mut stream, 300) {
                prop_assert!(body.len() <= 300);
                let _ = decode(&body);
            }
            let _ = decode(&bytes);
        }

        /// A message with bytes changed or cut off.
        #[test]
        fn a_damaged_message_is_a_message_or_an_error(
            at in 0usize..200, value in any::<u8>(), keep in 0usize..200, json in any::<bool>(),
        ) {
            let encoding = if json { Encoding::Json } else { Encoding::MessagePack };
            let mut body = encode(&message(), encoding).unwrap();
            let length = body.len();
            body[at % length] = value;
            body.truncate(keep);
            let _ = decode(&body);
        }
    }
}
