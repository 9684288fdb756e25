//! Outlines of letters from a built-in font (DejaVu Sans, free licence), so that a figure gives the same pixels on every computer.
//!
//! Letters are placed from left to right with the kerning of the font, which is sufficient for titles, units and numbers. Joined or
//! right-to-left scripts are correct only in the SVG, because the viewer sets its text.

use crate::drawing::TextAnchor;
use crate::drawing::{Px, TextStyle};
use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// The regular and the bold font.
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

/// Kerning between two glyphs, font units.
fn kerning(face: &Face<'_>, left: GlyphId, right: GlyphId) -> f32 {
    let tables = face.tables().kern.into_iter().flat_map(|kern| kern.subtables);
    let mut horizontal = tables.filter(|table| table.horizontal && !table.variable);
    horizontal.find_map(|table| table.glyphs_kerning(left, right)).map_or(0.0, f32::from)
}

/// Draws glyphs one after the other, font units.
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
