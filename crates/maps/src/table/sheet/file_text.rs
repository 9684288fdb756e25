//! Text of a map file that may be compressed or a workbook.

use crate::table::sheet::grid::text_of;
use crate::table::sheet::workbook::grid_of_workbook;
use mapper_core::{ImportError, MAP_FILE_SIZE_LIMIT};
use mapper_table::is_workbook;
use std::borrow::Cow;
use std::io::Read;

/// The text of a map file; of a workbook, its sheet with numbers as CSV.
///
/// # Errors
/// [`ImportError`] if it is neither text nor a workbook.
pub fn file_text(bytes: &[u8]) -> Result<String, ImportError> {
    let bytes = unpack(bytes)?;
    if is_workbook(&bytes) { Ok(grid_of_workbook(&bytes, None)?.csv()) } else { text_of(&bytes) }
}

/// Unpacks a gzip file; returns any other content unchanged.
///
/// # Errors
/// [`ImportError`] if it is broken or unpacks to more than a map needs.
pub fn unpack(bytes: &[u8]) -> Result<Cow<'_, [u8]>, ImportError> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(Cow::Borrowed(bytes));
    }
    let mut content = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes)
        .take(MAP_FILE_SIZE_LIMIT as u64 + 1)
        .read_to_end(&mut content)
        .map_err(|error| ImportError::Packed { problem: error.to_string() })?;
    if content.len() > MAP_FILE_SIZE_LIMIT {
        return Err(ImportError::TooLarge { bytes: content.len(), limit: MAP_FILE_SIZE_LIMIT });
    }
    Ok(Cow::Owned(content))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_compressed_file_is_its_content_and_a_broken_one_an_error() {
        let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        writer.write_all(b"speed,flow\n").unwrap();
        let packed = writer.finish().unwrap();
        assert_eq!(file_text(&packed).unwrap(), "speed,flow\n");
        assert!(matches!(unpack(&packed[..12]), Err(ImportError::Packed { .. })));
        assert_eq!(*unpack(b"plain").unwrap(), *b"plain");
    }
}
