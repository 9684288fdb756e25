//! The outcome of an item: a header line, then the result, or the reason for its absence.

use crate::files::{Durability, Machine, write_whole};
use crate::{FleetError, Hash, Item};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest first line, bytes.
const MAX_HEADER_BYTES: usize = 4096;
/// Largest result of one item, bytes.
const MAX_BODY_BYTES: u64 = 64 << 20;

/// The outcome of an item.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The body is its result.
    Done,
    /// The body is the reason for the missing result.
    Failed,
}

/// The first line of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    pub item: Hash,
    /// Program, version and commit that did it.
    pub program: String,
    pub outcome: Outcome,
    /// How long it took on one core, s.
    pub duration_s: f64,
    /// Peak memory of the process divided by its number of workers, bytes; 0 if unknown.
    pub memory_bytes: u64,
    /// Length of the body, bytes.
    pub body_bytes: u64,
    /// SHA-256 of the body.
    pub body_sha256: Hash,
}

/// Reason why a file is not a valid part of the study.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum PartRefusal {
    #[error("cannot be read: {0}")]
    Unread(String),
    #[error("is not a part")]
    NotAPart,
    #[error("contains the item {0}")]
    OtherItem(Hash),
    #[error("was made by {0}")]
    OtherProgram(String),
    #[error("has {found} bytes instead of {stated}")]
    Length { found: u64, stated: u64 },
    #[error("has {found} bytes, more than the {limit} that are read")]
    TooLarge { found: u64, limit: u64 },
    #[error("has been changed: its checksum is wrong")]
    Checksum,
}

impl Part {
    /// Writes the outcome of an item.
    pub(crate) fn write(
        path: &Path,
        (hash, item): (&Hash, &Item),
        (outcome, body): (Outcome, &str),
        (duration_s, memory_bytes): (f64, u64),
        machine: &Machine<'_>,
    ) -> Result<Part, FleetError> {
        let part = Part {
            item: *hash,
            program: item.program.clone(),
            outcome,
            // Zero if the clock went backwards.
            duration_s: if duration_s.is_finite() { duration_s.max(0.0) } else { 0.0 },
            memory_bytes,
            body_bytes: body.len() as u64,
            body_sha256: Hash::of(body.as_bytes()),
        };
        let header = serde_json::to_vec(&part).map_err(FleetError::content(path, "a part"))?;
        write_whole(path, &[&header, b"\n", body.as_bytes()], machine.name, Durability::Synced)?;
        Ok(part)
    }

    /// The part of the item `hash` by `program`, with its body, whose checksum is checked; `None` without a file.
    pub(crate) fn read(
        path: &Path,
        hash: &Hash,
        program: &str,
    ) -> Option<Result<(Part, String), PartRefusal>> {
        match std::fs::symlink_metadata(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => Some(Err(PartRefusal::Unread(error.to_string()))),
            // A pipe would hang, and a link may lead anywhere.
            Ok(metadata) if !metadata.is_file() => Some(Err(PartRefusal::NotAPart)),
            Ok(_) => Some(read_body(path, hash, program)),
        }
    }
}

fn unread(error: impl std::fmt::Display) -> PartRefusal {
    PartRefusal::Unread(error.to_string())
}

/// The header, the file, and the bytes of the body that were read with the header.
fn open(path: &Path, hash: &Hash, program: &str) -> Result<(Part, File, Vec<u8>), PartRefusal> {
    let mut file = mapper_yaml::open_file(path).map_err(unread)?;
    let length = file.metadata().map_err(unread)?.len();
    let mut bytes = Vec::with_capacity(MAX_HEADER_BYTES);
    (&mut file).take(MAX_HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(unread)?;
    let end = bytes.iter().position(|byte| *byte == b'\n').ok_or(PartRefusal::NotAPart)?;
    let part: Part = serde_json::from_slice(&bytes[..end]).map_err(|_| PartRefusal::NotAPart)?;
    if part.item != *hash {
        return Err(PartRefusal::OtherItem(part.item));
    }
    if part.program != program {
        return Err(PartRefusal::OtherProgram(part.program));
    }
    if part.body_bytes > MAX_BODY_BYTES {
        return Err(PartRefusal::TooLarge { found: part.body_bytes, limit: MAX_BODY_BYTES });
    }
    let found = length.saturating_sub(end as u64 + 1);
    if found != part.body_bytes {
        return Err(PartRefusal::Length { found, stated: part.body_bytes });
    }
    Ok((part, file, bytes.split_off(end + 1)))
}

fn read_body(path: &Path, hash: &Hash, program: &str) -> Result<(Part, String), PartRefusal> {
    let (part, file, mut body) = open(path, hash, program)?;
    file.take(MAX_BODY_BYTES + 1).read_to_end(&mut body).map_err(unread)?;
    if Hash::of(&body) != part.body_sha256 {
        return Err(PartRefusal::Checksum);
    }
    let body = String::from_utf8(body).map_err(|_| PartRefusal::Checksum)?;
    Ok((part, body))
}
