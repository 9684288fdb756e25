//! The judged quantity of one side of a machine, compared with the model without and with the most probable cause.

use mapper_chart::{Axis, Dash, Figure, Line, Panel, Rule, RuleAt, Scatter, ScatterPoint, palette};
use mapper_diagnose::driven::{Diagnosis, SideVerdict};

/// Two panels over time: the reading with both predictions, and both residuals.
pub fn why_figure(name: &str, diagnosis: &Diagnosis) -> Figure {
    let history = &diagnosis.time_history;
    let channel = diagnosis.judged.first().copied().unwrap_or("");
    let over = |values: &mut dyn Iterator<Item = f64>| -> Vec<(f64, f64)> {
        history.t_s.iter().copied().zip(values).collect()
    };
    let rule = |panel: &mut Panel| {
        if let Some(beyond) = &diagnosis.beyond {
            let at = Rule::new(RuleAt::X(beyond.from_s)).label("predicted from here on");
            panel.add(Rule { dash: Dash::Dashed, ..at });
        }
    };
    let mut readings = Panel::new(Axis::new("time, s"), Axis::new(format!("{channel}, degC")))
        .title(format!("(a) {channel} as read and as predicted"));
    let celsius = |values: &[f64]| over(&mut values.iter().map(|k| k - 273.15));
    readings.add(Line::new(celsius(&history.before_k), palette::INK).label("without a cause"));
    readings.add(Line::new(celsius(&history.after_k), palette::BLUE).label(cause_label(diagnosis)));
    let dot = |(x, y): (f64, f64)| ScatterPoint { x, y, x_interval: None, y_interval: None };
    let dots = celsius(&history.read_k).into_iter().map(dot).collect();
    readings.add(Scatter::new(dots, palette::INK).size_px(2.0).label("read"));
    rule(&mut readings);
    let mut left =
        Panel::new(Axis::new("time, s"), Axis::new("read less predicted, K")).title("(b) residual");
    let off = |predicted: &[f64]| {
        over(&mut history.read_k.iter().zip(predicted).map(|(read, predicted)| read - predicted))
    };
    left.add(Line::new(off(&history.before_k), palette::INK).label("without a cause"));
    left.add(Line::new(off(&history.after_k), palette::BLUE).label(cause_label(diagnosis)));
    rule(&mut left);
    let side = diagnosis.side.name();
    Figure::new(format!("The {side} side of {name}, driven by its measured neighbours"))
        .subtitle(format!("{} drive throughout.", diagnosis.driven_by.join(", ")))
        .panel(readings)
        .panel(left)
        .columns(2)
        .panel_size_px(520.0, 380.0)
}

fn cause_label(diagnosis: &Diagnosis) -> String {
    match (diagnosis.word, diagnosis.causes.first()) {
        (SideVerdict::Named | SideVerdict::NotDistinguished, Some(cause)) => {
            format!("with {}", cause.candidate.names.join(" and "))
        }
        _ => "no cause is named".to_owned(),
    }
}
