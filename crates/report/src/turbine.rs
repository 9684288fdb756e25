//! The turbine of a compressor test: sentence, table and picture.

use crate::document::{Cell, Document, Table};
use crate::formatting::{Message, number, percent};
use crate::pictures::add_by_verdict;
use mapper_chart::{Axis, Figure, Line, LineEnd, Panel, ScatterPoint, palette};
use mapper_core::{
    FittedTurbine, FittedTurbineLine, Margins, TurbineDoubt, TurbineMap, TurbinePoint, Verdict,
    half_width_95, one_line, step_number,
};
use mapper_maps::turbine_points_by_line;
use mapper_numerics::statistics::{median, range};
use mapper_recording::score::ScoredTurbinePoint;

/// What the efficiency of a turbine is.
const DEFINITION: &str = "The efficiency is turbine times mechanical efficiency, total to static (SAE J1826): the power of compressor and shaft over the \
     isentropic power of the gas from T3', which is T3 less the heat to the turbine housing before the wheel. Bearing friction is a loss in it: \
     separating the two takes the oil's flow and outlet temperature (m_oil, T_oil_out).";

pub(crate) fn turbine_section(points: &[ScoredTurbinePoint], map: Option<&TurbineMap>) -> Document {
    let mut document = Document::default();
    if points.is_empty() {
        return document;
    }
    document.text(summary_sentence(points).unwrap_or_default());
    document.text(DEFINITION);
    let figure = |panel| Figure::new("").columns(1).panel_size_px(430.0, 320.0).panel(panel);
    let caption = "Points with their 95 % intervals; lines: the fitted map, with N/sqrt(T3) in rpm/K^0.5";
    document.figures(caption, panels(points, map).map(figure).into());
    let heads = [
        "step",
        "N/sqrt(T3)",
        "P3/P4",
        "+/-",
        "flow",
        "+/- %",
        "u/c0",
        "eta_t eta_m %",
        "+/-",
        "heat W",
        "+/-",
        "T3' K",
        "verdict",
    ];
    let mut table = Table::new(heads).caption("rpm/K^0.5, flow in kg K^0.5/(s kPa)");
    let unordered: Vec<&TurbinePoint> = points.iter().map(|scored| &scored.point).collect();
    let rounded =
        |value: f64, decimals: usize| Cell::optional(Some(value), |value| number(Some(value), decimals));
    for point in turbine_points_by_line(&unordered) {
        let flow = point.flow_parameter_kg_sqrt_k_s_kpa;
        let margins = point.efficiency.zip(point.efficiency_low.zip(point.efficiency_high));
        let margins = margins.map(|(value, (low, high))| Margins::new(value, low, high).scaled(100.0));
        table.row_of_step(
            Some(point.step),
            vec![
                Cell::number(step_number(point.step).to_string(), point.step as f64),
                rounded(point.speed_parameter_rpm_sqrt_k, 0),
                rounded(point.expansion_ratio, 4),
                rounded(half_width_95(point.expansion_ratio_standard_error), 4),
                rounded(flow, 5),
                rounded(50.0 * (point.flow_high - point.flow_low) / flow, 2),
                rounded(point.blade_speed_ratio, 3),
                Cell::optional(point.efficiency, |value| percent(Some(value), 2)),
                Cell::margins(margins, 2),
                rounded(point.heat_w, 0),
                rounded(half_width_95(point.heat_standard_error_w), 0),
                rounded(point.t3_prime_k, 1),
                Cell::verdict(point.verdict),
            ],
        );
    }
    document.table(table);
    for doubt in TurbineDoubt::ALL {
        let count = points.iter().filter(|scored| scored.point.doubts.contains(&doubt)).count();
        if count > 0 {
            document.text(format!("{count} of {} points: {}.", points.len(), doubt.message()));
        }
    }
    document
}

pub(crate) fn summary_sentence(points: &[ScoredTurbinePoint]) -> Option<String> {
    let known = || points.iter().filter(|scored| scored.point.verdict != Verdict::Unusable);
    let etas: Vec<f64> = known().filter_map(|scored| scored.point.efficiency).collect();
    let half = |scored: &ScoredTurbinePoint| {
        Some(0.5 * (scored.point.efficiency_high? - scored.point.efficiency_low?))
    };
    let middle = median(known().filter_map(half))?;
    let (low, high) = range(etas.iter().copied());
    let good = points.iter().filter(|scored| scored.point.verdict == Verdict::Good).count();
    Some(format!(
        "Turbine: {good} of {} points are good; turbine times mechanical efficiency {} to {} %, median 95 % interval +/- {} points.",
        points.len(),
        percent(Some(low), 1),
        percent(Some(high), 1),
        percent(Some(middle), 2)
    ))
}

/// Flow parameter over expansion ratio and efficiency over blade-speed ratio: points with their intervals, and the fitted lines.
pub fn turbine_figure(machine: &str, points: &[ScoredTurbinePoint], map: Option<&TurbineMap>) -> Figure {
    let name =
        if machine.is_empty() { "Turbine".to_owned() } else { format!("Turbine of {}", one_line(machine)) };
    let [flow, eta] = panels(points, map);
    Figure::new(name)
        .subtitle("Points with their 95 % intervals; lines: the fitted map, with N/sqrt(T3) in rpm/K^0.5.")
        .panel(flow)
        .panel(eta)
        .panel_size_px(430.0, 320.0)
}

fn panels(points: &[ScoredTurbinePoint], map: Option<&TurbineMap>) -> [Panel; 2] {
    let known =
        || points.iter().map(|scored| &scored.point).filter(|point| point.verdict != Verdict::Unusable);
    let flows: Vec<(Verdict, ScatterPoint)> = known()
        .map(|point| {
            let half = half_width_95(point.expansion_ratio_standard_error);
            let scatter = ScatterPoint {
                x: point.expansion_ratio,
                y: point.flow_parameter_kg_sqrt_k_s_kpa,
                x_interval: Some((point.expansion_ratio - half, point.expansion_ratio + half)),
                y_interval: Some((point.flow_low, point.flow_high)),
            };
            (point.verdict, scatter)
        })
        .collect();
    let etas: Vec<(Verdict, ScatterPoint)> = known()
        .filter_map(|point| {
            let scaled = |value: f64| 100.0 * value;
            let y_interval = point.efficiency_low.map(scaled).zip(point.efficiency_high.map(scaled));
            let y = scaled(point.efficiency?);
            Some((
                point.verdict,
                ScatterPoint { x: point.blade_speed_ratio, y, x_interval: None, y_interval },
            ))
        })
        .collect();
    let mut flow =
        Panel::new(Axis::new("expansion ratio P3/P4, total to static"), Axis::new("flow, kg K^0.5/(s kPa)"));
    let mut eta = Panel::new(Axis::new("blade-speed ratio u/c0"), Axis::new("eta_t eta_m, %"));
    let lines =
        map.and_then(|map| map.fitted.as_ref()).map_or(&[][..], |fitted: &FittedTurbine| &fitted.lines);
    for line in lines {
        let nodes = || line.nodes.iter().filter(|node| !node.extrapolated);
        let curve = nodes().map(|node| (node.expansion_ratio, node.flow_parameter_kg_sqrt_k_s_kpa)).collect();
        flow.add(Line::new(curve, palette::GREY).width_px(1.2).end_label(line_name(line), LineEnd::Last));
    }
    add_by_verdict(&mut flow, &flows);
    add_by_verdict(&mut eta, &etas);
    [flow, eta]
}

fn line_name(line: &FittedTurbineLine) -> String {
    format!("{:.0}", line.speed_parameter_rpm_sqrt_k)
}

impl Message for TurbineDoubt {
    fn message(&self) -> String {
        match self {
            TurbineDoubt::CompressorPoint => {
                "the compressor's point is not good, and its power is the turbine's".to_owned()
            }
            TurbineDoubt::ApparentEfficiency => {
                "the compressor's efficiency is apparent: heat to its housing counts as power, and no interval contains it".to_owned()
            }
            TurbineDoubt::Impossible => {
                "the efficiency is not between 0 and 100 %; check flow and pressures of the turbine".to_owned()
            }
            TurbineDoubt::WideInterval => {
                "the interval of the efficiency is too wide; the uncertainty budget in points.json names the sensor".to_owned()
            }
        }
    }
}
