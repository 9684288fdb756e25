//! Draws a figure: arrow heads, items, panels.

use crate::contours::{self, Rect, band, contour_lines, place, without_gap};
use crate::frame::Frame;
use crate::items::{Annotation, Item, Line, LineEnd, Rule, RuleAt, Scatter};
use crate::layout::{
    AXIS_TITLE_PX, MARGIN_PX, PANEL_TITLE_PX, PlacedPanel, SUBTITLE_PX, Surroundings, TICK_PX, TITLE_PX,
    draw_legend, draw_marker, layout,
};
use crate::map_drawing::{Drawing, Shape, Stroke, TextAnchor, TextStyle};
use crate::palette::{BLUE, Colour, GREY, INK, LIGHT_GREY};
use crate::text::{cut, width_px};
use crate::{Contours, Figure, Panel};

/// An arrow head at the middle of a segment, unless the segment is too short.
fn draw_arrow(drawing: &mut Drawing, from: (f64, f64), to: (f64, f64), colour: Colour) {
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

const LABEL_PX: f64 = 11.0;
const MAX_LEVELS: usize = 100;
/// Colour of contour lines and their labels: dark blue, which stands out on the shading.
const CONTOUR: Colour = Colour(40, 80, 120);

/// A text that is drawn after everything else, so that no line crosses it.
struct LateText {
    at: (f64, f64),
    text: String,
    style: TextStyle,
    at_line_end: bool,
}

pub(crate) fn draw_figure(figure: &Figure) -> Drawing {
    let sheet = layout(figure);
    let mut drawing =
        Drawing { width_px: sheet.width, height_px: sheet.height, title: name(figure), shapes: Vec::new() };
    let mut y = MARGIN_PX + 10.0;
    for line in &sheet.title {
        drawing.text((MARGIN_PX, y), line, &TextStyle::new(TITLE_PX, INK, TextAnchor::Start).bold());
        y += 24.0;
    }
    for line in &sheet.subtitle {
        drawing.text((MARGIN_PX, y), line, &TextStyle::new(SUBTITLE_PX, INK, TextAnchor::Start));
        y += 18.0;
    }
    for placed in &sheet.panels {
        draw_panel(&mut drawing, placed);
    }
    drawing
}

fn draw_panel(drawing: &mut Drawing, placed: &PlacedPanel<'_>) {
    let frame = &placed.frame;
    drawing.shapes.push(Shape::OpenGroup("panel".to_owned()));
    draw_axes(drawing, placed);
    let mut obstacles = find_obstacles(frame, &placed.panel.items);
    let mut late = Vec::new();
    for item in &placed.panel.items {
        match item {
            Item::Line(item) => draw_line(drawing, frame, item, &mut late),
            Item::Scatter(item) => draw_scatter(drawing, frame, item),
            Item::Rule(item) => draw_rule(drawing, frame, item),
            Item::Contours(item) => draw_contours(drawing, frame, item, &mut obstacles, &mut late),
            Item::Polygon(item) => {
                let points: Vec<_> = item.points.iter().map(|p| frame.px(*p)).collect();
                drawing.areas(&[contours::polygon(&points, &frame.rect)], item.colour, item.opacity);
            }
            Item::Annotation(item) => add_annotation(frame, item, &mut late),
            Item::PointLabels(_) => {}
        }
    }
    draw_point_labels(drawing, placed, &mut late);
    for text in &late {
        drawing.text(text.at, &text.text, &text.style);
    }
    draw_legend(drawing, &placed.entries, &placed.legend_places, placed.legend_origin);
    drawing.shapes.push(Shape::CloseGroup);
}

/// Finds the positions that labels of contour lines avoid: markers, arrow heads and texts at the ends of lines.
fn find_obstacles(frame: &Frame, items: &[Item]) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    for item in items {
        match item {
            Item::Scatter(scatter) => out.extend(scatter.points.iter().map(|p| frame.px((p.x, p.y)))),
            Item::Line(line) if line.arrows => {
                let middle =
                    |pair: &[(f64, f64)]| (0.5 * (pair[0].0 + pair[1].0), 0.5 * (pair[0].1 + pair[1].1));
                out.extend(line.points.windows(2).map(|pair| frame.px(middle(pair))));
            }
            Item::Line(line) => {
                let half = line.end_label.as_ref().map_or(0.0, |(text, _)| 0.5 * width_px(text, LABEL_PX));
                let text = end_label_at(frame, line);
                out.extend(text.iter().flat_map(|at| [-half, 0.0, half].map(|dx| (at.0 + dx, at.1))));
            }
            _ => {}
        }
    }
    out
}

fn draw_axes(drawing: &mut Drawing, placed: &PlacedPanel<'_>) {
    let (frame, panel) = (&placed.frame, placed.panel);
    let Rect { left, top, right, bottom } = frame.rect;
    let (grid, ink) = (Stroke::solid(LIGHT_GREY, 0.8), Stroke::solid(INK, 1.0));
    for (value, text) in &frame.x.ticks {
        let x = frame.px((*value, frame.y.low)).0;
        drawing.line((x, top), (x, bottom), &grid);
        drawing.line((x, bottom), (x, bottom + 5.0), &ink);
        drawing.text((x, bottom + 15.0), text, &TextStyle::new(TICK_PX, INK, TextAnchor::Middle));
    }
    for (value, text) in &frame.y.ticks {
        let y = frame.px((frame.x.low, *value)).1;
        drawing.line((left, y), (right, y), &grid);
        drawing.line((left - 5.0, y), (left, y), &ink);
        drawing.text((left - 8.0, y), text, &TextStyle::new(TICK_PX, INK, TextAnchor::End));
    }
    drawing.polyline(&[(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], &ink);
    let title = TextStyle::new(AXIS_TITLE_PX, INK, TextAnchor::Middle);
    let cut_to = |text: &str, room: f64| cut(text, AXIS_TITLE_PX, room);
    drawing.text(
        (0.5 * (left + right), bottom + 38.0),
        &cut_to(&panel.x.title, frame.rect.width() + 40.0),
        &title,
    );
    let tick_width = frame.y.ticks.iter().map(|t| width_px(&t.1, TICK_PX)).fold(0.0, f64::max);
    drawing.text(
        (left - 16.0 - tick_width - 0.5 * AXIS_TITLE_PX + 4.0, 0.5 * (top + bottom)),
        &cut_to(&panel.y.title, frame.rect.height() + 40.0),
        &title.turned(90.0),
    );
    let panel_title = cut(&panel.title, PANEL_TITLE_PX, frame.rect.width());
    drawing.text(
        (left, top - 13.0),
        &panel_title,
        &TextStyle::new(PANEL_TITLE_PX, INK, TextAnchor::Start).bold(),
    );
}

fn draw_line(drawing: &mut Drawing, frame: &Frame, line: &Line, late: &mut Vec<LateText>) {
    let points: Vec<_> = line.points.iter().map(|p| frame.px(*p)).collect();
    let stroke = Stroke { colour: line.colour, width_px: line.width_px, dash: line.dash };
    let pieces = contours::polyline(&points, &frame.rect);
    for piece in &pieces {
        drawing.polyline(piece, &stroke);
        if line.arrows {
            for pair in piece.windows(2) {
                draw_arrow(drawing, pair[0], pair[1], line.colour);
            }
        }
    }
    let (Some((text, _)), Some(at)) = (&line.end_label, end_label_at(frame, line)) else { return };
    let width = width_px(text, LABEL_PX);
    // Overlapping texts are illegible, so the earlier one is kept.
    let covered = |earlier: &LateText| {
        (earlier.at.0 - at.0).abs() < 0.5 * (width + width_px(&earlier.text, LABEL_PX))
            && (earlier.at.1 - at.1).abs() < LABEL_PX
    };
    if !late.iter().filter(|text| text.at_line_end).any(covered) {
        let style = TextStyle::new(LABEL_PX, line.colour, TextAnchor::Middle).halo().bold();
        late.push(LateText { at, text: text.clone(), style, at_line_end: true });
    }
}

fn end_label_at(frame: &Frame, line: &Line) -> Option<(f64, f64)> {
    let (text, end) = line.end_label.as_ref()?;
    let points: Vec<_> = line.points.iter().map(|p| frame.px(*p)).collect();
    let pieces = contours::polyline(&points, &frame.rect);
    let ends = match end {
        LineEnd::First => pieces.first().map(|p| (p[1], p[0])),
        LineEnd::Last => pieces.last().map(|p| (p[p.len() - 2], p[p.len() - 1])),
    };
    // A line with a single visible point also gets its text.
    let single =
        points.iter().copied().find(|p| p.0.is_finite() && p.1.is_finite() && frame.rect.contains(*p));
    let (inner, end) = ends.or(single.map(|p| ((p.0 - 1.0, p.1), p)))?;
    let length = (end.0 - inner.0).hypot(end.1 - inner.1).max(1e-9);
    let (ux, uy) = ((end.0 - inner.0) / length, (end.1 - inner.1) / length);
    let half_width = 0.5 * width_px(text, LABEL_PX);
    // The distance that the box of the text needs in this direction, within the frame.
    let centre = (end.0 + ux * (half_width + 8.0), end.1 + uy * 14.0);
    let y = centre.1.clamp(frame.rect.top + 8.0, frame.rect.bottom - 8.0);
    // Without room above or below, place the text next to the end.
    let x = if y == centre.1 { centre.0 } else { end.0 - half_width - 9.0 };
    let leftmost = frame.rect.left + half_width + 2.0;
    Some((x.clamp(leftmost, leftmost.max(frame.rect.right - half_width - 2.0)), y))
}

fn draw_scatter(drawing: &mut Drawing, frame: &Frame, scatter: &Scatter) {
    for point in &scatter.points {
        for (interval, along_x) in [(point.x_interval, true), (point.y_interval, false)] {
            let Some((low, high)) = interval else { continue };
            let end = |v: f64| frame.px(if along_x { (v, point.y) } else { (point.x, v) });
            draw_error_bar(drawing, frame, end(low), end(high), along_x, scatter);
        }
    }
    for (index, point) in scatter.points.iter().enumerate() {
        let at = frame.px((point.x, point.y));
        if at.0.is_finite() && at.1.is_finite() && frame.rect.contains(at) {
            match scatter.notes.get(index) {
                None => draw_marker(drawing, at, scatter),
                Some(note) => drawing.noted(note, |drawing| draw_marker(drawing, at, scatter)),
            }
        }
    }
}

fn draw_error_bar(
    drawing: &mut Drawing,
    frame: &Frame,
    low: (f64, f64),
    high: (f64, f64),
    along_x: bool,
    scatter: &Scatter,
) {
    let stroke = Stroke::solid(scatter.colour, 1.1);
    for piece in contours::polyline(&[low, high], &frame.rect) {
        drawing.polyline(&piece, &stroke);
        for end in [low, high].into_iter().filter(|end| frame.rect.contains(*end)) {
            let (dx, dy) = if along_x { (0.0, 3.0) } else { (3.0, 0.0) };
            drawing.line((end.0 - dx, end.1 - dy), (end.0 + dx, end.1 + dy), &stroke);
        }
    }
}

fn draw_rule(drawing: &mut Drawing, frame: &Frame, rule: &Rule) {
    let ends = match rule.at {
        RuleAt::Y(value) => [(frame.x.low, value), (frame.x.high, value)],
        RuleAt::X(value) => [(value, frame.y.low), (value, frame.y.high)],
    };
    let stroke = Stroke { colour: GREY, width_px: 1.2, dash: rule.dash };
    for piece in contours::polyline(&ends.map(|p| frame.px(p)), &frame.rect) {
        drawing.polyline(&piece, &stroke);
    }
}

fn draw_contours(
    drawing: &mut Drawing,
    frame: &Frame,
    contours: &Contours,
    obstacles: &mut Vec<(f64, f64)>,
    late: &mut Vec<LateText>,
) {
    let levels = &contours.levels[..contours.levels.len().min(MAX_LEVELS)];
    let mut edges = vec![f64::NEG_INFINITY];
    edges.extend(levels.iter().map(|(level, _)| level));
    edges.push(f64::INFINITY);
    for (i, pair) in edges.windows(2).enumerate() {
        let share = i as f64 / (edges.len() - 2).max(1) as f64;
        let polygons: Vec<_> = band(&contours.grid, pair[0], pair[1])
            .into_iter()
            .map(|p| contours::polygon(&p.into_iter().map(|p| frame.px(p)).collect::<Vec<_>>(), &frame.rect))
            .collect();
        // Light enough that markers and texts stand out on the darkest.
        drawing.areas(&polygons, BLUE.tint(0.04 + 0.30 * share), 1.0);
    }
    let stroke = Stroke::solid(CONTOUR, 1.0);
    for (level, label) in levels {
        let width = width_px(label, LABEL_PX);
        for chain in contour_lines(&contours.grid, *level) {
            let points: Vec<_> = chain.into_iter().map(|p| frame.px(p)).collect();
            for piece in contours::polyline(&points, &frame.rect) {
                let Some(place) = place(&piece, width, obstacles) else {
                    drawing.polyline(&piece, &stroke);
                    continue;
                };
                for part in without_gap(&piece, place.gap) {
                    drawing.polyline(&part, &stroke);
                }
                obstacles.push(place.centre);
                late.push(LateText {
                    at: place.centre,
                    text: label.clone(),
                    style: TextStyle::new(LABEL_PX, CONTOUR, TextAnchor::Middle).turned(place.turn_deg),
                    at_line_end: false,
                });
            }
        }
    }
}

fn draw_point_labels(drawing: &mut Drawing, placed: &PlacedPanel<'_>, late: &mut Vec<LateText>) {
    let texts = late.iter().map(|text| text_box(text.at, &text.text, &text.style)).collect();
    let mut surroundings = Surroundings::of(&placed.frame, &placed.panel.items, texts);
    for item in &placed.panel.items {
        let Item::PointLabels(item) = item else { continue };
        for (text, point) in &item.labels {
            let Some(label) = surroundings.place(placed.frame.px(*point), text, item.size_px) else {
                continue;
            };
            if let Some((from, to)) = label.leader {
                drawing.line(from, to, &Stroke::solid(item.colour, 0.7));
            }
            let style = TextStyle::new(item.size_px, item.colour, TextAnchor::Middle).halo().bold();
            late.push(LateText { at: label.centre, text: text.clone(), style, at_line_end: false });
        }
    }
}

fn text_box(at: (f64, f64), text: &str, style: &TextStyle) -> Rect {
    let width = width_px(text, style.size_px);
    let left = match style.anchor {
        TextAnchor::Start => at.0,
        TextAnchor::Middle => at.0 - 0.5 * width,
        TextAnchor::End => at.0 - width,
    };
    let half = 0.5 * style.size_px;
    Rect { left, top: at.1 - half, right: left + width, bottom: at.1 + half }
}

fn add_annotation(frame: &Frame, item: &Annotation, late: &mut Vec<LateText>) {
    let (x, y) = frame.px(item.at);
    let at = (x + item.shift_px.0, y - item.shift_px.1);
    if at.0.is_finite() && at.1.is_finite() && frame.rect.contains(at) {
        let style = TextStyle::new(LABEL_PX, item.colour, TextAnchor::Start).halo();
        late.push(LateText { at, text: item.text.clone(), style, at_line_end: false });
    }
}

/// What a screen reader calls the figure: its title, otherwise that of its first panel or the panel's axes.
fn name(figure: &Figure) -> String {
    let of_panel = |panel: &Panel| {
        if panel.title.is_empty() {
            format!("{} over {}", panel.y.title, panel.x.title)
        } else {
            panel.title.clone()
        }
    };
    match figure.panels.first() {
        Some(panel) if figure.title.is_empty() => of_panel(panel),
        _ => figure.title.clone(),
    }
}
