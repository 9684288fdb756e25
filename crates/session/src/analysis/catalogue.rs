//! The catalogue of run folders: found, read, and kept as rows of the history. Files on disk win over rows.

use crate::machine::map_file::fitted_if_needed;
use crate::recording::files::read_at_most;
use crate::recording::journal::{JournalPart, is_run_now, read_journal};
use crate::recording::run_directory::{self, CAMPAIGN, EXECUTED, JOURNAL, PLAN, POINTS, RECORDING};
use crate::{MapFile, Registry, SessionError};
use mapper_core::{CompressorMap, IdentifiedPoint, MapDescription, MapFormat, Plan, StepMarker, Verdict};
use mapper_history::{CatalogueFilter, CataloguedRun, History, RunSummary};
use mapper_maps::{MapComparison, compare, repeated_jumps};
use mapper_recording::recording_program;
use mapper_report::instant;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Maximum depth of run folders below the indexed directory.
const MAX_DEPTH: usize = 8;
/// Maximum number of folders that are looked into.
const MAX_FOLDERS: usize = 200_000;
/// Maximum size of a file with results, bytes: those of a night have some megabytes.
const MAX_RESULTS_BYTES: u64 = 256 << 20;
/// The map of a run.
const MAP: &str = "map.json";
/// Files whose size and time say whether a folder has changed.
const STAMPED: [&str; 4] = [JOURNAL, POINTS, CAMPAIGN, RECORDING];

/// Indexes every run folder below `directory`: reads new and changed ones, drops rows of those that are gone. Returns the folders that cannot be
/// read, each with the reason.
pub fn index_runs(directory: &Path, history: &mut History) -> Result<Vec<(String, String)>, SessionError> {
    let (mut folders, mut unreadable) = (Vec::new(), Vec::new());
    // A directory that cannot be read at all must not empty the catalogue.
    std::fs::read_dir(directory).map_err(SessionError::file("read", directory))?;
    find_runs(directory, MAX_DEPTH, &mut folders, &mut unreadable);
    let mut known = history.catalogue_stamps()?;
    let mut read = Vec::new();
    for folder in &folders {
        let (name, stamp) = (folder_name(directory, folder), stamp(folder));
        if known.remove(&name).is_none_or(|known| known != stamp) {
            read.push((name, stamp, summary_of_run(folder)));
        }
    }
    history.update_catalogue(&read, &known.into_keys().collect::<Vec<_>>())?;
    let rows = history.catalogue(&CatalogueFilter { attention: true, ..CatalogueFilter::default() })?.runs;
    unreadable.extend(rows.into_iter().filter_map(|run| Some((run.folder, run.summary.problem?))));
    Ok(unreadable)
}

fn find_runs(folder: &Path, depth: usize, found: &mut Vec<PathBuf>, unreadable: &mut Vec<(String, String)>) {
    if [RECORDING, POINTS, JOURNAL].iter().any(|name| folder.join(name).exists()) {
        found.push(folder.to_owned());
        return;
    }
    match std::fs::read_dir(folder) {
        Err(error) => unreadable.push((folder.display().to_string(), error.to_string())),
        Ok(entries) => {
            // A link may lead out of the directory, or in a circle.
            let is_folder = |entry: &std::fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_dir());
            let mut inside: Vec<PathBuf> =
                entries.flatten().filter(is_folder).map(|entry| entry.path()).collect();
            inside.sort();
            for folder in inside {
                if depth > 0 && found.len() < MAX_FOLDERS {
                    find_runs(&folder, depth - 1, found, unreadable);
                }
            }
        }
    }
}

fn folder_name(directory: &Path, folder: &Path) -> String {
    let below = folder.strip_prefix(directory).unwrap_or(folder);
    let parts: Vec<_> = below.components().map(|part| part.as_os_str().to_string_lossy()).collect();
    if parts.is_empty() { ".".to_owned() } else { parts.join("/") }
}

fn stamp(folder: &Path) -> String {
    let of = |name: &str| {
        let about = folder.join(name).metadata().ok();
        let time = about.as_ref().and_then(|about| about.modified().ok()?.duration_since(UNIX_EPOCH).ok());
        format!("{}@{}", about.map_or(0, |about| about.len()), time.map_or(0, |time| time.as_nanos()))
    };
    STAMPED.map(of).join(" ")
}

/// The parts of a points file that a catalogue shows.
#[derive(Deserialize)]
struct StoredPoints {
    points: Vec<IdentifiedPoint>,
    surge: Option<StoredSurge>,
}

/// The name that the map of an imported log has.
#[derive(Deserialize)]
struct NamedMap {
    machine: String,
}

#[derive(Deserialize)]
struct StoredSurge {
    surges: usize,
}

fn summary_of_run(folder: &Path) -> RunSummary {
    read_summary(folder).unwrap_or_else(|error| RunSummary {
        problem: Some(error.to_string()),
        started: started(folder),
        ..RunSummary::default()
    })
}

/// Start time by the folder's name, else the time of the last change of its recording or points.
fn started(folder: &Path) -> Option<String> {
    let changed = |name: &str| {
        let changed = folder.join(name).metadata().and_then(|about| about.modified()).ok()?;
        instant(u64::try_from(changed.duration_since(UNIX_EPOCH).ok()?.as_nanos()).ok()?)
    };
    run_directory::started(folder).or_else(|| changed(RECORDING)).or_else(|| changed(POINTS))
}

fn read_summary(folder: &Path) -> Result<RunSummary, SessionError> {
    let mut run = RunSummary { started: started(folder), ..RunSummary::default() };
    let journal = folder.join(JOURNAL);
    let parts = if journal.exists() {
        read_journal(&journal).map_err(SessionError::file("read", &journal))?
    } else {
        Vec::new()
    };
    run.program = recording_program(&folder.join(RECORDING));
    let plan = plan_of(folder);
    run.campaign = plan.as_ref().map(|plan| plan.campaign.clone()).unwrap_or_default();
    match parts.into_iter().next_back() {
        Some(JournalPart { identity, ending, .. }) => {
            (run.machine, run.serial_number) = (identity.machine, identity.serial_number);
            run.campaign_sha256 = Some(identity.campaign_sha256);
            run.backend = identity.backend;
            (run.has_journal, run.ending) = (true, ending);
        }
        None => {
            run.machine = json_of::<NamedMap>(folder, MAP).map(|map| map.machine).unwrap_or_default();
        }
    }
    let file = folder.join(POINTS);
    if file.exists() {
        let bytes = read_at_most(&file, MAX_RESULTS_BYTES)?;
        let stored: StoredPoints = serde_json::from_slice(&bytes)
            .map_err(|error| SessionError::file("read", &file)(std::io::Error::other(error)))?;
        run.surges = stored.surge.map(|surge| surge.surges);
        let verdicts = [Verdict::Good, Verdict::Doubtful, Verdict::Unusable];
        run.points =
            verdicts.map(|verdict| stored.points.iter().filter(|point| point.verdict == verdict).count());
        let usable = stored.points.iter().filter(|point| point.verdict != Verdict::Unusable);
        let widths = usable.filter_map(|point| Some(0.5 * (point.eta_high? - point.eta_low?)));
        run.worst_eta_half_width = widths.max_by(f64::total_cmp);
        let markers: Vec<StepMarker> =
            plan.iter().flat_map(|plan| &plan.steps).map(StepMarker::from).collect();
        let changes = repeated_jumps(&markers, &stored.points);
        run.drift = changes.iter().map(|jump| jump.eta_change).max_by(|a, b| a.abs().total_cmp(&b.abs()));
    }
    Ok(run)
}

/// The executed plan, or the one made before; `None` if neither can be read.
fn plan_of(folder: &Path) -> Option<Plan> {
    json_of(folder, EXECUTED).or_else(|| json_of(folder, PLAN))
}

fn json_of<T: serde::de::DeserializeOwned>(folder: &Path, name: &str) -> Option<T> {
    serde_json::from_slice(&read_at_most(&folder.join(name), MAX_RESULTS_BYTES).ok()?).ok()
}

/// A catalogued run with its folder, which lies below the indexed directory.
#[derive(Debug, Clone)]
pub struct RunFolder {
    /// Its row.
    pub run: CataloguedRun,
    /// The folder, without links.
    pub path: PathBuf,
}

impl RunFolder {
    /// The folder of a row. A link that leads out of `directory` is refused.
    pub fn of(directory: &Path, run: CataloguedRun) -> Result<RunFolder, SessionError> {
        let outside =
            |path: &Path| SessionError::file("open", path)(std::io::ErrorKind::PermissionDenied.into());
        let named = Path::new(&run.folder);
        if !named.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
            return Err(outside(named));
        }
        let real = |path: &Path| std::fs::canonicalize(path).map_err(SessionError::file("open", path));
        let path = real(&directory.join(named))?;
        if path.starts_with(real(directory)?) { Ok(RunFolder { run, path }) } else { Err(outside(named)) }
    }

    /// Whether a process runs it now.
    pub fn is_run_now(&self) -> bool {
        is_run_now(&self.path.join(JOURNAL))
    }

    /// Names of the files of its results, plan and campaign, in order.
    pub fn files(&self) -> BTreeSet<String> {
        let entries = std::fs::read_dir(&self.path).into_iter().flatten().flatten();
        let files = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
        let is_plain =
            |name: &String| name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
        let names = files.filter_map(|entry| entry.file_name().into_string().ok()).filter(is_plain);
        names
            .filter(|name| run_directory::is_result(name) || [PLAN, CAMPAIGN].contains(&name.as_str()))
            .collect()
    }

    /// The content of one of its [`files`](RunFolder::files); `None` for any other name.
    pub fn file(&self, name: &str) -> Result<Option<Vec<u8>>, SessionError> {
        let known = self.files().contains(name);
        known.then(|| read_at_most(&self.path.join(name), MAX_RESULTS_BYTES)).transpose()
    }

    /// Its map.
    pub fn map(&self, registry: &Registry) -> Result<CompressorMap, SessionError> {
        match registry.read_map_file(&[&self.path], &MapDescription::default())? {
            MapFile::Compressor(imported) => Ok(imported.map),
            MapFile::Turbine(_) => Err(crate::MapWorkError::TwoMachines(self.path.clone()).into()),
        }
    }

    /// Its map in a format that the program writes: name of the file, content.
    pub fn export(&self, registry: &Registry, format: &str) -> Result<(String, Vec<u8>), SessionError> {
        let format: &MapFormat = registry.written_format(format)?;
        let (map, _) = fitted_if_needed(format, self.map(registry)?)?;
        Ok((format!("map.{}", format.extension), format.write(&map)?))
    }
}

/// Compares the maps of runs with that of the first, by the comparison of two map files.
pub fn compare_runs(
    registry: &Registry,
    runs: &[RunFolder],
) -> Result<(Vec<CompressorMap>, Vec<MapComparison>), SessionError> {
    let maps = runs.iter().map(|run| run.map(registry)).collect::<Result<Vec<_>, _>>()?;
    let Some((first, others)) = maps.split_first() else { return Err(SessionError::NoRecording) };
    let compared = others.iter().map(|other| compare(first, other).map_err(crate::MapWorkError::from));
    let compared = compared.collect::<Result<Vec<_>, _>>()?;
    Ok((maps, compared))
}
