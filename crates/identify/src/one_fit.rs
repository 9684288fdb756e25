//! A single least-squares fit of all steps, for timing comparisons with another program.

use crate::joint::fit::solve::{FULLY, Problem};
use crate::joint::fit::start;
use crate::joint::step_model::parameters::{ALPHA, ETA, PROBE_MM2};
use crate::single_step::dynamic::Estimate;
use crate::step_data::end_state::end_state;
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, identify};
use mapper_core::Recording;

/// Result of one fit.
#[doc(hidden)]
#[derive(Debug, Clone, PartialEq)]
pub struct OneFit {
    /// alpha_A, ratio.
    pub alpha_area_ratio: f64,
    /// Diameter of the probe, m.
    pub probe_diameter_m: f64,
    /// Efficiency of each step, fraction.
    pub etas: Vec<f64>,
}

/// Prepares rows, weights and start values, and returns a function that fits once from there; `None` if there is nothing to fit. The weights
/// are those of the declared noise, without re-estimation, checks or corrections.
#[doc(hidden)]
pub fn one_fit<R>(
    recording: &Recording,
    config: &IdentifyConfig,
    measure: impl FnOnce(&mut dyn FnMut() -> Option<OneFit>) -> R,
) -> Option<R> {
    identify::check(config).ok()?;
    let mut findings = vec![Findings::new(); recording.steps.len()];
    let states: Vec<_> = recording
        .steps
        .iter()
        .zip(&mut findings)
        .map(|(step, findings)| end_state(recording, step, config, findings).ok())
        .collect();
    let steps = start::steps(recording, &states, config, &mut findings);
    let nothing_known = vec![Estimate::default(); recording.steps.len()];
    let mut prepared: Problem<'_> = start::problem(&steps, &nothing_known, config)?;
    start::set_weights(&mut prepared, &steps, config);
    Some(measure(&mut || {
        let mut problem = prepared.clone();
        problem.minimise(FULLY)?;
        Some(OneFit {
            alpha_area_ratio: problem.shared[ALPHA],
            probe_diameter_m: 1e-3 * problem.shared[PROBE_MM2].max(0.0).sqrt(),
            etas: problem.members.iter().map(|member| member.local[ETA]).collect(),
        })
    }))
}
