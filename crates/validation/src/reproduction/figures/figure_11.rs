//! Figure 11 (b): the heat-transfer coefficient when the gas heats the housing and when the housing heats the gas.

use crate::reproduction::lab::{
    Outcome, RUN_S, Run, WINDOW, dynamic_config, extremes, fixed, identify_run, range, run_all,
    truth_in_window,
};
use crate::reproduction::picture::{h_pair, h_panel};
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Axis, Figure, Marker, Panel, Scatter, palette};
use mapper_physics::simulation::model::Model;

/// Factor of h when the housing heats the gas. The paper does not print its second correlation.
const HOT_METAL_RATIO: f64 = 0.65;

/// An identified jump, and the share of the window in which the housing is hotter than the gas after the wheel.
struct Case {
    outcome: Outcome,
    cooling_ratio: f64,
    flow_kg_s: f64,
}

impl Case {
    fn is_cooling(&self) -> bool {
        self.cooling_ratio > 0.5
    }
}

fn case(run: &Run) -> Result<Case, ReproduceError> {
    let window = truth_in_window(run, &WINDOW);
    let cooling = window.iter().filter(|truth| truth.heats_gas).count();
    let flow_kg_s = window.last().ok_or(ReproduceError::NoStep)?.flow_kg_s;
    let cooling_ratio = cooling as f64 / window.len() as f64;
    Ok(Case { outcome: identify_run(run, &dynamic_config(0.0))?, cooling_ratio, flow_kg_s })
}

pub(crate) fn figure() -> Result<FigureResult, ReproduceError> {
    let mut machine = Model::nominal();
    machine.params.compressor.hot_metal_h_ratio = HOT_METAL_RATIO;
    let cases = run_all(&machine, RUN_S)?.iter().map(case).collect::<Result<Vec<Case>, _>>()?;
    let errors = |cooling: bool| {
        let selected = cases.iter().filter(move |case| case.is_cooling() == cooling);
        extremes(selected.map(|case| case.outcome.h_error_percent()))
    };
    let (heating, cooling) = (errors(false), errors(true));
    let size = |range: Option<(f64, f64)>| range.map_or(f64::NAN, |(low, high)| low.abs().max(high.abs()));
    let cooled = cases.iter().filter(|case| case.is_cooling()).count();
    let statements = vec![
        Statement::new(
            "The coefficients form two clusters, by the direction of the heat between housing and gas.",
            format!(
                "The machine has {HOT_METAL_RATIO} of the law's h where the housing is hotter than the gas: in most of the window at {cooled} of {} \
                 points, all of them at low speed after a high one.",
                cases.len()
            ),
            Verdict::holds_if(cooled > 0 && cooled < cases.len()),
        ),
        Statement::new(
            "The dynamic identification gives reasonable estimates where the gas heats the housing.",
            format!("h {} % off.", range(heating, 0)),
            Verdict::holds_if(size(heating) < 15.0),
        ),
        Statement::new(
            "It fails to capture the correlation where the housing heats the gas.",
            format!("h {} % off.", range(cooling, 0)),
            match size(cooling) {
                size if size > 30.0 => Verdict::Holds,
                size if size > 15.0 => Verdict::Partly,
                _ => Verdict::Differs,
            },
        ),
    ];
    let mut table = Table::new([
        "jump, krpm",
        "opening",
        "flow, kg/s",
        "housing hotter than gas, % of the window",
        "model h",
        "identified h",
        "h error, %",
    ]);
    for case in &cases {
        let outcome = &case.outcome;
        table.row([
            outcome.jump.name(),
            fixed(outcome.jump.opening, 2),
            fixed(case.flow_kg_s, 4),
            fixed(100.0 * case.cooling_ratio, 0),
            fixed(outcome.h_mean_w_m2k, 0),
            fixed(outcome.point.h_w_m2k.unwrap_or(f64::NAN), 0),
            fixed(outcome.h_error_percent().unwrap_or(f64::NAN), 0),
        ]);
    }
    Ok(FigureResult {
        number: "11".to_owned(),
        title: "heat-transfer coefficient by the direction of the heat".to_owned(),
        method: "Part (b) alone: the paper's part (a) is from its rig. The jumps of figure 6 on a machine whose h is smaller where the housing is \
                 hotter than the gas; the paper does not print its second correlation. Model h: mean in the window, with that factor."
            .to_owned(),
        statements,
        table,
        svg: picture(&cases),
    })
}

fn picture(cases: &[Case]) -> String {
    let groups = [
        (false, palette::BLUE, Marker::Circle, "gas heats housing"),
        (true, palette::ORANGE, Marker::Triangle, "housing heats gas"),
    ];
    let selected = |cooling: bool| cases.iter().filter(move |case| case.is_cooling() == cooling);
    let mut over_flow =
        Panel::new(Axis::new("flow, kg/s").from(0.0), Axis::new("h, W/(m2 K)")).title("(a) h over the flow");
    for (cooling, colour, marker, label) in groups {
        let model = selected(cooling).map(|case| (case.flow_kg_s, case.outcome.h_mean_w_m2k)).collect();
        let points = selected(cooling)
            .filter_map(|case| Some((case.flow_kg_s, case.outcome.point.h_w_m2k?)))
            .collect();
        over_flow.add(Scatter::new(model, colour).marker(marker).label(format!("{label}: model")));
        over_flow
            .add(Scatter::new(points, colour).marker(marker).label(format!("{label}: identified")).hollow());
    }
    let series = groups.map(|(cooling, colour, marker, label)| {
        (
            selected(cooling).filter_map(|case| h_pair(&case.outcome)).collect(),
            colour,
            marker,
            true,
            label.to_owned(),
        )
    });
    Figure::new("Figure 11 (b): heat-transfer coefficient by the direction of the heat")
        .subtitle("model values: mean in the window")
        .panel(over_flow)
        .panel(h_panel(series.to_vec()))
        .to_svg()
}
