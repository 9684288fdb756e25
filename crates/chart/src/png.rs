//! A figure as pixels: the SVG drawn by resvg with a font that comes along (DejaVu Sans, free licence), so that the
//! same figure gives the same pixels on a machine without fonts.

use crate::Figure;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Most pixels of a picture.
const MOST_PIXELS: f32 = 64e6;

/// Why a figure cannot be drawn as pixels.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// The SVG was not understood.
    #[error("failed to read the picture's own SVG: {0}")]
    Svg(#[from] Box<resvg::usvg::Error>),
    /// Too large or of no size.
    #[error("a picture of {width} by {height} pixels cannot be made; at most 64 million pixels")]
    Size {
        /// Width, pixels.
        width: f32,
        /// Height, pixels.
        height: f32,
    },
    /// The encoder failed.
    #[error("failed to encode the picture: {source}")]
    Encode {
        /// What it said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl Figure {
    /// The picture as a PNG file, `scale` pixels for each unit of the SVG (above 0; 2 is sharp on paper).
    ///
    /// # Errors
    /// [`PngError`].
    pub fn to_png(&self, scale: f32) -> Result<Vec<u8>, PngError> {
        let mut options = Options::default();
        let fonts = options.fontdb_mut();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_font_data(dejavu::sans::bold().to_vec());
        fonts.set_sans_serif_family("DejaVu Sans");
        options.font_family = "DejaVu Sans".to_owned();
        let tree = Tree::from_str(&self.to_svg(), &options).map_err(Box::new)?;
        let (width, height) = (tree.size().width() * scale, tree.size().height() * scale);
        // Not a number counts as too large.
        if !(width >= 1.0 && height >= 1.0 && width * height <= MOST_PIXELS) {
            return Err(PngError::Size { width, height });
        }
        let pixels = Pixmap::new(width.ceil() as u32, height.ceil() as u32);
        let mut pixels = pixels.ok_or(PngError::Size { width, height })?;
        resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| PngError::Encode { source: Box::new(error) })
    }
}
