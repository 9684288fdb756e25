//! Positions of all parts of a figure, entries of its legend, and the shapes of markers.

use crate::clip::Rect;
use crate::drawing::{Drawing, Stroke, TextAnchor, TextStyle};
use crate::frame::{Frame, fit_scales};
use crate::items::{Marker, Scatter};
use crate::palette::{GREY, INK, WHITE};
use crate::text::{cut, width_px, wrap};
use crate::{Colour, Figure, Item, Panel};

pub(crate) const TITLE_PX: f64 = 18.0;
pub(crate) const SUBTITLE_PX: f64 = 13.0;
pub(crate) const PANEL_TITLE_PX: f64 = 14.0;
pub(crate) const AXIS_TITLE_PX: f64 = 14.0;
pub(crate) const TICK_PX: f64 = 12.0;
pub(crate) const MARGIN_PX: f64 = 16.0;
/// Ticks, their labels and the axis title below a drawing area.
const BELOW_PX: f64 = 54.0;
/// Room to the right of a drawing area.
const RIGHT_PX: f64 = 10.0;
/// Gap between panels side by side.
/// Gap between panels, and between entries of a legend, px.
const GAP_PX: f64 = 18.0;

/// A panel with the positions of its parts.
pub(crate) struct PlacedPanel<'a> {
    pub panel: &'a Panel,
    pub frame: Frame,
    pub entries: Vec<Entry<'a>>,
    pub legend_places: Vec<(f64, f64)>,
    pub legend_origin: (f64, f64),
}

/// The whole figure with the positions of its parts.
pub(crate) struct Sheet<'a> {
    pub width: f64,
    pub height: f64,
    pub title: Vec<String>,
    pub subtitle: Vec<String>,
    pub panels: Vec<PlacedPanel<'a>>,
}

pub(crate) fn layout(figure: &Figure) -> Sheet<'_> {
    let size = |v: f64, default: f64| if v.is_finite() { v.clamp(100.0, 4000.0) } else { default };
    let (width, height) = (size(figure.panel_width_px, 520.0), size(figure.panel_height_px, 400.0));
    let columns = figure.columns.clamp(1, figure.panels.len().max(1));

    let measured: Vec<_> = figure
        .panels
        .iter()
        .map(|panel| {
            let (x, y) = fit_scales(panel, width, height);
            let tick_width = y.ticks.iter().map(|t| width_px(&t.1, TICK_PX)).fold(0.0, f64::max);
            let left = 10.0 + tick_width + if panel.y.title.is_empty() { 0.0 } else { 10.0 + AXIS_TITLE_PX };
            (panel, x, y, left)
        })
        .collect();

    // Equal widths in a column keep the frames aligned.
    let max_in_column = |column: usize| {
        measured[column.min(measured.len())..].iter().step_by(columns).map(|m| m.3).fold(0.0, f64::max)
    };
    let lefts: Vec<f64> = (0..columns).map(max_in_column).collect();
    let sheet_width = 2.0 * MARGIN_PX
        + lefts.iter().map(|left| left + width + RIGHT_PX).sum::<f64>()
        + GAP_PX * (columns - 1) as f64;

    let text_width = sheet_width - 2.0 * MARGIN_PX;
    let title = wrap(&figure.title, TITLE_PX, text_width);
    let subtitle: Vec<String> =
        figure.subtitles.iter().flat_map(|line| wrap(line, SUBTITLE_PX, text_width)).collect();
    let mut top = MARGIN_PX + 24.0 * title.len() as f64 + 18.0 * subtitle.len() as f64 + 8.0;

    let mut panels = Vec::with_capacity(measured.len());
    let mut rows = measured.into_iter().peekable();
    while rows.peek().is_some() {
        let row: Vec<_> = rows.by_ref().take(columns).collect();
        let title_room = if row.iter().any(|r| !r.0.title.is_empty()) { 24.0 } else { 6.0 };
        let frame_top = top + title_room;
        let mut cell_height: f64 = height + BELOW_PX;
        let mut left = MARGIN_PX;
        for (column, (panel, x, y, _)) in row.into_iter().enumerate() {
            let frame_left = left + lefts[column];
            let rect = Rect {
                left: frame_left,
                top: frame_top,
                right: frame_left + width,
                bottom: frame_top + height,
            };
            let entries = entries(panel);
            let (legend_places, count) = flow(&entries, width + lefts[column] - 10.0);
            cell_height = cell_height.max(height + BELOW_PX + count as f64 * ROW_PX + 4.0);
            let legend_origin = (left + 10.0, rect.bottom + BELOW_PX);
            let frame = Frame { rect, x, y };
            panels.push(PlacedPanel { panel, frame, entries, legend_places, legend_origin });
            left = rect.right + RIGHT_PX + GAP_PX;
        }
        top = frame_top + cell_height + 8.0;
    }
    Sheet { width: sheet_width.max(200.0), height: top + 4.0, title, subtitle, panels }
}

const FONT_PX: f64 = 12.0;
const ROW_PX: f64 = 20.0;
const SWATCH_PX: f64 = 28.0;
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

pub(crate) fn draw_legend(
    drawing: &mut Drawing,
    entries: &[Entry<'_>],
    places: &[(f64, f64)],
    origin: (f64, f64),
) {
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
