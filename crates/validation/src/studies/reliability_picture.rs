//! The reliability of the diagnosis' first answer as a picture.

use crate::blind::scoring::reliability::{Bin, Reliability};
use mapper_chart::{Axis, Dash, Figure, Line, Panel, Scatter, ScatterPoint, palette};

/// A panel for each calibration: how often the first answer is right over the probability that it was given, in %.
pub(crate) fn reliability_svg(reliabilities: &[Reliability]) -> String {
    let cases: usize =
        reliabilities.first().map_or(0, |one| one.bins.iter().map(|bin| bin.right.trials).sum());
    let mut figure = Figure::new("Reliability of the diagnosis' first answer")
        .subtitle(format!(
            "{cases} diagnoses. Bars: 95 % intervals of the share that is right; on the diagonal probabilities hold."
        ))
        .panel_size_px(420.0, 420.0);
    for one in reliabilities {
        figure = figure.panel(panel(one));
    }
    figure.to_svg()
}

fn panel(one: &Reliability) -> Panel {
    let percent = |share: f64| 100.0 * share;
    let error =
        one.expected_calibration_error.map_or("-".to_owned(), |error| format!("{:.1} %", percent(error)));
    let point = |bin: &Bin| ScatterPoint {
        x: percent(bin.said),
        y: percent(bin.right_share),
        x_interval: None,
        y_interval: Some((percent(bin.right_low), percent(bin.right_high))),
    };
    Panel::new(
        Axis::new("probability given, %").range(0.0, 105.0),
        Axis::new("first answer right, %").range(0.0, 105.0),
    )
    .title(format!("calibration {}: error {error}", one.calibration))
    .with(Line::new(vec![(0.0, 0.0), (100.0, 100.0)], palette::GREY).dash(Dash::Dashed).label("it holds"))
    .with(
        Scatter::new(one.bins.iter().map(point).collect::<Vec<_>>(), palette::BLUE).label("classes of 10 %"),
    )
}
