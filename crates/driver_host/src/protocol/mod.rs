//! The protocol between host and driver (docs/reference/protocol.md): frames, messages, their JSON schema, and conversion.

mod convert;
mod frame;
mod samples;
#[cfg(test)]
#[path = "../../tests/inside/schema.rs"]
mod schema;

pub use crate::protocol::convert::{read_error, write_error};
pub use convert::{InvalidData, read_description, write_description};
pub use frame::{
    ChannelDescription, Code, Configure, DescribeResult, Description, Encoding, Failure, FrameError, Hello,
    LastSample, Message, Poll, Ranges, Version, Welcome, decode, encode, read_frame, write_frame,
};
pub use samples::{Column, ElementSamples, RigEvent, Samples, TruthSamples, batch, split_batch};

/// Magic word in the hello of both sides.
pub const MAGIC: &str = "mapper-backend";
/// Version of the protocol in this program. Another major number is refused; a higher minor one has fields that are ignored.
pub const VERSION: Version = Version { major: 1, minor: 1 };
/// First minor version whose drivers support `hold`.
pub const HOLD_SINCE_MINOR: u32 = 1;
/// Largest frame that this program accepts, bytes.
pub const FRAME_LIMIT_BYTES: u32 = 1 << 20;
/// Largest frame that either side may send before the hello of the other, which states its limit, bytes.
pub const FIRST_FRAME_LIMIT_BYTES: u32 = 1 << 16;
/// Time without a message after which an armed driver executes its safe trajectory, s.
pub const LEASE_S: f64 = 2.0;
/// Interval at which the host renews the lease, s.
pub const RENEW_S: f64 = 0.5;
