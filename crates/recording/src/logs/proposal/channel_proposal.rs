//! The proposed channel map of a log.

use super::remark::ProposalRemark;
use mapper_core::Channel;
use serde::Serialize;

/// Flow at surge and at choke of a machine at a shaft speed in rpm, kg/s.
pub type NominalFlows<'a> = &'a dyn Fn(f64) -> (f64, f64);

/// Certainty of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// Contradicted or ambiguous: written as a comment.
    Unsure,
    /// Some property was guessed.
    Likely,
    /// Name, unit and range agree.
    Sure,
}

/// A channel with its proposed column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProposedChannel {
    /// The channel.
    pub channel: Channel,
    /// Index of the column in the layout.
    pub column: usize,
    /// Columns of further sensors at the same place.
    pub others: Vec<usize>,
    /// Unit as written in a channel map; `None` if unknown.
    pub unit: Option<&'static str>,
    /// Whether it is a gauge pressure.
    pub gauge: bool,
    /// Certainty.
    pub certainty: Certainty,
    /// Reasons for the certainty, and assumptions.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ProposalRemark>,
}

impl ProposedChannel {
    /// Its remarks on one line.
    pub fn remarks_text(&self) -> String {
        self.remarks.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    }
}

/// Reference of the gauge pressures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Ambient {
    /// A column.
    Column {
        /// Index of the column in the layout.
        column: usize,
        /// Its unit.
        unit: &'static str,
    },
    /// The standard atmosphere, since no column has the ambient pressure; the user replaces it by the barometer's reading.
    Assumed,
}

/// The proposed channel map of a log.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Proposal {
    /// Channels in the order of the channel table.
    pub channels: Vec<ProposedChannel>,
    /// Reference of gauge pressures; `None` if the log has no gauge pressure.
    pub ambient: Option<Ambient>,
    /// Results of the checks between channels.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ProposalRemark>,
}

impl Proposal {
    /// The entry of a channel.
    pub fn entry(&self, channel: Channel) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.channel == channel)
    }

    /// The entry of a column.
    pub fn channel_of_column(&self, column: usize) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.column == column || proposed.others.contains(&column))
    }
}
