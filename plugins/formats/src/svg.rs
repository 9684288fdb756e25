//! The map as a picture.

use crate::map_picture::map_figure;
use mapper_core::{CompressorMap, ExportError, MapFormat, MapUnits};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "svg",
    extension: "svg",
    description: "picture: speed lines with efficiency contours, and efficiency with its 95 % interval",
    write: Some(write),
    draw: Some(draw),
    ..MapFormat::NONE
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    draw(map, &MapUnits::default())
}

fn draw(map: &CompressorMap, units: &MapUnits) -> Result<Vec<u8>, ExportError> {
    Ok(map_figure(map, units).to_svg().into_bytes())
}
