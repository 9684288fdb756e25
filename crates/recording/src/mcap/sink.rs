//! Receiver of a recording's content, record by record.

use crate::mcap::records::ChannelDefinition;
use std::collections::BTreeMap;

/// Receives the content of a recording.
pub(crate) trait Sink: Sync {
    type SinkMessage: Send;
    /// A topic, before its first message.
    fn define(&mut self, definition: &ChannelDefinition);
    /// Reads a message on a defined topic; `None` if the topic is not wanted. Several are read in parallel.
    fn read(&self, channel_id: u16, data: &[u8]) -> Option<Self::SinkMessage>;
    /// Receives the content of a message, in the order of the file.
    fn take(&mut self, channel_id: u16, log_time_ns: u64, content: Self::SinkMessage);
    /// A metadata record.
    fn metadata(&mut self, name: String, pairs: BTreeMap<String, String>);
    fn attachment(&mut self, name: String, data: &[u8]);
    /// Number of values kept so far.
    fn value_count(&self) -> u64;
}
