//! Writing SVG elements with fixed number formatting.

use crate::Colour;
use crate::items::{Dash, TextAnchor};
use crate::palette::WHITE;
use crate::text::escape;
use std::fmt::Write;

/// A coordinate with at most two decimals; what is not finite becomes 0.
pub(crate) fn px(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" || text.is_empty() { "0".to_owned() } else { text.to_owned() }
}

/// How a line looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stroke {
    pub colour: Colour,
    pub width_px: f64,
    pub dash: Dash,
}

impl Stroke {
    pub(crate) fn solid(colour: Colour, width_px: f64) -> Self {
        Stroke { colour, width_px, dash: Dash::Solid }
    }

    fn attributes(&self) -> String {
        let w = if self.width_px.is_finite() { self.width_px.clamp(0.1, 20.0) } else { 1.0 };
        let pattern: &[f64] = match self.dash {
            Dash::Solid => &[],
            Dash::Dashed => &[4.0, 2.5],
            Dash::Dotted => &[1.0, 2.0],
            Dash::DashDot => &[5.0, 2.0, 1.0, 2.0],
        };
        let mut out = format!("stroke=\"{}\" stroke-width=\"{}\"", self.colour.hex(), px(w));
        if !pattern.is_empty() {
            let lengths: Vec<String> = pattern.iter().map(|part| px(part * w.max(1.2))).collect();
            let _ = write!(out, " stroke-dasharray=\"{}\"", lengths.join(" "));
        }
        out
    }
}

/// How a text looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TextStyle {
    pub size_px: f64,
    pub colour: Colour,
    pub anchor: TextAnchor,
    pub bold: bool,
    /// White rim, so that the text stays legible on lines.
    pub halo: bool,
    /// Turned counter-clockwise by this, degrees.
    pub turn_deg: f64,
}

impl TextStyle {
    pub(crate) fn new(size_px: f64, colour: Colour, anchor: TextAnchor) -> Self {
        TextStyle { size_px, colour, anchor, bold: false, halo: false, turn_deg: 0.0 }
    }

    pub(crate) fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    pub(crate) fn halo(mut self) -> Self {
        self.halo = true;
        self
    }

    pub(crate) fn turned(mut self, turn_deg: f64) -> Self {
        self.turn_deg = turn_deg;
        self
    }
}

/// The elements written so far.
#[derive(Debug, Default)]
pub(crate) struct Svg {
    body: String,
}

impl Svg {
    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.body.write_fmt(element);
        self.body.push('\n');
    }

    pub(crate) fn open_group(&mut self, name: &str) {
        self.push(format_args!("<g class=\"{}\">", escape(name)));
    }

    pub(crate) fn close_group(&mut self) {
        self.push(format_args!("</g>"));
    }

    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), stroke: &Stroke) {
        self.push(format_args!(
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" {}/>",
            px(from.0),
            px(from.1),
            px(to.0),
            px(to.1),
            stroke.attributes()
        ));
    }

    pub(crate) fn polyline(&mut self, points: &[(f64, f64)], stroke: &Stroke) {
        if points.len() > 1 {
            self.push(format_args!(
                "<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" {}/>",
                list(points),
                stroke.attributes()
            ));
        }
    }

    /// Polygons as one shape, so that no seam shows between neighbours.
    pub(crate) fn areas(&mut self, polygons: &[Vec<(f64, f64)>], fill: Colour, opacity: f64) {
        let data: Vec<String> =
            polygons.iter().filter(|p| p.len() > 2).map(|p| format!("M{}Z", list(p))).collect();
        if !data.is_empty() {
            let opacity = if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 };
            self.push(format_args!(
                "<path d=\"{}\" fill=\"{}\" fill-opacity=\"{}\"/>",
                data.join(""),
                fill.hex(),
                px(opacity)
            ));
        }
    }

    pub(crate) fn polygon(&mut self, points: &[(f64, f64)], fill: Colour, stroke: &Stroke) {
        self.push(format_args!(
            "<polygon points=\"{}\" fill=\"{}\" {}/>",
            list(points),
            fill.hex(),
            stroke.attributes()
        ));
    }

    pub(crate) fn circle(&mut self, centre: (f64, f64), radius: f64, fill: Colour, stroke: &Stroke) {
        self.push(format_args!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\" {}/>",
            px(centre.0),
            px(centre.1),
            px(radius),
            fill.hex(),
            stroke.attributes()
        ));
    }

    /// Text whose vertical middle is at `at`.
    pub(crate) fn text(&mut self, at: (f64, f64), text: &str, style: &TextStyle) {
        if text.is_empty() {
            return;
        }
        let anchor = match style.anchor {
            TextAnchor::Start => "start",
            TextAnchor::Middle => "middle",
            TextAnchor::End => "end",
        };
        let turn = if style.turn_deg == 0.0 {
            String::new()
        } else {
            format!(" transform=\"rotate({} {} {})\"", px(-style.turn_deg), px(at.0), px(at.1))
        };
        let weight = if style.bold { " font-weight=\"bold\"" } else { "" };
        let common = format!(
            "x=\"{}\" y=\"{}\" dy=\"0.35em\" font-size=\"{}\" text-anchor=\"{anchor}\"{weight}{turn}",
            px(at.0),
            px(at.1),
            px(style.size_px)
        );
        let text = escape(text);
        if style.halo {
            // Drawn twice: every viewer knows this, not every one knows paint-order.
            let (white, colour) = (WHITE.hex(), style.colour.hex());
            self.push(format_args!(
                "<text {common} fill=\"{white}\" stroke=\"{white}\" stroke-width=\"3\" stroke-linejoin=\"round\" aria-hidden=\"true\">{text}</text>"
            ));
            self.push(format_args!("<text {common} fill=\"{colour}\">{text}</text>"));
        } else {
            self.push(format_args!("<text {common} fill=\"{}\">{text}</text>", style.colour.hex()));
        }
    }

    /// The whole document.
    pub(crate) fn finish(self, width: f64, height: f64, title: &str) -> String {
        let (w, h) = (px(width.ceil()), px(height.ceil()));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\" role=\"img\">\n<title>{}</title>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            escape(title),
            self.body
        )
    }
}

fn list(points: &[(f64, f64)]) -> String {
    let mut out = String::with_capacity(points.len() * 14);
    for (x, y) in points {
        if !out.is_empty() {
            out.push(' ');
        }
        let _ = write!(out, "{},{}", px(*x), px(*y));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::px;

    #[test]
    fn coordinates_are_short_and_never_odd() {
        assert_eq!(
            [1.0, 0.125, -0.001, 100.0, 12.5, f64::NAN].map(px),
            ["1", "0.12", "0", "100", "12.5", "0"]
        );
    }
}
