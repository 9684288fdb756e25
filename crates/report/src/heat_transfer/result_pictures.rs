//! Further pictures of the results: h over flow, and error of efficiency over the change of T2.

use mapper_chart::{Axis, Dash, Figure, Line, Marker, Panel, Rule, RuleAt, Scatter, ScatterPoint, palette};
use mapper_core::{IdentifiedPoint, Verdict};

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
    for (verdict, colour, marker, name) in CLASSES {
        let members: Vec<ScatterPoint> = known()
            .filter(|p| p.verdict == verdict)
            .filter_map(|p| {
                let y_interval = p.h_low_w_m2k.zip(p.h_high_w_m2k);
                Some(ScatterPoint { x: p.flow_kg_s, y: p.h_w_m2k?, x_interval: None, y_interval })
            })
            .collect();
        if !members.is_empty() {
            panel.add(Scatter::new(members, colour).marker(marker).label(name));
        }
    }
    let machine = if machine.is_empty() { "unnamed machine" } else { machine };
    Figure::new(format!("Heat transfer between gas and compressor housing of {machine}"))
        .subtitle("Points with their 95 % intervals; the law goes through the good points' median.")
        .panel(panel)
        .columns(1)
        .panel_size_px(640.0, 420.0)
}

/// A point's error of efficiency relative to the true value, as in figure 12 of the paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorAtGradient {
    /// Change of T2 over the window, K.
    pub dt2_k: f64,
    /// Identified minus true efficiency, fraction.
    pub eta_error: f64,
    /// Half width of the point's 95 % interval, fraction.
    pub eta_half_interval: Option<f64>,
    /// Verdict of the point.
    pub verdict: Verdict,
}

/// Error of efficiency over the change of T2 (figure 12), for simulated runs, whose truth is known.
pub fn error_figure(machine: &str, errors: &[ErrorAtGradient]) -> Figure {
    let mut panel =
        Panel::new(Axis::new("change of T2 in the window, K"), Axis::new("error of efficiency, points"))
            .with(Rule::new(RuleAt::Y(0.0)));
    for at in [-1.0, 1.0] {
        panel.add(Rule { dash: Dash::Dotted, ..Rule::new(RuleAt::Y(at)).label("1 point") });
    }
    for (verdict, colour, marker, name) in CLASSES {
        let members: Vec<ScatterPoint> = errors
            .iter()
            .filter(|e| e.verdict == verdict)
            .map(|e| {
                let y = 100.0 * e.eta_error;
                let y_interval = e.eta_half_interval.map(|half| (y - 100.0 * half, y + 100.0 * half));
                ScatterPoint { x: e.dt2_k, y, x_interval: None, y_interval }
            })
            .collect();
        if !members.is_empty() {
            panel.add(Scatter::new(members, colour).marker(marker).label(name));
        }
    }
    let machine = if machine.is_empty() { "unnamed machine" } else { machine };
    Figure::new(format!("Error of efficiency over the change of T2, {machine}"))
        .subtitle("Against the simulator's truth; bars are the 95 % intervals that the identification gives, cut at the frame.")
        .panel(panel)
        .columns(1)
        .panel_size_px(640.0, 420.0)
}

const CLASSES: [(Verdict, palette::Colour, Marker, &str); 2] = [
    (Verdict::Good, palette::BLUE, Marker::Circle, "good"),
    (Verdict::Doubtful, palette::VERMILLION, Marker::Diamond, "doubtful"),
];
