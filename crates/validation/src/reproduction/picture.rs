//! Common parts of the pictures.

use crate::reproduction::figure_data;
use crate::reproduction::lab::{JUMPS, Outcome, extremes};
use mapper_chart::{Axis, Colour, Dash, Line, Marker, Panel, Scatter, palette};
use mapper_numerics::statistics::range;

/// Colour of a target speed: ordered, slow to fast.
pub(crate) fn speed_colour(speed_rpm: f64) -> Colour {
    palette::sequential((speed_rpm - 50e3) / 100e3)
}

/// `110 krpm`.
pub(crate) fn krpm(speed_rpm: f64) -> String {
    format!("{:.0} krpm", speed_rpm / 1e3)
}

/// Target speeds of table 1, slow to fast.
pub(crate) fn target_speeds_rpm() -> [f64; 4] {
    let mut speeds = JUMPS.map(|(_, to_rpm)| to_rpm);
    speeds.sort_by(f64::total_cmp);
    speeds
}

/// Points (model, identified) with colour, shape, hollow flag and legend text.
pub(crate) type Series = (Vec<(f64, f64)>, Colour, Marker, bool, String);

/// Identified against model values with the line of equality and, if given, a band of error around it.
fn equality_panel(title: &str, axis: (&str, &str), band: Option<(f64, &str)>, series: Vec<Series>) -> Panel {
    let (low, high) = range(series.iter().flat_map(|(points, ..)| points.iter().map(|(x, _)| *x)));
    let margin = 0.06 * (high - low);
    let ends = [low - margin, high + margin];
    let mut panel = Panel::new(Axis::new(axis.0), Axis::new(axis.1)).title(title);
    panel.add(Line::new(ends.map(|x| (x, x)).to_vec(), palette::INK).width_px(1.0).label("equal"));
    if let Some((by, label)) = band {
        for by in [-by, by] {
            let line = Line::new(ends.map(|x| (x, x + by)).to_vec(), palette::GREY);
            panel.add(line.width_px(1.0).dash(Dash::Dashed).label(label));
        }
    }
    for (points, colour, marker, hollow, label) in series {
        let scatter = Scatter::new(points, colour).marker(marker).label(label);
        panel.add(if hollow { scatter.hollow() } else { scatter });
    }
    panel
}

/// Efficiency in %: model (mean in the window) and identified, for outcomes with a result.
pub(crate) fn efficiency_pair(outcome: &Outcome) -> Option<(f64, f64)> {
    Some((100.0 * outcome.eta_mean, 100.0 * outcome.point.eta?))
}

/// h in W/(m2 K): model (mean in the window) and identified, for outcomes with a result.
pub(crate) fn h_pair(outcome: &Outcome) -> Option<(f64, f64)> {
    Some((outcome.h_mean_w_m2k, outcome.point.h_w_m2k?))
}

/// Efficiency in %, one point of error marked.
pub(crate) fn efficiency_panel(series: Vec<Series>) -> Panel {
    let axis = ("model efficiency, %", "identified efficiency, %");
    equality_panel("(a) efficiency", axis, Some((1.0, "1 point off")), series)
}

/// h in W/(m2 K).
pub(crate) fn h_panel(series: Vec<Series>) -> Panel {
    let axis = ("model h, W/(m2 K)", "identified h, W/(m2 K)");
    equality_panel("(b) heat-transfer coefficient", axis, None, series)
}

/// One series per target speed.
pub(crate) fn series_by_speed(
    outcomes: &[Outcome],
    value: fn(&Outcome) -> Option<(f64, f64)>,
    (marker, is_hollow, name): (Marker, bool, &str),
) -> Vec<Series> {
    let series = |speed_rpm: f64| {
        let points = at_speed(outcomes, speed_rpm).filter_map(value).collect();
        (points, speed_colour(speed_rpm), marker, is_hollow, format!("{name}, {}", krpm(speed_rpm)))
    };
    target_speeds_rpm().map(series).to_vec()
}

/// One series for each of several cases, with its label.
pub(crate) fn series_by_case<'a>(
    cases: impl Iterator<Item = (&'a Vec<Outcome>, String)>,
    markers: [Marker; 5],
    is_hollow: fn(usize) -> bool,
    value: fn(&Outcome) -> Option<(f64, f64)>,
) -> Vec<Series> {
    cases
        .zip(markers)
        .enumerate()
        .map(|(index, ((outcomes, label), marker))| {
            let points = outcomes.iter().filter_map(value).collect();
            (points, palette::categorical(index), marker, is_hollow(index), label)
        })
        .collect()
}

/// Smallest and largest value of the outcomes at one target speed, as text.
pub(crate) fn span_at_speed(
    outcomes: &[Outcome],
    speed_rpm: f64,
    value: fn(&Outcome) -> Option<f64>,
    decimals: usize,
) -> String {
    figure_data::range(extremes(at_speed(outcomes, speed_rpm).map(value)), decimals)
}

/// The outcomes at one target speed.
pub(crate) fn at_speed(outcomes: &[Outcome], speed_rpm: f64) -> impl Iterator<Item = &Outcome> {
    outcomes.iter().filter(move |o| o.jump.to_rpm == speed_rpm)
}
