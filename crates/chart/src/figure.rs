//! A figure: title, subtitle, panels with their axes.

use crate::Item;

/// Settings of an axis; without a range it follows the data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Title with the unit, e.g. `corrected mass flow, kg/s`.
    pub title: String,
    /// Lower end, in the axis' unit; `None` follows the data.
    pub low: Option<f64>,
    /// Upper end, in the axis' unit; `None` follows the data.
    pub high: Option<f64>,
    /// Factor from the values of the data to the numbers of the tick labels, if the title has another unit; `None` for 1.
    pub written_times: Option<f64>,
    /// Ticks with labels, instead of round numbers, e.g. names of cases.
    pub ticks: Option<Vec<(f64, String)>>,
}

impl Axis {
    /// An axis that follows the data.
    pub fn new(title: impl Into<String>) -> Self {
        Axis { title: title.into(), ..Axis::default() }
    }

    /// Fixes both ends, in the axis' unit. An end that is NaN or infinite follows the data.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        (self.low, self.high) = (Some(low), Some(high));
        self
    }

    /// Fixes the lower end only, in the axis' unit.
    pub fn from(mut self, low: f64) -> Self {
        self.low = Some(low);
        self
    }

    /// Multiplies the numbers of the tick labels by `factor`. A factor that is not positive and finite counts as 1.
    pub fn written_times(mut self, factor: f64) -> Self {
        self.written_times = Some(factor);
        self
    }

    /// Sets the ticks with their labels.
    pub fn ticks(mut self, ticks: Vec<(f64, String)>) -> Self {
        self.ticks = Some(ticks);
        self
    }
}

/// A pair of axes with its items. The legend is below the axes, so that it never covers data.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title, e.g. `(a) 110 to 50 krpm`; empty for none.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Contents, in drawing order.
    pub items: Vec<Item>,
}

impl Panel {
    /// An empty panel.
    pub fn new(x: Axis, y: Axis) -> Self {
        Panel { title: String::new(), x, y, items: Vec::new() }
    }

    /// Sets the title.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds something to show.
    pub fn with(mut self, item: impl Into<Item>) -> Self {
        self.items.push(item.into());
        self
    }

    /// Adds something to show.
    pub fn add(&mut self, item: impl Into<Item>) {
        self.items.push(item.into());
    }
}

/// A whole picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Title.
    pub title: String,
    /// Smaller lines below the title; long ones are wrapped.
    pub subtitles: Vec<String>,
    /// Panels, row after row.
    pub panels: Vec<Panel>,
    /// Panels in a row, at least 1.
    pub columns: usize,
    /// Width of each drawing area, px, 100..4000.
    pub panel_width_px: f64,
    /// Height of each drawing area, px, 100..4000.
    pub panel_height_px: f64,
}

impl Figure {
    /// An empty figure; panels stand side by side, two in a row, each with a drawing area of 520 by 400 px.
    pub fn new(title: impl Into<String>) -> Self {
        Figure {
            title: title.into(),
            subtitles: Vec::new(),
            panels: Vec::new(),
            columns: 2,
            panel_width_px: 520.0,
            panel_height_px: 400.0,
        }
    }

    /// Adds a line below the title.
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitles.push(subtitle.into());
        self
    }

    /// Adds a panel.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Sets the number of panels in a row.
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns;
        self
    }

    /// Sets the size of each drawing area, px.
    pub fn panel_size_px(mut self, width_px: f64, height_px: f64) -> Self {
        (self.panel_width_px, self.panel_height_px) = (width_px, height_px);
        self
    }
}
