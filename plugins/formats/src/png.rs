//! The picture as pixels.

use crate::map_picture::map_figure;
use mapper_core::{CompressorMap, ExportError, MapFormat};

/// Pixels for each unit of the picture: sharp on paper and on dense screens.
const SCALE: f32 = 2.0;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "png",
    extension: "png",
    further_extensions: &[],
    description: "the picture as pixels",
    write: Some(write),
    read: None,
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    map_figure(map).to_png(SCALE).map_err(ExportError::failed(FORMAT.name))
}
