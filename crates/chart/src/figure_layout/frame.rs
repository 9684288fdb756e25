//! Conversion from the units of the axes to px.

use crate::figure_layout::clip::Rect;
use crate::figure_layout::ticks::{labels, nice_ticks, valid_range};
use crate::items::{Item, RuleAt, Scatter};
use crate::{Axis, Panel};

/// An axis with its final range and ticks.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scale {
    pub low: f64,
    pub high: f64,
    pub ticks: Vec<(f64, String)>,
}

impl Scale {
    /// Position of a value on the axis, 0 at the low end, 1 at the high end; NaN for a value that is not finite.
    ///
    /// Values are limited to a million times the axis length, so that clipping at the frame keeps its precision.
    fn position(&self, value: f64) -> f64 {
        if value.is_finite() {
            ((value - self.low) / (self.high - self.low)).clamp(-1e6, 1e6)
        } else {
            f64::NAN
        }
    }
}

/// A panel's drawing area with its scales.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Frame {
    pub rect: Rect,
    pub x: Scale,
    pub y: Scale,
}

impl Frame {
    pub(crate) fn px(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            self.rect.left + self.x.position(x) * self.rect.width(),
            self.rect.bottom - self.y.position(y) * self.rect.height(),
        )
    }
}

/// Smallest and largest finite value so far.
#[derive(Debug, Clone, Copy)]
struct Extent {
    low: f64,
    high: f64,
}

impl Extent {
    const NONE: Extent = Extent { low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn add(&mut self, value: f64) {
        if value.is_finite() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
        }
    }

    fn is_none(&self) -> bool {
        self.low > self.high
    }
}

/// Determines the scales of a panel of `width_px` by `height_px`.
pub(crate) fn fit_scales(panel: &Panel, width_px: f64, height_px: f64) -> (Scale, Scale) {
    let (mut x, mut y) = (Extent::NONE, Extent::NONE);
    for item in &panel.items {
        let mut add = |(px, py): (f64, f64)| {
            if px.is_finite() && py.is_finite() {
                x.add(px);
                y.add(py);
            }
        };
        match item {
            Item::Line(line) => line.points.iter().copied().for_each(add),
            Item::Polygon(polygon) => polygon.points.iter().copied().for_each(add),
            Item::Scatter(scatter) => scatter.points.iter().map(|p| (p.x, p.y)).for_each(add),
            Item::Contours(contours) => contours.grid.known_nodes().for_each(|n| add((n[0], n[1]))),
            Item::Rule(rule) => match rule.at {
                RuleAt::Y(value) => y.add(value),
                RuleAt::X(value) => x.add(value),
            },
            Item::Annotation(_) | Item::PointLabels(_) => {}
        }
    }
    let scatters = || {
        panel.items.iter().filter_map(|item| match item {
            Item::Scatter(scatter) => Some(scatter),
            _ => None,
        })
    };
    let (points_x, points_y) = (x, y);
    for scatter in scatters() {
        widen(&mut x, points_x, scatter, |p| p.x_interval);
        widen(&mut y, points_y, scatter, |p| p.y_interval);
    }
    (fit_scale(&panel.x, x, (width_px / 75.0) as usize), fit_scale(&panel.y, y, (height_px / 48.0) as usize))
}

/// Extends the range for error bars, up to half the span of the points on each side, so that one very uncertain point does not compress all
/// others.
fn widen(
    extent: &mut Extent,
    points: Extent,
    scatter: &Scatter,
    interval: impl Fn(&crate::ScatterPoint) -> Option<(f64, f64)>,
) {
    let span = points.high - points.low;
    let room = if span > 0.0 { 0.5 * span } else { f64::INFINITY };
    for point in &scatter.points {
        if let (true, true, Some((low, high))) = (point.x.is_finite(), point.y.is_finite(), interval(point)) {
            if low.is_finite() {
                extent.add(low.max(points.low - room));
            }
            if high.is_finite() {
                extent.add(high.min(points.high + room));
            }
        }
    }
}

fn fit_scale(axis: &Axis, data: Extent, target: usize) -> Scale {
    let fixed = |end: Option<f64>| end.filter(|v| v.is_finite());
    let (low, high) = (fixed(axis.low), fixed(axis.high));
    let (low, high) = if data.is_none() {
        match (low, high) {
            (Some(low), Some(high)) => valid_range(low, high),
            (Some(low), None) => valid_range(low, low + 1.0),
            (None, Some(high)) => valid_range(high - 1.0, high),
            (None, None) => (0.0, 1.0),
        }
    } else {
        let (data_low, data_high) = valid_range(data.low, data.high);
        let padding = 0.05 * (data_high - data_low);
        valid_range(low.unwrap_or(data_low - padding), high.unwrap_or(data_high + padding))
    };
    let ticks = match &axis.ticks {
        Some(ticks) => ticks.iter().filter(|t| t.0 >= low && t.0 <= high).cloned().collect(),
        None => {
            let factor =
                axis.written_times.filter(|factor| factor.is_normal() && *factor > 0.0).unwrap_or(1.0);
            let values = nice_ticks(low * factor, high * factor, target.max(2));
            let texts = labels(&values);
            values.into_iter().map(|value| value / factor).zip(texts).collect()
        }
    };
    Scale { low, high, ticks }
}
