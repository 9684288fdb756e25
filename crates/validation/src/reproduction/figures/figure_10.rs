//! Figure 10: heat from the turbine, varied by the oil's cooling.

use crate::reproduction::lab::{
    JUMPS, Outcome, RUN_S, Run, dynamic_config, extremes, fixed, identify_runs, range, rms, run_all, worst,
};
use crate::reproduction::picture::{
    efficiency_pair, efficiency_panel, h_pair, h_panel, series_by_case, span_at_speed,
};
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Figure, Marker};
use mapper_core::Channel;
use mapper_physics::simulation::model::Model;

/// Oil conductance over the nominal one.
const OIL_SCALES: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

struct Case {
    oil_scale: f64,
    outcomes: Vec<Outcome>,
    tc_end_k: Vec<f64>,
}

fn tc_end_k(run: &Run) -> Option<f64> {
    run.recording.series.get(&Channel::Tc)?.values.last().copied()
}

fn cases() -> Result<Vec<Case>, ReproduceError> {
    OIL_SCALES
        .into_iter()
        .map(|oil_scale| {
            let mut machine = Model::nominal();
            machine.params.bearing.oil_conductance_w_k *= oil_scale;
            let runs = run_all(&machine, RUN_S)?;
            let tc_end_k = runs.iter().filter_map(tc_end_k).collect();
            Ok(Case { oil_scale, outcomes: identify_runs(&runs, &dynamic_config(0.0))?, tc_end_k })
        })
        .collect()
}

pub(crate) fn figure() -> Result<FigureResult, ReproduceError> {
    let cases = cases()?;
    let worst_of = |case: &Case| worst(case.outcomes.iter().map(Outcome::eta_error_points));
    let rms_of = |case: &Case| rms(case.outcomes.iter().map(Outcome::eta_error_points));
    let worst_range = extremes(cases.iter().map(|case| Some(worst_of(case))));
    let rms_range = extremes(cases.iter().map(rms_of));
    // The influence of the oil on the housing temperature, at the first opening of the first jump.
    let tc_range = extremes(cases.iter().map(|case| case.tc_end_k.first().map(|tc| tc - 273.15)));
    let statements = vec![Statement::new(
        "At five levels of heat from the turbine the accuracy of the identified efficiency is similar.",
        format!(
            "rms {} points, worst {} points, over the five levels; the housing (110 to 50 krpm, opening 0.5) ends at {} degC.",
            range(rms_range, 2).replace('+', ""),
            range(worst_range, 2).replace('+', ""),
            range(tc_range, 0).replace('+', "")
        ),
        Verdict::holds_if(
            rms_range.is_some_and(|(low, high)| high - low < 0.5) && worst_range.is_some_and(|r| r.1 < 2.0),
        ),
    )];
    let mut table = Table::new([
        "oil conductance over nominal",
        "jump, krpm",
        "efficiency error, points",
        "against the end, points",
        "h error, %",
    ]);
    for case in &cases {
        for (from_rpm, to_rpm) in JUMPS {
            let span = |value: fn(&Outcome) -> Option<f64>, decimals| {
                span_at_speed(&case.outcomes, to_rpm, value, decimals)
            };
            table.row([
                fixed(case.oil_scale, 2),
                format!("{:.0} to {:.0}", from_rpm / 1e3, to_rpm / 1e3),
                span(Outcome::eta_error_points, 2),
                span(Outcome::eta_end_error_points, 2),
                span(Outcome::h_error_percent, 1),
            ]);
        }
    }
    let markers = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond, Marker::Cross];
    let series = |value: fn(&Outcome) -> Option<(f64, f64)>| {
        let all = cases.iter().map(|case| (&case.outcomes, format!("oil conductance x {}", case.oil_scale)));
        series_by_case(all, markers, |_| true, value)
    };
    let svg = Figure::new("Figure 10: heat from the turbine, varied by the oil's cooling")
        .subtitle("model values: mean in the window")
        .panel(efficiency_panel(series(efficiency_pair)))
        .panel(h_panel(series(h_pair)))
        .to_svg();
    Ok(FigureResult {
        number: "10".to_owned(),
        title: "heat from the turbine".to_owned(),
        method: "The jumps of figure 6 on machines whose conductance from bearing housing to oil is scaled. P3 is the \
                 nominal machine's. Ranges run over the valve openings."
            .to_owned(),
        statements,
        table,
        svg,
    })
}
