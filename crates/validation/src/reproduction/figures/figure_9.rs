//! Figure 9: thermocouples of several diameters at the compressor outlet.

use crate::reproduction::lab::{
    JUMPS, Outcome, RUN_S, WINDOW, dynamic_config, extremes, fixed, identify_runs, range, run_all,
    truth_in_window, worst,
};
use crate::reproduction::picture::{
    at_speed, efficiency_pair, efficiency_panel, h_pair, h_panel, krpm, series_by_case, span_at_speed,
    speed_colour, target_speeds_rpm,
};
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Axis, Figure, Line, Marker, Panel, Rule, RuleAt};
use mapper_core::Verdict as PointVerdict;
use mapper_physics::simulation::model::Model;

const DIAMETERS_MM: [f64; 5] = [0.0, 0.25, 0.5, 1.5, 3.0];

struct Case {
    diameter_mm: f64,
    outcomes: Vec<Outcome>,
    time_constants_s: Option<(f64, f64)>,
}

fn cases() -> Result<Vec<Case>, ReproduceError> {
    DIAMETERS_MM
        .into_iter()
        .map(|diameter_mm| {
            let mut machine = Model::nominal();
            machine.params.t2_probe_diameter_m = diameter_mm * 1e-3;
            let runs = run_all(&machine, RUN_S)?;
            let taus = runs.iter().flat_map(|run| truth_in_window(run, &WINDOW).iter());
            let time_constants_s = extremes(taus.map(|truth| Some(truth.probe_time_constant_s)));
            Ok(Case { diameter_mm, outcomes: identify_runs(&runs, &dynamic_config(0.0))?, time_constants_s })
        })
        .collect()
}

pub(crate) fn figure() -> Result<FigureResult, ReproduceError> {
    let cases = cases()?;
    let small = || cases.iter().filter(|case| case.diameter_mm > 0.0 && case.diameter_mm <= 1.5);
    let worst_at = |diameter_mm: f64| {
        let case = cases.iter().find(|case| case.diameter_mm == diameter_mm);
        case.map_or(f64::NAN, |case| worst(case.outcomes.iter().map(Outcome::eta_error_points)))
    };
    let nothing = Vec::new();
    let thick = cases.iter().find(|case| case.diameter_mm == 3.0);
    let thick_outcomes = thick.map_or(&nothing, |case| &case.outcomes);
    let slow: Vec<&Outcome> = at_speed(thick_outcomes, 50e3).collect();
    let slow_failed = slow.iter().filter(|o| o.point.eta.is_none()).count();
    let slow_bad =
        slow.iter().filter(|o| o.point.eta.is_some() && o.point.verdict != PointVerdict::Good).count();
    let slow_range = extremes(slow.iter().map(|o| o.eta_error_points()));
    let fast = thick_outcomes.iter().filter(|o| o.jump.to_rpm > 50e3);
    let fast_range = extremes(fast.map(Outcome::eta_error_points));
    let h_small = extremes(small().flat_map(|case| case.outcomes.iter().map(Outcome::h_error_percent)));
    let h_thick = extremes(thick_outcomes.iter().map(Outcome::h_error_percent));
    let tau = thick.and_then(|case| case.time_constants_s);
    let is_largest_in = |range_s: std::ops::Range<f64>| tau.is_some_and(|(_, high)| range_s.contains(&high));
    let statements = vec![
        Statement::new(
            "Thermocouples of 0.5 and 1.5 mm: the efficiency is within 1 point.",
            format!(
                "Worst {} points with 0.5 mm, {} with 1.5 mm; {} with 0.25 mm and {} with an ideal probe.",
                fixed(worst_at(0.5), 2),
                fixed(worst_at(1.5), 2),
                fixed(worst_at(0.25), 2),
                fixed(worst_at(0.0), 2)
            ),
            Verdict::holds_if(worst_at(0.5) <= 1.0 && worst_at(1.5) <= 1.0),
        ),
        Statement::new(
            "3 mm at 50 krpm: the efficiency cannot be identified.",
            format!(
                "{} points off from near choke to near surge; {slow_failed} of {} fits failed, {slow_bad} are called unusable or doubtful, the others good.",
                range(slow_range, 1),
                slow.len()
            ),
            Verdict::of(slow_failed == slow.len(), slow_failed + slow_bad > 0),
        ),
        Statement::new(
            "3 mm: much larger errors, over 10 points, especially at low speed.",
            format!(
                "{} points at 90 to 150 krpm, {} at 50 krpm.",
                range(fast_range, 1),
                range(slow_range, 1)
            ),
            Verdict::holds_if(slow_range.is_some_and(|(_, high)| high > 10.0)),
        ),
        Statement::new(
            "Similar observations are made for the heat-transfer coefficient.",
            format!("h {} % for 0.25 to 1.5 mm, {} % for 3 mm.", range(h_small, 0), range(h_thick, 0)),
            Verdict::holds_if(worst([h_thick.map(|r| r.0), h_thick.map(|r| r.1)]) > 30.0),
        ),
        Statement::new(
            "Time constants can be as large as 10 s for a 3 mm thermocouple (section 4.1).",
            format!("{} s for 3 mm over these runs.", range(tau, 1).replace('+', "")),
            Verdict::of(is_largest_in(9.0..12.0), is_largest_in(5.0..20.0)),
        ),
    ];
    let mut table = Table::new([
        "diameter, mm",
        "jump, krpm",
        "efficiency error, points",
        "against the end, points",
        "h error, %",
        "failed",
    ]);
    for case in &cases {
        for (from_rpm, to_rpm) in JUMPS {
            let span = |value: fn(&Outcome) -> Option<f64>, decimals| {
                span_at_speed(&case.outcomes, to_rpm, value, decimals)
            };
            let failed = at_speed(&case.outcomes, to_rpm).filter(|o| o.point.eta.is_none()).count();
            table.row([
                fixed(case.diameter_mm, 2),
                format!("{:.0} to {:.0}", from_rpm / 1e3, to_rpm / 1e3),
                span(Outcome::eta_error_points, 2),
                span(Outcome::eta_end_error_points, 2),
                span(Outcome::h_error_percent, 1),
                failed.to_string(),
            ]);
        }
    }
    Ok(FigureResult {
        number: "9".to_owned(),
        title: "thermocouple diameter at the compressor outlet".to_owned(),
        method: "The jumps of figure 6 with T2 read by probes of several diameters (eqs. 11 and 12); 0 mm is an ideal \
                 probe. Ranges run over the valve openings. A fit that ends on a bound (h = 0) has failed: no number \
                 is given."
            .to_owned(),
        statements,
        table,
        svg: picture(&cases),
    })
}

fn picture(cases: &[Case]) -> String {
    let markers = [Marker::Circle, Marker::Plus, Marker::Square, Marker::Triangle, Marker::Diamond];
    let series = |value: fn(&Outcome) -> Option<(f64, f64)>| {
        let all = cases.iter().map(|case| (&case.outcomes, format!("{} mm", case.diameter_mm)));
        series_by_case(all, markers, |index| index > 0, value)
    };
    let mut worst_panel = Panel::new(
        Axis::new("probe diameter, mm"),
        Axis::new("efficiency, worst error, points").range(0.0, 12.0),
    )
    .title("(c) worst error over the diameter");
    for speed_rpm in target_speeds_rpm() {
        let line = cases.iter().map(|case| {
            let failed = at_speed(&case.outcomes, speed_rpm).any(|o| o.point.eta.is_none());
            let worst = worst(at_speed(&case.outcomes, speed_rpm).map(Outcome::eta_error_points));
            (case.diameter_mm, if failed { 100.0 } else { worst })
        });
        worst_panel.add(Line::new(line.collect(), speed_colour(speed_rpm)).label(krpm(speed_rpm)));
    }
    worst_panel.add(Rule::new(RuleAt::Y(1.0)).label("1 point"));
    Figure::new("Figure 9: thermocouple diameter at the compressor outlet")
        .columns(3)
        .panel_size_px(400.0, 340.0)
        .subtitle("model values: mean in the window; fits that failed are not shown; (c): 3 mm at 50 krpm is far off the scale")
        .panel(efficiency_panel(series(efficiency_pair)))
        .panel(h_panel(series(h_pair)))
        .panel(worst_panel)
        .to_svg()
}
