//! What a log suggests.

use mapper_core::Channel;
use serde::Serialize;

/// Flow at surge and at choke of a machine at a shaft speed in rpm, kg/s.
pub type NominalFlows<'a> = &'a dyn Fn(f64) -> (f64, f64);

/// How sure an entry is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// Contradicted, or one of several: written as a comment.
    Unsure,
    /// Something had to be guessed.
    Likely,
    /// Name, unit and range agree.
    Sure,
}

/// One channel and its column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProposedChannel {
    /// The channel.
    pub channel: Channel,
    /// Index of the column in the layout.
    pub column: usize,
    /// Further columns with the same quantity: several sensors at one place.
    pub others: Vec<usize>,
    /// Unit as a channel map writes it; `None` if it could not be found out.
    pub unit: Option<&'static str>,
    /// Whether the pressure is read over the ambient pressure.
    pub gauge: bool,
    /// How sure it is.
    pub certainty: Certainty,
    /// Why it is not surer, and what was found out.
    pub remarks: Vec<String>,
}

/// The ambient pressure that gauge pressures are read over.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Ambient {
    /// A column.
    Column {
        /// Index of the column in the layout.
        column: usize,
        /// Its unit.
        unit: &'static str,
    },
    /// No column: the standard atmosphere is used, to be replaced by the barometer's reading.
    Assumed,
}

/// What a log suggests.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Proposal {
    /// Channels in the order of the channel table.
    pub channels: Vec<ProposedChannel>,
    /// The zero of gauge pressures; `None` if the log has none.
    pub ambient: Option<Ambient>,
    /// What the channels say of each other.
    pub remarks: Vec<String>,
}

impl Proposal {
    /// The entry of a channel.
    pub fn of(&self, channel: Channel) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.channel == channel)
    }

    /// The channel that a column was taken for.
    pub fn of_column(&self, column: usize) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.column == column || proposed.others.contains(&column))
    }
}
