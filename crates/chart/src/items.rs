//! Items that a panel can show. Coordinates are in the axes' units throughout; lengths on paper are in px.

use crate::palette::INK;
use crate::{Colour, Contours};

/// An item of a panel. Items are drawn in the given order, texts last.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A line series.
    Line(Line),
    /// Points with markers.
    Scatter(Scatter),
    /// A reference line across the whole panel.
    Rule(Rule),
    /// Contour lines of a field.
    Contours(Contours),
    /// A shaded area.
    Polygon(Polygon),
    /// A text.
    Annotation(Annotation),
    /// Short texts around points.
    PointLabels(PointLabels),
}

/// Dash pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dash {
    /// A solid line.
    #[default]
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
    /// Alternating dashes and dots.
    DashDot,
}

/// A line through points; a NaN or infinite point splits it.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Points (x, y) in drawing order.
    pub points: Vec<(f64, f64)>,
    /// Colour.
    pub colour: Colour,
    /// Width, px.
    pub width_px: f64,
    /// Dash pattern.
    pub dash: Dash,
    /// Whether each segment has an arrow head at its middle (a path through the map).
    pub arrows: bool,
    /// Entry in the legend; items with equal text share one entry.
    pub label: Option<String>,
    /// Text next to one end, on the line's continuation.
    pub end_label: Option<(String, LineEnd)>,
}

/// End of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineEnd {
    /// First visible point.
    First,
    /// Last visible point.
    Last,
}

impl Line {
    /// A solid line of 1.8 px.
    pub fn new(points: Vec<(f64, f64)>, colour: Colour) -> Self {
        Line { points, colour, width_px: 1.8, dash: Dash::Solid, arrows: false, label: None, end_label: None }
    }

    /// Sets the legend's text.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// Sets the dash pattern.
    pub fn dash(mut self, dash: Dash) -> Self {
        self.dash = dash;
        self
    }

    /// Sets the width, px.
    pub fn width_px(mut self, width_px: f64) -> Self {
        self.width_px = width_px;
        self
    }

    /// Puts an arrow head at the middle of each segment.
    pub fn arrows(mut self) -> Self {
        self.arrows = true;
        self
    }

    /// Writes a text next to one end.
    pub fn end_label(mut self, text: impl Into<String>, end: LineEnd) -> Self {
        self.end_label = Some((text.into(), end));
        self
    }
}

/// Shape of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Marker {
    /// Circle.
    #[default]
    Circle,
    /// Square.
    Square,
    /// Triangle, tip up.
    Triangle,
    /// Diamond.
    Diamond,
    /// Upright cross.
    Plus,
    /// Diagonal cross.
    Cross,
}

/// A point with optional intervals (low, high), absolute values in the axes' units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScatterPoint {
    /// x.
    pub x: f64,
    /// y.
    pub y: f64,
    /// Ends of the error bar along x.
    pub x_interval: Option<(f64, f64)>,
    /// Ends of the error bar along y.
    pub y_interval: Option<(f64, f64)>,
}

impl From<(f64, f64)> for ScatterPoint {
    fn from((x, y): (f64, f64)) -> Self {
        ScatterPoint { x, y, x_interval: None, y_interval: None }
    }
}

/// Points drawn as markers. Error bars extend an axis by at most half the span of the points; longer ones are cut.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// The points; NaN or infinite ones are skipped.
    pub points: Vec<ScatterPoint>,
    /// Colour.
    pub colour: Colour,
    /// Shape.
    pub marker: Marker,
    /// Whether only the outline is drawn.
    pub hollow: bool,
    /// Diameter, px.
    pub size_px: f64,
    /// Entry in the legend; items with equal text share one entry.
    pub label: Option<String>,
    /// Tooltips of the points in an SVG viewer, in the order of the points; empty for none.
    pub notes: Vec<Note>,
}

/// Tooltip of a point in an SVG, and target of a click; not used in a PNG.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Note {
    /// Text of the tooltip.
    pub text: String,
    /// File or page to open on a click.
    pub link: Option<String>,
}

impl Scatter {
    /// Filled circles of 7 px.
    pub fn new<P: Into<ScatterPoint>>(points: Vec<P>, colour: Colour) -> Self {
        Scatter {
            points: points.into_iter().map(Into::into).collect(),
            colour,
            marker: Marker::Circle,
            hollow: false,
            size_px: 7.0,
            label: None,
            notes: Vec::new(),
        }
    }

    /// Sets the note of each point, in the order of the points.
    pub fn notes(mut self, notes: Vec<Note>) -> Self {
        self.notes = notes;
        self
    }

    /// Sets the shape.
    pub fn marker(mut self, marker: Marker) -> Self {
        self.marker = marker;
        self
    }

    /// Draws only the outlines.
    pub fn hollow(mut self) -> Self {
        self.hollow = true;
        self
    }

    /// Sets the diameter, px.
    pub fn size_px(mut self, size_px: f64) -> Self {
        self.size_px = size_px;
        self
    }

    /// Sets the legend's text.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }
}

/// Direction and position of a [`Rule`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RuleAt {
    /// Along x at this y.
    Y(f64),
    /// Along y at this x.
    X(f64),
}

/// A straight grey reference line across the whole panel. The axis is extended to include it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// Position.
    pub at: RuleAt,
    /// Dash pattern.
    pub dash: Dash,
    /// Entry in the legend.
    pub label: Option<String>,
}

impl Rule {
    /// A dashed line.
    pub fn new(at: RuleAt) -> Self {
        Rule { at, dash: Dash::Dashed, label: None }
    }

    /// Sets the legend's text.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }
}

/// A shaded area, e.g. an extrapolated region.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    /// Corners (x, y); NaN or infinite ones are skipped.
    pub points: Vec<(f64, f64)>,
    /// Colour of the fill.
    pub colour: Colour,
    /// Opacity of the fill, 0..1.
    pub opacity: f64,
    /// Entry in the legend.
    pub label: Option<String>,
}

impl Polygon {
    /// A lightly shaded area.
    pub fn new(points: Vec<(f64, f64)>, colour: Colour) -> Self {
        Polygon { points, colour, opacity: 0.2, label: None }
    }

    /// Sets the legend's text.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }
}

/// A text that begins at a place. It does not widen the axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Annotation {
    /// The text, one line.
    pub text: String,
    /// Place (x, y), in the axes' units.
    pub at: (f64, f64),
    /// Shift from the place, px, to the right and up.
    pub shift_px: (f64, f64),
    /// Colour.
    pub colour: Colour,
}

impl Annotation {
    /// Text 6 px to the right of a point.
    pub fn new(text: impl Into<String>, at: (f64, f64)) -> Self {
        Annotation { text: text.into(), at, shift_px: (6.0, 0.0), colour: INK }
    }
}

/// Short texts next to points, e.g. numbers of steps, clear of markers and other texts; distant ones have a leader line.
#[derive(Debug, Clone, PartialEq)]
pub struct PointLabels {
    /// Texts with their points, the most important first; labels without a free position are omitted.
    pub labels: Vec<(String, (f64, f64))>,
    /// Colour.
    pub colour: Colour,
    /// Height of the text, px.
    pub size_px: f64,
}

macro_rules! into_item {
    ($($kind:ident),*) => {
        $(impl From<$kind> for Item {
            fn from(item: $kind) -> Item {
                Item::$kind(item)
            }
        })*
    };
}
into_item!(Line, Scatter, Rule, Contours, Polygon, Annotation, PointLabels);
