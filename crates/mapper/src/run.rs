//! Runs of a campaign.

use crate::campaign::Campaign;
use crate::error::Error;
use crate::identification::remarks_text;
use crate::recording::Recording;
use mapper_core::{Clock, CompressorMap, IdentifiedPoint, RigDescription, RunEnding, UnpacedClock};
use mapper_session::{Results, RunOutcome, RunRequest, Session, SessionError, SessionEvent};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Called with every event of a run, from any thread that works for it.
pub type Observer = Arc<dyn Fn(&SessionEvent) + Send + Sync>;

/// Called once before the rig is armed; a text refuses the run.
pub type BeforeArming = Box<dyn FnOnce(&RigDescription) -> Result<(), String> + Send>;

/// How a campaign is run. The default: below the campaign's own directory, at full speed, without an observer, and only on a simulated rig.
pub struct RunOptions {
    /// Directory in which the run's own one is created; `None` for the campaign's `outputs.directory`.
    pub parent: Option<PathBuf>,
    /// Start time in the name of the run's directory. A directory of an earlier run is never used again.
    pub started_name: String,
    /// Start time, ns since 1970-01-01 UTC, for recordings of rigs in real time.
    pub started_ns: u64,
    /// The clock that paces the rig. `None`: as fast as possible, which a rig in real time does not allow.
    pub clock: Option<Box<dyn Clock + Send>>,
    /// Set by the caller to stop at the next sample; the rig then goes to its safe state.
    pub stop: Arc<AtomicBool>,
    /// Observer of the run.
    pub observer: Option<Observer>,
    /// Last check before the rig is armed.
    pub before_arming: Option<BeforeArming>,
}

impl Default for RunOptions {
    fn default() -> Self {
        RunOptions {
            parent: None,
            started_name: "run".to_owned(),
            started_ns: 0,
            clock: None,
            stop: Arc::default(),
            observer: None,
            before_arming: None,
        }
    }
}

impl RunOptions {
    /// Options with this parent directory.
    pub fn below(parent: impl Into<PathBuf>) -> RunOptions {
        RunOptions { parent: Some(parent.into()), ..RunOptions::default() }
    }

    pub(crate) fn run(self, campaign: &Campaign) -> Result<Run, Error> {
        let settings = campaign.settings();
        let parent = self.parent.unwrap_or_else(|| PathBuf::from(&settings.outputs.directory));
        let request = RunRequest {
            started_name: &self.started_name,
            started_ns: self.started_ns,
            ..RunRequest::new(settings, campaign.text(), &parent)
        };
        let on_event = |event: &SessionEvent| {
            if let Some(observer) = &self.observer {
                observer(event);
            }
        };
        let session = Session { on_event: &on_event, stop: &self.stop, ..Session::new(campaign.plugins()) };
        let prepared = session.prepare(request).map_err(|error| campaign.show(error))?;
        let rig = prepared.rig();
        if !rig.simulated_time && self.clock.is_none() {
            return Err(refused(format!(
                "backend `{}` is a rig in real time and needs a clock",
                rig.backend
            )));
        }
        if let Some(check) = self.before_arming {
            check(&rig).map_err(refused)?;
        }
        let each_sample = self.clock.is_some();
        let mut clock: Box<dyn Clock> = match self.clock {
            Some(clock) => clock,
            None => Box::new(UnpacedClock),
        };
        Run::of(prepared.run_paced(&session, clock.as_mut(), each_sample)?)
    }
}

impl Campaign {
    /// Runs the campaign on its simulated rig, as fast as possible: plan, steps, recording, identification, map and report. The files are
    /// in a new directory below the campaign's `outputs.directory`.
    ///
    /// # Errors
    /// As [`Campaign::run_with`].
    pub fn run(&self) -> Result<Run, Error> {
        self.run_with(RunOptions::default())
    }

    /// The same with options: directory, pace, stop flag, observer.
    ///
    /// # Errors
    /// If no plan is possible, the rig is not available or fails, a file cannot be written, or the finished recording cannot be identified. A
    /// run that a guard or the operator stopped is not an error: [`Run::ending`] says so, and the rig is safe.
    pub fn run_with(&self, options: RunOptions) -> Result<Run, Error> {
        options.run(self)
    }
}

fn refused(why: String) -> Error {
    SessionError::Preflight(why).into()
}

/// A run that has ended: the rig is safe and the recording is kept.
pub struct Run {
    directory: PathBuf,
    recording: PathBuf,
    ending: RunEnding,
    sentence: String,
    /// `None` if it was stopped before there was anything to identify.
    results: Option<Results>,
}

impl Run {
    fn of(outcome: RunOutcome) -> Result<Run, Error> {
        let sentence = outcome.sentence();
        let RunOutcome { directory, recording, end, results } = outcome;
        let ending = match end {
            Ok(ending) => ending,
            Err(source) => return Err(SessionError::Run { source, recording }.into()),
        };
        let results = match (&ending, results) {
            (_, Ok(results)) => Some(results),
            (RunEnding::Completed, Err(error)) => return Err(error.into()),
            // Stopped before there was anything to identify.
            (_, Err(_)) => None,
        };
        Ok(Run { directory, recording, ending, sentence, results })
    }

    /// The run's directory, with campaign, plan, recording, points, map and report.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The file of the recording.
    pub fn recording_file(&self) -> &Path {
        &self.recording
    }

    /// The recording.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn recording(&self) -> Result<Recording, Error> {
        Recording::open(&self.directory)
    }

    /// How it ended: completed, drifted, tripped or interrupted.
    pub fn ending(&self) -> &RunEnding {
        &self.ending
    }

    /// The same in a sentence.
    pub fn sentence(&self) -> &str {
        &self.sentence
    }

    /// The results with their files: points, map, report and page. `None` if the run was stopped before there was anything to identify.
    pub fn results(&self) -> Option<&Results> {
        self.results.as_ref()
    }

    /// The identified points.
    pub fn points(&self) -> impl Iterator<Item = &IdentifiedPoint> {
        self.results.iter().flat_map(|results| results.identified.points_alone())
    }

    /// The map.
    ///
    /// # Errors
    /// If there is none; the reasons are in the message.
    pub fn map(&self) -> Result<CompressorMap, Error> {
        let results = self.results.as_ref();
        let map = results.and_then(|results| results.compressor_map.clone());
        map.ok_or_else(|| {
            let remarks = results.map_or(&[][..], |results| &results.identified.remarks);
            let why = if remarks.is_empty() { self.sentence.clone() } else { remarks_text(remarks) };
            SessionError::NoMap(why).into()
        })
    }
}
