//! Parses the bodies of the relevant records without trusting any length.
//!
//! `mcap`'s own parser allocates a stated length (4 GB for a damaged string), and panics on a short attachment.

use std::collections::BTreeMap;

/// Start of every MCAP file.
pub(crate) const MAGIC: &[u8] = mcap::MAGIC;
/// Kinds of records.
pub(crate) use mcap::records::op;

/// Reads fields off the front of a body.
pub(crate) struct Body<'a>(pub(crate) &'a [u8]);

impl<'a> Body<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(*self.bytes(2)?.first_chunk()?))
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.bytes(4)?.first_chunk()?))
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(*self.bytes(8)?.first_chunk()?))
    }

    /// Bytes after their number in 32 bits.
    pub(crate) fn u32_prefixed_bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.bytes(usize::try_from(count).ok()?)
    }

    /// Bytes after their number in 64 bits.
    pub(crate) fn u64_prefixed_bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u64()?;
        self.bytes(usize::try_from(count).ok()?)
    }

    pub(crate) fn text(&mut self) -> Option<String> {
        Some(std::str::from_utf8(self.u32_prefixed_bytes()?).ok()?.to_owned())
    }

    pub(crate) fn text_map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut pairs = Body(self.u32_prefixed_bytes()?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            map.insert(pairs.text()?, pairs.text()?);
        }
        Some(map)
    }
}

/// A topic as a file defines it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChannelDefinition {
    pub(crate) id: u16,
    pub(crate) topic: String,
    pub(crate) encoding: String,
    pub(crate) metadata: BTreeMap<String, String>,
    /// Content of the schema; empty if there is none.
    pub(crate) schema: Vec<u8>,
}

/// Id and content of a schema.
pub(crate) fn parse_schema(body: &[u8]) -> Option<(u16, &[u8])> {
    let mut body = Body(body);
    let id = body.u16()?;
    let (_name, _encoding) = (body.u32_prefixed_bytes()?, body.u32_prefixed_bytes()?);
    Some((id, body.u32_prefixed_bytes()?))
}

/// A topic and the id of its schema; the schema's content is not filled in.
pub(crate) fn parse_channel(body: &[u8]) -> Option<(ChannelDefinition, u16)> {
    let mut body = Body(body);
    let (id, schema_id) = (body.u16()?, body.u16()?);
    let (topic, encoding, metadata) = (body.text()?, body.text()?, body.text_map()?);
    Some((ChannelDefinition { id, topic, encoding, metadata, schema: Vec::new() }, schema_id))
}

/// Channel id, log time and content of a message.
pub(crate) fn parse_message(body: &[u8]) -> Option<(u16, u64, &[u8])> {
    let mut body = Body(body);
    let (id, _sequence, log_time, _publish_time) = (body.u16()?, body.u32()?, body.u64()?, body.u64()?);
    Some((id, log_time, body.0))
}

/// Name and pairs of a metadata record.
pub(crate) fn parse_metadata(body: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut body = Body(body);
    Some((body.text()?, body.text_map()?))
}

/// Name and content of an attachment with a correct checksum.
pub(crate) fn parse_attachment(record: &[u8]) -> Option<(String, &[u8])> {
    let mut body = Body(record);
    let (_log_time, _create_time) = (body.u64()?, body.u64()?);
    let (name, _media_type, data) = (body.text()?, body.u32_prefixed_bytes()?, body.u64_prefixed_bytes()?);
    let checked = record.get(..record.len() - body.0.len())?;
    let saved = body.u32()?;
    (saved == 0 || saved == crc32fast::hash(checked)).then_some((name, data))
}
