//! A drawing as SVG, with fixed number formatting.

use crate::map_drawing::{Drawing, Px, Shape, Stroke, TextAnchor, TextStyle};
use crate::palette::WHITE;
use crate::text::escape;
use std::fmt::Write;

/// Writes the SVG document.
pub(crate) fn write_document(drawing: &Drawing) -> String {
    let (w, h) = (px(drawing.width_px.ceil()), px(drawing.height_px.ceil()));
    let mut body = String::new();
    for shape in &drawing.shapes {
        write_element(&mut body, shape);
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
         font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\" role=\"img\">\n<title>{}</title>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{body}</svg>\n",
        escape(&drawing.title),
    )
}

fn write_element(body: &mut String, shape: &Shape) {
    // Writing to a string cannot fail.
    let _ = match shape {
        Shape::OpenGroup(name) => writeln!(body, "<g class=\"{}\">", escape(name)),
        Shape::CloseGroup => writeln!(body, "</g>"),
        Shape::OpenNote(note) => {
            let title = escape(&note.text);
            match &note.link {
                Some(link) => writeln!(body, "<a href=\"{}\"><title>{title}</title>", escape(link)),
                None => writeln!(body, "<g><title>{title}</title>"),
            }
        }
        Shape::CloseNote(note) => writeln!(body, "{}", if note.link.is_some() { "</a>" } else { "</g>" }),
        Shape::Line(from, to, stroke) => writeln!(
            body,
            "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" {}/>",
            px(from.0),
            px(from.1),
            px(to.0),
            px(to.1),
            format_stroke(stroke)
        ),
        Shape::Polyline(points, stroke) => writeln!(
            body,
            "<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" {}/>",
            format_points(points),
            format_stroke(stroke)
        ),
        Shape::Areas(polygons, fill, opacity) => {
            let data: String = polygons.iter().map(|points| format!("M{}Z", format_points(points))).collect();
            let (fill, opacity) = (fill.hex(), px(*opacity));
            writeln!(body, "<path d=\"{data}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>")
        }
        Shape::Polygon(points, fill, stroke) => writeln!(
            body,
            "<polygon points=\"{}\" fill=\"{}\" {}/>",
            format_points(points),
            fill.hex(),
            format_stroke(stroke)
        ),
        Shape::Circle(centre, radius, fill, stroke) => writeln!(
            body,
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\" {}/>",
            px(centre.0),
            px(centre.1),
            px(*radius),
            fill.hex(),
            format_stroke(stroke)
        ),
        Shape::Text(at, written, style) => write_text(body, *at, written, style),
    };
}

fn write_text(body: &mut String, at: Px, text: &str, style: &TextStyle) -> std::fmt::Result {
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
        // Draw the text twice: not every viewer supports `paint-order`.
        let white = WHITE.hex();
        writeln!(
            body,
            "<text {common} fill=\"{white}\" stroke=\"{white}\" stroke-width=\"3\" stroke-linejoin=\"round\" aria-hidden=\"true\">{text}</text>"
        )?;
    }
    writeln!(body, "<text {common} fill=\"{}\">{text}</text>", style.colour.hex())
}

fn format_stroke(stroke: &Stroke) -> String {
    let mut out =
        format!("stroke=\"{}\" stroke-width=\"{}\"", stroke.colour.hex(), px(stroke.drawn_width_px()));
    let lengths: Vec<String> = stroke.dashes_px().into_iter().map(px).collect();
    if !lengths.is_empty() {
        let _ = write!(out, " stroke-dasharray=\"{}\"", lengths.join(" "));
    }
    out
}

/// A coordinate with at most two decimals; 0 if it is not finite.
pub(crate) fn px(value: f64) -> String {
    if !value.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" || text.is_empty() { "0".to_owned() } else { text.to_owned() }
}

fn format_points(points: &[(f64, f64)]) -> String {
    let mut out = String::with_capacity(points.len() * 14);
    for (x, y) in points {
        if !out.is_empty() {
            out.push(' ');
        }
        let _ = write!(out, "{},{}", px(*x), px(*y));
    }
    out
}

impl crate::Figure {
    /// The picture as an SVG document. The same figure gives the same bytes.
    pub fn to_svg(&self) -> String {
        write_document(&crate::draw::draw_figure(self))
    }
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
