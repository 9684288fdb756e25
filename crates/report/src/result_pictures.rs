//! Further pictures of the results: h over flow, and error of efficiency over the change of T2.

use mapper_chart::{Axis, Dash, Figure, Line, Marker, Panel, Rule, RuleAt, Scatter, ScatterPoint, palette};
use mapper_core::{IdentifiedPoint, Verdict};
use mapper_recording::score::ScoredPoint;

/// h of every point over flow with its interval, and the law `h ~ flow^exponent` through the good points' median.
pub fn heat_transfer_figure(machine: &str, points: &[IdentifiedPoint], exponent: f64) -> Figure {
    let mut panel = Panel::new(Axis::new("mass flow, kg/s"), Axis::new("h, W/(m2 K)"));
    let known = || points.iter().filter(|p| p.verdict != Verdict::Unusable && p.flow_kg_s > 0.0);
    let mut factors: Vec<f64> = known()
        .filter(|p| p.verdict == Verdict::Good)
        .filter_map(|p| Some(p.h_w_m2k? / p.flow_kg_s.powf(exponent)))
        .filter(|factor| factor.is_finite())
        .collect();
    factors.sort_by(f64::total_cmp);
    let flows = || known().map(|p| p.flow_kg_s);
    let (low, high) = flows().fold((f64::INFINITY, 0.0f64), |r, v| (r.0.min(v), r.1.max(v)));
    if let Some(factor) = factors.get(factors.len() / 2) {
        let law = (0..=60)
            .map(|i| low + (high - low) * f64::from(i) / 60.0)
            .map(|flow| (flow, factor * flow.powf(exponent)))
            .collect();
        panel.add(Line::new(law, palette::INK).label(format!("law, flow to the power of {exponent:.3}")));
    }
    let shown = known().filter_map(|p| {
        let y_interval = p.h_low_w_m2k.zip(p.h_high_w_m2k);
        Some((p.verdict, ScatterPoint { x: p.flow_kg_s, y: p.h_w_m2k?, x_interval: None, y_interval }))
    });
    add_by_verdict(&mut panel, &shown.collect::<Vec<_>>());
    figure_of(panel, format!("Heat transfer between gas and compressor housing of {}", named(machine)))
        .subtitle("Points with their 95 % intervals; the law goes through the good points' median.")
}

/// Error of efficiency over the change of T2, as in figure 12 of the paper, for simulated runs, whose truth is known; `None` without truth.
pub fn error_figure(machine: &str, points: &[ScoredPoint]) -> Option<Figure> {
    let errors: Vec<(Verdict, ScatterPoint)> = points
        .iter()
        .filter_map(|ScoredPoint { point, truth }| {
            let y = 100.0 * (point.eta? - truth.as_ref()?.eta);
            let half = point.eta_low.zip(point.eta_high).map(|(low, high)| 100.0 * (0.5 * (high - low)));
            let y_interval = half.map(|half| (y - half, y + half));
            Some((point.verdict, ScatterPoint { x: point.dt2_k?, y, x_interval: None, y_interval }))
        })
        .collect();
    if errors.is_empty() {
        return None;
    }
    let mut panel =
        Panel::new(Axis::new("change of T2 in the window, K"), Axis::new("error of efficiency, points"))
            .with(Rule::new(RuleAt::Y(0.0)));
    for at in [-1.0, 1.0] {
        panel.add(Rule { dash: Dash::Dotted, ..Rule::new(RuleAt::Y(at)).label("1 point") });
    }
    add_by_verdict(&mut panel, &errors);
    Some(figure_of(panel, format!("Error of efficiency over the change of T2, {}", named(machine)))
        .subtitle("Against the simulator's truth; bars are the 95 % intervals that the identification gives, cut at the frame."))
}

/// Adds the good and the doubtful points to a panel.
fn add_by_verdict(panel: &mut Panel, points: &[(Verdict, ScatterPoint)]) {
    for (verdict, colour, marker, name) in [
        (Verdict::Good, palette::BLUE, Marker::Circle, "good"),
        (Verdict::Doubtful, palette::VERMILLION, Marker::Diamond, "doubtful"),
    ] {
        let members: Vec<ScatterPoint> =
            points.iter().filter(|(of_point, _)| *of_point == verdict).map(|(_, point)| *point).collect();
        if !members.is_empty() {
            panel.add(Scatter::new(members, colour).marker(marker).label(name));
        }
    }
}

fn named(machine: &str) -> &str {
    if machine.is_empty() { "unnamed machine" } else { machine }
}

fn figure_of(panel: Panel, title: String) -> Figure {
    Figure::new(title).panel(panel).columns(1).panel_size_px(640.0, 420.0)
}
