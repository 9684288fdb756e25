//! Renders a drawing as pixels.

use crate::drawing::{Drawing, Px, Shape, Stroke};
use crate::palette::WHITE;
use crate::rendering::glyphs::Fonts;
use crate::{Colour, Figure};
use tiny_skia::{Color, FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform};

/// Maximum number of pixels of a picture.
const MAX_PIXELS: f64 = 64e6;

/// Width of the white rim around a text, px, both sides together.
const HALO_PX: f32 = 3.0;

/// Reason why a figure cannot be drawn as pixels.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum PngError {
    #[error("failed to read the font that comes with the program: {0}")]
    Font(#[from] ttf_parser::FaceParsingError),
    #[error("a picture of {width} by {height} pixels cannot be made; at most 64 million pixels are allowed")]
    Size { width: f64, height: f64 },
    #[error("failed to encode the picture: {0}")]
    Encode(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl Figure {
    /// Renders a PNG file with `scale` pixels for each unit of the SVG (above 0; 2 is sharp on paper).
    ///
    /// # Errors
    /// [`PngError`].
    pub fn to_png(&self, scale: f32) -> Result<Vec<u8>, PngError> {
        let pixels = render(&crate::rendering::draw::draw_figure(self), scale)?;
        pixels.encode_png().map_err(|error| PngError::Encode(Box::new(error)))
    }
}

fn render(drawing: &Drawing, scale: f32) -> Result<Pixmap, PngError> {
    let size = |px: f64| px.ceil() * f64::from(scale);
    let (width, height) = (size(drawing.width_px), size(drawing.height_px));
    // NaN counts as too large.
    if !(width >= 1.0 && height >= 1.0 && width * height <= MAX_PIXELS) {
        return Err(PngError::Size { width, height });
    }
    let pixels = Pixmap::new(width.ceil() as u32, height.ceil() as u32);
    let mut pixels = pixels.ok_or(PngError::Size { width, height })?;
    pixels.fill(Color::WHITE);
    let mut canvas = Canvas { pixels, to_pixels: Transform::from_scale(scale, scale), fonts: Fonts::new()? };
    drawing.shapes.iter().for_each(|shape| canvas.shape(shape));
    Ok(canvas.pixels)
}

struct Canvas {
    pixels: Pixmap,
    to_pixels: Transform,
    fonts: Fonts,
}

impl Canvas {
    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::OpenGroup(_) | Shape::CloseGroup | Shape::OpenNote(_) | Shape::CloseNote(_) => {}
            Shape::Line(from, to, stroke) => self.outline(open(&[*from, *to]), stroke, LineJoin::Miter),
            Shape::Polyline(points, stroke) => self.outline(open(points), stroke, LineJoin::Round),
            Shape::Areas(polygons, colour, opacity) => self.fill(closed(polygons), *colour, *opacity),
            Shape::Polygon(points, colour, stroke) => {
                let path = closed(std::slice::from_ref(points));
                self.fill(path.clone(), *colour, 1.0);
                self.outline(path, stroke, LineJoin::Miter);
            }
            Shape::Circle(centre, radius, colour, stroke) => {
                let path = PathBuilder::from_circle(centre.0 as f32, centre.1 as f32, *radius as f32);
                self.fill(path.clone(), *colour, 1.0);
                self.outline(path, stroke, LineJoin::Miter);
            }
            Shape::Text(at, text, style) => {
                let path = self.fonts.outline(*at, text, style);
                if style.halo {
                    let rim = Stroke::solid(WHITE, f64::from(HALO_PX));
                    self.fill(path.clone(), WHITE, 1.0);
                    self.outline(path.clone(), &rim, LineJoin::Round);
                }
                self.fill(path, style.colour, 1.0);
            }
        }
    }

    /// Fills a path; `None` if it had too few points, or NaN coordinates.
    fn fill(&mut self, path: Option<Path>, colour: Colour, opacity: f64) {
        if let Some(path) = path {
            self.pixels.fill_path(&path, &paint(colour, opacity), FillRule::Winding, self.to_pixels, None);
        }
    }

    fn outline(&mut self, path: Option<Path>, stroke: &Stroke, line_join: LineJoin) {
        let dashes: Vec<f32> = stroke.dashes_px().into_iter().map(|length| length as f32).collect();
        let stroke_style = tiny_skia::Stroke {
            width: stroke.drawn_width_px() as f32,
            line_join,
            dash: StrokeDash::new(dashes, 0.0),
            ..tiny_skia::Stroke::default()
        };
        if let Some(path) = path {
            self.pixels.stroke_path(&path, &paint(stroke.colour, 1.0), &stroke_style, self.to_pixels, None);
        }
    }
}

fn paint(Colour(red, green, blue): Colour, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    paint
}

fn open(points: &[Px]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    trace(&mut builder, points);
    builder.finish()
}

fn closed(polygons: &[Vec<Px>]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for points in polygons {
        trace(&mut builder, points);
        builder.close();
    }
    builder.finish()
}

fn trace(builder: &mut PathBuilder, points: &[Px]) {
    for (index, (x, y)) in points.iter().enumerate() {
        let (x, y) = (finite(*x), finite(*y));
        if index == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
    }
}

/// NaN counts as 0, as in the SVG.
fn finite(value: f64) -> f32 {
    if value.is_finite() { value as f32 } else { 0.0 }
}
