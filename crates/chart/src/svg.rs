//! Drawings as SVG and as PNG.

use crate::map_drawing::{Drawing, Px, Shape, Stroke, TextAnchor, TextStyle};
use crate::palette::WHITE;
use crate::text::escape;
use crate::{Colour, Figure};
use std::fmt::Write;
use tiny_skia::{Color, FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

pub(crate) fn write_document(drawing: &Drawing) -> String {
    let (w, h) = (px(drawing.width_px.ceil()), px(drawing.height_px.ceil()));
    let mut body = String::new();
    for shape in &drawing.shapes {
        write_element(&mut body, shape);
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
         font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\" role=\"img\">\n<title>{}</title>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{body}</svg>\n",
        escape(&drawing.title),
    )
}

fn write_element(body: &mut String, shape: &Shape) {
    // Writing to a string cannot fail.
    let _ = match shape {
        Shape::OpenGroup(name) => writeln!(body, "<g class=\"{}\">", escape(name)),
        Shape::CloseGroup => writeln!(body, "</g>"),
        Shape::OpenNote(note) => {
            let title = escape(&note.text);
            match &note.link {
                Some(link) => writeln!(body, "<a href=\"{}\"><title>{title}</title>", escape(link)),
                None => writeln!(body, "<g><title>{title}</title>"),
            }
        }
        Shape::CloseNote(note) => writeln!(body, "{}", if note.link.is_some() { "</a>" } else { "</g>" }),
        Shape::Line(from, to, stroke) => writeln!(
            body,
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" {}/>",
            px(from.0),
            px(from.1),
            px(to.0),
            px(to.1),
            format_stroke(stroke)
        ),
        Shape::Polyline(points, stroke) => writeln!(
            body,
            "<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" {}/>",
            format_points(points),
            format_stroke(stroke)
        ),
        Shape::Areas(polygons, fill, opacity) => {
            let data: String = polygons.iter().map(|points| format!("M{}Z", format_points(points))).collect();
            let (fill, opacity) = (fill.hex(), px(*opacity));
            writeln!(body, "<path d=\"{data}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>")
        }
        Shape::Polygon(points, fill, stroke) => writeln!(
            body,
            "<polygon points=\"{}\" fill=\"{}\" {}/>",
            format_points(points),
            fill.hex(),
            format_stroke(stroke)
        ),
        Shape::Circle(centre, radius, fill, stroke) => writeln!(
            body,
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\" {}/>",
            px(centre.0),
            px(centre.1),
            px(*radius),
            fill.hex(),
            format_stroke(stroke)
        ),
        Shape::Text(at, written, style) => write_text(body, *at, written, style),
    };
}

fn write_text(body: &mut String, at: Px, text: &str, style: &TextStyle) -> std::fmt::Result {
    let anchor = match style.anchor {
        TextAnchor::Start => "start",
        TextAnchor::Middle => "middle",
        TextAnchor::End => "end",
    };
    let turn = if style.turn_deg == 0.0 {
        String::new()
    } else {
        format!(" transform=\"rotate({} {} {})\"", px(-style.turn_deg), px(at.0), px(at.1))
    };
    let weight = if style.bold { " font-weight=\"bold\"" } else { "" };
    let common = format!(
        "x=\"{}\" y=\"{}\" dy=\"0.35em\" font-size=\"{}\" text-anchor=\"{anchor}\"{weight}{turn}",
        px(at.0),
        px(at.1),
        px(style.size_px)
    );
    let text = escape(text);
    if style.halo {
        // Draw the text twice: not every viewer supports `paint-order`.
        let white = WHITE.hex();
        writeln!(
            body,
            "<text {common} fill=\"{white}\" stroke=\"{white}\" stroke-width=\"3\" stroke-linejoin=\"round\" aria-hidden=\"true\">{text}</text>"
        )?;
    }
    writeln!(body, "<text {common} fill=\"{}\">{text}</text>", style.colour.hex())
}

fn format_stroke(stroke: &Stroke) -> String {
    let mut out =
        format!("stroke=\"{}\" stroke-width=\"{}\"", stroke.colour.hex(), px(stroke.drawn_width_px()));
    let lengths: Vec<String> = stroke.dashes_px().into_iter().map(px).collect();
    if !lengths.is_empty() {
        let _ = write!(out, " stroke-dasharray=\"{}\"", lengths.join(" "));
    }
    out
}

/// A coordinate with at most two decimals; 0 if it is not finite.
pub(crate) fn px(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" || text.is_empty() { "0".to_owned() } else { text.to_owned() }
}

fn format_points(points: &[(f64, f64)]) -> String {
    let mut out = String::with_capacity(points.len() * 14);
    for (x, y) in points {
        if !out.is_empty() {
            out.push(' ');
        }
        let _ = write!(out, "{},{}", px(*x), px(*y));
    }
    out
}

impl crate::Figure {
    /// The picture as an SVG document. The same figure gives the same bytes.
    pub fn to_svg(&self) -> String {
        write_document(&crate::draw::draw_figure(self))
    }
}

// A drawing as PNG; the letters are outlines of a built-in font (DejaVu Sans, free licence), so that a figure gives the same pixels on every
// computer.
// Letters are placed from left to right with the kerning of the font, which is sufficient for titles, units and numbers. Joined or
// right-to-left scripts are correct only in the SVG, because the viewer sets its text.

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
    pub fn to_png(&self, scale: f32) -> Result<Vec<u8>, PngError> {
        let pixels = render(&crate::draw::draw_figure(self), scale)?;
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

pub(crate) struct Fonts {
    regular: Face<'static>,
    bold: Face<'static>,
}

impl Fonts {
    pub(crate) fn new() -> Result<Self, ttf_parser::FaceParsingError> {
        let regular = Face::parse(dejavu::sans::regular(), 0)?;
        Ok(Fonts { regular, bold: Face::parse(dejavu::sans::bold(), 0)? })
    }

    /// The outline of a text whose vertical middle is at `at`; `None` if nothing is visible, e.g. for blanks.
    pub(crate) fn outline(&self, at: Px, text: &str, style: &TextStyle) -> Option<Path> {
        let face = if style.bold { &self.bold } else { &self.regular };
        let em = style.size_px as f32 / f32::from(face.units_per_em());
        let mut pen = Pen { builder: PathBuilder::new(), x: 0.0 };
        let mut previous: Option<GlyphId> = None;
        for c in text.chars() {
            let shown = if c.is_whitespace() { ' ' } else { c };
            // Glyph 0 is the font's replacement for missing characters.
            let glyph = face.glyph_index(shown).unwrap_or_default();
            pen.x += previous.map_or(0.0, |previous| kerning(face, previous, glyph));
            face.outline_glyph(glyph, &mut pen);
            pen.x += f32::from(face.glyph_hor_advance(glyph).unwrap_or_default());
            previous = Some(glyph);
        }
        let start = match style.anchor {
            TextAnchor::Start => 0.0,
            TextAnchor::Middle => -0.5 * pen.x,
            TextAnchor::End => -pen.x,
        };
        let (x, y) = (at.0 as f32, at.1 as f32);
        // Font units point up, pixels down; the baseline is 0.35 em below the middle, as in the SVG.
        let place = Transform::from_translate(start, 0.0)
            .post_scale(em, -em)
            .post_translate(x, y + 0.35 * style.size_px as f32)
            .post_concat(Transform::from_rotate_at(-style.turn_deg as f32, x, y));
        pen.builder.finish()?.transform(place)
    }
}

fn kerning(face: &Face<'_>, left: GlyphId, right: GlyphId) -> f32 {
    let tables = face.tables().kern.into_iter().flat_map(|kern| kern.subtables);
    let mut horizontal = tables.filter(|table| table.horizontal && !table.variable);
    horizontal.find_map(|table| table.glyphs_kerning(left, right)).map_or(0.0, f32::from)
}

struct Pen {
    builder: PathBuilder,
    /// Left end of the next glyph.
    x: f32,
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.builder.move_to(self.x + x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.builder.line_to(self.x + x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.builder.quad_to(self.x + x1, y1, self.x + x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.builder.cubic_to(self.x + x1, y1, self.x + x2, y2, self.x + x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::px;

    #[test]
    fn coordinates_are_short_and_never_odd() {
        assert_eq!(
            [1.0, 0.125, -0.001, 100.0, 12.5, f64::NAN].map(px),
            ["1", "0.12", "0", "100", "12.5", "0"]
        );
    }
}
