//! A night: full maps on the simulated rig, compared with the nights before.

use crate::nightly_run::NightlyRun;
use crate::planning::nominal_model;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Nightly;
use mapper_core::Method;
use mapper_history::{RunKey, RunRow};
use mapper_numerics::parallel;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// All runs of a night, ready to start.
pub struct PreparedNight {
    runs: Vec<NightlyRun>,
}

impl PreparedNight {
    /// Reads every campaign of the night. Mistakes are found before anything runs.
    ///
    /// # Errors
    /// [`SessionError`] of the first campaign that cannot be part of a night.
    pub fn new(nightly: &Nightly) -> Result<Self, SessionError> {
        let mut runs: Vec<NightlyRun> = Vec::new();
        for group in &nightly.groups {
            let campaign = mapper_campaign::load(&group.campaign)?;
            if campaign.sequence.is_some() {
                return Err(SessionError::NightlySequence { path: group.campaign.clone() });
            }
            let model = nominal_model(&campaign)?;
            let methods = if group.methods.is_empty() {
                vec![campaign.identification.method]
            } else {
                group.methods.iter().map(|name| method(name)).collect::<Result<_, _>>()?
            };
            let seeds = if group.seeds.is_empty() { vec![campaign.seed] } else { group.seeds.clone() };
            for method in methods {
                for &seed in &seeds {
                    let mut campaign = campaign.clone();
                    campaign.identification.method = method;
                    campaign.seed = seed;
                    let key = RunKey {
                        campaign: campaign.name.clone(),
                        machine: campaign.machine.name.clone(),
                        method: method.to_string(),
                        seed,
                    };
                    if runs.iter().any(|run| run.key == key) {
                        return Err(SessionError::NightlyTwice { key: key.to_string() });
                    }
                    runs.push(NightlyRun { campaign, model: model.clone(), key });
                }
            }
        }
        Ok(PreparedNight { runs })
    }

    /// Number of runs.
    pub fn len(&self) -> usize {
        self.runs.len()
    }

    /// Whether the night has no runs.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }
}

/// A method as campaigns write it.
fn method(name: &str) -> Result<Method, SessionError> {
    serde_json::from_value(name.into())
        .map_err(|source| SessionError::Method { name: name.to_owned(), source })
}

impl Session<'_> {
    /// Runs everything on `jobs` threads, all cores where it is not given. Rows come in the order of the nightly campaign,
    /// whatever the number of threads.
    ///
    /// # Errors
    /// [`SessionError::Interrupted`] where the operator stopped it, [`SessionError::File`] where there is no room for the
    /// recordings. A run that fails is a row that says why.
    pub fn night(&self, night: &PreparedNight, jobs: Option<usize>) -> Result<Vec<RunRow>, SessionError> {
        let runs = &night.runs;
        let room = std::env::temp_dir();
        let scratch = tempfile::Builder::new()
            .prefix("mapper-nightly-")
            .tempdir()
            .map_err(SessionError::file("create a directory in", &room))?;
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let jobs = jobs.unwrap_or(cores).clamp(1, runs.len().max(1));
        let done = AtomicUsize::new(0);
        self.tell(SessionEvent::PiecesDone { done: 0, of: runs.len() });
        parallel::try_map_on(jobs, runs, |index, run| {
            let row = self.nightly_run(run, &scratch.path().join(index.to_string()))?;
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            self.tell(SessionEvent::PiecesDone { done, of: runs.len() });
            Ok(row)
        })
    }

    /// One run in a directory of its own, which is gone afterwards: a night of recordings need not fit on the disk.
    fn nightly_run(&self, run: &NightlyRun, directory: &Path) -> Result<RunRow, SessionError> {
        std::fs::create_dir(directory).map_err(SessionError::file("create", directory))?;
        let row = run.run(self, directory);
        let _ = std::fs::remove_dir_all(directory);
        row
    }
}
