//! The reliability of the diagnosis' first answer as a picture.

use crate::blind::scoring::reliability::{Bin, Reliability};
use mapper_chart::{Axis, Dash, Figure, Line, Panel, Scatter, ScatterPoint, palette};

/// A panel for each calibration: share of correct first answers over their predicted probability, %.
pub(crate) fn reliability_svg(reliabilities: &[Reliability]) -> String {
    let cases: usize =
        reliabilities.first().map_or(0, |summary| summary.bins.iter().map(|bin| bin.right.trials).sum());
    let mut figure = Figure::new("Reliability of the diagnosis' first answer")
        .subtitle(format!(
            "{cases} diagnoses. Bars: 95 % intervals of the share of correct answers; on the diagonal, the probabilities are correct."
        ))
        .panel_size_px(420.0, 420.0);
    for summary in reliabilities {
        figure = figure.panel(panel(summary));
    }
    figure.to_svg()
}

fn panel(summary: &Reliability) -> Panel {
    let percent = |share: f64| 100.0 * share;
    let error =
        summary.expected_calibration_error.map_or("-".to_owned(), |error| format!("{:.1} %", percent(error)));
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
    .title(format!("calibration {}: error {error}", summary.calibration))
    .with(
        Line::new(vec![(0.0, 0.0), (100.0, 100.0)], palette::GREY)
            .dash(Dash::Dashed)
            .label("correct probabilities"),
    )
    .with(
        Scatter::new(summary.bins.iter().map(point).collect::<Vec<_>>(), palette::BLUE)
            .label("classes of 10 %"),
    )
}
