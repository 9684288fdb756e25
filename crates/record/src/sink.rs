//! What takes the content of a recording, record by record.

use crate::records::ChannelDefinition;
use std::collections::BTreeMap;

/// Takes what a recording holds.
pub(crate) trait Sink: Sync {
    /// What a message says.
    type SinkMessage: Send;
    /// A topic, before its first message.
    fn define(&mut self, definition: &ChannelDefinition);
    /// Reads a message on a defined topic; `None` where the topic is not wanted. Several are read at a time.
    fn read(&self, channel_id: u16, data: &[u8]) -> Option<Self::SinkMessage>;
    /// Takes what a message says, in the order of the file.
    fn take(&mut self, channel_id: u16, log_time_ns: u64, told: Self::SinkMessage);
    /// A metadata record.
    fn metadata(&mut self, name: String, pairs: BTreeMap<String, String>);
    /// An attachment.
    fn attachment(&mut self, name: String, data: &[u8]);
    /// Values that it keeps by now.
    fn kept(&self) -> u64;
}
