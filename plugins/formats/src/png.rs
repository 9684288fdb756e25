//! The picture as pixels.

use crate::map_picture::map_figure;
use mapper_core::{CompressorMap, ExportError, MapFormat, MapUnits};

/// Pixels per unit of the picture: sharp on paper and on high-resolution screens.
const SCALE: f32 = 2.0;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "png",
    extension: "png",
    description: "the picture as pixels",
    write: Some(write),
    draw: Some(draw),
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    draw(map, &MapUnits::default())
}

fn draw(map: &CompressorMap, units: &MapUnits) -> Result<Vec<u8>, ExportError> {
    map_figure(map, units).to_png(SCALE).map_err(ExportError::failed(FORMAT.name))
}
