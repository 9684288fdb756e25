//! Positions of all parts of a figure.

use crate::figure_layout::clip::Rect;
use crate::figure_layout::frame::{Frame, fit_scales};
use crate::figure_layout::legend::{Entry, ROW_PX, entries, flow};
use crate::text::{width_px, wrap};
use crate::{Figure, Panel};

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
