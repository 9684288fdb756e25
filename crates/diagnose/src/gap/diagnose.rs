//! The diagnosis of one recording, stage by stage; `docs/explanation/gap.md` explains each.

use crate::closure::discover::{Discovered, Proposed, discover};
use crate::closure::select::ClosureKey;
use crate::drift::DriftReport;
use crate::gap::baseline::Baseline;
use crate::gap::best_fit::fit::Fit;
use crate::gap::best_fit::fitted_causes::{CauseFit, Fits, map_effect};
use crate::gap::calibrated_model::Found;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::probabilities::{Posterior, rivals, smallest_seen, suspicions, weight};
use crate::gap::experiment::{Experiment, GapWarning};
use crate::gap::gap_reduction::{Compared, beyond_prior, held_out_gap};
use crate::gap::library_fits::{LibraryFits, explained};
use crate::gap::next_experiment::{Suggested, next, sensor_near};
use crate::gap::preconditions::{
    GapError, Prepared, Problem, Zeroed, another_machine, assumed, checked_study, found_drift, is_of_sensors,
};
use crate::gap::report::{Candidate, Diagnosis, Gap, Next, Place, Verdict};
use crate::gap::request::{BaselineRecording, ClosureSearch, GapRequest, RigRecording};
use crate::gap::residuals::study::{Hypothesis, PredictError, Prediction, Study, members};
use crate::gap::residuals::whiten::Linearised;
use mapper_identify::ZeroOutcome;
use mapper_observe::model_inputs::step_timing::with_command_times;
use mapper_physics::rig::effect::{Effect, Submodel};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A diagnosis with its fits: new, or restored from a file.
#[derive(Debug)]
pub struct Diagnosed {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// Drift during the recording; `None` if none was found or none can be detected, for example without repeats.
    pub drift: Option<DriftReport>,
    /// Result of the isothermal zero.
    pub zero: ZeroOutcome,
    /// The machine as found; `None` if its covariance cannot be formed.
    pub found: Option<Found>,
    /// The prepared recording, with the closure terms of the fits.
    pub study: Study,
    pub(crate) fits: Fits,
    /// Everything that was fitted, for calibration; `None` if restored.
    pub(crate) library: Option<LibraryFits>,
}

/// Predictions of a diagnosis and their whitened residuals, for figures.
#[derive(Debug)]
pub struct Evidence {
    /// With the tolerances of the cause, but without the cause: fitted alone, tolerances imitate it.
    pub without_cause: (Prediction, Vec<f64>),
    /// With the cause, and its name for people; `None` if the recording has no gap.
    pub with_cause: Option<(&'static str, Prediction, Vec<f64>)>,
}

impl Diagnosed {
    /// Runs the model with and without the cause: the closure term if it is more probable than not, else the most probable effects.
    pub fn evidence(&self) -> Result<Evidence, GapError> {
        let Diagnosed { diagnosis, study, fits, .. } = self;
        let new = self.library.is_none().then(|| Linearised::new(study)).transpose()?;
        let Some(linearised) = self.library.as_ref().map(|library| &library.linearised).or(new.as_ref())
        else {
            return Err(Problem::Empty.into());
        };
        let read = |hypothesis: &Hypothesis| -> Result<(Prediction, Vec<f64>), GapError> {
            let prediction = study.predict(hypothesis)?;
            let residual = linearised.residual(study, &prediction);
            Ok((prediction, residual))
        };
        let first = diagnosis.candidates.first().zip(fits.causes.first());
        let with = first.filter(|_| diagnosis.verdict != Verdict::WithinTolerance).map(|(candidate, fit)| {
            let closure = candidate.has_closure();
            (if closure { "the closure term" } else { "the most probable cause" }, fit, closure)
        });
        let named = with.filter(|(.., closure)| *closure || diagnosis.verdict != Verdict::Unexplained);
        let tolerances = named.map_or(&fits.null, |(_, fit, _)| fit).hypothesis.nuisances.clone();
        Ok(Evidence {
            without_cause: read(&Hypothesis { nuisances: tolerances, effects: Vec::new() })?,
            with_cause: with
                .map(|(name, fit, _)| {
                    read(&fit.hypothesis).map(|(prediction, residual)| (name, prediction, residual))
                })
                .transpose()?,
        })
    }
}

/// Share of the time taken by the drift search. Bound: only shown.
const DRIFT_SHARE: f64 = 0.15;
/// Share of the time after which the effect library is finished and the search for unmodelled effects begins. Bound: only shown.
const LIBRARY_END: f64 = 0.7;
/// Share of the library's time after which its tolerances are fitted. Bound: only shown.
const MODEL_DRIVEN: f64 = 0.02;
/// Share of the library's time after which its residual is tested. Bound: only shown.
const LIBRARY_FITTED: f64 = 0.88;
/// Share of the remaining time after which the next experiment is searched. Bound: only shown.
const CLOSURE_END: f64 = 0.9;

/// Diagnoses a recording: drift and zero, the effect library, closure terms, and the verdict with its consequences.
pub fn gap(request: GapRequest<'_>) -> Result<Diagnosed, GapError> {
    let GapRequest { recording: rig, effects, experiments, calibration, progress, .. } = request;
    let in_library = |done: f64, what: &str| progress(DRIFT_SHARE + (LIBRARY_END - DRIFT_SHARE) * done, what);
    let beyond = |done: f64, what: &str| progress(LIBRARY_END + (1.0 - LIBRARY_END) * done, what);
    progress(0.0, "drift");
    let mut prepared = Prepared::new(&rig, &calibration);
    in_library(0.0, "reading");
    let constant = match prepared.with_drift_left(&rig).filter(|_| request.baseline.is_none()) {
        Some(left) => with_constant_causes(&rig, left, &effects, &calibration, &in_library)?,
        None => None,
    };
    let (baseline, warnings, library) = match constant {
        Some((left, warnings, library)) => {
            prepared = left;
            (None, warnings, library)
        }
        None => {
            let driven = drive_model(&rig, &mut prepared, request.baseline, effects, &calibration)?;
            in_library(MODEL_DRIVEN, "tolerances");
            let DrivenModel { study, linearised, baseline, warnings } = driven;
            (baseline, warnings, LibraryFits::new(study, linearised, &calibration, &in_library)?)
        }
    };
    in_library(LIBRARY_FITTED, "residual");
    let posterior = library.posterior(&calibration);
    let gap = gap_on_held_out_steps(&library, &posterior, &calibration);
    let explained = explained(&library, &posterior, &gap);
    let verdict = verdict(explained, posterior.probabilities.unmodelled, prepared.drift.as_ref());
    let mut closure = closure_terms(&library, explained, request.closure_search, &calibration, &beyond);
    // A change with time cannot be expressed as a closure term.
    if prepared.drift.is_some() {
        closure.proposed = None;
    }
    let settled = closure.proposed.as_ref();
    let settled = settled.filter(|found| is_open(verdict) && found.closure_term.probability > 0.5);
    let verdict = match settled {
        Some(found) if found.closure_term.with_effects.is_empty() => Verdict::Unexplained,
        Some(_) => Verdict::PartlyExplained,
        None => verdict,
    };
    let is_outside_tolerance = verdict != Verdict::WithinTolerance;
    let has_closure = settled.is_some();
    let locations = match closure.places {
        _ if !is_outside_tolerance => Vec::new(),
        Some(places) => places,
        None => library.locations(&calibration, &posterior),
    };
    beyond(CLOSURE_END, "next experiment");
    let open = OpenQuestion { verdict, locations: &locations, has_closure };
    let Suggested { next, experiments } =
        next_experiment(&library, &posterior, open, &experiments, &calibration);
    let smallest_seen = match verdict {
        Verdict::WithinTolerance => smallest_seen(&library.study, &library.linearised, &calibration),
        _ => Vec::new(),
    };
    let with_closure = settled.and_then(|proposed| Some((&proposed.study, &proposed.causes.first()?.1)));
    let best = with_closure.map(|(_, fit)| fit).or(library.fits.first());
    let named = library.fits.first().filter(|_| posterior.probabilities.named);
    let (study, named) = with_closure.unwrap_or((&library.study, named.unwrap_or(&library.null)));
    let diagnosis = Diagnosis {
        verdict,
        baseline,
        locations,
        suspects: beyond_prior(study, library.at_best(), named),
        inseparable: inseparable(&library, &posterior),
        closure_terms: closure.proposed.iter().map(|proposed| proposed.closure_term.clone()).collect(),
        closure_terms_by_balance: if is_outside_tolerance { closure.residual_sources } else { Vec::new() },
        gap: settled.map_or(gap, |proposed| proposed.gap.clone()),
        map_effect: None,
        lists_all: false,
        next,
        experiments,
        smallest_seen,
        offsets_at_rest: prepared.zeroed.offsets_at_rest,
        assumed: if rig.tolerances_declared { Vec::new() } else { assumed(&library.study) },
        warnings: all_warnings(&prepared.drift, warnings, request.warnings, prepared.rejected_drift),
        candidates: match settled {
            Some(proposed) => proposed.causes.iter().map(|(candidate, ..)| candidate.clone()).collect(),
            None => posterior.candidates,
        },
        probability_none: settled.map_or(posterior.probabilities.none, |proposed| proposed.none),
        probability_unlisted: if has_closure { 0.0 } else { posterior.probabilities.unlisted },
        probability_outside: settled.map_or(posterior.probabilities.unmodelled, Proposed::outside),
    };
    let best = best.filter(|_| has_closure || verdict.names_a_cause()).unwrap_or(&library.null);
    let found = Found::of(&library.study, best, diagnosis.doubt());
    let fit_of = |(_, fit, key): &(Candidate, Fit, Option<ClosureKey>)| CauseFit::of(fit, key.as_ref());
    let mut proposed = closure.proposed.iter().flat_map(|proposed| &proposed.causes);
    let with_closure = proposed.find(|(candidate, ..)| candidate.has_closure()).map(fit_of);
    let of_library = posterior.probabilities.causes.iter().map(|cause| &library.fits[cause.set]);
    let causes = match settled {
        Some(proposed) => proposed.causes.iter().map(fit_of).collect(),
        None => of_library.map(|fit| CauseFit::of(fit, None)).collect(),
    };
    let study = closure.proposed.map_or_else(|| library.study.clone(), |proposed| proposed.study);
    let fits = Fits { null: CauseFit::of(&library.null, None), causes, closure: with_closure };
    let cause = fits.causes.first().filter(|_| has_closure || verdict.names_a_cause());
    let Zeroed { recording, zero, .. } = prepared.zeroed;
    let map_effect = cause.and_then(|cause| map_effect(&study, cause, &recording, &rig.identification));
    let diagnosis = Diagnosis { map_effect, ..diagnosis };
    progress(1.0, "done");
    Ok(Diagnosed { diagnosis, drift: prepared.drift, zero, found, study, fits, library: Some(library) })
}

/// The library's fits to the recording with its drift left in it, if causes that act all the time leave only noise and a machine with them shows no drift:
/// their effect differs from point to point, and the drift search took that for a change. `None` otherwise.
fn with_constant_causes(
    rig: &RigRecording,
    mut left: Prepared,
    effects: &[Arc<dyn Effect>],
    calibration: &Calibration,
    progress: &dyn Fn(f64, &str),
) -> Result<Option<(Prepared, Vec<GapWarning>, LibraryFits)>, GapError> {
    let DrivenModel { study, linearised, warnings, .. } =
        drive_model(rig, &mut left, None, effects.to_vec(), calibration)?;
    let library = LibraryFits::new(study, linearised, calibration, progress)?;
    let posterior = library.posterior(calibration);
    let is_constant = posterior.candidates.first().is_some_and(|cause| cause.onsets.is_empty());
    let Some(fit) = library.fits.first().filter(|_| is_constant && posterior.probabilities.unmodelled < 0.5)
    else {
        return Ok(None);
    };
    let (found, _) = library.study.rig(&fit.hypothesis, 0).map_err(PredictError::from)?;
    Ok(found_drift(rig, &found.model).is_none().then_some((left, warnings, library)))
}

/// The nominal model driven by a recording, or by its changes since a baseline.
struct DrivenModel {
    study: Study,
    linearised: Linearised,
    baseline: Option<Baseline>,
    warnings: Vec<GapWarning>,
}

/// Lets the recording drive the nominal model through all steps.
fn drive_model(
    rig: &RigRecording,
    prepared: &mut Prepared,
    baseline: Option<BaselineRecording>,
    effects: Vec<Arc<dyn Effect>>,
    calibration: &Calibration,
) -> Result<DrivenModel, GapError> {
    let (model, judged) = (rig.model.clone(), rig.tolerances_declared);
    let recording = with_command_times(&prepared.zeroed.recording);
    let declared = prepared.zeroed.declared.clone();
    let declared = if baseline.is_some() { declared.with_exact_equations() } else { declared };
    let (mut study, mut warnings) = checked_study(&recording, declared, model.clone(), effects, judged)?;
    let mut lacking = None;
    if let Some(BaselineRecording { name, recording }) = baseline {
        let before = Prepared::new(&recording, calibration).zeroed;
        let changed = study.changes_since(name, &before, model, judged)?;
        study = changed.study;
        lacking = Some(changed.baseline);
        let of_baseline = |warning| GapWarning::BaselineRecording { warning: Box::new(warning) };
        warnings.extend(changed.warnings.into_iter().map(of_baseline));
    }
    if study.scatter_s > 0.0 {
        warnings.push(GapWarning::UncertainTimes { scatter_s: study.scatter_s });
    }
    let linearised = match prepared.linearised.take().filter(|_| lacking.is_none()) {
        Some(linearised) => linearised,
        None => Linearised::new(&study)?,
    };
    another_machine(&study, &linearised.base.values)?;
    Ok(DrivenModel { study, linearised, baseline: lacking, warnings })
}

/// The gap before and after the cause on held-out steps. Each fold chooses among the causes that the data do not distinguish.
fn gap_on_held_out_steps(library: &LibraryFits, posterior: &Posterior, calibration: &Calibration) -> Gap {
    let weight = |fit: &Fit| weight(calibration, &library.study, fit);
    let compared = Compared {
        study: &library.study,
        linearised: [&library.linearised, library.at_best()],
        null: &library.null,
        causes: &alike(library, posterior),
        weight: &weight,
    };
    held_out_gap(compared, &library.folds)
}

fn closure_terms(
    library: &LibraryFits,
    explained: Verdict,
    search: ClosureSearch,
    calibration: &Calibration,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Discovered {
    let is_wanted = match search {
        ClosureSearch::Always => true,
        ClosureSearch::IfUnexplained => is_open(explained),
        ClosureSearch::Never => false,
    };
    if is_wanted { discover(library, calibration, progress) } else { Discovered::default() }
}

/// What the choice of the next experiment depends on.
struct OpenQuestion<'a> {
    verdict: Verdict,
    locations: &'a [Place],
    has_closure: bool,
}

/// The experiments that would separate the open causes; for a cause outside the library the sensor next to its largest location.
fn next_experiment(
    library: &LibraryFits,
    posterior: &Posterior,
    open: OpenQuestion<'_>,
    allowed: &[Experiment],
    calibration: &Calibration,
) -> Suggested {
    let rivals = match open.verdict {
        Verdict::WithinTolerance => suspicions(&posterior.probabilities, &library.fits, &library.null),
        Verdict::Explained => rivals(&posterior.probabilities, &library.fits),
        Verdict::Unexplained | Verdict::PartlyExplained => {
            let mut sensor = sensor_near(open.locations);
            if let Next::Sensor { reason, .. } = &mut sensor
                && open.has_closure
            {
                "the closure term needs confirmation: measure there, and add it as an effect to the next diagnosis"
                    .clone_into(reason);
            }
            return Suggested { next: Some(sensor), experiments: Vec::new() };
        }
    };
    rivals.map(|rivals| next(&library.study, rivals, allowed, calibration.temperature)).unwrap_or_default()
}

/// The limits of a diagnosis: its drift first, those of recording and file, and a drift that was not subtracted.
fn all_warnings(
    drift: &Option<DriftReport>,
    of_recording: Vec<GapWarning>,
    of_file: Vec<GapWarning>,
    rejected_drift: Option<String>,
) -> Vec<GapWarning> {
    let drift = drift
        .as_ref()
        .map(|drift| GapWarning::Drift { reason: drift.reason.clone(), subtracted: is_of_sensors(drift) });
    let rejected = rejected_drift.map(|reason| GapWarning::DriftNotSubtracted { reason });
    drift.into_iter().chain(of_recording).chain(of_file).chain(rejected).collect()
}

/// The fits of the named cause and of those that the data do not distinguish from it.
fn alike<'a>(library: &'a LibraryFits, posterior: &Posterior) -> Vec<&'a Fit> {
    posterior.alike.iter().map(|place| &library.fits[*place]).collect()
}

fn inseparable(library: &LibraryFits, posterior: &Posterior) -> Vec<String> {
    let parts = |fit: &Fit| -> BTreeSet<Submodel> {
        let effects = &library.study.effects;
        members(&fit.hypothesis).iter().map(|effect| effects[*effect].info().submodel).collect()
    };
    let parts: Vec<BTreeSet<Submodel>> = alike(library, posterior).into_iter().map(parts).collect();
    let in_all = |part: &Submodel| parts.iter().all(|of_fit| of_fit.contains(part));
    let some: BTreeSet<Submodel> = parts.iter().flatten().copied().filter(|part| !in_all(part)).collect();
    some.into_iter().map(|part| part.name().to_owned()).collect()
}

/// After drift subtraction, unmodelled causes below this probability are ignored. The uncertainty of the drift's time history is not in any
/// tolerance, and its residual resembles a small unmodelled cause. Judgement: as sure as a correction must be
/// (`NEEDED_PROBABILITY`).
const SURELY_OUTSIDE: f64 = 0.9;

/// The verdict. No cause is named for a machine that drifts.
fn verdict(explained: Verdict, probability_outside: f64, drift: Option<&DriftReport>) -> Verdict {
    let sensors_drift = drift.is_some_and(is_of_sensors);
    match explained {
        Verdict::Explained | Verdict::PartlyExplained if drift.is_some() && !sensors_drift => {
            Verdict::Unexplained
        }
        Verdict::Unexplained if sensors_drift && probability_outside < SURELY_OUTSIDE => {
            Verdict::WithinTolerance
        }
        explained => explained,
    }
}

/// Whether the effect library leaves a gap.
fn is_open(verdict: Verdict) -> bool {
    matches!(verdict, Verdict::PartlyExplained | Verdict::Unexplained)
}
