//! Makes a directory of blind cases.

use crate::blind::calibration::no_cause_study::visibility_on;
use crate::blind::cases::case::{Case, Draw};
use crate::blind::cases::equations::Laboratory;
use crate::blind::cases::truth::Truth;
use crate::blind::error::BlindError;
use crate::blind::outside::outside_kinds;
use crate::blind::seal::{ANSWERS_NAME, MANIFEST_NAME, Manifest, sha256};
use crate::blind::virtual_runs::case_run::Schedule;
use mapper_campaign::{Campaign, nominal_model};
use mapper_numerics::parallel;
use mapper_physics::rig::effect::Effect;
use mapper_recording::RecordingHeader;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Maximum number of cases of one directory.
const MAX_CASES: usize = 100_000;

/// A new directory of cases.
#[derive(Debug, Clone, PartialEq)]
pub struct CreatedCases {
    /// Manifest of the directory.
    pub manifest: Manifest,
    /// Answers in the order of the cases; for calibration, which may know them.
    pub answers: Vec<Truth>,
}

/// Draws cases from `catalogue` and the outside causes, runs each on the virtual lab of `campaign`, and writes to
/// `directory`, which must not contain cases yet: NAME.mcap for each, NAME.baseline.mcap if requested, the answers, and a manifest with their hash.
///
/// `done` receives the number of finished cases. Equal arguments give equal bytes.
///
/// # Errors
/// [`BlindError`] if the campaign has no nominal model, a point cannot be held, or a file cannot be written.
pub fn make(
    campaign: &Campaign,
    catalogue: &[Arc<dyn Effect>],
    draw: &Draw,
    directory: &Path,
    done: &(dyn Fn(usize) + Sync),
) -> Result<CreatedCases, BlindError> {
    let cases = draw_cases(campaign, catalogue, draw)?;
    let nominal = nominal_model(campaign)?;
    // Strengths are always measured with the model's own equations, so that equal seeds give equal causes in both simulators.
    let schedule = Schedule::new(campaign, &nominal)?.on(draw.laboratory);
    std::fs::create_dir_all(directory).map_err(BlindError::file(directory))?;
    let answers = run_all(&schedule, campaign, &cases, draw.baseline, directory, done)?;
    let manifest = seal(&campaign.name, draw.laboratory, draw.baseline, &answers, directory)?;
    Ok(CreatedCases { manifest, answers })
}

/// Draws cases.
///
/// # Errors
/// [`BlindError`] if the campaign has no nominal model or cannot be run, or there are too many.
pub fn draw_cases(
    campaign: &Campaign,
    catalogue: &[Arc<dyn Effect>],
    draw: &Draw,
) -> Result<Vec<Case>, BlindError> {
    if !(1..=MAX_CASES).contains(&draw.cases) {
        return Err(BlindError::Cases { cases: draw.cases, max: MAX_CASES });
    }
    let nominal = nominal_model(campaign)?;
    let schedule = Schedule::new(campaign, &nominal)?;
    let mut known = catalogue.to_vec();
    known.extend(outside_kinds(draw.outside));
    let meter = visibility_on(campaign, &schedule, &nominal, known, draw.seed)?;
    Ok(draw.cases(catalogue, &meter))
}

/// Records one case in a new file and returns its answer.
///
/// # Errors
/// [`BlindError`] if the lab stops, or the file cannot be written.
pub fn record(
    campaign: &Campaign,
    case: &Case,
    laboratory: Laboratory,
    file: &Path,
) -> Result<Truth, BlindError> {
    let nominal = nominal_model(campaign)?;
    Schedule::new(campaign, &nominal)?.on(laboratory).run(case, file, &header(campaign))
}

/// Writes answers and the manifest with their hash into a directory that has neither.
///
/// # Errors
/// [`BlindError::File`].
pub fn seal(
    campaign: &str,
    laboratory: Laboratory,
    baseline: bool,
    answers: &[Truth],
    directory: &Path,
) -> Result<Manifest, BlindError> {
    let bytes = json(&answers, &directory.join(ANSWERS_NAME))?;
    let manifest = Manifest {
        campaign: campaign.to_owned(),
        laboratory,
        baseline,
        former: (),
        cases: answers.iter().map(|answer| answer.name.clone()).collect(),
        answers_sha256: sha256(&bytes),
    };
    json(&manifest, &directory.join(MANIFEST_NAME))?;
    Ok(manifest)
}

fn header(campaign: &Campaign) -> RecordingHeader {
    RecordingHeader {
        library: concat!("mapper ", env!("CARGO_PKG_VERSION")).to_owned(),
        metadata: [("campaign".to_owned(), campaign.name.clone())].into(),
        ..RecordingHeader::default()
    }
}

/// Runs the cases on all cores; each is independent of the others.
fn run_all(
    schedule: &Schedule<'_>,
    campaign: &Campaign,
    cases: &[Case],
    baseline: bool,
    directory: &Path,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Truth>, BlindError> {
    let finished = AtomicUsize::new(0);
    // After a failure no further case is started.
    parallel::try_map(cases, |case| {
        let header = header(campaign);
        let truth = schedule.run(case, &directory.join(format!("{}.mcap", case.name)), &header);
        if baseline && truth.is_ok() {
            let file = directory.join(format!("{}.baseline.mcap", case.name));
            schedule.run_reference(case, &file, &header)?;
        }
        done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        truth
    })
}

fn json(value: &impl serde::Serialize, path: &Path) -> Result<Vec<u8>, BlindError> {
    let bytes = serde_json::to_vec_pretty(value).map_err(|source| BlindError::Content {
        path: path.to_owned(),
        what: "JSON",
        source,
    })?;
    let mut file = std::fs::File::create_new(path).map_err(BlindError::file(path))?;
    std::io::Write::write_all(&mut file, &bytes).map_err(BlindError::file(path))?;
    Ok(bytes)
}
