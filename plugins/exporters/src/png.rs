//! The picture as pixels.

use crate::{ExportError, svg};
use mapper_core::CompressorMap;

/// Pixels for each unit of the picture: sharp on paper and on dense screens.
const SCALE: f32 = 2.0;

pub(crate) fn export(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    Ok(svg::map_figure(map).to_png(SCALE)?)
}
