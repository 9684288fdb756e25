//! The joint method: all steps of a campaign together.
//!
//! Each step keeps its own efficiency; what the steps share (how convection follows flow and temperature, the share of
//! the area before the wheel, the probe's lag, what a hotter wall does, the sensors' offsets, how efficiency varies over
//! the map) is found once, from all of them. Why that is needed, what it assumes and what it can not do stands in
//! `docs/identification.md`.

pub(crate) mod explained;
pub(crate) mod model;
pub(crate) mod parameters;
pub(crate) mod probe;
pub(crate) mod rows;
pub(crate) mod settings;
pub(crate) mod smoothing;
pub(crate) mod solve;
pub(crate) mod start;
pub(crate) mod surface;
pub(crate) mod whitening;

use crate::dynamic::{self, Estimate};
use crate::end_state::EndState;
use crate::findings::Findings;
use crate::joint::parameters::{ETA, EXPONENT, LN_COEFFICIENT, LN_DEVIATION, OFFSETS, SHARED, SURFACE};
use crate::joint::solve::{Covariance, Problem};
use crate::IdentifyConfig;
use mapper_core::{EstimateUncertainty, Recording};

/// What the method makes of a recording.
#[derive(Debug)]
pub(crate) struct Joint {
    pub(crate) estimates: Vec<Estimate>,
    pub(crate) shared: Option<(parameters::SharedVector, Vec<(usize, f64)>)>,
}

/// Identifies all steps. `end_states` and `findings`: one for each step; no end state, no estimate.
pub(crate) fn estimate(
    recording: &Recording,
    end_states: &[Option<EndState>],
    config: &IdentifyConfig,
    findings: &mut [Findings],
) -> Joint {
    let alone: Vec<Estimate> = (0..recording.steps.len())
        .map(|position| {
            let mut own = Findings::new();
            let estimate = dynamic::estimate(recording, position, config, &mut own);
            if config.joint == settings::JointSettings::all_off() {
                findings[position].take(own);
            }
            estimate
        })
        .collect();
    if config.joint == settings::JointSettings::all_off() {
        return Joint { estimates: alone, shared: None };
    }
    let steps = start::steps(recording, end_states, config, findings);
    let Some(mut problem) = start::problem(&steps, &alone, config) else {
        return Joint { estimates: alone.iter().map(|_| Estimate::default()).collect(), shared: None };
    };
    for round in 0..4 {
        let cost = problem.minimise();
        if std::env::var("JOINT_DEBUG").is_ok() {
            eprintln!("round {round} cost {cost:?} shared {:?}", &problem.shared);
        }
        start::refine(&mut problem, &steps, config);
    }
    let _ = problem.minimise();
    let mut estimates: Vec<Estimate> = alone;
    let covariance = problem.covariance();
    for (member, step) in problem.members.iter().zip(&steps) {
        estimates[step.position].eta = Some((member.local[ETA], None));
        let (h, _) = problem.setting.h_at_end(&step.end, &problem.shared, &member.local);
        estimates[step.position].h_w_m2k = Some((h, None));
    }
    let mut shared_errors = Vec::new();
    if let Some(covariance) = covariance {
        for (row, index) in covariance.fitted.iter().enumerate() {
            shared_errors.push((*index, covariance.shared[(row, row)].sqrt()));
        }
        for (i, step) in steps.iter().enumerate() {
            let estimate = &mut estimates[step.position];
            estimate.eta = estimate.eta.map(|(eta, _)| (eta, Some(eta_uncertainty(&problem, &covariance, i))));
            estimate.h_w_m2k = estimate.h_w_m2k.map(|(h, _)| (h, Some(h_uncertainty(&problem, &covariance, &steps, i))));
        }
    }
    Joint { estimates, shared: Some((problem.shared, shared_errors)) }
}

/// Splits a variance into what declared offsets and gains bring and the rest.
fn split(problem: &Problem<'_>, covariance: &Covariance, variance: f64, with_shared: impl Fn(usize) -> f64) -> EstimateUncertainty {
    let mut bias = 0.0;
    for (row, index) in covariance.fitted.iter().enumerate() {
        if (OFFSETS..SURFACE).contains(index) {
            bias += with_shared(row).powi(2) * problem.priors[*index].weight();
        }
    }
    EstimateUncertainty {
        noise_standard_error: (variance - bias).max(0.0).sqrt(),
        bias_standard_error: bias.sqrt(),
    }
}

fn eta_uncertainty(problem: &Problem<'_>, covariance: &Covariance, i: usize) -> EstimateUncertainty {
    let (own, mixed) = &covariance.own[i];
    split(problem, covariance, own[(ETA, ETA)], |row| mixed[(ETA, row)])
}

fn h_uncertainty(problem: &Problem<'_>, covariance: &Covariance, steps: &[rows::StepRows], i: usize) -> EstimateUncertainty {
    let (own, mixed) = &covariance.own[i];
    let (h, ln_re) = problem.setting.h_at_end(&steps[i].end, &problem.shared, &problem.members[i].local);
    let mut weights = [0.0; SHARED];
    if problem.setting.with_law {
        weights[LN_COEFFICIENT] = 1.0;
        weights[EXPONENT] = ln_re;
    }
    let with_shared = |row: usize| {
        let shared: f64 = covariance
            .fitted
            .iter()
            .enumerate()
            .map(|(other, index)| weights[*index] * covariance.shared[(other, row)])
            .sum();
        shared + mixed[(LN_DEVIATION, row)]
    };
    let mut variance = own[(LN_DEVIATION, LN_DEVIATION)];
    for (row, index) in covariance.fitted.iter().enumerate() {
        variance += weights[*index] * (with_shared(row) + mixed[(LN_DEVIATION, row)]);
    }
    let relative = split(problem, covariance, variance, with_shared);
    EstimateUncertainty {
        noise_standard_error: h * relative.noise_standard_error,
        bias_standard_error: h * relative.bias_standard_error,
    }
}
