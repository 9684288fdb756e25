//! Entries of a legend, and their positions.

use crate::drawing::{Drawing, Stroke, TextAnchor, TextStyle};
use crate::items::{Item, Scatter};
use crate::markers::draw_marker;
use crate::palette::{GREY, INK};
use crate::text::{cut, width_px};
use crate::{Colour, Panel};

pub(crate) const FONT_PX: f64 = 12.0;
pub(crate) const ROW_PX: f64 = 20.0;
const SWATCH_PX: f64 = 28.0;
const GAP_PX: f64 = 18.0;
const LONGEST_TEXT_PX: f64 = 420.0;

/// A symbol in the legend.
#[derive(Debug, Clone, Copy)]
enum Swatch<'a> {
    Line(Stroke),
    Marker(&'a Scatter),
    Area(Colour, f64),
}

/// A text with the symbol that it explains.
#[derive(Debug, Clone)]
pub(crate) struct Entry<'a> {
    text: String,
    swatches: Vec<Swatch<'a>>,
}

impl Entry<'_> {
    pub(crate) fn width_px(&self) -> f64 {
        SWATCH_PX + 6.0 + width_px(&self.text, FONT_PX) + GAP_PX
    }

    fn has_area(&self) -> bool {
        self.swatches.iter().any(|swatch| matches!(swatch, Swatch::Area(..)))
    }
}

/// One entry per text, in order of first appearance.
pub(crate) fn entries(panel: &Panel) -> Vec<Entry<'_>> {
    let mut entries: Vec<Entry<'_>> = Vec::new();
    for item in &panel.items {
        let (label, swatch) = match item {
            Item::Line(line) => (
                &line.label,
                Swatch::Line(Stroke { colour: line.colour, width_px: line.width_px, dash: line.dash }),
            ),
            Item::Scatter(scatter) => (&scatter.label, Swatch::Marker(scatter)),
            Item::Rule(rule) => {
                (&rule.label, Swatch::Line(Stroke { colour: GREY, width_px: 1.2, dash: rule.dash }))
            }
            Item::Polygon(polygon) => (&polygon.label, Swatch::Area(polygon.colour, polygon.opacity)),
            Item::Contours(_) | Item::Annotation(_) | Item::PointLabels(_) => continue,
        };
        let Some(label) = label else { continue };
        let text = cut(label, FONT_PX, LONGEST_TEXT_PX);
        match entries.iter_mut().find(|entry| entry.text == text) {
            // Areas are translucent: overlapping ones in a swatch would be darker than in the picture.
            Some(entry) if matches!(swatch, Swatch::Area(..)) && entry.has_area() => {}
            Some(entry) => entry.swatches.push(swatch),
            None => entries.push(Entry { text, swatches: vec![swatch] }),
        }
    }
    entries
}

/// Upper left corners of entries in rows of `width` px, and the number of rows.
pub(crate) fn flow(entries: &[Entry<'_>], width: f64) -> (Vec<(f64, f64)>, usize) {
    // Equal columns are easier to read than ragged rows.
    let cell = entries.iter().map(Entry::width_px).fold(1.0, f64::max);
    let columns = ((width / cell) as usize).max(1);
    let places =
        (0..entries.len()).map(|i| ((i % columns) as f64 * cell, (i / columns) as f64 * ROW_PX)).collect();
    (places, entries.len().div_ceil(columns))
}

pub(crate) fn draw(drawing: &mut Drawing, entries: &[Entry<'_>], places: &[(f64, f64)], origin: (f64, f64)) {
    for (entry, place) in entries.iter().zip(places) {
        let (x, y) = (origin.0 + place.0, origin.1 + place.1 + 0.5 * ROW_PX);
        for swatch in &entry.swatches {
            match swatch {
                Swatch::Line(stroke) => drawing.line((x, y), (x + SWATCH_PX, y), stroke),
                Swatch::Marker(scatter) => draw_marker(drawing, (x + 0.5 * SWATCH_PX, y), scatter),
                Swatch::Area(colour, opacity) => {
                    let (x2, top, bottom) = (x + SWATCH_PX, y - 6.0, y + 6.0);
                    drawing.areas(&[vec![(x, top), (x2, top), (x2, bottom), (x, bottom)]], *colour, *opacity);
                }
            }
        }
        drawing.text((x + SWATCH_PX + 6.0, y), &entry.text, &TextStyle::new(FONT_PX, INK, TextAnchor::Start));
    }
}
