//! Contours as an item of a panel.

use crate::StructuredGrid;

/// Labelled contour lines of a field, shaded between them: from white below the first level to light blue above the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Contours {
    /// The field.
    pub grid: StructuredGrid,
    /// Levels in rising order, unit of the field, with the labels of their lines; at most 100 are drawn.
    pub levels: Vec<(f64, String)>,
}

impl Contours {
    /// Contours at `levels` (unit of the field, any order; values that are not finite are skipped), each labelled
    /// by `text`.
    pub fn new(grid: StructuredGrid, levels: &[f64], text: impl Fn(f64) -> String) -> Self {
        let mut values: Vec<f64> = levels.iter().copied().filter(|v| v.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        Contours { grid, levels: values.into_iter().map(|value| (value, text(value))).collect() }
    }
}
