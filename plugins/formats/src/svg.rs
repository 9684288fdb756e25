//! The map as a picture.

use crate::map_picture::map_figure;
use mapper_core::{CompressorMap, ExportError, MapFormat};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "svg",
    extension: "svg",
    further_extensions: &[],
    description: "picture: speed lines with efficiency contours, and efficiency with its 95 % interval",
    write: Some(write),
    read: None,
};

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    Ok(map_figure(map).to_svg().into_bytes())
}
