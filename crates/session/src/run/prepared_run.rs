//! A complete run: makes the plan, drives the rig, records, identifies, assembles the map, and writes the report.

use crate::analysis::results::{Results, RunPart};
use crate::plan::planning::{ScriptedSteps, hash_inputs, hold_near_surge, nominal_model, plan, stored_plan};
use crate::plan::rehearsal::rehearse;
use crate::recording::files::{PROGRAM, json_text, write_new};
use crate::recording::identification_config::{declared, identification};
use crate::recording::journal::{Entry, Identity, Journal, rig_sha256};
use crate::recording::resume::{InterruptedRun, MissingSteps, depends_on_readings};
use crate::recording::run_directory;
use crate::rig::drive::{Pace, check_guards, drive_paced, soak_s};
use crate::rig::observers::{EventForwarder, Lockouts, Recorder, StepEstimator, ThreadedObserver};
use crate::rig::rig_state::{ADDRESS_PREFIX, RigLease, RigStates};
use crate::rig::sources::Sources;
use crate::run::commissioning::Commissioning;
use crate::run::preflight::{check_room, check_setpoints};
use crate::run::replayed_steps::drive_resumed;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::MapSource;
use mapper_core::{Clock, Plan, PlanInputHashes, Reaction, RigDescription, RunEnding, UnpacedClock};
use mapper_physics::simulation::model::Model;
use mapper_recording::{ChannelMap, DiskFaults, RecordingHeader, RecordingWriter, RunFile};
use mapper_report::Message;
use mapper_runner::{
    DeadlineBackend, Deadlines, DriftWatch, PlanSteps, RunError, RunObserver, StepSource, SurgeSearch,
    stated_end,
};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Deadlines for rig calls. Arming and release get slightly more time than a driver has (docs/reference/protocol.md).
const DEADLINES: Deadlines = Deadlines { arming: Duration::from_secs(11), call: Duration::from_secs(2) };

/// Request for a run.
pub struct RunRequest<'a> {
    /// The campaign.
    pub campaign: &'a Campaign,
    /// Its text, stored with the run and in the recording.
    pub campaign_text: &'a str,
    /// A stored plan to run instead of a new one.
    pub plan: Option<&'a Path>,
    /// Parent directory, in which the run directory is created.
    pub parent: &'a Path,
    /// Start time, ns since 1970-01-01 UTC, for recordings of rigs in real time.
    pub started_ns: u64,
    /// Start time in the name of the run directory, e.g. `20261122T101500Z`.
    pub started_name: &'a str,
    /// Directory of the locks and lockouts of rigs; `None` for `.rigs` in `parent`.
    pub rig_states: Option<&'a Path>,
    /// The interrupted run to resume.
    pub resume: Option<InterruptedRun>,
}

impl<'a> RunRequest<'a> {
    /// A run on a simulated rig, with time starting at 0. Its directory is `<parent>/<campaign>-run`.
    pub fn new(campaign: &'a Campaign, campaign_text: &'a str, parent: &'a Path) -> Self {
        RunRequest {
            campaign,
            campaign_text,
            plan: None,
            parent,
            started_ns: 0,
            started_name: "run",
            rig_states: None,
            resume: None,
        }
    }
}

/// A run that is ready to start; nothing has been written or armed yet.
pub struct PreparedRun<'a> {
    request: RunRequest<'a>,
    model: Model,
    plan: Plan,
    scripted: Option<ScriptedSteps>,
    sources: Sources,
}

/// Outcome of a run. In all cases the rig is safe and the recording is kept.
#[derive(Debug)]
pub struct RunOutcome {
    /// The run's directory.
    pub directory: PathBuf,
    /// Its recording.
    pub recording: PathBuf,
    /// How it ended; the error if rig, script or recording failed.
    pub end: Result<RunEnding, RunError>,
    /// The results, or the reason for their absence.
    pub results: Result<Results, SessionError>,
}

/// A run without results; as [`RunOutcome`].
#[allow(missing_docs, reason = "the same fields")]
pub struct RecordedRun {
    pub directory: PathBuf,
    pub recording: PathBuf,
    pub end: Result<RunEnding, RunError>,
    pub(crate) parts: Vec<RunPart>,
}

impl RunOutcome {
    /// The end of the run in one sentence.
    pub fn sentence(&self) -> String {
        for_files(&self.end).message()
    }
}

fn for_files(end: &Result<RunEnding, RunError>) -> RunEnding {
    end.as_ref().map_or_else(|error| RunEnding::Failed { reason: error.to_string() }, Clone::clone)
}

/// Why the rig must be locked out: its state is unknown, or it must be inspected before the next run. `None` if the next run may start.
pub(crate) fn lockout_reason(end: &Result<RunEnding, RunError>) -> Option<String> {
    match end {
        Ok(RunEnding::Tripped(trip)) if trip.reaction == Reaction::Latch => Some(trip.reason.clone()),
        Err(error) if error.leaves_rig_state_unknown() => Some(error.to_string()),
        _ => None,
    }
}

impl<'s> Session<'s> {
    /// Makes the plan or checks the stored one, rehearses a script and creates the backend. Errors here never reach the rig.
    pub fn prepare<'a>(&self, request: RunRequest<'a>) -> Result<PreparedRun<'a>, SessionError> {
        let (campaign, mut request) = (request.campaign, request);
        if let Some(interrupted) = &mut request.resume {
            interrupted.discard_superseded_steps(campaign)?;
        }
        self.registry.check_formats(campaign)?;
        let model = nominal_model(campaign)?;
        let sources = self.registry.make_sources(campaign, &model)?;
        let rig = sources.backend.describe();
        let rig_sha256 = Some(rig_sha256(&rig)?);
        let earlier_plan =
            request.resume.as_ref().map(|interrupted| interrupted.directory.join(run_directory::PLAN));
        let mut plan = match (request.plan.or(earlier_plan.as_deref()), &campaign.sequence) {
            (Some(path), _) => {
                let now =
                    PlanInputHashes { rig_sha256: rig_sha256.clone(), ..hash_inputs(campaign, &model)? };
                stored_plan(path, &now, campaign)?
            }
            (None, None) => plan(campaign, &model)?,
            (None, Some(source)) => rehearse(self, campaign, &model, source)?.plan,
        };
        plan.made_from.rig_sha256 = rig_sha256;
        let scripted = match &campaign.sequence {
            Some(source) if request.plan.is_none() => {
                Some(ScriptedSteps::new(campaign, &model, source, &rig)?)
            }
            _ => None,
        };
        check_guards(campaign, &rig)?;
        check_setpoints(&plan, &rig)?;
        if let Some(interrupted) = &mut request.resume {
            interrupted.check(campaign, &plan, &Identity::of(campaign, &plan, &rig)?)?;
        }
        Ok(PreparedRun { request, model, plan, scripted, sources })
    }

    /// Prepares the steps of a commissioning on the rig of the request's campaign.
    pub fn prepare_commissioning<'a>(
        &self,
        commissioning: &'a Commissioning,
        request: RunRequest<'a>,
    ) -> Result<PreparedRun<'a>, SessionError> {
        let model = nominal_model(request.campaign)?;
        let sources = self.registry.make_sources(request.campaign, &model)?;
        let rig = sources.backend.describe();
        let mut plan = commissioning.plan.clone();
        plan.made_from.rig_sha256 = Some(rig_sha256(&rig)?);
        let campaign = &commissioning.campaign;
        check_guards(campaign, &rig)?;
        check_setpoints(&plan, &rig)?;
        Ok(PreparedRun { request: RunRequest { campaign, ..request }, model, plan, scripted: None, sources })
    }

    /// Prepares and runs.
    pub fn run(&self, request: RunRequest<'_>) -> Result<RunOutcome, SessionError> {
        self.prepare(request)?.run(self)
    }
}

impl PreparedRun<'_> {
    /// The plan to run.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The rig.
    pub fn rig(&self) -> RigDescription {
        self.sources.backend.describe()
    }

    /// Drives the rig at full speed, records, identifies, reports.
    pub fn run(self, session: &Session<'_>) -> Result<RunOutcome, SessionError> {
        self.run_paced(session, &mut UnpacedClock, false)
    }

    /// Drives the rig at the pace of a clock, records, identifies, reports. With `each_sample`, each sample is polled separately.
    pub fn run_paced(
        self,
        session: &Session<'_>,
        clock: &mut dyn Clock,
        each_sample: bool,
    ) -> Result<RunOutcome, SessionError> {
        if let Some(outcome) = self.finish_complete_run(session)? {
            return Ok(outcome);
        }
        let (run, recorded) = self.record_paced(session, clock, each_sample)?;
        let RecordedRun { directory, recording, end, parts } = recorded;
        move_earlier_results(&directory)?;
        let executed = run.executed(&directory);
        let results = run.results(session, executed, for_files(&end), &directory, &parts);
        Ok(RunOutcome { directory, recording, end, results })
    }

    /// Drives the rig at the pace of a clock and records, without results. Returns this run too.
    pub fn record_paced(
        mut self,
        session: &Session<'_>,
        clock: &mut dyn Clock,
        each_sample: bool,
    ) -> Result<(Self, RecordedRun), SessionError> {
        let rig = self.rig();
        if !rig.simulated_time {
            let backend =
                DeadlineBackend::new(self.sources.backend, DEADLINES).map_err(SessionError::Backend)?;
            self.sources.backend = Box::new(backend);
        }
        let mut lease = self.acquire_lease(&rig)?;
        let opened = self.open_recorder(&mut lease, &rig, &session.registry.disk);
        let (directory, recording, recorder) = match opened {
            Ok(opened) => opened,
            Err(error) => {
                lease.release_untouched()?;
                return Err(error);
            }
        };
        let mut parts = self.earlier_parts(&directory);
        let auxiliary_channels = self.sources.auxiliary_channels.clone();
        let pace = Pace {
            clock,
            each_sample,
            stop: session.stop,
            stop_after_step: session.stop_after_step,
            operator: session.operator,
            auxiliary_channels: &auxiliary_channels,
        };
        let (end, finished, lockout) = self.drive_and_record(session, recorder, &directory, &lease, pace);
        match (&end, lockout) {
            (Err(RunError::NotArmed(_)), None) => lease.release_untouched()?,
            (_, lockout) => lease.release(lockout, &directory)?,
        }
        session.send(SessionEvent::RigReleased);
        if let Err(error @ RunError::NotArmed(_)) = end {
            return Err(self.discard_unarmed_run(error, &directory));
        }
        // A failed run has its own reason; any other run must have a complete file.
        if matches!(end, Ok(RunEnding::Completed | RunEnding::Drifted { .. })) {
            finished?;
        }
        parts.push(RunPart { recording: recording.clone(), soaked: true, saved: None });
        Ok((self, RecordedRun { directory, recording, end, parts }))
    }

    /// Creates the files of a run, before the rig is armed: its directory, recording and journal.
    fn open_recorder(
        &self,
        lease: &mut RigLease,
        rig: &RigDescription,
        disk: &Option<DiskFaults>,
    ) -> Result<(PathBuf, PathBuf, Recorder), SessionError> {
        let (directory, plan_json) = (self.create_directory()?, json_text(&self.plan)?);
        lease.record_owner(&directory, self.request.started_name)?;
        check_room(&directory, soak_s(self.request.campaign) + self.plan.duration_s(), rig)?;
        let mut name = run_directory::RECORDING.to_owned();
        if let Some(interrupted) = &self.request.resume {
            // A kill before the journal named its recording leaves one that belongs to no part; one that is gone keeps its name.
            let is_used = |name: &String| {
                directory.join(name).exists() || interrupted.parts.iter().any(|part| part.recording == *name)
            };
            let mut names = (2..).map(run_directory::further_recording);
            name = names.find(|name| !is_used(name)).unwrap_or(name);
        }
        let recording = directory.join(&name);
        let path = directory.join(run_directory::JOURNAL);
        let mut journal =
            Journal::open(&path, !rig.simulated_time, disk.clone()).map_err(|error| match error.kind() {
                ErrorKind::WouldBlock => {
                    SessionError::NotResumable { run: directory.clone(), why: error.to_string() }
                }
                _ => SessionError::file("write", &path)(error),
            })?;
        // With several sources, each has its own sample times.
        let writer = RecordingWriter::create_on(disk.clone(), &recording, &self.header(plan_json))?
            .omit_absent(!self.sources.auxiliary_channels.is_empty());
        let identity = Identity::of(self.request.campaign, &self.plan, rig)?;
        journal
            .write(&Entry::Part { identity, recording: name })
            .map_err(SessionError::file("write", &path))?;
        // A rig in real time keeps running if this computer fails, so the recording is flushed to disk.
        let opened = if rig.simulated_time { None } else { std::fs::File::open(&recording).ok() };
        let sync_handle = opened.map(|file| RunFile::new(file, &recording, disk.clone()));
        Ok((directory, recording, Recorder::new(writer).with_journal(journal, sync_handle)))
    }

    fn discard_unarmed_run(&self, error: RunError, directory: &Path) -> SessionError {
        if self.request.resume.is_none() && !error.leaves_rig_state_unknown() {
            // A failure leaves an empty run directory, which is harmless.
            let _ = std::fs::remove_dir_all(directory);
        }
        SessionError::NotArmed(error)
    }

    fn results(
        &self,
        session: &Session<'_>,
        executed: Result<Plan, SessionError>,
        ending: RunEnding,
        directory: &Path,
        parts: &[RunPart],
    ) -> Result<Results, SessionError> {
        let what = "identifying the recorded steps".to_owned();
        session.send(SessionEvent::Progress { done_ratio: 0.0, what });
        let (campaign, started_ns) = (self.request.campaign, self.request.started_ns);
        let results = session.results(campaign, &executed?, ending, started_ns, directory, parts)?;
        let path = directory.join(run_directory::JOURNAL);
        Journal::open(&path, false, None)
            .and_then(|mut journal| journal.write(&Entry::Results))
            .map_err(SessionError::file("write", &path))?;
        Ok(results)
    }

    /// Identifies a run that was interrupted after its last step. Only the map is missing, so the rig is not used.
    fn finish_complete_run(&self, session: &Session<'_>) -> Result<Option<RunOutcome>, SessionError> {
        let Some(interrupted) = &self.request.resume else { return Ok(None) };
        if !interrupted.is_complete(self.request.campaign, &self.plan) {
            return Ok(None);
        }
        let directory = interrupted.directory.clone();
        let parts = self.earlier_parts(&directory);
        let recording = parts.last().map_or_else(PathBuf::new, |part| part.recording.clone());
        let end = Ok(RunEnding::Completed);
        move_earlier_results(&directory)?;
        let results = self.results(session, Ok(self.plan.clone()), RunEnding::Completed, &directory, &parts);
        Ok(Some(RunOutcome { directory, recording, end, results }))
    }

    fn acquire_lease(&self, rig: &RigDescription) -> Result<RigLease, SessionError> {
        let default = self.request.parent.join(".rigs");
        let states = RigStates::new(self.request.rig_states.unwrap_or(&default));
        let resumed_directory =
            self.request.resume.as_ref().map(|interrupted| interrupted.directory.as_path());
        let address = rig.reached_at.iter().map(|address| format!("{ADDRESS_PREFIX}{address}"));
        let shared: Vec<String> = self.sources.exclusive.iter().cloned().chain(address).collect();
        RigLease::acquire(&states, rig.exclusive.as_deref(), &shared, resumed_directory)
    }

    fn create_directory(&self) -> Result<PathBuf, SessionError> {
        if let Some(interrupted) = &self.request.resume {
            return Ok(interrupted.directory.clone());
        }
        let campaign = self.request.campaign;
        let directory =
            run_directory::create(self.request.parent, &campaign.name, self.request.started_name)?;
        write_new(&directory.join(run_directory::CAMPAIGN), self.request.campaign_text.as_bytes())?;
        write_new(&directory.join(run_directory::PLAN), json_text(&self.plan)?.as_bytes())?;
        if let MapSource::Table { named, text, description, .. } = &campaign.machine.map {
            run_directory::keep_copy(&directory, named, text)?;
            if let Some(description) = description {
                run_directory::keep_copy(&directory, &description.named, &description.text)?;
            }
        }
        if let Some(source) = &campaign.sequence {
            write_new(&directory.join(run_directory::SEQUENCE), source.text.as_bytes())?;
            // A resumed run finds the script under the name in its campaign.
            if Path::new(&source.named) != Path::new(run_directory::SEQUENCE) {
                run_directory::keep_copy(&directory, &source.named, &source.text)?;
            }
        }
        Ok(directory)
    }

    fn earlier_parts(&self, directory: &Path) -> Vec<RunPart> {
        let parts = self.request.resume.iter().flat_map(|interrupted| &interrupted.parts);
        parts
            .map(|part| RunPart {
                recording: directory.join(&part.recording),
                soaked: part.soaked,
                saved: Some(part.saved.clone()),
            })
            .collect()
    }

    fn drive_and_record(
        &mut self,
        session: &Session<'_>,
        recorder: Recorder,
        directory: &Path,
        lease: &RigLease,
        pace: Pace<'_>,
    ) -> (Result<RunEnding, RunError>, Result<(), SessionError>, Option<String>) {
        let mut planned = PlanSteps::new(&self.plan);
        let mut missing;
        // A resumed run uses its unchanged plan, or replays its data if later steps depend on them.
        let interrupted = self.request.resume.as_ref();
        let replayed = interrupted.filter(|_| depends_on_readings(self.request.campaign));
        let from_plan = interrupted.filter(|_| replayed.is_none());
        // A recorded soak applies to the whole run, so a resumed run does not repeat it.
        let without_soak;
        let mut campaign = self.request.campaign;
        if interrupted.is_some_and(InterruptedRun::has_soak) {
            without_soak = Campaign { zero: None, ..campaign.clone() };
            campaign = &without_soak;
        }
        let mut steps_s = self.plan.duration_s();
        let steps: &mut dyn StepSource = match (&mut self.scripted, from_plan) {
            (Some(scripted), _) => scripted,
            (None, Some(interrupted)) => {
                let saved = interrupted.saved();
                let note = interrupted.summary(self.request.campaign, &self.plan, &saved);
                missing = MissingSteps::new(&self.plan, &saved, note);
                steps_s = missing.duration_s();
                &mut missing
            }
            (None, None) => &mut planned,
        };
        let hold = |point| hold_near_surge(campaign, &self.model, point);
        let mut search;
        let steps: &mut dyn StepSource = match campaign.surge_search {
            None => steps,
            Some(settings) => {
                search = SurgeSearch::new(steps, settings, campaign.reference, &hold);
                &mut search
            }
        };
        let mut forwarder = EventForwarder {
            on_event: session.on_event,
            steps: self.plan.steps.len(),
            duration_s: soak_s(campaign) + steps_s,
            steps_left_s: steps_s - self.plan.warm_up_s - self.plan.cool_down_s,
            cool_down_s: self.plan.cool_down_s,
        };
        let (model, backend) = (&self.model, self.sources.backend.as_mut());
        let (end, drifted, recorder) = std::thread::scope(|scope| {
            let start = || StepEstimator::start(scope, identification(campaign), session.on_event);
            let mut estimates = session.estimates.then(start);
            let mut recorder = ThreadedObserver::start(scope, recorder, session.registry.disk.is_some());
            let mut lockouts = Lockouts { lease, run: directory, scope };
            let mut observers: Vec<&mut dyn RunObserver> = vec![&mut lockouts, &mut recorder, &mut forwarder];
            observers.extend(estimates.as_mut().map(|estimates| estimates as &mut dyn RunObserver));
            let run_steps = |steps: &mut dyn StepSource| {
                drive_resumed(replayed, steps, |steps| {
                    drive_paced(campaign, model, steps, backend, &mut observers, pace)
                })
            };
            let (end, drifted) = match campaign.on_drift {
                Some(on_drift) => {
                    let sensors = declared(campaign, &ChannelMap::native());
                    let mut watch = DriftWatch::new(steps, on_drift, sensors);
                    (run_steps(&mut watch), watch.end_reason().map(str::to_owned))
                }
                None => (run_steps(steps), None),
            };
            let (recorder, recorded) = recorder.end();
            // A write error at the very end is reported after the run, unless a guard ended it.
            let recorded = recorded.map_err(RunError::from);
            let end = end.and_then(|end| stated_end(Ok(end), Ok(()), String::new(), recorded));
            (end, drifted, recorder)
        });
        let lockout = lockout_reason(&end);
        let end = end.map(|ending| match (ending, drifted) {
            (RunEnding::Completed, Some(reason)) => RunEnding::Drifted { reason },
            (ending, _) => ending,
        });
        let finished = recorder.finish(for_files(&end)).map_err(SessionError::from);
        (end, finished, lockout)
    }

    fn executed(&self, directory: &Path) -> Result<Plan, SessionError> {
        let Some(steps) = &self.scripted else { return Ok(self.plan.clone()) };
        let executed = steps.executed(&self.plan);
        write_new(&directory.join(run_directory::EXECUTED), json_text(&executed)?.as_bytes())?;
        Ok(executed)
    }

    fn header(&self, plan_json: String) -> RecordingHeader {
        RecordingHeader {
            library: PROGRAM.to_owned(),
            profile: String::new(),
            // Simulated time starts at 0, so that equal seeds give equal bytes.
            start_time_ns: start_time_ns(&self.rig(), self.request.started_ns),
            metadata: metadata(self.request.campaign, &self.plan),
            plan_json: Some(plan_json.into_bytes()),
            campaign_yaml: Some(self.request.campaign_text.as_bytes().to_vec()),
        }
    }
}

/// Moves earlier results of this run, complete or partial, into the subdirectory `results-N`, so that new results overwrite nothing.
fn move_earlier_results(run: &Path) -> Result<(), SessionError> {
    let entries = std::fs::read_dir(run).map_err(SessionError::file("read", run))?;
    let results: Vec<_> = entries
        .filter_map(Result::ok)
        .map(|entry| entry.file_name())
        .filter(|name| name.to_str().is_some_and(run_directory::is_result))
        .collect();
    if results.is_empty() {
        return Ok(());
    }
    let free = (1..).map(|number| run.join(format!("results-{number}"))).find(|path| !path.exists());
    let Some(destination) = free else { return Ok(()) };
    std::fs::create_dir(&destination).map_err(SessionError::file("create", &destination))?;
    for name in results {
        let (from, to) = (run.join(&name), destination.join(&name));
        std::fs::rename(&from, &to).map_err(SessionError::file("move", &from))?;
    }
    Ok(())
}

pub(crate) fn metadata(campaign: &Campaign, plan: &Plan) -> BTreeMap<String, String> {
    let reference = campaign.reference;
    let always = [
        ("campaign", campaign.name.clone()),
        ("machine", campaign.machine.name.clone()),
        ("seed", campaign.seed.to_string()),
        ("program", PROGRAM.to_owned()),
        ("reference_temperature_k", reference.t_ref_k.to_string()),
        ("reference_pressure_pa", reference.p_ref_pa.to_string()),
        ("campaign_sha256", plan.made_from.campaign_sha256.clone()),
        ("model_sha256", plan.made_from.model_sha256.clone()),
    ];
    let readers: Vec<&str> = campaign.readers.iter().map(|reader| reader.name.as_str()).collect();
    let sometimes = [
        ("readers", (!readers.is_empty()).then(|| readers.join(", "))),
        ("script_sha256", plan.made_from.script_sha256.clone()),
        ("serial_number", campaign.machine.serial_number.clone()),
        ("operator", campaign.report.operator.clone()),
    ];
    let sometimes = sometimes.into_iter().filter_map(|(key, value)| Some((key, value?)));
    always.into_iter().chain(sometimes).map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Epoch time of run time 0, ns, for a run started at `started_ns`; 0 for simulated time, so that equal runs give equal bytes.
fn start_time_ns(rig: &RigDescription, started_ns: u64) -> u64 {
    if rig.simulated_time { 0 } else { started_ns }
}
