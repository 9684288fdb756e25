//! A nightly campaign: full maps on the simulated rig, compared with earlier nights.

use crate::nights::nightly_run::NightlyRun;
use crate::plan::planning::nominal_model;
use crate::variant::Variant;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Nightly;
use mapper_core::Method;
use mapper_fleet::Engine;
use mapper_history::RunRow;
use std::collections::BTreeSet;
use std::path::Path;

/// All runs of a night, ready to start.
pub struct PreparedNight {
    runs: Vec<NightlyRun>,
}

impl PreparedNight {
    /// Reads every campaign of the night, so that mistakes are found before any run.
    ///
    /// # Errors
    /// [`SessionError`] of the first campaign that cannot be part of a night.
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
            let machines: Vec<Option<Variant>> = match (&group.machines, group.drawn_machines) {
                (Some(table), _) => Variant::read(table)?.into_iter().map(Some).collect(),
                (None, Some(count)) => Variant::draw(&campaign, count).into_iter().map(Some).collect(),
                (None, None) => vec![None],
            };
            let seeds = if group.seeds.is_empty() { vec![campaign.seed] } else { group.seeds.clone() };
            for method in methods {
                for &seed in &seeds {
                    for machine in &machines {
                        let run =
                            NightlyRun::new(campaign.clone(), model.clone(), method, seed, machine.clone())?;
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
    ///
    /// # Errors
    /// [`SessionError::NightlyMismatch`] if a run is missing or belongs to another night.
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

/// Parses a method name as written in campaigns.
fn method(name: &str) -> Result<Method, SessionError> {
    serde_json::from_value(name.into()).map_err(|source| SessionError::Method(name.to_owned(), source))
}

impl Session<'_> {
    /// Runs all campaigns on `jobs` threads (default: all cores). Rows come in the order of the nightly campaign for any number of threads.
    ///
    /// # Errors
    /// [`SessionError::Interrupted`] if the operator stopped it, [`SessionError::File`] if the recordings cannot be stored. A failed run becomes
    /// a row with its reason.
    pub fn run_night(&self, night: &PreparedNight, jobs: Option<usize>) -> Result<Vec<RunRow>, SessionError> {
        let runs = &night.runs;
        // Machines that the backend does not know are reported before any run.
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
    ///
    /// # Errors
    /// As [`Session::run_night`].
    pub fn nightly_run(&self, run: &NightlyRun, directory: &Path) -> Result<RunRow, SessionError> {
        std::fs::create_dir(directory).map_err(SessionError::file("create", directory))?;
        let row = run.run(self, directory);
        let _ = std::fs::remove_dir_all(directory);
        row
    }
}
