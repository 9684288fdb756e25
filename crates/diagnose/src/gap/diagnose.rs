//! The whole diagnosis of one recording.

use crate::gap::best_fit::adequacy::{Adequacy, adequacy};
use crate::gap::best_fit::fit::{Effort, Fit};
use crate::gap::best_fit::selection::Selection;
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::place::{Gain, places};
use crate::gap::causes::probabilities::{Posterior, posterior, rivals, suspicions, weight};
use crate::gap::causes::select::{
    MAX_EVIDENCE_DEFICIT, MIN_GAP_REDUCTION, Search, close, ranked, refit, search, search_onsets, supported,
};
use crate::gap::causes::smallest_seen::smallest_seen;
use crate::gap::findings::experiment::Experiment;
use crate::gap::findings::report::{Diagnosis, MAX_REFITTED, Verdict};
use crate::gap::findings::warning::GapWarning;
use crate::gap::gap_reduction::beyond_prior::beyond_prior;
use crate::gap::gap_reduction::folds::Folds;
use crate::gap::gap_reduction::held_out_gap::{Compared, held_out_gap};
use crate::gap::model_error::healthy::Healthy;
use crate::gap::next_experiment::best_experiment::{Suggested, next, sensor_near};
use crate::gap::preconditions::default_tolerances::assumed;
use crate::gap::preconditions::machine_mismatch::another_machine;
pub use crate::gap::preconditions::problem::GapError;
use crate::gap::preconditions::usable::checked_study;
use crate::gap::residuals::study::{Hypothesis, Prediction, Study, members};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::Recording;
use mapper_inference::posterior::CauseProbabilities;
use mapper_observe::declared::Declared;
use mapper_observe::model_inputs::step_timing::with_command_times;
use mapper_physics::rig::effect::{Effect, Submodel};
use mapper_physics::simulation::model::Model;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Input of a diagnosis.
pub struct GapRequest<'a> {
    /// The recording to explain.
    pub recording: &'a Recording,
    /// Declared tolerances, noise and conditions.
    pub declared: Declared,
    /// A fault-free recording of the same rig and steps; the diagnosis then explains the changes since.
    pub healthy: Option<Healthy<'a>>,
    /// The nominal machine.
    pub model: Model,
    /// Candidate effects.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Whether the campaign declares tolerances. If not, default tolerances hold, and the actuator responses are estimated from the recording.
    pub tolerances_declared: bool,
    /// Experiments allowed on this machine to distinguish causes; if they contain no jump, the recorded jumps are allowed.
    pub experiments: Vec<Experiment>,
    /// Constants of the probabilities.
    pub calibration: Calibration,
    /// Linearisation of the recording at the nominal model without effects, if it is already available.
    pub linearised: Option<Linearised>,
    /// Receives the completed share and the name of the next stage.
    pub progress: &'a (dyn Fn(f64, &str) + Sync),
}

/// A diagnosis with its fits, for figures and calibration.
#[derive(Debug)]
pub struct Diagnosed {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The prepared recording.
    pub study: Study,
    /// Fit of the tolerances alone, on all steps.
    pub null: Fit,
    /// Prediction and whitened residual of the nominal model with the tolerances of the best fit, but without its cause. In
    /// [`Diagnosed::null`] the tolerances imitate the cause. Equal to the null if no cause is named.
    pub without_cause: (Prediction, Vec<f64>),
    /// Best fits on all steps, best first.
    pub fits: Vec<Fit>,
    /// The best fit, or the fit of a [law](Diagnosed::explain_by) that explains the gap, with its name for people; `None` without a fit.
    pub with_cause: Option<(&'static str, Fit)>,
    /// Tests of the residual of the best fit.
    pub adequacy: Adequacy,
    /// Whitening and derivatives.
    pub linearised: Linearised,
}

/// Diagnoses a recording.
///
/// # Errors
/// [`GapError`] if no diagnosis is possible.
pub fn diagnose(request: GapRequest<'_>) -> Result<Diagnosed, GapError> {
    let GapRequest {
        recording,
        declared,
        healthy,
        model,
        effects,
        tolerances_declared,
        experiments,
        calibration,
        linearised,
        progress,
    } = request;
    progress(0.0, "reading");
    let recording = &with_command_times(recording);
    let (nominal, mut since) = (model.clone(), None);
    let declared = if healthy.is_some() { declared.with_exact_equations() } else { declared };
    let (mut study, mut warnings) = checked_study(recording, declared, model, effects, tolerances_declared)?;
    if let Some(healthy) = healthy {
        progress(0.01, "the healthy recording");
        let changed = study.since(healthy, nominal, tolerances_declared)?;
        study = changed.study;
        since = Some(changed.since);
        let of_healthy = |warning| GapWarning::HealthyRecording { warning: Box::new(warning) };
        warnings.extend(changed.warnings.into_iter().map(of_healthy));
    }
    if study.scatter_s > 0.0 {
        warnings.push(GapWarning::UncertainTimes { scatter_s: study.scatter_s });
    }
    progress(0.02, "tolerances");
    let linearised = match linearised.filter(|_| since.is_none()) {
        Some(linearised) => linearised,
        None => Linearised::new(&study)?,
    };
    another_machine(&study, &linearised.base.values)?;
    // Held-out steps are selected before any fit.
    let folds = Folds::of(&study);
    let everywhere = Selection::all(&study);
    let (selection, calibration) = (&everywhere, &calibration);
    let at = |linearised| Search { study: &study, linearised, selection, calibration, onsets: false };
    let found = search(at(&linearised), progress)?;
    progress(0.65, "closest causes");
    let null = found.null;
    let at_best = found.relinearised.as_ref().map_or(&linearised, |(linearised, _)| linearised);
    let hopeless =
        |f: &&Fit| found.fits.first().is_some_and(|best| best.score - f.score > MAX_EVIDENCE_DEFICIT);
    let mut finalists: Vec<&Fit> = found
        .fits
        .iter()
        .take(MAX_REFITTED)
        .enumerate()
        .filter(|(place, f)| *place < 3 || !hopeless(f))
        .map(|(_, f)| f)
        .collect();
    // A pair is only compared fairly if its members alone are refitted, too.
    if let Some(best) = found.fits.first() {
        for effect in members(&best.hypothesis) {
            let alone = found.fits.iter().find(|f| members(&f.hypothesis) == [effect]);
            finalists.extend(alone.filter(|f| !finalists.iter().any(|other| std::ptr::eq(*other, *f))));
        }
    }
    let effort = Effort { iterations: 5, enough: 0.1, ..Effort::default() };
    let mut fits = refit(&at(at_best), &finalists, effort);
    // Close candidates are compared with the linearisation at the best fit, not at the nominal point.
    let relinearised = match (fits.first(), &found.relinearised) {
        (Some(best), Some((_, there))) if members(&best.hypothesis) != *there => {
            linearised.at(&study, &best.hypothesis).ok()
        }
        _ => None,
    };
    let at_best = relinearised.as_ref().unwrap_or(at_best);
    if relinearised.is_some() {
        let (closest, others) = fits.split_at(close(&fits[..fits.len().min(4)], MAX_EVIDENCE_DEFICIT).len());
        let again = refit(&at(at_best), &closest.iter().collect::<Vec<_>>(), effort);
        fits = ranked(&at(at_best), again.iter().chain(closest).chain(others));
    }
    fits = supported(&at(at_best), fits);
    let mut left = adequacy(&study, &linearised, fits.first().unwrap_or(&null));
    if calibration.outside(left.features()) > 0.5 && folds.steps.len() > 1 {
        progress(0.8, "causes that begin");
        study.add_onsets();
        let at = Search { study: &study, linearised: at_best, selection, calibration, onsets: true };
        search_onsets(at, &null, &mut fits);
        fits.truncate(MAX_REFITTED);
        fits = supported(&at, fits);
        left = adequacy(&study, &linearised, fits.first().unwrap_or(&null));
    }
    progress(0.88, "residual");
    let best = fits.first().unwrap_or(&null);
    let left_by_null = adequacy(&study, &linearised, &null);
    let Posterior { probabilities, candidates, alike } = posterior(&study, calibration, &null, &fits, &left);
    let CauseProbabilities { named, unmodelled, .. } = probabilities;
    let weight = |fit: &Fit| weight(calibration, &study, fit);
    // Each fold chooses among the causes that the data do not distinguish, and they share the location.
    let alike: Vec<&Fit> = alike.iter().map(|place| &fits[*place]).collect();
    let linearisations = [&linearised, at_best];
    let compared =
        Compared { study: &study, linearised: linearisations, null: &null, causes: &alike, weight: &weight };
    let gap = held_out_gap(compared, &folds);
    let verdict = if !named {
        if unmodelled > 0.5 { Verdict::Unexplained } else { Verdict::WithinTolerance }
    } else if unmodelled <= 0.5 {
        Verdict::Explained
    } else {
        let n = null.residual.len() as f64;
        let removed = 1.0 - (best.cost - n).max(0.0) / (null.cost - n).max(1.0);
        let smooth = 1.0 - left.smooth_excess.max(0.0) / left_by_null.smooth_excess.max(1.0);
        let better = gap.gap_reduction > MIN_GAP_REDUCTION;
        if removed > MIN_GAP_REDUCTION && smooth > MIN_GAP_REDUCTION && better {
            Verdict::PartlyExplained
        } else {
            Verdict::Unexplained
        }
    };
    let mut gains: Vec<Gain<'_>> = fits.iter().map(|fit| Gain { fit, gain: null.cost - fit.cost }).collect();
    for fit in &found.fits {
        if gains.iter().all(|other| members(&other.fit.hypothesis) != members(&fit.hypothesis)) {
            gains.push(Gain { fit, gain: null.cost - fit.cost });
        }
    }
    let inseparable = inseparable(&study, &alike);
    let rank =
        |gain: &Gain<'_>| alike.iter().position(|fit| std::ptr::eq(*fit, gain.fit)).unwrap_or(usize::MAX);
    gains.sort_by_key(rank);
    let r#where = if verdict == Verdict::WithinTolerance {
        Vec::new()
    } else {
        places((&study, calibration), &linearised, &null, &gains, named.then_some(alike.len()))
    };
    progress(0.95, "next experiment");
    let Suggested { next, experiments } = match verdict {
        Verdict::WithinTolerance => suspicions(&probabilities, &fits, &null)
            .map(|rivals| next(&study, rivals, &experiments, calibration.temperature))
            .unwrap_or_default(),
        Verdict::Unexplained | Verdict::PartlyExplained => {
            Suggested { next: Some(sensor_near(&r#where)), experiments: Vec::new() }
        }
        Verdict::Explained => rivals(&probabilities, &fits)
            .map(|rivals| next(&study, rivals, &experiments, calibration.temperature))
            .unwrap_or_default(),
    };
    let smallest_seen = if verdict == Verdict::WithinTolerance {
        smallest_seen(&study, &linearised, calibration)
    } else {
        Vec::new()
    };
    progress(1.0, "summary");
    let diagnosis = Diagnosis {
        verdict,
        since,
        r#where,
        suspects: beyond_prior(&study, at_best, fits.first().filter(|_| named).unwrap_or(&null)),
        inseparable,
        candidates,
        probability_none: probabilities.none,
        probability_unlisted: probabilities.unlisted,
        probability_outside: unmodelled,
        closure_terms: Vec::new(),
        residual_sources: Vec::new(),
        gap,
        next,
        experiments,
        smallest_seen,
        off_at_rest: Vec::new(),
        assumed: if tolerances_declared { Vec::new() } else { assumed(&study) },
        warnings,
    };
    let without_cause = without_cause(&study, &linearised, fits.first().filter(|_| named))
        .unwrap_or_else(|| (null.prediction.clone(), null.residual.clone()));
    let with_cause = fits.first().map(|best| ("the most probable cause", best.clone()));
    Ok(Diagnosed { diagnosis, study, null, without_cause, with_cause, fits, adequacy: left, linearised })
}

impl Diagnosed {
    /// Replaces the cause by a fitted law, for figures.
    pub fn explain_by(&mut self, law: Fit) {
        if let Some(without) = without_cause(&self.study, &self.linearised, Some(&law)) {
            self.without_cause = without;
        }
        self.with_cause = Some(("the law", law));
    }
}

/// Machine parts of some, but not all, of the indistinguishable causes.
fn inseparable(study: &Study, named: &[&Fit]) -> Vec<String> {
    let parts = |fit: &Fit| -> BTreeSet<Submodel> {
        members(&fit.hypothesis).iter().map(|effect| study.effects[*effect].info().submodel).collect()
    };
    let parts: Vec<BTreeSet<Submodel>> = named.iter().map(|fit| parts(fit)).collect();
    let in_all = |part: &Submodel| parts.iter().all(|of_fit| of_fit.contains(part));
    let some: BTreeSet<Submodel> = parts.iter().flatten().copied().filter(|part| !in_all(part)).collect();
    some.into_iter().map(|part| part.name().to_owned()).collect()
}

fn without_cause(
    study: &Study,
    linearised: &Linearised,
    named: Option<&Fit>,
) -> Option<(Prediction, Vec<f64>)> {
    let bare = Hypothesis { nuisances: named?.hypothesis.nuisances.clone(), effects: Vec::new() };
    let prediction = study.predict(&bare).ok()?;
    let residual = linearised.residual(study, &prediction);
    Some((prediction, residual))
}
