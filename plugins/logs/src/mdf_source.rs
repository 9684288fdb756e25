//! Protects the MDF library from hostile files: limits the nesting of formulas and the unpacked size.

use falcon_mdf::error::{Mf4Error, Result};
use falcon_mdf::io::memory::MemorySource;
use falcon_mdf::io::reader::BufferedSource;
use falcon_mdf::io::{ByteSlice, ByteSource};
use mapper_recording::logs::limits::{MAX_BLOCK_BYTES, is_too_deep, max_unpacked_bytes};
use mapper_recording::logs::{LogError, LogFile};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

/// Size of the header of a block of MDF 4, and with the fields of a packed one, bytes.
const HEADER: usize = 24;
const PACKED_HEADER: usize = 48;

/// Size of the header of a conversion of MDF 3, and its kind with a formula.
const CONVERSION_HEADER: usize = 46;
const FORMULA: [[u8; 2]; 2] = [[10, 0], [0, 10]];

/// The file as the library reads it.
pub(crate) struct MdfSource {
    inner: Box<dyn ByteSource>,
    /// Unpacked size of each compressed block that was read, bytes, by its offset.
    unpacked: Mutex<BTreeMap<u64, u64>>,
}

impl MdfSource {
    pub(crate) fn open(
        file: &LogFile,
        name: &'static str,
    ) -> std::result::Result<Arc<dyn ByteSource>, LogError> {
        let inner: Box<dyn ByteSource> = match file.bytes() {
            Some(bytes) => Box::new(MemorySource::new(bytes.to_vec())),
            None => Box::new(
                BufferedSource::open(file.path())
                    .map_err(|error| file.content_error(name, error.to_string()))?,
            ),
        };
        Ok(Arc::new(MdfSource { inner, unpacked: Mutex::default() }))
    }

    /// Counts a packed block once.
    fn count(&self, offset: u64, unpacked_bytes: u64) -> Result<()> {
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

    fn read_bytes(&self, offset: u64, len: usize) -> Result<ByteSlice<'_>> {
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

/// The stated unpacked size of a packed block, bytes.
fn packed_size(bytes: &[u8]) -> Option<u64> {
    let size = bytes.get(32..40).filter(|_| bytes.starts_with(b"##DZ") && bytes.len() >= PACKED_HEADER)?;
    Some(u64::from_le_bytes(size.try_into().ok()?))
}

/// Start of the text of a block that may contain a formula.
fn text_start(bytes: &[u8]) -> Option<usize> {
    let is_text = bytes.starts_with(b"##TX") && bytes.len() > HEADER;
    let kind = bytes.get(42..44).filter(|_| bytes.starts_with(b"CC") && bytes.len() > CONVERSION_HEADER);
    let is_formula = kind.is_some_and(|kind| FORMULA.iter().any(|formula| kind == formula));
    is_text.then_some(HEADER).or(is_formula.then_some(CONVERSION_HEADER))
}
