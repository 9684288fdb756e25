//! Predicts the joint method's result for forecast steps, for planning before the measurement.
//!
//! The forecast is identified like a noise-free recording. The covariance at the minimum includes the declared noise, the remaining offsets
//! and everything that the steps share: the Fisher information of all steps together.

use crate::IdentifyConfig;
use crate::config::coloured;
use crate::joint::Fitted;
use crate::joint::fit::start::{self, START_S};
use crate::joint::step_model::rows::{COARSER, Row, StepRows, block_s_after, place};
use crate::joint::{fit::refinements, uncertainty::smoothness};
use crate::single_step::dynamic::Estimate;
use crate::single_step::expected::{DECLARED_INTERVAL_S, Expected, ExpectedRow};
use mapper_numerics::coloured_noise::BlockNoise;
use mapper_numerics::statistics::MIN_VALUES;

/// A forecast step.
#[derive(Debug, Clone, Copy)]
pub struct ExpectedStep<'a> {
    /// Its instants; `t_s` counts from the jump, the last one is the step's end.
    pub rows: &'a [ExpectedRow],
    /// Efficiency at its end, fraction.
    pub eta: f64,
}

impl ExpectedStep<'_> {
    /// Start values for a fit.
    fn estimate(&self) -> Estimate {
        Estimate { eta: Some((self.eta, None)), ..Estimate::default() }
    }
}

/// The expected result of the joint method for the steps of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedTogether {
    /// One result per step on a machine as declared; `None` for a step that is too short.
    pub steps: Vec<Option<Expected>>,
    /// Standard error of each efficiency that the identification of such a recording reports, fraction: it includes the values of alpha_A,
    /// probe, heating/cooling ratio and h before the wheel that these steps cannot exclude.
    pub reported_sigma_eta: Vec<Option<f64>>,
    /// Error of the efficiencies (rms over the steps, one sigma, fraction) if alpha_A, probe and heating/cooling ratio had to be found from
    /// these steps. Above [`MAX_RESTING_ETA`](crate::MAX_RESTING_ETA) the points depend on the declaration and are doubtful.
    pub resting_eta: f64,
}

/// Identifies noise-free steps together; `None` if the fit does not converge.
///
/// The errors are computed with alpha_A, probe and heating/cooling ratio as declared: without evidence against the declaration, the method
/// shrinks them towards it. After an isothermal zero `config` is that of [`expected_after_zero`](crate::expected_after_zero).
pub fn expected_together(steps: &[ExpectedStep<'_>], config: &IdentifyConfig) -> Option<ExpectedTogether> {
    let condensed: Vec<StepRows> =
        steps.iter().enumerate().filter_map(|(position, step)| condensed(position, step, config)).collect();
    let alone: Vec<Estimate> = steps.iter().map(ExpectedStep::estimate).collect();
    let mut problem = start::problem(&condensed, &alone, config)?;
    problem.minimise_roughly()?;
    start::refine(&mut problem, &condensed, config)?;
    problem.minimise_roughly()?;
    let resting_eta = refinements::resting_on_declaration(&problem, None)?;
    let mut reported_sigma_eta = vec![None; steps.len()];
    let mut open = problem.clone();
    let reported = Fitted::of(&mut open)?.smoothed(&open, &condensed, config);
    for (eta, step) in reported.eta.iter().zip(&condensed) {
        reported_sigma_eta[step.position] = Some(eta.uncertainty.combined_standard_error());
    }
    refinements::hold(&mut problem);
    problem.minimise_roughly()?;
    let smoothed = smoothness::smoothed(&problem, &problem.covariance()?, None, &condensed, config.reference);
    let mut found = vec![None; steps.len()];
    for (i, (member, step)) in problem.members.iter().zip(&condensed).enumerate() {
        let (eta, ln_h) = (smoothed.eta[i], smoothed.ln_h[i]);
        let h_w_m2k =
            problem.setting.h_at_end(&step.end, &problem.shared, &member.local).0 * ln_h.value.exp();
        let expected = Expected {
            eta: eta.value,
            sigma_eta: eta.uncertainty.combined_standard_error(),
            h_w_m2k,
            sigma_h_w_m2k: h_w_m2k * ln_h.uncertainty.combined_standard_error(),
        };
        let numbers = [expected.eta, expected.sigma_eta, h_w_m2k, expected.sigma_h_w_m2k];
        found[step.position] = numbers.iter().all(|x| x.is_finite()).then_some(expected);
    }
    Some(ExpectedTogether { steps: found, reported_sigma_eta, resting_eta })
}

/// The rows to which the method would condense the samples of a recording.
fn condensed(position: usize, step: &ExpectedStep<'_>, config: &IdentifyConfig) -> Option<StepRows> {
    let first = step.rows.partition_point(|expected| expected.t_s < START_S);
    let first_s = step.rows.get(first)?.t_s;
    let mut rows: Vec<Row> = Vec::new();
    for expected in &step.rows[first..] {
        let block_s = COARSER * block_s_after(expected.t_s - first_s, config);
        // Half a nanosecond: times are rounded.
        if rows.last().is_none_or(|last| expected.t_s - last.t_s >= block_s - 5e-10) {
            rows.push(row(expected, noise(block_s, config), config));
        }
    }
    let end = row(step.rows.last()?, rows.last()?.noise, config);
    let usable = rows.len() >= MIN_VALUES && end.place.0 > 0.0 && end.place.1 > 0.0;
    usable.then_some(StepRows { position, rows, end })
}

fn row(expected: &ExpectedRow, noise: BlockNoise, config: &IdentifyConfig) -> Row {
    Row {
        t_s: expected.t_s,
        t1_k: expected.t1_k,
        t2_k: expected.t2_k,
        tc_k: expected.tc_k,
        p1_pa: expected.p1_pa,
        p2_pa: expected.p2_pa,
        flow_kg_s: expected.flow_kg_s,
        place: place(config, expected.speed_rpm, expected.flow_kg_s, expected.t1_k, expected.p1_pa),
        noise,
    }
}

fn noise(block_s: f64, config: &IdentifyConfig) -> BlockNoise {
    BlockNoise::of_mean(coloured(config.noise_colour), block_s / DECLARED_INTERVAL_S, block_s)
}
