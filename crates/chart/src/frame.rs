//! Axes as drawn: round numbers for ticks and contour levels, and the frame with ticks and titles.

use crate::contours::Rect;
use crate::items::{Item, RuleAt, Scatter};
use crate::{Axis, Panel};

/// Maximum magnitude on an axis; beyond it the span of an axis could overflow.
const MAX_MAGNITUDE: f64 = 1e300;
/// Minimum span of an axis relative to its largest value: below it, tick labels could not distinguish ticks.
const MIN_RELATIVE_SPAN: f64 = 1e-9;

/// Turns any pair of numbers into a valid axis range: ordered, finite, with a span above rounding.
fn valid_range(low: f64, high: f64) -> (f64, f64) {
    if !low.is_finite() || !high.is_finite() {
        return (0.0, 1.0);
    }
    let (low, high) = (
        low.min(high).clamp(-MAX_MAGNITUDE, MAX_MAGNITUDE),
        low.max(high).clamp(-MAX_MAGNITUDE, MAX_MAGNITUDE),
    );
    let largest = low.abs().max(high.abs());
    if high - low > (MIN_RELATIVE_SPAN * largest).max(1e-250) {
        return (low, high);
    }
    let half = if largest < 1e-240 { 1.0 } else { 0.05 * largest };
    ((low - half).max(-2.0 * MAX_MAGNITUDE), (high + half).min(2.0 * MAX_MAGNITUDE))
}

/// Round numbers (1, 2, 2.5 or 5 times a power of ten apart) between `low` and `high`, about `target` of them.
///
/// At least two and at most 4 `target` + 4. An empty, infinite or NaN range is replaced by a valid one.
pub(crate) fn nice_ticks(low: f64, high: f64, target: usize) -> Vec<f64> {
    let (low, high) = valid_range(low, high);
    let target = target.clamp(1, 1000);
    // A round step may give one tick or none; a readable axis needs two.
    [1, 2, 4]
        .into_iter()
        .map(|finer| {
            ticks_with_step(low, high, nice_step((high - low) / (finer * target) as f64), 4 * target + 4)
        })
        .find(|ticks| ticks.len() > 1)
        .unwrap_or_default()
}

/// Multiples of `step` in the range, at most `max_ticks`.
fn ticks_with_step(low: f64, high: f64, step: f64, max_ticks: usize) -> Vec<f64> {
    // Multiply instead of adding repeatedly, which would accumulate rounding errors.
    let first = (low / step - 1e-9).ceil();
    let count = ((high / step + 1e-9).floor() - first + 1.0).clamp(0.0, max_ticks as f64) as usize;
    (0..count).map(|i| (first + i as f64) * step).map(|tick| if tick == 0.0 { 0.0 } else { tick }).collect()
}

/// Rounds `raw` up to 1, 2, 2.5, 5 or 10 times a power of ten.
fn nice_step(raw: f64) -> f64 {
    let power = 10f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 2.5, 5.0].into_iter().find(|f| raw <= f * power * (1.0 + 1e-9)).unwrap_or(10.0);
    factor * power
}

/// Labels that distinguish all `values`: fixed point if that is short, otherwise scientific.
pub(crate) fn labels(values: &[f64]) -> Vec<String> {
    let largest = values.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    let step = values.windows(2).map(|w| (w[1] - w[0]).abs()).fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() && step > 0.0 { step } else { largest.max(1.0) };
    let step_exponent = step.log10().floor() as i32;
    // 2.5 needs one digit more than 2.
    let mantissa = step / 10f64.powi(step_exponent);
    let extra = i32::from((mantissa - mantissa.round()).abs() > 1e-6);
    let text = |value: f64| {
        if largest < 1e6 && step_exponent > -7 {
            format!("{value:.*}", (extra - step_exponent).max(0) as usize)
        } else {
            let digits = (largest.max(step).log10().floor() as i32 - step_exponent + extra).clamp(0, 12);
            format!("{value:.*e}", digits as usize)
        }
    };
    values.iter().map(|v| text(*v).replace('-', "\u{2212}")).collect()
}

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

/// Extends the range for error bars, at most by half the span on each side, so that one uncertain point does not compress the others.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn known_axes() {
        assert_eq!(labels(&nice_ticks(0.0, 0.11, 6)), ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10"]);
        assert_eq!(nice_ticks(1.0, 3.1, 5), [1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(labels(&nice_ticks(0.0, 1.0, 4)), ["0.00", "0.25", "0.50", "0.75", "1.00"]);
        assert_eq!(labels(&nice_ticks(-20.0, 20.0, 2)), ["\u{2212}20", "0", "20"]);
        assert_eq!(labels(&nice_ticks(0.0, 2e7, 2)), ["0e0", "1e7", "2e7"]);
    }

    proptest! {
        #[test]
        fn ticks_are_few_rising_inside_and_distinct(low in proptest::num::f64::ANY, high in proptest::num::f64::ANY, target in 0usize..30) {
            let ticks = nice_ticks(low, high, target);
            let (low, high) = valid_range(low, high);
            prop_assert!(low < high);
            prop_assert!(ticks.len() > 1 && ticks.len() <= 4 * target.max(1) + 4, "{} ticks", ticks.len());
            prop_assert!(ticks.windows(2).all(|w| w[0] < w[1]));
            let slack = (high - low) * 1e-6;
            prop_assert!(ticks.iter().all(|t| *t >= low - slack && *t <= high + slack));
            let labels = labels(&ticks);
            let mut unique = labels.clone();
            unique.dedup();
            prop_assert_eq!(labels.len(), unique.len());
        }

        #[test]
        fn ordinary_ranges_get_about_the_ticks_asked_for(low in -1e4..1e4f64, span in 1e-3..1e5f64, target in 5usize..12) {
            let count = nice_ticks(low, low + span, target).len();
            // The step is at least the one asked for, and at most 2.5 times it (2 to 5).
            prop_assert!(count <= target + 1 && (count + 1) as f64 > target as f64 / 2.5, "{count} ticks for {target}");
        }
    }
}
