//! Text of a map file that may be compressed or a workbook.

use crate::table::columns::quantity_name::end_in;
use crate::table::sheet::grid::{Grid, text_of};
use crate::table::sheet::speed_heading::without_speed;
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

/// One text of files with a speed line each, named after its speed or as the surge line (`45000.csv`, `surge.csv`), as digitisers write them.
///
/// # Errors
/// [`ImportError`] for other names, and for files that are not text.
pub fn text_of_lines(files: &[(String, Vec<u8>)]) -> Result<String, ImportError> {
    let mut lines: Vec<(f64, String)> = Vec::new();
    for (name, bytes) in files {
        let mut grid = Grid::of_text(&text_of(&unpack(bytes)?)?)?;
        grid.rows.retain(|row| !row.is_comment);
        let (speed_rpm, title) = match without_speed(&grid, name) {
            Some((_, speed_rpm)) => (speed_rpm, format!("{speed_rpm} rpm")),
            None if end_in(name).is_some() => (f64::INFINITY, name.clone()),
            None => {
                let form = "the speed of a line, as in `45000.csv`, or `surge.csv`";
                return Err(ImportError::RowForm { line: 1, text: name.clone(), form });
            }
        };
        let has_heading =
            grid.rows.iter().any(|row| row.cells.iter().any(|c| c.contains(char::is_alphabetic)));
        let width = grid.rows.iter().map(|row| row.cells.len()).max().unwrap_or_default();
        // `Q` is a flow without a unit, which the user has to state.
        let heading = match (has_heading, width) {
            (true, _) => "",
            (false, ..=2) => "Q,PR\n",
            (false, _) => "Q,PR,efficiency\n",
        };
        lines.push((speed_rpm, format!("{title}\n{heading}{}", grid.csv())));
    }
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(lines.into_iter().map(|(_, text)| text).collect())
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
