//! Makes a directory of cases: recordings, and sealed answers whose hash is printed before the diagnosis.

use crate::blind::calibration::visibility;
use crate::blind::cases::{BlindError, Case, Draw, Laboratory, Truth, strengths};
use crate::blind::outside::outside_kinds;
use crate::blind::virtual_runs::Schedule;
use mapper_campaign::{Campaign, nominal_model};
use mapper_fleet::Hash;
use mapper_numerics::parallel;
use mapper_physics::rig::effect::{Effect, EffectParameter};
use mapper_recording::RecordingHeader;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
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
    let meter = visibility(campaign, &schedule, &nominal, known, draw.seed)?;
    Ok(draw.cases(catalogue, &meter))
}

/// Records one case in a new file and returns its answer.
pub fn record(
    campaign: &Campaign,
    case: &Case,
    laboratory: Laboratory,
    file: &Path,
) -> Result<Truth, BlindError> {
    let nominal = nominal_model(campaign)?;
    Schedule::new(campaign, &nominal)?.on(laboratory).run(case, file, &header(campaign))
}

/// Key of a cause that the library does not have, with a sentence.
pub const OUTSIDE_NAME: &str = "outside_catalogue";

/// What a person builds into a rig; without any cause it is a rig as it is.
#[derive(Debug, Clone, Copy)]
pub struct Planted<'a> {
    /// Name of the case.
    pub name: &'a str,
    /// Id of an effect, the parameter if it has several, and its value in the parameter's unit.
    pub causes: &'a [(String, Option<String>, f64)],
    /// A sentence on a cause that the library does not have.
    pub outside: Option<&'a str>,
}

/// Seals causes of `catalogue` and others before the rig is recorded, as a case without a recording.
pub fn plant(
    campaign: &Campaign,
    catalogue: &[Arc<dyn Effect>],
    Planted { name, causes, outside }: Planted<'_>,
    directory: &Path,
) -> Result<Manifest, BlindError> {
    let ids = || catalogue.iter().map(|effect| effect.info());
    let mut effects = serde_json::Map::new();
    for (id, _, _) in causes {
        let info = ids().find(|info| info.id == *id).ok_or_else(|| BlindError::UnknownCause {
            id: id.clone(),
            known: ids().map(|info| info.id.as_ref()).collect::<Vec<_>>().join(", "),
        })?;
        let given = |parameter: &EffectParameter| {
            let is_meant = |name: &Option<String>| match name {
                Some(name) => *name == parameter.name,
                None => info.parameters.len() == 1,
            };
            causes.iter().find(|(other, name, _)| other == id && is_meant(name)).map(|(_, _, value)| *value)
        };
        let values: Option<Vec<f64>> = info.parameters.iter().map(given).collect();
        let count = causes.iter().filter(|(other, _, _)| other == id).count();
        let values = values.filter(|values| values.len() == count).ok_or_else(|| {
            let names: Vec<&str> = info.parameters.iter().map(|parameter| parameter.name.as_ref()).collect();
            BlindError::CauseParameters { id: id.clone(), parameters: names.join(", ") }
        })?;
        for (parameter, value) in info.parameters.iter().zip(&values) {
            if !(parameter.low..=parameter.high).contains(value) {
                return Err(BlindError::CauseRange {
                    id: id.clone(),
                    value: *value,
                    low: parameter.low,
                    high: parameter.high,
                    unit: if parameter.unit == "1" { String::new() } else { format!(" {}", parameter.unit) },
                });
            }
        }
        effects.insert(id.clone(), strengths(&info.parameters, &values));
    }
    effects.extend(outside.map(|sentence| (OUTSIDE_NAME.to_owned(), sentence.into())));
    let answer = Truth { name: name.to_owned(), effects, sigmas: BTreeMap::new(), points: Vec::new() };
    std::fs::create_dir_all(directory).map_err(BlindError::file(directory))?;
    seal(&campaign.name, Laboratory::default(), false, &[answer], directory)
}

/// Writes answers and the manifest with their hash into a directory that has neither.
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
        cases: answers.iter().map(|answer| answer.name.clone()).collect(),
        answers_sha256: Hash::of(&bytes).to_string(),
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

/// File of the answers, within the directory of the cases.
pub const ANSWERS_NAME: &str = "answers.json";
/// File that describes the content of the directory.
pub const MANIFEST_NAME: &str = "manifest.json";

/// Description of a directory of cases. It contains only the hash of the answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name of the campaign.
    pub campaign: String,
    /// The simulator of the cases.
    #[serde(default)]
    pub laboratory: Laboratory,
    /// Whether each rig was also recorded on a night without its causes, as NAME.baseline.mcap.
    #[serde(default)]
    pub baseline: bool,
    /// Names of the cases; each has a recording NAME.mcap.
    pub cases: Vec<String>,
    /// SHA-256 of the file of answers.
    pub answers_sha256: String,
}

impl Manifest {
    /// Reads a manifest.
    pub fn read(path: &Path) -> Result<Manifest, BlindError> {
        read_json(path, "manifest of blind cases")
    }
}

/// Maximum size of a file that is read, bytes: far more than any number of answers.
const MAX_BYTES: u64 = 256 << 20;

pub(crate) fn read_json<T: DeserializeOwned>(path: &Path, what: &'static str) -> Result<T, BlindError> {
    let bytes = read(path)?;
    serde_json::from_slice(&bytes).map_err(|source| BlindError::Content {
        path: path.to_owned(),
        what,
        source,
    })
}

fn read(path: &Path) -> Result<Vec<u8>, BlindError> {
    let mut bytes = Vec::new();
    let file = mapper_yaml::open_file(path).map_err(BlindError::file(path))?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(BlindError::file(path))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(BlindError::TooLarge { path: path.to_owned(), limit: MAX_BYTES });
    }
    Ok(bytes)
}

pub(crate) fn open(directory: &Path, manifest: &Manifest) -> Result<Vec<Truth>, BlindError> {
    let path = directory.join(ANSWERS_NAME);
    let bytes = read(&path)?;
    let actual = Hash::of(&bytes).to_string();
    if actual != manifest.answers_sha256 {
        return Err(BlindError::Seal { path, actual, expected: manifest.answers_sha256.clone() });
    }
    serde_json::from_slice(&bytes).map_err(|source| BlindError::Content { path, what: "answers", source })
}
