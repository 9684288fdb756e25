//! Layout of a figure, and the places of its labels.

use crate::contours::{Rect, touches};
use crate::frame::{Frame, fit_scales};
use crate::items::{Marker, Scatter};
use crate::map_drawing::{Drawing, Stroke, TextAnchor, TextStyle};
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

pub(crate) struct PlacedPanel<'a> {
    pub panel: &'a Panel,
    pub frame: Frame,
    pub entries: Vec<Entry<'a>>,
    pub legend_places: Vec<(f64, f64)>,
    pub legend_origin: (f64, f64),
}

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

#[derive(Debug, Clone, Copy)]
enum Swatch<'a> {
    Line(Stroke),
    Marker(&'a Scatter),
    Area(Colour, f64),
}

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

type Px = (f64, f64);

/// Candidate gaps between point and text, px.
const GAPS_PX: [f64; 9] = [3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 36.0, 48.0, 64.0];
/// Directions that are tried at each gap.
const DIRECTIONS: usize = 24;
/// Minimum gap at which a leader line connects a text with its point.
const LEADER_FROM_PX: f64 = 8.0;
/// Cost of a line through the text, as px of gap: a line behind a short text hides little of it.
const CROSSED_PX: f64 = 1.5;
/// Cost of a leader line through a marker, a text or another leader line, as px of gap.
const LEADER_CROSSED_PX: f64 = 40.0;
/// Room around a text, px.
const ROOM_PX: f64 = 2.0;
/// Factor on estimated widths for bold digits, which are wider than letters.
const BOLD_RATIO: f64 = 1.12;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlacedLabel {
    /// Middle, px.
    pub centre: Px,
    /// From the point to the text.
    pub leader: Option<(Px, Px)>,
}

pub(crate) struct Surroundings {
    inside: Rect,
    boxes: Vec<Rect>,
    lines: Vec<(Px, Px)>,
    leaders: Vec<(Px, Px)>,
}

impl Surroundings {
    pub(crate) fn of(frame: &Frame, items: &[Item], mut boxes: Vec<Rect>) -> Self {
        let mut lines = Vec::new();
        for item in items {
            match item {
                Item::Scatter(scatter) => boxes.extend(scatter.points.iter().map(|point| {
                    let ((x, y), half) = (frame.px((point.x, point.y)), 0.5 * scatter.size_px);
                    Rect { left: x - half, top: y - half, right: x + half, bottom: y + half }
                })),
                Item::Line(line) => {
                    lines.extend(line.points.windows(2).map(|pair| (frame.px(pair[0]), frame.px(pair[1]))))
                }
                _ => {}
            }
        }
        Surroundings { inside: frame.rect, boxes, lines, leaders: Vec::new() }
    }

    /// Finds the cheapest place around a point, and occupies it; `None` if no place is free.
    pub(crate) fn place(&mut self, point: Px, text: &str, size_px: f64) -> Option<PlacedLabel> {
        let half = (0.5 * BOLD_RATIO * width_px(text, size_px) + ROOM_PX, 0.5 * size_px + ROOM_PX);
        let mut best: Option<(f64, PlacedLabel, Rect)> = None;
        for gap_px in GAPS_PX {
            if best.is_some_and(|(cost, ..)| cost <= gap_px) {
                break;
            }
            for direction in 0..DIRECTIONS {
                let turn = (direction as f64 / DIRECTIONS as f64 - 0.125) * std::f64::consts::TAU;
                let (ux, uy) = (turn.cos(), turn.sin());
                // The middle of a box at this gap from the point.
                let reach = (half.0 / ux.abs().max(1e-9)).min(half.1 / uy.abs().max(1e-9)) + gap_px;
                let (x, y) = (point.0 + reach * ux, point.1 + reach * uy);
                let around =
                    Rect { left: x - half.0, top: y - half.1, right: x + half.0, bottom: y + half.1 };
                let inside = self.inside.contains((around.left, around.top))
                    && self.inside.contains((around.right, around.bottom));
                if !inside || self.boxes.iter().any(|taken| taken.overlaps(&around)) {
                    continue;
                }
                let edge = (point.0 + (gap_px + ROOM_PX) * ux, point.1 + (gap_px + ROOM_PX) * uy);
                let leader = (gap_px >= LEADER_FROM_PX).then_some((point, edge));
                let cost = gap_px + self.crossed_px(&around, point, leader);
                if best.is_none_or(|(before, ..)| cost < before) {
                    best = Some((cost, PlacedLabel { centre: (x, y), leader }, around));
                }
            }
        }
        let (_, label, around) = best?;
        self.boxes.push(around);
        self.leaders.extend(label.leader);
        Some(label)
    }

    /// Cost of lines that cross a text, and of obstacles that its leader line crosses.
    fn crossed_px(&self, around: &Rect, point: Px, leader: Option<(Px, Px)>) -> f64 {
        let through =
            |lines: &[(Px, Px)]| lines.iter().filter(|line| touches(line.0, line.1, around)).count();
        let mut cost_px =
            CROSSED_PX * through(&self.lines) as f64 + LEADER_CROSSED_PX * through(&self.leaders) as f64;
        if let Some((from, to)) = leader {
            // The leader line begins in its own marker.
            let foreign =
                self.boxes.iter().filter(|taken| !taken.contains(point) && touches(from, to, taken));
            cost_px += LEADER_CROSSED_PX * foreign.count() as f64;
        }
        cost_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crowd(count: usize) -> (Surroundings, Vec<Px>) {
        let points: Vec<Px> = (0..count)
            .map(|i| (60.0 + 17.0 * (i % 20) as f64, 60.0 + 23.0 * (i / 20) as f64 + 0.4 * (i % 20) as f64))
            .collect();
        let marker = |p: &Px| Rect { left: p.0 - 2.5, top: p.1 - 2.5, right: p.0 + 2.5, bottom: p.1 + 2.5 };
        let surroundings = Surroundings {
            inside: Rect { left: 0.0, top: 0.0, right: 600.0, bottom: 500.0 },
            boxes: points.iter().map(marker).collect(),
            lines: points.windows(2).map(|pair| (pair[0], pair[1])).collect(),
            leaders: Vec::new(),
        };
        (surroundings, points)
    }

    #[test]
    fn no_text_covers_a_marker_or_another_text() {
        // All labels of a usual number of points find a place; of more points, most do.
        for (count, most) in [(1, 1.0), (20, 1.0), (60, 1.0), (200, 0.8)] {
            let (mut surroundings, points) = crowd(count);
            let placed = points
                .iter()
                .enumerate()
                .filter_map(|(i, point)| surroundings.place(*point, &(i + 1).to_string(), 10.0))
                .count();
            assert!(placed as f64 >= most * count as f64, "{placed} of {count}");
            let boxes = &surroundings.boxes;
            assert_eq!(boxes.len(), count + placed);
            for (i, text) in boxes.iter().enumerate().skip(count) {
                assert!(!boxes[..i].iter().any(|other| other.overlaps(text)), "{text:?}");
            }
        }
    }

    #[test]
    fn a_text_with_room_is_at_its_point_and_one_without_has_no_place() {
        let (mut surroundings, points) = crowd(1);
        let label = surroundings.place(points[0], "7", 10.0).unwrap();
        assert_eq!(label.leader, None);
        assert!((label.centre.0 - points[0].0).hypot(label.centre.1 - points[0].1) < 15.0);
        surroundings.boxes.push(surroundings.inside);
        assert_eq!(surroundings.place(points[0], "8", 10.0), None);
        assert_eq!(surroundings.place((f64::NAN, 0.0), "9", 10.0), None);
    }
}
