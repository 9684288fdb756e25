//! The levels of efficiency contours.

use crate::figure_layout::ticks::nice_ticks;

/// Round levels (fractions), finer near the best efficiency, where the map is flat.
pub fn contour_levels(range: Option<(f64, f64)>) -> Vec<f64> {
    let Some((low, high)) = range else { return Vec::new() };
    let (low, high) = (low.max(0.0), high.min(1.5));
    if low >= high {
        return Vec::new();
    }
    if high - low < 0.08 {
        return nice_ticks(low, high, 6);
    }
    let coarse_end = high - 0.06;
    // Whole percents as integers, to avoid accumulated rounding errors.
    let every = |step: i32| (1..=150 / step).map(move |i| f64::from(i * step) / 100.0);
    let mut levels: Vec<f64> = every(5).filter(|v| *v > low && *v < coarse_end).collect();
    levels.extend(every(2).filter(|v| *v >= coarse_end && *v < high));
    levels
}
