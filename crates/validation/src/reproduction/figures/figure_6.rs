//! Figure 6: the dynamic method against the model's own efficiency and heat-transfer coefficient.

use crate::reproduction::figures::figure_5::apparent_eta;
use crate::reproduction::lab::{
    Outcome, Run, WINDOW, dynamic_config, extremes, fixed, identify_runs, range, rms, settled_at, signed,
    signed_or_dash, truth_in_window, worst,
};
use crate::reproduction::picture::{
    efficiency_pair, efficiency_panel, h_pair, h_panel, series_by_speed, speed_colour, target_speeds_rpm,
};
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Figure, Marker};
use mapper_numerics::statistics::mean;
use mapper_physics::simulation::model::Model;

pub(crate) fn figure(runs: &[Run]) -> Result<FigureResult, ReproduceError> {
    let outcomes = identify_runs(runs, &dynamic_config(0.0))?;
    let steady_hot = outcomes.iter().map(steady_hot).collect::<Result<Vec<_>, _>>()?;
    let eta_worst = worst(outcomes.iter().map(Outcome::eta_error_points));
    let eta_end_worst = worst(outcomes.iter().map(Outcome::eta_end_error_points));
    let within = outcomes.iter().filter(|o| o.eta_error_points().is_some_and(|e| e.abs() < 0.3)).count();
    let h_range = extremes(outcomes.iter().map(Outcome::h_error_percent));
    let (nrmse_range, nrmse_mean) = nrmse_percent(&outcomes);
    let t2_range = extremes(runs.iter().map(|run| {
        let window = truth_in_window(run, &WINDOW);
        extremes(window.iter().map(|t| Some(t.t2_k))).map(|(low, high)| high - low)
    }));
    let drift = |value: fn(&crate::reproduction::lab::Truth) -> f64| {
        extremes(runs.iter().map(|run| {
            let window = truth_in_window(run, &WINDOW);
            let (low, high) = extremes(window.iter().map(|t| Some(value(t))))?;
            Some(100.0 * (high - low) / value(window.last()?))
        }))
    };
    let statements = vec![
        Statement::new(
            "Compressor efficiency is identified to within 1 point.",
            format!(
                "Worst {} points against the mean in the window, {} against its end; {within} of {} below 0.3 points.",
                fixed(eta_worst, 2),
                fixed(eta_end_worst, 2),
                outcomes.len()
            ),
            Verdict::of(eta_end_worst < 1.0, eta_worst < 1.05),
        ),
        Statement::new(
            "Convective heat transfer with a nRMSE of 3.2 % (section 5.1, conclusion 2; the abstract's 1 % is an erratum).",
            format!(
                "nRMSE {} % of the range, {} % of the mean; single points {} %.",
                fixed(nrmse_range, 1),
                fixed(nrmse_mean, 1),
                range(h_range, 1)
            ),
            Verdict::holds_if(nrmse_range < 5.0),
        ),
        Statement::new(
            "Gas temperature varies by up to 26 K over the period of identification (section 3).",
            format!("{} K.", range(t2_range, 1)),
            Verdict::holds_if(t2_range.is_some_and(|(_, high)| (20.0..32.0).contains(&high))),
        ),
        Statement::new(
            "Typical variations of flow, pressure ratio and speed over the period: 0.8 %, 2 %, 1.5 % (section 3).",
            format!(
                "Flow {} %, pressure ratio {} %, speed {} %.",
                range(drift(|t| t.flow_kg_s), 1),
                range(drift(|t| t.pressure_ratio), 1),
                range(drift(|t| t.speed_rpm), 1)
            ),
            Verdict::Partly,
        ),
    ];
    let mut table = Table::new([
        "jump, krpm",
        "opening",
        "model efficiency (mean, end), %",
        "dynamic, %",
        "error (mean, end), points",
        "settled at 500 degC, points",
        "model h (mean, end), W/(m2 K)",
        "dynamic h, W/(m2 K)",
        "error (mean, end), %",
    ]);
    for (o, hot) in outcomes.iter().zip(&steady_hot) {
        table.row([
            o.jump.name().replace(" krpm", ""),
            fixed(o.jump.opening, 1),
            format!("{}, {}", fixed(100.0 * o.eta_mean, 2), fixed(100.0 * o.eta_end, 2)),
            fixed(100.0 * o.point.eta.unwrap_or(f64::NAN), 2),
            format!(
                "{}, {}",
                signed_or_dash(o.eta_error_points(), 2),
                signed_or_dash(o.eta_end_error_points(), 2)
            ),
            signed(100.0 * (hot - o.eta_end), 2),
            format!("{}, {}", fixed(o.h_mean_w_m2k, 0), fixed(o.h_end_w_m2k, 0)),
            fixed(o.point.h_w_m2k.unwrap_or(f64::NAN), 0),
            format!(
                "{}, {}",
                signed_or_dash(o.h_error_percent(), 1),
                signed_or_dash(o.h_end_error_percent(), 1)
            ),
        ]);
    }
    Ok(FigureResult {
        number: "6".to_owned(),
        title: "the dynamic method against the model".to_owned(),
        method: format!(
            "The four jumps of table 1 at {} valve openings, without noise, alpha_A = 0 and known, T3 = 500 degC; \
             least squares over 10 to 110 s after the jump. Errors against the mean of the model's own values in the \
             window, and against their end.",
            crate::reproduction::lab::OPENINGS.len()
        ),
        statements,
        table,
        svg: picture(&outcomes, &steady_hot),
    })
}

fn steady_hot(outcome: &Outcome) -> Result<f64, ReproduceError> {
    Ok(apparent_eta(&settled_at(&Model::nominal(), outcome.jump.to_rpm, outcome.jump.opening)?))
}

/// Root mean square error of h over its range and over its mean, %.
fn nrmse_percent(outcomes: &[Outcome]) -> (f64, f64) {
    let error = rms(outcomes.iter().map(|o| Some(o.point.h_w_m2k? - o.h_mean_w_m2k))).unwrap_or(f64::NAN);
    let (low, high) = extremes(outcomes.iter().map(|o| Some(o.h_mean_w_m2k))).unwrap_or((f64::NAN, f64::NAN));
    let mean = mean(outcomes.iter().map(|o| o.h_mean_w_m2k)).unwrap_or(f64::NAN);
    (100.0 * error / (high - low), 100.0 * error / mean)
}

fn picture(outcomes: &[Outcome], steady_hot: &[f64]) -> String {
    let style = (Marker::Circle, false, "dynamic");
    let mut eta = series_by_speed(outcomes, efficiency_pair, style);
    for speed_rpm in target_speeds_rpm() {
        let points = outcomes
            .iter()
            .zip(steady_hot)
            .filter(|(o, _)| o.jump.to_rpm == speed_rpm)
            .map(|(o, hot)| (100.0 * o.eta_mean, 100.0 * hot))
            .collect();
        let label = "settled, 500 degC".to_owned();
        eta.push((points, speed_colour(speed_rpm), Marker::Diamond, true, label));
    }
    Figure::new("Figure 6: dynamic identification against the model")
        .subtitle(
            "window 10 to 110 s after the jump, alpha_A = 0, no noise; model values: mean in the window",
        )
        .panel(efficiency_panel(eta))
        .panel(h_panel(series_by_speed(outcomes, h_pair, style)))
        .to_svg()
}
