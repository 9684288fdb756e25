//! Shapes of a picture before they are written as SVG or drawn as pixels.

use crate::Colour;
use crate::items::{Dash, Note};

/// Style of a line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stroke {
    pub colour: Colour,
    pub width_px: f64,
    pub dash: Dash,
}

impl Stroke {
    pub(crate) fn solid(colour: Colour, width_px: f64) -> Self {
        Stroke { colour, width_px, dash: Dash::Solid }
    }

    /// Width that is drawn, px.
    pub(crate) fn drawn_width_px(&self) -> f64 {
        if self.width_px.is_finite() { self.width_px.clamp(0.1, 20.0) } else { 1.0 }
    }

    /// Lengths of dashes and gaps, px; empty for a solid line.
    pub(crate) fn dashes_px(&self) -> Vec<f64> {
        let pattern: &[f64] = match self.dash {
            Dash::Solid => &[],
            Dash::Dashed => &[4.0, 2.5],
            Dash::Dotted => &[1.0, 2.0],
            Dash::DashDot => &[5.0, 2.0, 1.0, 2.0],
        };
        pattern.iter().map(|part| part * self.drawn_width_px().max(1.2)).collect()
    }
}

/// Part of a text that is at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextAnchor {
    Start,
    Middle,
    End,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct TextStyle {
    pub size_px: f64,
    pub colour: Colour,
    pub anchor: TextAnchor,
    pub bold: bool,
    /// White rim, so that the text stays legible on lines.
    pub halo: bool,
    /// Counter-clockwise rotation, degrees.
    pub turn_deg: f64,
}

impl TextStyle {
    pub(crate) fn new(size_px: f64, colour: Colour, anchor: TextAnchor) -> Self {
        TextStyle { size_px, colour, anchor, bold: false, halo: false, turn_deg: 0.0 }
    }

    pub(crate) fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    pub(crate) fn halo(mut self) -> Self {
        self.halo = true;
        self
    }

    pub(crate) fn turned(mut self, turn_deg: f64) -> Self {
        self.turn_deg = turn_deg;
        self
    }
}

/// A point of the picture, px from its upper left corner.
pub(crate) type Px = (f64, f64);

/// An element of a picture.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    OpenGroup(String),
    /// Starts the note for the shapes up to the next [`Shape::CloseNote`].
    OpenNote(Note),
    CloseNote(Note),
    CloseGroup,
    Line(Px, Px, Stroke),
    /// At least two points.
    Polyline(Vec<Px>, Stroke),
    /// Polygons of at least three points as one shape, so that there is no gap between neighbours; opacity 0 to 1.
    Areas(Vec<Vec<Px>>, Colour, f64),
    Polygon(Vec<Px>, Colour, Stroke),
    /// Centre and radius.
    Circle(Px, f64, Colour, Stroke),
    /// A text, not empty, with its vertical middle at the point.
    Text(Px, String, TextStyle),
}

/// A picture: its shapes in drawing order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Drawing {
    pub width_px: f64,
    pub height_px: f64,
    pub title: String,
    pub shapes: Vec<Shape>,
}

impl Drawing {
    pub(crate) fn open_group(&mut self, name: &str) {
        self.shapes.push(Shape::OpenGroup(name.to_owned()));
    }

    /// Draws shapes with a note for the mouse, and a link if there is one.
    pub(crate) fn noted(&mut self, note: &Note, draw: impl FnOnce(&mut Drawing)) {
        self.shapes.push(Shape::OpenNote(note.clone()));
        draw(self);
        self.shapes.push(Shape::CloseNote(note.clone()));
    }

    pub(crate) fn close_group(&mut self) {
        self.shapes.push(Shape::CloseGroup);
    }

    pub(crate) fn line(&mut self, from: Px, to: Px, stroke: &Stroke) {
        self.shapes.push(Shape::Line(from, to, *stroke));
    }

    pub(crate) fn polyline(&mut self, points: &[Px], stroke: &Stroke) {
        if points.len() > 1 {
            self.shapes.push(Shape::Polyline(points.to_vec(), *stroke));
        }
    }

    pub(crate) fn areas(&mut self, polygons: &[Vec<Px>], fill: Colour, opacity: f64) {
        let polygons: Vec<_> = polygons.iter().filter(|polygon| polygon.len() > 2).cloned().collect();
        if !polygons.is_empty() {
            let opacity = if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 };
            self.shapes.push(Shape::Areas(polygons, fill, opacity));
        }
    }

    pub(crate) fn polygon(&mut self, points: &[Px], fill: Colour, stroke: &Stroke) {
        self.shapes.push(Shape::Polygon(points.to_vec(), fill, *stroke));
    }

    pub(crate) fn circle(&mut self, centre: Px, radius: f64, fill: Colour, stroke: &Stroke) {
        self.shapes.push(Shape::Circle(centre, radius, fill, *stroke));
    }

    pub(crate) fn text(&mut self, at: Px, text: &str, style: &TextStyle) {
        if !text.is_empty() {
            self.shapes.push(Shape::Text(at, text.to_owned(), *style));
        }
    }
}
