//! Code shared by drivers of gas stands behind a controller, whatever the protocol. An author implements [`Controller`], and [`rig`] makes a
//! rig of it. The rig keeps the heartbeat and writes setpoints in a safe order. If the controller does not answer, the rig returns a sample
//! without readings, so that the guards count how long. Before the first write it checks the readings and refuses implausible ones.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod absurd;
mod limits;
mod rig;

pub use absurd::{can_be_read, short};
pub use limits::{Accepts, LimitError, NEEDS, Safe, Target, fine_enough, scale, within};
pub use rig::{Reading, Stand, rig};

use mapper_core::Channel;
use std::collections::BTreeMap;

/// A connection to a controller. Every call returns within a second or two, even if the controller does not answer.
pub trait Controller: Send {
    /// Why a call failed.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Connects, and reads every channel once.
    ///
    /// # Errors
    /// If the controller cannot be reached, or a channel cannot be read.
    fn open(&mut self) -> Result<(), Self::Error>;

    /// Reads all channels for the sample at `t_s`, s since arming, and omits a channel that could not be read.
    fn read(&mut self, t_s: f64) -> BTreeMap<Channel, Reading>;

    /// Writes these values, SI, one after the other in this order.
    ///
    /// # Errors
    /// If a value was not written.
    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), Self::Error>;

    /// Address and number format of a channel, for messages.
    fn place(&self, channel: Channel) -> String;

    /// Settings to check if the last readings are implausible; a sentence without its full stop.
    fn remedy(&self) -> String;

    /// A message for the user since the last call.
    fn remark(&mut self) -> Option<String> {
        None
    }

    /// Closes the connection.
    fn close(&mut self);
}
