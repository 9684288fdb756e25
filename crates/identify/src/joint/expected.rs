//! Predicts the joint method's result for forecast steps, for planning before the measurement.
//!
//! The forecast is identified like a noise-free recording. The covariance at the minimum includes the declared noise, the remaining offsets
//! and everything that the steps share: the Fisher information of all steps together.

use crate::IdentifyConfig;
use crate::joint::fit::solve::Problem;
use crate::joint::fit::{refinements, start};
use crate::joint::step_model::parameters::Refinement;
use crate::joint::step_model::rows::{
    Row, Smoothing, StepRows, TIME_ROUNDING_S, block_s_after, place, slopes,
};
use crate::joint::uncertainty::Numbers;
use crate::joint::{Fitted, MAX_PRIOR_SENSITIVITY_ETA};
use crate::single_step::dynamic::Estimate;
use mapper_core::{MethodResult, MethodResults, SAMPLE_INTERVAL_S};
use mapper_numerics::coloured_noise::covariance_of_means;
use mapper_numerics::statistics::MIN_VALUES;
use mapper_physics::operating_point::forecast::ForecastRow;

/// Identifies noise-free steps together, each from its jump to its end; `None` if the fit does not converge.
///
/// The errors are computed with alpha_A, probe and heating/cooling ratio as declared: without evidence against the declaration, the method
/// shrinks them towards it. After an isothermal zero `config` is that of [`expected_after_zero`](crate::expected_after_zero).
pub fn expected_together(steps: &[&[ForecastRow]], config: &IdentifyConfig) -> Option<MethodResults> {
    let rows_of =
        |(position, step): (usize, &&[ForecastRow])| condensed((position, steps.len()), step, config);
    let condensed: Vec<StepRows> = steps.iter().enumerate().filter_map(rows_of).collect();
    let start = |rows: &&[ForecastRow]| Estimate {
        eta: rows.last().map(|end| (end.efficiency, None)),
        ..Estimate::default()
    };
    let alone: Vec<Estimate> = steps.iter().map(start).collect();
    let mut problem = start::problem(&condensed, &alone, config)?;
    problem.minimise_roughly()?;
    start::refine(&mut problem, config)?;
    problem.minimise_roughly()?;
    let parameter_error_eta = refinements::prior_sensitivity(&problem, None)?;
    let reported = |problem: &Problem<'_>| -> Option<Vec<Option<f64>>> {
        let mut open = problem.clone();
        let found = Fitted::of(&mut open, config)?.numbers(&open, &condensed);
        let mut sigmas = vec![None; steps.len()];
        for (eta, step) in found.eta.iter().zip(&condensed) {
            sigmas[step.position] = Some(eta.uncertainty.combined_standard_error());
        }
        Some(sigmas)
    };
    let reported_sigma_eta = reported(&problem)?;
    let undeclared_sigma_eta =
        undeclared(&problem).and_then(|problem| reported(&problem)).unwrap_or_default();
    refinements::hold(&mut problem);
    problem.minimise_roughly()?;
    let numbers = Numbers::of(&problem, &problem.covariance()?, None, &condensed);
    let mut found = vec![None; steps.len()];
    for (i, (member, step)) in problem.members.iter().zip(&condensed).enumerate() {
        let (eta, ln_h) = (numbers.eta[i], numbers.ln_h[i]);
        let at_end = problem.model.at_end(&step.end, &problem.shared, &member.local);
        let h_w_m2k = at_end.h_w_m2k * ln_h.value.exp();
        let expected = MethodResult {
            eta: eta.value,
            sigma_eta: eta.uncertainty.combined_standard_error(),
            h_w_m2k,
            sigma_h_w_m2k: h_w_m2k * ln_h.uncertainty.combined_standard_error(),
        };
        let numbers = [expected.eta, expected.sigma_eta, h_w_m2k, expected.sigma_h_w_m2k];
        found[step.position] = numbers.iter().all(|x| x.is_finite()).then_some(expected);
    }
    Some(MethodResults {
        steps: found,
        reported_sigma_eta,
        undeclared_sigma_eta,
        parameter_error_eta,
        max_parameter_error_eta: MAX_PRIOR_SENSITIVITY_ETA,
    })
}

/// The fit of a machine whose alpha_A, probe and heating/cooling ratio each differ from the declaration by one standard deviation of their
/// slab; `None` if all of them are fixed.
fn undeclared<'a>(problem: &Problem<'a>) -> Option<Problem<'a>> {
    let mut off = problem.clone();
    let sought = refinements::sought(problem);
    for Refinement { index, slab_sigma, .. } in &sought {
        off.shared[*index] = off.priors[*index].mean + slab_sigma;
    }
    let predictions = off.predictions(&off.shared, &off.locals(), None);
    for (member, prediction) in off.members.iter_mut().zip(predictions) {
        member.measured_k = prediction.readings_k;
    }
    (!sought.is_empty()).then_some(off)
}

/// The rows to which the method would condense the samples of a recording.
fn condensed(
    (position, steps): (usize, usize),
    step: &[ForecastRow],
    config: &IdentifyConfig,
) -> Option<StepRows> {
    let first = step.partition_point(|expected| expected.t_s < start::start_after_s(config));
    let (first_s, last_s) = (step.get(first)?.t_s, step.last()?.t_s);
    let mut rows: Vec<Row> = Vec::new();
    let mut times_s: Vec<Vec<f64>> = Vec::new();
    for expected in &step[first..] {
        let block_s = block_s_after(expected.t_s - first_s, last_s - first_s, steps, config);
        if rows.last().is_none_or(|last| expected.t_s - last.t_s >= block_s - TIME_ROUNDING_S) {
            rows.push(row(expected, config));
            let count = (block_s / SAMPLE_INTERVAL_S).round().max(1.0) as usize;
            times_s.push((0..count).map(|i| expected.t_s + i as f64 * SAMPLE_INTERVAL_S).collect());
        }
    }
    slopes(&mut rows);
    let t_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let blocks: Vec<&[f64]> = times_s.iter().map(Vec::as_slice).collect();
    let noise = covariance_of_means(&blocks, config.noise());
    let smoothing = (!config.declared.is_empty()).then(|| Smoothing::new(&t_s));
    let mut lead: Vec<Row> = step[..first].iter().map(|expected| row(expected, config)).collect();
    slopes(&mut lead);
    let end = row(step.last()?, config);
    let usable = rows.len() >= MIN_VALUES && end.place.0 > 0.0 && end.place.1 > 0.0;
    usable.then_some(StepRows { position, lead, rows, end, smoothing, noise })
}

fn row(expected: &ForecastRow, config: &IdentifyConfig) -> Row {
    Row {
        t_s: expected.t_s,
        t1_k: expected.t1_k,
        t2_k: expected.t2_k,
        tc_k: expected.tc_k,
        tc_read_k: expected.tc_k,
        tc_slope_k_s: 0.0,
        p1_pa: expected.p1_pa,
        p2_pa: expected.p2_pa,
        flow_kg_s: expected.flow_kg_s,
        tt_k: f64::NAN,
        oil_k: f64::NAN,
        ambient_k: f64::NAN,
        speed_rpm: expected.speed_rpm,
        place: place(config, expected.speed_rpm, expected.flow_kg_s, expected.t1_k, expected.p1_pa),
    }
}
