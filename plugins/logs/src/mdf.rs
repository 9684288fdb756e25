//! Common parts of both versions of MDF: columns and rows, and protection of the library from hostile files by limits on the nesting of formulas
//! and the unpacked size.

use falcon_mdf::error::{Mf4Error, Result as MdfResult};
use falcon_mdf::io::memory::MemorySource;
use falcon_mdf::io::reader::BufferedSource;
use falcon_mdf::io::{ByteSlice, ByteSource};
use mapper_recording::logs::limits::{MAX_BLOCK_BYTES, is_too_deep, max_unpacked_bytes};
use mapper_recording::logs::{Column, Layout, LogError, LogFile, Row, RowSink};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

const MAX_CHANNELS: usize = 10_000;

/// Maximum length of a comment, characters.
const MAX_DESCRIPTION: usize = 200;

/// Refuses a file with too many channels.
pub(crate) fn check_channel_count(file: &LogFile, name: &'static str, count: usize) -> Result<(), LogError> {
    if count > MAX_CHANNELS {
        return Err(
            file.content_error(name, format!("it has {count} channels; at most {MAX_CHANNELS} are read"))
        );
    }
    Ok(())
}

/// The column of a channel. A name that the group already has is numbered.
pub(crate) fn column(
    names: &mut BTreeSet<String>,
    [header, unit, description]: [&str; 3],
    group: usize,
) -> Column {
    let mut name = header.to_owned();
    let mut number = 1usize;
    while !names.insert(name.clone()) {
        number += 1;
        name = format!("{header} ({number})");
    }
    Column {
        name,
        header: header.to_owned(),
        unit: Some(unit.trim().to_owned()).filter(|unit| !unit.is_empty()),
        description: description.chars().take(MAX_DESCRIPTION).collect(),
        group,
    }
}

/// The wanted channels of a group; `channels` has one for each column of the layout.
pub(crate) fn wanted_channels<'a, T>(
    layout: &Layout,
    wanted: &[usize],
    channels: &'a [T],
    group: usize,
) -> Vec<&'a T> {
    layout.members(group, wanted).into_iter().filter_map(|column| channels.get(column)).collect()
}

/// Forwards rows of columns that begin together; values in `missing` mark missing readings.
pub(crate) fn forward_rows(
    group: usize,
    times_s: impl Iterator<Item = f64>,
    columns: &[Vec<f64>],
    missing: &[f64],
    sink: &mut RowSink<'_>,
) -> Result<(), LogError> {
    let mut values: Vec<f64> = Vec::new();
    for (row, t_s) in times_s.enumerate() {
        values.clear();
        values.extend(columns.iter().map(|column| {
            let value = column.get(row).copied().unwrap_or(f64::NAN);
            if missing.contains(&value) { f64::NAN } else { value }
        }));
        sink(Row { group, t_s, values: &values })?;
    }
    Ok(())
}

/// Size of the header of a block of MDF 4, and with the fields of a packed one, bytes.
const HEADER: usize = 24;
const PACKED_HEADER: usize = 48;

/// Size of the header of a conversion of MDF 3, and its kind with a formula.
const CONVERSION_HEADER: usize = 46;
const FORMULA: [[u8; 2]; 2] = [[10, 0], [0, 10]];

pub(crate) struct MdfSource {
    inner: Box<dyn ByteSource>,
    /// Unpacked size of each compressed block that was read, bytes, by its offset.
    unpacked: Mutex<BTreeMap<u64, u64>>,
}

impl MdfSource {
    pub(crate) fn open(file: &LogFile, name: &'static str) -> Result<Arc<dyn ByteSource>, LogError> {
        let inner: Box<dyn ByteSource> = match file.bytes() {
            Some(bytes) => Box::new(MemorySource::new(bytes.to_vec())),
            None => Box::new(
                BufferedSource::open(file.path())
                    .map_err(|error| file.content_error(name, error.to_string()))?,
            ),
        };
        Ok(Arc::new(MdfSource { inner, unpacked: Mutex::default() }))
    }

    fn count(&self, offset: u64, unpacked_bytes: u64) -> MdfResult<()> {
        let refused = |limit: u64| {
            Mf4Error::Decompression(format!(
                "its blocks unpack to more than the {} MiB that a file of this size may have",
                limit >> 20
            ))
        };
        if unpacked_bytes > MAX_BLOCK_BYTES {
            return Err(Mf4Error::Decompression(format!(
                "a block unpacks to {} MiB; at most {} are read",
                unpacked_bytes >> 20,
                MAX_BLOCK_BYTES >> 20
            )));
        }
        let limit = max_unpacked_bytes(self.inner.len());
        let Ok(mut unpacked) = self.unpacked.lock() else { return Err(refused(limit)) };
        unpacked.insert(offset, unpacked_bytes);
        let total = unpacked.values().fold(0u64, |total, bytes| total.saturating_add(*bytes));
        if total > limit { Err(refused(limit)) } else { Ok(()) }
    }
}

impl ByteSource for MdfSource {
    fn len(&self) -> u64 {
        self.inner.len()
    }

    fn read_bytes(&self, offset: u64, len: usize) -> MdfResult<ByteSlice<'_>> {
        let bytes = self.inner.read_bytes(offset, len)?;
        if let Some(size) = packed_size(&bytes) {
            self.count(offset, size)?;
        }
        match text_start(&bytes) {
            // Without its text a conversion is unknown, so its channel is left out; a comment would just be lost.
            Some(start) if bytes.get(start..).is_some_and(is_too_deep) => {
                let mut bytes = bytes.into_owned();
                bytes.iter_mut().skip(start).for_each(|byte| *byte = 0);
                Ok(ByteSlice::owned(bytes))
            }
            _ => Ok(bytes),
        }
    }
}

fn packed_size(bytes: &[u8]) -> Option<u64> {
    let size = bytes.get(32..40).filter(|_| bytes.starts_with(b"##DZ") && bytes.len() >= PACKED_HEADER)?;
    Some(u64::from_le_bytes(size.try_into().ok()?))
}

fn text_start(bytes: &[u8]) -> Option<usize> {
    let is_text = bytes.starts_with(b"##TX") && bytes.len() > HEADER;
    let kind = bytes.get(42..44).filter(|_| bytes.starts_with(b"CC") && bytes.len() > CONVERSION_HEADER);
    let is_formula = kind.is_some_and(|kind| FORMULA.iter().any(|formula| kind == formula));
    is_text.then_some(HEADER).or(is_formula.then_some(CONVERSION_HEADER))
}
