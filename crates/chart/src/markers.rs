//! Marker shapes and arrow heads.

use crate::Colour;
use crate::drawing::{Drawing, Stroke};
use crate::items::{Marker, Scatter};
use crate::palette::WHITE;

/// A marker in the style of `style`, at this place.
pub(crate) fn draw_marker(drawing: &mut Drawing, (x, y): (f64, f64), style: &Scatter) {
    let size = if style.size_px.is_finite() { style.size_px.clamp(1.0, 60.0) } else { 7.0 };
    let r = size / 2.0;
    let (fill, stroke) = if style.hollow {
        (WHITE, Stroke::solid(style.colour, 1.4))
    } else {
        // A white rim keeps neighbours apart.
        (style.colour, Stroke::solid(WHITE, 0.7))
    };
    let at = |points: &[(f64, f64)]| points.iter().map(|p| (x + r * p.0, y + r * p.1)).collect::<Vec<_>>();
    match style.marker {
        Marker::Circle => drawing.circle((x, y), r, fill, &stroke),
        Marker::Square => {
            drawing.polygon(&at(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]), fill, &stroke)
        }
        Marker::Triangle => drawing.polygon(&at(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)]), fill, &stroke),
        Marker::Diamond => {
            drawing.polygon(&at(&[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)]), fill, &stroke)
        }
        Marker::Plus | Marker::Cross => {
            let stroke = Stroke::solid(style.colour, 1.6);
            let arms = match style.marker {
                Marker::Plus => [[(-1.1, 0.0), (1.1, 0.0)], [(0.0, -1.1), (0.0, 1.1)]],
                _ => [[(-0.9, -0.9), (0.9, 0.9)], [(-0.9, 0.9), (0.9, -0.9)]],
            };
            for arm in arms {
                drawing.polyline(&at(&arm), &stroke);
            }
        }
    }
}

/// An arrow head at the middle of a segment, unless the segment is too short.
pub(crate) fn draw_arrow(drawing: &mut Drawing, from: (f64, f64), to: (f64, f64), colour: Colour) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = dx.hypot(dy);
    if length < 14.0 {
        return;
    }
    let (ux, uy) = (dx / length, dy / length);
    let middle = (from.0 + 0.5 * dx, from.1 + 0.5 * dy);
    let corner =
        |along: f64, aside: f64| (middle.0 + along * ux - aside * uy, middle.1 + along * uy + aside * ux);
    drawing.polygon(
        &[corner(5.0, 0.0), corner(-4.0, 3.8), corner(-4.0, -3.8)],
        colour,
        &Stroke::solid(colour, 0.5),
    );
}
