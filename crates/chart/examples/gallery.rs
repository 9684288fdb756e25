//! One of everything: `cargo run -p mapper-chart --example gallery > gallery.svg`.

use mapper_chart::{
    Annotation, Axis, Contours, Dash, Figure, LegendPlace, Line, LineEnd, Marker, Panel, Polygon, Rule,
    RuleAt, Scatter, ScatterPoint, Space, StructuredGrid, TextAnchor, palette,
};
use std::io::Write;

fn main() -> std::io::Result<()> {
    let figure = Figure::new("Gallery: <one> of \"everything\" & more")
        .subtitle("Made-up numbers. Texts with <, > and & are escaped.")
        .columns(2)
        .panel(series())
        .panel(path())
        .panel(hostile())
        .panel(Panel::new(Axis::new("x, 1"), Axis::new("y, 1")).title("(d) nothing at all"))
        .panel_size_px(460.0, 320.0);
    std::io::stdout().write_all(figure.to_svg().as_bytes())
}

fn series() -> Panel {
    let decay =
        |k: f64| (0..=110).map(|t| (f64::from(t), 300.0 + 60.0 * (-f64::from(t) / k).exp())).collect();
    let points = (0..6).map(|i| ScatterPoint {
        x: 10.0 + 20.0 * f64::from(i),
        y: 340.0 - 8.0 * f64::from(i),
        x_interval: Some((7.0 + 20.0 * f64::from(i), 13.0 + 20.0 * f64::from(i))),
        y_interval: Some((335.0 - 8.0 * f64::from(i), 345.0 - 8.0 * f64::from(i))),
    });
    let mut panel = Panel::new(Axis::new("time after the jump, s"), Axis::new("outlet temperature T2, K"))
        .title("(a) series, points, rules")
        .legend(LegendPlace::Right)
        .with(
            Polygon::new(vec![(10.0, 290.0), (110.0, 290.0), (110.0, 365.0), (10.0, 365.0)], palette::SKY)
                .label("window"),
        );
    for (i, dash) in [Dash::Solid, Dash::Dashed, Dash::Dotted, Dash::DashDot].into_iter().enumerate() {
        let line: Vec<(f64, f64)> = decay(15.0 + 20.0 * i as f64);
        panel.add(Line::new(line, palette::categorical(i)).dash(dash).label(format!("case {}", i + 1)));
    }
    panel
        .with(Scatter::new(points.collect(), palette::INK).marker(Marker::Square).label("measured"))
        .with(Rule::new(RuleAt::Y(300.0)).label("paper: 300 K"))
        .with(Rule::new(RuleAt::X(60.0)))
        .with(Annotation::in_panel("n = 6", (0.97, 0.06), TextAnchor::End))
}

fn path() -> Panel {
    let axis: Vec<f64> = (0..40).map(|i| -2.0 + 0.1 * f64::from(i)).collect();
    let saddle = StructuredGrid::from_fn(&axis, &axis, |x, y| {
        if x + y > 2.6 || (x + 1.2).hypot(y + 1.2) < 0.35 { f64::NAN } else { x * x - y * y }
    });
    let levels: Vec<f64> = (-6..=6).map(|i| 0.5 * f64::from(i)).collect();
    let stops = vec![(-1.5, 1.0), (0.0, -1.0), (1.0, 1.0), (1.5, -1.5), (-0.5, 0.2)];
    let mut panel = Panel::new(Axis::new("x, m"), Axis::new("y, m"))
        .title("(b) contours with holes, a path with arrows")
        .with(Contours::new(saddle, &levels, |z| format!("{z:.1}")).shaded().label("height, m"))
        .with(
            Line::new(stops.clone(), palette::VERMILLION)
                .arrows()
                .label("order of visits")
                .end_label("end", LineEnd::Last),
        )
        .with(
            Scatter::new(stops.clone(), palette::VERMILLION).hollow().size_px(9.0).label("order of visits"),
        );
    for (i, at) in stops.into_iter().enumerate() {
        panel.add(Annotation {
            shift_px: (8.0, 8.0),
            space: Space::Data,
            ..Annotation::new((i + 1).to_string(), at)
        });
    }
    panel
}

fn hostile() -> Panel {
    Panel::new(Axis::new("constant, s"), Axis::new("also constant, K").from(290.0))
        .title("(c) constant data, NaN left out")
        .with(
            Scatter::new(vec![(5.0, 300.0), (f64::NAN, 3.0), (5.0, f64::INFINITY)], palette::GREEN)
                .marker(Marker::Triangle)
                .label("a point"),
        )
        .with(Line::new(vec![(5.0, 300.0), (f64::NAN, 0.0)], palette::GREEN).label("a line of one point"))
}
