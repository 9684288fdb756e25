//! T2 of a log without steps compared with its prediction, and the efficiency behind it.

use mapper_chart::{Axis, Dash, Figure, Line, Panel, Polygon, Rule, RuleAt, Scatter, ScatterPoint, palette};
use mapper_diagnose::driven::{DrivenOutcome, Trace};

/// Two panels over time: measured T2 and its prediction with interval; apparent and isentropic efficiency.
pub fn transient_figure(name: &str, outcome: &DrivenOutcome) -> Figure {
    let trace = &outcome.trace;
    let split = outcome.held_out.map(|held_out| held_out.from_s);
    let rule = |panel: &mut Panel| {
        if let Some(at_s) = split {
            panel.add(Rule {
                dash: Dash::Dashed,
                ..Rule::new(RuleAt::X(at_s)).label("predicted from here on")
            });
        }
    };
    let over = |values: &[f64], shift: f64, factor: f64| -> Vec<(f64, f64)> {
        trace.t_s.iter().zip(values).map(|(t_s, value)| (*t_s, factor * (value - shift))).collect()
    };
    let mut t2 =
        Panel::new(Axis::new("time, s"), Axis::new("T2, degC")).title("(a) compressor outlet temperature");
    t2.add(Polygon::new(band(trace), palette::BLUE).label("predicted, 95 %"));
    t2.add(Line::new(over(&trace.predicted_k, 273.15, 1.0), palette::BLUE).label("predicted, mean"));
    t2.add(dots(over(&trace.read_k, 273.15, 1.0)).label("read"));
    rule(&mut t2);
    let mut eta = Panel::new(Axis::new("time, s"), Axis::new("efficiency, %"))
        .title("(b) apparent and isentropic efficiency");
    eta.add(dots(over(&trace.apparent_efficiency, 0.0, 100.0)).label("apparent, from the readings"));
    eta.add(Line::new(over(&trace.efficiency, 0.0, 100.0), palette::BLUE).label("isentropic, found"));
    rule(&mut eta);
    Figure::new(format!("Compressor side of {name}, driven by its measured neighbours"))
        .subtitle("Nothing of T2 behind the dashed line was looked at; speed, flow, P1, P2 and T1 drive throughout.")
        .panel(t2)
        .panel(eta)
        .columns(2)
        .panel_size_px(520.0, 380.0)
}

fn dots(points: Vec<(f64, f64)>) -> Scatter {
    let points: Vec<ScatterPoint> =
        points.into_iter().map(|(x, y)| ScatterPoint { x, y, x_interval: None, y_interval: None }).collect();
    Scatter::new(points, palette::INK).size_px(2.0)
}

fn band(trace: &Trace) -> Vec<(f64, f64)> {
    let upper = trace.t_s.iter().zip(&trace.high_k);
    let lower = trace.t_s.iter().zip(&trace.low_k).rev();
    upper.chain(lower).map(|(t_s, k)| (*t_s, k - 273.15)).collect()
}
