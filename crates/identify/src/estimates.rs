//! The estimates of all steps by the configured method, and the faults of sensors and machine that explain contradictions between them.

use crate::evidence::Evidence;
use crate::faults::Hypotheses;
use crate::faults::balances::efficiency::FittedEfficiencies;
use crate::faults::balances::standstill::standstills;
use crate::faults::found_fault::{FoundFault, Suspect};
use crate::faults::nominal_rig::NominalRig;
use crate::joint::{DynamicEfficiency, Joint};
use crate::reading_checks::ends::FailedCheck;
use crate::single_step::dynamic::Estimate;
use crate::single_step::steady;
use crate::step_data::end_state::EndState;
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, StepError, faults, joint};
use mapper_core::{LeftOut, Method, Recording, ThermalModel, Warning};

/// The estimate of each step, in order, with everything that was found about it.
pub(crate) struct Estimated {
    pub(crate) steps: Vec<(Result<EndState, StepError>, Findings)>,
    pub(crate) estimates: Vec<Estimate>,
    pub(crate) thermal: Option<ThermalModel>,
    pub(crate) dynamic: Vec<DynamicEfficiency>,
    pub(crate) faults: Vec<FoundFault>,
    /// One standard error of each suspect's size, in its unit.
    pub(crate) detectable: Vec<(Suspect, f64)>,
}

impl Estimated {
    pub(crate) fn of(
        mut evidence: Evidence,
        recording: &Recording,
        config: &IdentifyConfig,
        nominal: Option<&NominalRig<'_>>,
    ) -> Self {
        let whole = evidence.is_whole();
        let ends = std::mem::take(&mut evidence.ends);
        let standstills = standstills(recording, config);
        let likelihood = |fitted: Option<&FittedEfficiencies>| {
            whole.then(|| faults::hypotheses(recording, &ends, fitted, config, nominal, &standstills))?
        };
        let find = |hypotheses: &Hypotheses| faults::find(hypotheses, config.method, &standstills);
        let mut balances = likelihood(None);
        let mut faults = balances.as_ref().map(find).unwrap_or_default();
        let is_refused = faults.iter().any(|fault| fault.touches_points) || evidence.is_refused();
        // Only the joint fit computes the effect of each sensor error on the efficiencies. The points stay those of the method.
        let needs_joint = whole && nominal.is_some() && !evidence.alone.0.is_empty();
        let Joint { mut estimates, thermal, dynamic, fitted } =
            by_method(&mut evidence, recording, config, is_refused, needs_joint);
        if let Some(fitted) = &fitted {
            // The efficiencies carry more information, and about more channels.
            balances = likelihood(Some(fitted));
            faults = balances.as_ref().map(find).unwrap_or_default();
        }
        if let (Some(fitted), Some(balances), true) =
            (&fitted, &balances, nominal.is_some() && faults.is_empty())
        {
            let readings = faults::all_readings(recording, &ends, config.exact_at).unwrap_or_default();
            // Without a density of the balances nothing is known of faults.
            let _ = faults::possible::widen(&mut estimates, fitted, &readings, balances, config);
        }
        let Evidence { states, mut findings, mut failed_checks, .. } = evidence;
        failed_checks.extend(faults::failed_check(&faults, ends.len()));
        if let Some(remark) = faults::remark(&faults) {
            findings.iter_mut().for_each(|findings| findings.remark(remark.clone()));
        }
        // Doubts about the readings come first: all other findings depend on them.
        for failed_check in failed_checks.iter().rev() {
            for position in &failed_check.steps {
                findings[*position].doubt_first(failed_check.warning.clone());
            }
        }
        let errors = balances.as_ref().map(faults::standard_errors);
        let steps = states.into_iter().zip(findings).collect();
        Estimated { steps, estimates, thermal, dynamic, faults, detectable: errors.unwrap_or_default() }
    }
}

/// The estimates of the configured method. `needs_joint`: the efficiencies of the joint fit are needed whatever the method.
fn by_method(
    evidence: &mut Evidence,
    recording: &Recording,
    config: &IdentifyConfig,
    is_refused: bool,
    needs_joint: bool,
) -> Joint {
    let known = evidence.known();
    let (alone, own_findings) = std::mem::take(&mut evidence.alone);
    let together = |findings: &mut [Findings], alone: Vec<Estimate>, own_findings: Vec<Findings>| {
        let known = without_the_refused(known, &evidence.failed_checks, findings);
        joint::estimate(recording, &known, (alone, own_findings), config, is_refused, findings)
    };
    if config.method == Method::Joint {
        return together(&mut evidence.findings, alone, own_findings);
    }
    let fitted = needs_joint
        .then(|| together(&mut evidence.findings.clone(), alone.clone(), own_findings.clone()).fitted)
        .flatten();
    let estimates = if config.method == Method::Steady {
        let steps = evidence.findings.iter_mut().enumerate();
        let estimate = |(position, findings): (usize, &mut Findings)| match &evidence.states[position] {
            Err(_) => Estimate::default(),
            Ok(_) => steady::estimate(recording, position, config, findings),
        };
        steps.map(estimate).collect()
    } else {
        evidence.findings.iter_mut().zip(own_findings).for_each(|(findings, own)| findings.take(own));
        alone
    };
    Joint { estimates, thermal: None, dynamic: Vec::new(), fitted }
}

/// The steps that contribute to the shared parameters: steps with a failed check would bias the others. Samples of a temporarily frozen
/// channel are omitted, and the rest of the step is used.
fn without_the_refused(
    mut known: Vec<Option<EndState>>,
    failed_checks: &[FailedCheck],
    findings: &mut [Findings],
) -> Vec<Option<EndState>> {
    let mut refused = vec![false; known.len()];
    let whole = failed_checks.iter().filter(|failed_check| !failed_check.samples_left_out);
    whole.flat_map(|failed_check| &failed_check.steps).for_each(|position| refused[*position] = true);
    let few = refused.iter().any(|refused| !refused);
    for (position, _) in refused.iter().enumerate().filter(|(_, refused)| few && **refused) {
        if known[position].take().is_some() {
            findings[position].doubt(Warning::LeftOut(LeftOut::Readings));
        }
    }
    known
}
