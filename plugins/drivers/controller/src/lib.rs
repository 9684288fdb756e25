//! The common part of drivers for gas stands with a PLC or another controller, independent of its protocol. An author of such a driver
//! implements [`Controller`], and [`rig`] turns it into a backend.
//!
//! The rig sends the heartbeat and writes setpoints in a safe order. Before the first write it checks that the readings are plausible. If
//! the controller does not answer, it returns samples without readings, so that the guards trip.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod limits;
mod rig;

pub use limits::{
    AcceptedRanges, LimitError, REQUIRED_GUARDS, SafeSettings, Target, WriteSettings, check_range,
    check_resolution, check_scale, format_short, is_plausible,
};
pub use rig::{Reading, Stand, rig};

use mapper_core::Channel;
use std::collections::BTreeMap;

/// A connection to a controller. Every call returns within a second or two, even if the controller does not answer.
pub trait Controller: Send {
    /// Why a call failed.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Connects, and reads every channel once.
    fn open(&mut self) -> Result<(), Self::Error>;

    /// Reads all channels for the sample at `t_s`, s since arming. Omits a channel that could not be read, and returns the reason.
    fn read(&mut self, t_s: f64) -> (BTreeMap<Channel, Reading>, Option<Self::Error>);

    /// Writes these values, SI, one after the other in this order.
    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), Self::Error>;

    /// Address and number format of a channel, for messages.
    fn describe_source(&self, channel: Channel) -> String;

    /// Settings to check if the last readings are implausible; a sentence without its full stop.
    fn remedy(&self) -> String;

    /// A message for the user since the last call.
    fn remark(&mut self) -> Option<String> {
        None
    }

    /// Closes the connection.
    fn close(&mut self);
}
