//! What drivers of a gas stand behind a controller share, whatever it speaks: an author implements [`Controller`], and [`rig`] makes a
//! rig of it. It keeps the heartbeat, writes setpoints in the order that is safe, and gives a sample without readings where
//! the controller does not answer, so that the guards count how long. Before it writes anything it looks at the readings: what no sensor can
//! read is refused.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod absurd;
mod limits;
mod rig;

pub use absurd::{can_be_read, short};
pub use limits::{Accepts, LimitError, NEEDS, Safe, Target, fine_enough, scale, within};
pub use rig::{Reading, Stand, rig};

use mapper_core::Channel;
use std::collections::BTreeMap;

/// A connection to a controller. Every call comes back within a second or two, whatever the other side does.
pub trait Controller: Send {
    /// Why a call failed.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Connects, and reads everything once.
    ///
    /// # Errors
    /// Where it cannot be reached, or something cannot be read.
    fn open(&mut self) -> Result<(), Self::Error>;

    /// Reads everything for the sample at `t_s`, s since arming. A channel that could not be read is left out.
    fn read(&mut self, t_s: f64) -> BTreeMap<Channel, Reading>;

    /// Writes these values, SI, in this order: each before the next.
    ///
    /// # Errors
    /// Where one was not written.
    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), Self::Error>;

    /// Where a channel stands, and how its number is read there, for people.
    fn place(&self, channel: Channel) -> String;

    /// What to look at where what was read last cannot be, a sentence without its point.
    fn remedy(&self) -> String;

    /// Something to be said to people since the last call.
    fn remark(&mut self) -> Option<String> {
        None
    }

    /// Gives the connection up.
    fn close(&mut self);
}
