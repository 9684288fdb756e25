//! Whatever is put in, a well-formed picture comes out, and the same one each time.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_chart::{
    Annotation, Axis, Contours, Figure, Line, LineEnd, Marker, Panel, Polygon, Rule, RuleAt, Scatter,
    ScatterPoint, StructuredGrid, palette,
};
use proptest::prelude::*;

/// Parses the picture and checks that each number in it is one, within the sheet.
fn check(svg: &str) -> roxmltree::Document<'_> {
    let document = roxmltree::Document::parse(svg).expect("well-formed XML");
    let root = document.root_element();
    let number =
        |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite()).unwrap_or_else(|| panic!("`{text}`"));
    let (width, height) =
        (number(root.attribute("width").unwrap()), number(root.attribute("height").unwrap()));
    let inside = |x: f64, y: f64| {
        assert!(x >= 0.0 && x <= width && y >= 0.0 && y <= height, "({x}, {y}) is off the sheet")
    };
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        for attribute in node.attributes() {
            match attribute.name() {
                "points" => attribute.value().split(' ').for_each(|pair| {
                    let (x, y) = pair.split_once(',').unwrap();
                    inside(number(x), number(y));
                }),
                "cx" | "x" | "x1" | "x2" => inside(number(attribute.value()), 0.0),
                "cy" | "y" | "y1" | "y2" => inside(0.0, number(attribute.value())),
                _ => assert!(!attribute.value().contains("NaN") && !attribute.value().contains("inf")),
            }
        }
    }
    document
}

fn any_pairs() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let value = || prop_oneof![3 => -10.0..10.0f64, 1 => proptest::num::f64::ANY, 1 => Just(2.0)];
    proptest::collection::vec((value(), value()), 0..8)
}

fn figure(points: &[(f64, f64)], others: &[(f64, f64)], text: &str, range: (f64, f64)) -> Figure {
    let bars = points
        .iter()
        .zip(others)
        .map(|(p, o)| ScatterPoint { x: p.0, y: p.1, x_interval: Some(*o), y_interval: Some((o.1, o.0)) })
        .collect::<Vec<_>>();
    let z = points
        .iter()
        .chain(others)
        .chain([&(0.0, 1.0); 3])
        .map(|p| p.0)
        .take(6)
        .chain([0.5; 6])
        .take(6)
        .collect();
    let grid =
        StructuredGrid::new(2, 3, vec![0.0, 1.0, 2.0, 0.0, 1.0, 2.0], vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0], z)
            .unwrap();
    let levels: Vec<f64> = others.iter().map(|p| p.1).collect();
    let panel = Panel::new(Axis::new(text), Axis::new(text))
        .title(text)
        .with(Contours::new(grid, &levels, |z| z.to_string()))
        .with(Polygon::new(points.to_vec(), palette::SKY).label("area"))
        .with(Line::new(points.to_vec(), palette::BLUE).arrows().label(text).end_label(text, LineEnd::Last))
        .with(Scatter::new(bars, palette::ORANGE).marker(Marker::Cross).label("points"))
        .with(Annotation::new(text, others.first().copied().unwrap_or_default()));
    let mut fixed = panel.clone();
    fixed.x = fixed.x.range(range.0, range.1);
    for other in others {
        fixed.add(Rule::new(RuleAt::Y(other.0)));
        fixed.add(Rule::new(RuleAt::X(other.1)));
    }
    Figure::new(text)
        .subtitle(text)
        .panel(panel)
        .panel(fixed)
        .panel(Panel::new(Axis::default(), Axis::default()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_numbers_and_texts_give_a_well_formed_picture(
        points in any_pairs(), others in any_pairs(), text in ".{0,30}", range in (proptest::num::f64::ANY, proptest::num::f64::ANY),
    ) {
        let figure = figure(&points, &others, &text, range);
        let svg = figure.to_svg();
        check(&svg);
        prop_assert_eq!(svg, figure.to_svg());
    }
}

#[test]
fn huge_wishes_stay_small() {
    let figure = Figure::new("x ".repeat(4000)).columns(usize::MAX).panel_size_px(f64::INFINITY, 1e300);
    assert!(check(&figure.to_svg()).root_element().attribute("width").is_some());
    let wide = Panel::new(Axis::new("a").range(-1e308, 1e308), Axis::new("b").range(1.0, 1.0 + 1e-15));
    check(&Figure::new("").panel(wide).to_svg());
}

#[test]
fn points_that_are_no_numbers_are_left_out_and_all_others_drawn() {
    let points = vec![(1.0, 1.0), (f64::NAN, 2.0), (3.0, f64::INFINITY), (4.0, 2.0)];
    let panel = Panel::new(Axis::new("x"), Axis::new("y")).with(Scatter::new(points, palette::BLUE));
    let svg = Figure::new("").panel(panel).to_svg();
    let circles = check(&svg).descendants().filter(|n| n.has_tag_name("circle")).count();
    assert_eq!(circles, 2);
}

#[test]
fn higher_values_stand_higher_and_larger_ones_further_right() {
    let panel = Panel::new(Axis::new("x"), Axis::new("y"))
        .with(Scatter::new(vec![(1.0, 5.0), (2.0, 7.0)], palette::BLUE));
    let svg = Figure::new("").panel(panel).to_svg();
    let document = check(&svg);
    let at: Vec<(f64, f64)> = document
        .descendants()
        .filter(|n| n.has_tag_name("circle"))
        .map(|n| (n.attribute("cx").unwrap().parse().unwrap(), n.attribute("cy").unwrap().parse().unwrap()))
        .collect();
    assert!(at[1].0 > at[0].0 && at[1].1 < at[0].1);
}

#[test]
fn markup_in_texts_reads_back_as_text() {
    let title = "a<b & \"c\" </svg>";
    let svg = Figure::new(title).to_svg();
    let document = check(&svg);
    let texts: Vec<_> =
        document.descendants().filter(|n| n.has_tag_name("text")).filter_map(|n| n.text()).collect();
    assert_eq!(texts, [title]);
}

#[test]
fn items_of_one_label_share_a_legend_entry() {
    let panel = Panel::new(Axis::new("x"), Axis::new("y"))
        .with(Line::new(vec![(0.0, 0.0), (1.0, 1.0)], palette::BLUE).label("110 krpm"))
        .with(Scatter::new(vec![(0.0, 0.0)], palette::BLUE).label("110 krpm"));
    let svg = Figure::new("").panel(panel).to_svg();
    assert_eq!(
        check(&svg).descendants().filter(|n| n.text() == Some("110 krpm") && n.has_tag_name("text")).count(),
        1
    );
}

#[test]
fn of_two_texts_at_one_line_end_the_earlier_stays() {
    let line = |y: f64, text: &str| {
        Line::new(vec![(0.0, y), (1.0, y)], palette::BLUE).end_label(text, LineEnd::Last)
    };
    let panel = Panel::new(Axis::new("x"), Axis::new("y"))
        .with(line(1.0, "100 krpm"))
        .with(line(1.0001, "101 krpm"))
        .with(line(2.0, "200 krpm"));
    let svg = Figure::new("").panel(panel).to_svg();
    let shown = |text: &str| check(&svg).descendants().any(|n| n.text() == Some(text));
    assert!(shown("100 krpm") && shown("200 krpm") && !shown("101 krpm"));
}

#[test]
fn an_area_s_legend_has_the_shade_of_the_picture() {
    let area =
        |x: f64| Polygon::new(vec![(x, 0.0), (x + 1.0, 0.0), (x, 1.0)], palette::GREY).label("extrapolated");
    let panel = Panel::new(Axis::new("x"), Axis::new("y")).with(area(0.0)).with(area(2.0)).with(area(4.0));
    let svg = Figure::new("").panel(panel).to_svg();
    // Three areas and one swatch: a swatch of three would be darker than any of them.
    assert_eq!(check(&svg).descendants().filter(|n| n.attribute("fill-opacity").is_some()).count(), 4);
}

#[test]
fn pixels_show_the_texts_without_fonts_of_the_machine() {
    let bare = Figure::new("").panel(Panel::new(Axis::new(""), Axis::new("")));
    let titled = Figure::new("Compressor map").panel(Panel::new(Axis::new("flow, kg/s"), Axis::new("P2/P1")));
    let (bare, titled) = (bare.to_png(1.0).unwrap(), titled.to_png(1.0).unwrap());
    assert!(titled.starts_with(b"\x89PNG\r\n\x1a\n"));
    // Letters are what the second picture has more of: some 30 of them, each dozens of bytes.
    assert!(titled.len() > bare.len() + 1000, "{} {}", titled.len(), bare.len());
    assert!(Figure::new("x").to_png(f32::NAN).is_err());
    assert!(Figure::new("x").to_png(1e6).is_err());
}
