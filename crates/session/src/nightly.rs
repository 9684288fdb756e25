//! A night of runs: its pieces, its rows in the history, comparison with earlier nights, and the report, stored next to the history.

use crate::plan::planning::{nominal_model, plan};
use crate::recording::files::{PROGRAM, json_text};
use crate::recording::recording_file::Recorded;
use crate::recording::run_directory;
use crate::rig::drive::drive;
use crate::rig::observers::Recorder;
use crate::{ErrorKind, Existing, Session, SessionError, SessionEvent, write_file};
use mapper_campaign::{Campaign, Nightly};
use mapper_core::{Method, Plan, RunEnding, Verdict};
use mapper_fleet::Engine;
use mapper_history::{Comparison, ListedRun, Metric, Night, PointRow, RunKey, RunRow, StoredNight};
use mapper_numerics::statistics::mean;
use mapper_physics::simulation::model::Model;
use mapper_recording::score::ScoredPoint;
use mapper_recording::{ChannelMap, ReadOptions, RecordingHeader, RecordingWriter, read_recording};
use mapper_report::{Document, listed_runs, night_comparison};
use mapper_runner::PlanSteps;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// First seed of drawn machines, far above those of campaigns. A machine keeps its own seed for any number of drawn machines.
const FIRST_DRAWN_SEED: u64 = 1_000_000;

/// One drawn machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawnMachine {
    /// Its serial number, the key of its results.
    pub serial_number: String,
    /// Seed of its deviations.
    pub tolerances_seed: u64,
}

impl DrawnMachine {
    /// Machines drawn from the campaign's declared tolerances. Repeated calls return the same machines.
    pub fn draw(campaign: &Campaign, count: usize) -> Vec<DrawnMachine> {
        let kind = campaign.machine.serial_number.as_deref().unwrap_or(&campaign.machine.name);
        let machine = |index| DrawnMachine {
            serial_number: format!("{kind}-drawn-{:04}", index + 1),
            tolerances_seed: FIRST_DRAWN_SEED + index as u64,
        };
        (0..count).map(machine).collect()
    }

    /// Puts the machine into a campaign. The backend itself checks that it can draw machines.
    pub fn apply_to(&self, campaign: &mut Campaign) {
        campaign.machine.serial_number = Some(self.serial_number.clone());
        let settings = &mut campaign.backend.settings;
        if !settings.is_object() {
            *settings = json!({});
        }
        settings["tolerances"] = json!("drawn");
        settings["tolerances_seed"] = json!(self.tolerances_seed);
    }
}

/// All runs of a night, ready to start.
pub struct PreparedNight {
    runs: Vec<NightlyRun>,
}

impl PreparedNight {
    /// Reads every campaign of the night, so that mistakes are found before any run.
    pub fn new(nightly: &Nightly) -> Result<Self, SessionError> {
        let mut runs: Vec<NightlyRun> = Vec::new();
        let mut keys = BTreeSet::new();
        for group in &nightly.groups {
            let campaign = mapper_campaign::load(&group.campaign)?;
            if campaign.sequence.is_some() {
                return Err(SessionError::NightlySequence(group.campaign.clone()));
            }
            let model = nominal_model(&campaign)?;
            let methods = if group.methods.is_empty() {
                vec![campaign.identification.method]
            } else {
                group.methods.iter().map(|name| method(name)).collect::<Result<_, _>>()?
            };
            let drawn = |count| DrawnMachine::draw(&campaign, count).into_iter().map(Some).collect();
            let machines: Vec<Option<DrawnMachine>> = group.drawn_machines.map_or_else(|| vec![None], drawn);
            let seeds = if group.seeds.is_empty() { vec![campaign.seed] } else { group.seeds.clone() };
            for method in methods {
                for &seed in &seeds {
                    for machine in &machines {
                        let run =
                            NightlyRun::new(campaign.clone(), model.clone(), method, seed, machine.clone());
                        if !keys.insert(run.key.clone()) {
                            return Err(SessionError::DuplicateNightlyRun(run.key.to_string()));
                        }
                        runs.push(run);
                    }
                }
            }
        }
        Ok(PreparedNight { runs })
    }

    /// The runs, in the order of the nightly campaign.
    pub fn runs(&self) -> &[NightlyRun] {
        &self.runs
    }

    /// Checks that rows made elsewhere match the runs of this night.
    pub fn check_rows(&self, rows: Vec<RunRow>) -> Result<Vec<RunRow>, SessionError> {
        let expected_keys = self.runs.iter().map(|run| &run.key);
        if expected_keys.eq(rows.iter().map(|row| &row.key)) {
            return Ok(rows);
        }
        let missing = self.runs.iter().find(|run| !rows.iter().any(|row| row.key == run.key));
        let missing =
            missing.map_or_else(|| "it has other runs".to_owned(), |run| format!("it has no {}", run.key));
        Err(SessionError::NightlyMismatch(missing))
    }
}

fn method(name: &str) -> Result<Method, SessionError> {
    serde_json::from_value(name.into()).map_err(|source| SessionError::Method(name.to_owned(), source))
}

impl Session<'_> {
    /// Runs all campaigns on `jobs` threads (default: all cores), rows in the order of the file. A failed run becomes a row with its reason.
    pub fn run_night(&self, night: &PreparedNight, jobs: Option<usize>) -> Result<Vec<RunRow>, SessionError> {
        let runs = &night.runs;
        // A backend that cannot draw machines is reported before any run.
        for run in runs.iter().filter(|run| run.machine.is_some()) {
            self.registry.make_sources(&run.campaign, &run.model)?;
        }
        let temporary = std::env::temp_dir();
        let scratch = tempfile::Builder::new()
            .prefix("mapper-nightly-")
            .tempdir()
            .map_err(SessionError::file("create a directory in", &temporary))?;
        let on_progress = |done, of| self.send(SessionEvent::PiecesDone { done, of });
        let engine = Engine { jobs, stop: self.stop, on_progress: &on_progress };
        let run_one =
            |index: usize, run: &NightlyRun| self.nightly_run(run, &scratch.path().join(index.to_string()));
        // A missing row means that the operator stopped the night before this run.
        engine.each(runs, run_one)?.into_iter().collect::<Option<_>>().ok_or(SessionError::Interrupted)
    }

    /// Makes one run in a new directory and deletes it afterwards, because a night of recordings may not fit on the disk.
    pub fn nightly_run(&self, run: &NightlyRun, directory: &Path) -> Result<RunRow, SessionError> {
        std::fs::create_dir(directory).map_err(SessionError::file("create", directory))?;
        let row = run.run(self, directory);
        let _ = std::fs::remove_dir_all(directory);
        row
    }
}

/// A campaign with method and seed set, ready to run.
pub struct NightlyRun {
    /// The campaign, with method and seed.
    pub campaign: Campaign,
    /// Its nominal model.
    pub model: Model,
    /// The machine, if it is one of several.
    pub machine: Option<DrawnMachine>,
    /// Key of the run, the same every night.
    pub key: RunKey,
}

impl NightlyRun {
    /// A campaign with a method, a seed and, optionally, one of several machines.
    pub fn new(
        mut campaign: Campaign,
        model: Model,
        method: Method,
        seed: u64,
        machine: Option<DrawnMachine>,
    ) -> NightlyRun {
        campaign.identification.method = method;
        campaign.seed = seed;
        if let Some(machine) = &machine {
            machine.apply_to(&mut campaign);
        }
        let key = RunKey {
            campaign: campaign.name.clone(),
            machine: machine
                .as_ref()
                .map_or_else(|| campaign.machine.name.clone(), |machine| machine.serial_number.clone()),
            method: method.to_string(),
            seed,
        };
        NightlyRun { campaign, model, machine, key }
    }

    pub(crate) fn run(&self, session: &Session<'_>, directory: &Path) -> Result<RunRow, SessionError> {
        let mut row = RunRow {
            key: self.key.clone(),
            campaign_sha256: String::new(),
            model_sha256: String::new(),
            failure: None,
            figures: BTreeMap::new(),
            points: Vec::new(),
        };
        match self.fill_row(&mut row, session, directory) {
            Err(error) if error.kind() == ErrorKind::Interrupted => return Err(error),
            Err(error) => row.failure = Some(error.to_string()),
            Ok(()) => {}
        }
        Ok(row)
    }

    fn fill_row(
        &self,
        row: &mut RunRow,
        session: &Session<'_>,
        directory: &Path,
    ) -> Result<(), SessionError> {
        let plan = plan(&self.campaign, &self.model)?;
        row.campaign_sha256 = plan.made_from.campaign_sha256.clone();
        row.model_sha256 = plan.made_from.model_sha256.clone();
        match self.record_and_read(&plan, session, directory)? {
            Ok(recorded) => {
                let identified = session.identify(vec![recorded], &ChannelMap::native(), None)?;
                row.figures = metrics(&identified.points, &plan);
                row.points = point_rows(&identified.points);
            }
            Err(stopped) => row.failure = Some(stopped),
        }
        Ok(())
    }

    /// Identifies one recording by each method; returns the points with their truth. The inner `Err`: why a guard stopped the run.
    pub fn points(
        &self,
        session: &Session<'_>,
        directory: &Path,
        methods: &[Method],
    ) -> Result<Result<Vec<Value>, String>, SessionError> {
        let plan = plan(&self.campaign, &self.model)?;
        let recording = match self.record_and_read(&plan, session, directory)? {
            Ok(recorded) => recorded.path,
            Err(stopped) => return Ok(Err(stopped)),
        };
        let identify_with = |method: &Method| -> Result<Value, SessionError> {
            let recorded = self.read(&recording)?;
            let identified = session.identify(vec![recorded], &ChannelMap::native(), Some(*method))?;
            Ok(serde_json::to_value(&identified.points)?)
        };
        methods.iter().map(identify_with).collect::<Result<_, _>>().map(Ok)
    }

    /// Runs the campaign and reads the recording. The inner `Err` is the reason if a guard stopped the run.
    fn record_and_read(
        &self,
        plan: &Plan,
        session: &Session<'_>,
        directory: &Path,
    ) -> Result<Result<Recorded, String>, SessionError> {
        let recording = directory.join(run_directory::RECORDING);
        match self.record(plan, session, &recording)? {
            RunEnding::Completed => Ok(Ok(self.read(&recording)?)),
            RunEnding::Interrupted { .. } => Err(SessionError::Interrupted),
            RunEnding::Drifted { reason } | RunEnding::Failed { reason } => Ok(Err(reason)),
            RunEnding::Tripped(trip) => Ok(Err(format!("stopped at {:.1} s: {}", trip.t_s, trip.reason))),
        }
    }

    fn read(&self, recording: &Path) -> Result<Recorded, SessionError> {
        let read = read_recording(recording, &ChannelMap::native(), &ReadOptions::default())?;
        Ok(Recorded::of(recording.to_owned(), read, Some(self.campaign.clone())))
    }

    fn record(
        &self,
        plan: &Plan,
        session: &Session<'_>,
        recording: &Path,
    ) -> Result<RunEnding, SessionError> {
        let mut backend = session.registry.make_sources(&self.campaign, &self.model)?.backend;
        let header = RecordingHeader {
            library: PROGRAM.to_owned(),
            plan_json: Some(json_text(plan)?.into_bytes()),
            ..RecordingHeader::default()
        };
        let mut recorder = Recorder::new(RecordingWriter::create(recording, &header)?);
        // A night runs many campaigns in parallel; no step events are sent.
        let mut steps = PlanSteps::new(plan);
        let end =
            drive(&self.campaign, &self.model, &mut steps, backend.as_mut(), &mut recorder, session.stop)
                .map_err(|source| SessionError::Run { source, recording: recording.to_owned() })?;
        // Nightly runs have no journal.
        recorder.finish(RunEnding::Completed)?;
        Ok(end)
    }
}

fn metrics(points: &[ScoredPoint], plan: &Plan) -> BTreeMap<Metric, f64> {
    let score = mapper_recording::score::summarise(points);
    let good = points.iter().filter(|scored| scored.point.verdict == Verdict::Good).count();
    // Means of the truth use the same points as means of the results.
    let both = |scored: &&ScoredPoint| scored.point.eta.is_some() && scored.truth.is_some();
    let with_eta: Vec<&ScoredPoint> = points.iter().filter(both).collect();
    Metric::ALL
        .into_iter()
        .filter_map(|metric| {
            let value = match metric {
                Metric::GoodPoints => Some(good as f64),
                Metric::EtaMean => mean(with_eta.iter().filter_map(|scored| scored.point.eta)),
                Metric::EtaTrueMean => mean(with_eta.iter().filter_map(|scored| Some(scored.truth?.eta))),
                Metric::EtaMedianError => score.map(|score| score.eta_median_error),
                Metric::EtaWorstError => score.map(|score| score.eta_worst_error),
                Metric::EtaCoverage => score.map(|score| score.eta_coverage_ratio),
                Metric::HMean => mean(with_eta.iter().filter_map(|scored| scored.point.h_w_m2k)),
                Metric::HTrueMean => mean(with_eta.iter().filter_map(|scored| Some(scored.truth?.h_w_m2k))),
                Metric::HMedianError => score.and_then(|score| score.h_median_error_ratio),
                Metric::HWorstError => score.and_then(|score| score.h_worst_error_ratio),
                Metric::RigMinutes => Some(plan.duration_s() / 60.0),
            };
            Some((metric, value.filter(|value| value.is_finite())?))
        })
        .collect()
}

fn point_rows(points: &[ScoredPoint]) -> Vec<PointRow> {
    let mut visits: BTreeMap<(u64, u64), usize> = BTreeMap::new();
    points
        .iter()
        .map(|ScoredPoint { point, truth }| {
            let speed_rpm = point.target.map_or(point.speed_rpm, |target| target.speed_rpm);
            let visits =
                visits.entry((speed_rpm.to_bits(), point.valve_opening_ratio.to_bits())).or_default();
            let visit = *visits;
            *visits += 1;
            PointRow {
                speed_rpm,
                valve_opening_ratio: point.valve_opening_ratio,
                visit,
                eta: point.eta,
                eta_true: truth.map(|truth| truth.eta),
                h_w_m2k: point.h_w_m2k,
                h_true_w_m2k: truth.map(|truth| truth.h_w_m2k),
            }
        })
        .collect()
}

/// Report path of the night that began at this time (ms since 1970-01-01 00:00 UTC), e.g. `runs/history.nights/1763942400000.txt`.
pub fn night_report_path(history: &Path, started_ms: i64) -> PathBuf {
    history.with_extension("nights").join(format!("{started_ms}.txt"))
}

/// Writes the report of the night, with a row for each run.
pub fn write_night_report(
    history: &Path,
    night: &Night,
    comparison: &Comparison,
) -> Result<(), SessionError> {
    let path = night_report_path(history, night.started_ms);
    let folder = path.parent().unwrap_or(history);
    std::fs::create_dir_all(folder).map_err(SessionError::file("create", folder))?;
    let text = format!(
        "{}, {}\n\n{}\n{}",
        night.name,
        night.program,
        night_comparison(night, comparison, history),
        night_runs(night, !comparison.is_quiet())
    );
    write_file(&path, text.as_bytes(), Existing::Replaced)
}

/// A row for each run of a night that may not be in a history.
pub fn night_runs(night: &Night, moved: bool) -> Document {
    let stored = StoredNight {
        id: 0,
        name: night.name.clone(),
        started_ms: night.started_ms,
        duration_s: night.duration_s,
        program: night.program.clone(),
        accepted: night.accepted,
        moved,
    };
    let runs: Vec<ListedRun> =
        night.runs.iter().map(|run| ListedRun { night: stored.clone(), run: run.clone() }).collect();
    listed_runs(&runs, &Metric::ALL)
}

/// Link from a picture to the report of a night, relative if possible and absolute otherwise. `None` without a report.
pub fn night_report_link(picture: &Path, history: &Path, started_ms: i64) -> Option<String> {
    let report = std::fs::canonicalize(night_report_path(history, started_ms)).ok()?;
    let folder = picture.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = std::fs::canonicalize(folder).ok()?;
    match report.strip_prefix(folder) {
        Ok(relative) => Some(escaped(relative)),
        Err(_) => Some(format!("file://{}", escaped(&report))),
    }
}

fn escaped(path: &Path) -> String {
    let mut text = String::new();
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' | b'~' => {
                text.push(char::from(byte));
            }
            // Writing to a string cannot fail.
            _ => drop(write!(text, "%{byte:02X}")),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_links_to_the_report_next_to_it_or_anywhere_on_the_disk() {
        let scratch = tempfile::tempdir().unwrap();
        let runs = scratch.path().join("my runs");
        let history = runs.join("history.db");
        std::fs::create_dir_all(runs.join("history.nights")).unwrap();
        std::fs::write(night_report_path(&history, 5), "").unwrap();
        let link = |picture: PathBuf| night_report_link(&picture, &history, 5).unwrap();
        assert_eq!(link(runs.join("a.svg")), "history.nights/5.txt");
        assert_eq!(link(scratch.path().join("a.svg")), "my%20runs/history.nights/5.txt");
        std::fs::create_dir(scratch.path().join("other")).unwrap();
        let far = link(scratch.path().join("other/a.svg"));
        assert!(far.starts_with("file:///") && far.ends_with("my%20runs/history.nights/5.txt"), "{far}");
        assert_eq!(night_report_link(&runs.join("a.svg"), &history, 6), None);
    }
}
