//! Contours as an item of a panel.

use crate::palette::{BLUE, GREY};
use crate::{Colour, StructuredGrid};

/// A contour level with its label.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourLevel {
    /// Value, in the unit of the field.
    pub value: f64,
    /// Label on the line; empty for none.
    pub label: String,
}

/// Labelled contour lines of a field, with optional shading between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Contours {
    /// The field.
    pub grid: StructuredGrid,
    /// Levels in rising order; at most 100 are drawn.
    pub levels: Vec<ContourLevel>,
    /// Colour of lines and texts.
    pub colour: Colour,
    /// Shading between the levels, from white below the first level to this colour above the last.
    pub shade: Option<Colour>,
    /// Entry in the legend.
    pub label: Option<String>,
}

impl Contours {
    /// Contours at `levels` (unit of the field, any order; values that are not finite are skipped), each labelled
    /// by `text`.
    pub fn new(grid: StructuredGrid, levels: &[f64], text: impl Fn(f64) -> String) -> Self {
        let mut values: Vec<f64> = levels.iter().copied().filter(|v| v.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let levels = values.into_iter().map(|value| ContourLevel { value, label: text(value) }).collect();
        Contours { grid, levels, colour: GREY, shade: None, label: None }
    }

    /// Shades the areas between the levels in light blue.
    pub fn shaded(mut self) -> Self {
        self.shade = Some(BLUE);
        self
    }

    /// Sets the colour of lines and texts.
    pub fn colour(mut self, colour: Colour) -> Self {
        self.colour = colour;
        self
    }

    /// Sets the legend's text.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }
}
