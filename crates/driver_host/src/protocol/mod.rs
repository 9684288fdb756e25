//! The protocol between the runner and a driver, a program of its own that speaks for a rig: frames, messages and what they
//! mean in the words of [`mapper_core`]. Specified in docs/reference/protocol.md; the JSON schema of the messages is made from these types.

mod convert;
mod convert_error;
mod frame;
mod message;
mod samples;
mod schema;

pub use convert::{Unusable, description, description_on_the_wire, setpoints, setpoints_on_the_wire};
pub use convert_error::{error_on_the_wire, rig_error};
pub use frame::{Encoding, FrameError, decode, encode, read_frame, write_frame};
pub use message::{
    ChannelDescription, Code, Configure, Described, Description, Failure, Hello, LastSample, Message, Mode,
    Note, Poll, Ranges, SafeWay, Setpoints, Version, Welcome,
};
pub use samples::{Column, ElementSamples, Happened, Samples, TruthSamples, batch, pieces};
pub use schema::schema;

/// First word of both sides.
pub const MAGIC: &str = "mapper-backend";
/// Version of the protocol spoken here. Another major number is refused; a higher minor one has fields that are ignored.
pub const VERSION: Version = Version { major: 1, minor: 1 };
/// From this minor version on a driver knows `hold`.
pub const HOLD_SINCE_MINOR: u32 = 1;
/// Largest frame that this side takes, bytes.
pub const FRAME_LIMIT_BYTES: u32 = 1 << 20;
/// Largest frame that either side may send before it knows the limit of the other, bytes.
pub const FIRST_FRAME_LIMIT_BYTES: u32 = 1 << 16;
/// An armed driver that has heard nothing for so long flies its safe trajectory, s.
pub const LEASE_S: f64 = 2.0;
/// How often the host renews the lease, s.
pub const RENEW_S: f64 = 0.5;
