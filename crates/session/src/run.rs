//! A whole run: plan, drive the rig, record, identify, assemble, report.

use crate::drive::{drive, soak_s};
use crate::files::{json_text, write_new};
use crate::guards::drift_watch;
use crate::observers::{Recorder, Teller};
use crate::planning::{nominal_model, plan, stored_plan};
use crate::rehearsal::rehearse;
use crate::results::Results;
use crate::scripted_steps::ScriptedSteps;
use crate::surge::{hold_near_surge, remark_surge_search};
use crate::{Session, SessionError, run_directory};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::MapSource;
use mapper_core::{Backend, Plan, RigDescription};
use mapper_physics::model::Model;
use mapper_record::{RecordingHeader, RecordingWriter};
use mapper_runner::{PlanSteps, RunEnd, RunError, RunObserver, StepSource, SurgeSearch};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name and version of the program, as recordings carry it.
pub const PROGRAM: &str = concat!("mapper ", env!("CARGO_PKG_VERSION"));

/// What to run.
pub struct RunRequest<'a> {
    /// The campaign.
    pub campaign: &'a Campaign,
    /// Its text, kept beside the run and in the recording.
    pub campaign_text: &'a str,
    /// A stored plan to run instead of making one.
    pub plan: Option<&'a Path>,
    /// Directory for the run's own directory, which is made.
    pub parent: &'a Path,
    /// When the run starts, ns since 1970-01-01 UTC: for recordings of rigs whose time is not simulated.
    pub started_ns: u64,
    /// The same in the name of the run's directory, e.g. `20261122T101500Z`.
    pub started_name: &'a str,
}

impl<'a> RunRequest<'a> {
    /// A run on a simulated rig, whose time begins at 0: its directory is `<parent>/<campaign>-run`.
    pub fn new(campaign: &'a Campaign, campaign_text: &'a str, parent: &'a Path) -> Self {
        RunRequest { campaign, campaign_text, plan: None, parent, started_ns: 0, started_name: "run" }
    }
}

/// A run that is ready to start: nothing has been touched yet.
pub struct PreparedRun<'a> {
    request: RunRequest<'a>,
    model: Model,
    /// The plan as made; where a script decides, its forecast.
    made: Plan,
    /// The plan to be run.
    plan: Plan,
    scripted: Option<ScriptedSteps>,
    backend: Box<dyn Backend>,
}

/// How a run ended. Whatever ended it, the rig is safe and what was recorded is kept.
#[derive(Debug)]
pub struct RunOutcome {
    /// The run's directory.
    pub directory: PathBuf,
    /// Its recording.
    pub recording: PathBuf,
    /// How it ended.
    pub end: Ended,
    /// What was identified, or why nothing was.
    pub results: Result<Results, SessionError>,
}

/// How a run ended.
#[derive(Debug)]
pub enum Ended {
    /// Every step was run.
    Completed,
    /// Drift was seen, and the campaign says to stop then.
    Drifted {
        /// What drifted.
        reason: String,
    },
    /// A guard tripped.
    Tripped {
        /// Run time, s.
        t_s: f64,
        /// What tripped it.
        reason: String,
    },
    /// The operator stopped it.
    Interrupted {
        /// Run time, s.
        t_s: f64,
    },
    /// Rig, script or recording failed.
    Failed(RunError),
}

impl<'s> Session<'s> {
    /// Makes the plan, or holds the stored one against it, rehearses a script and makes the backend. What fails here never
    /// touches the rig.
    ///
    /// # Errors
    /// [`SessionError`] where there is no plan, the stored one is stale, the script fails or the backend's settings are wrong.
    pub fn prepare<'a>(&self, request: RunRequest<'a>) -> Result<PreparedRun<'a>, SessionError> {
        let campaign = request.campaign;
        self.registry.check_formats(campaign)?;
        let model = nominal_model(campaign)?;
        let mut made = match &campaign.sequence {
            None => plan(campaign, &model)?,
            Some(source) => rehearse(self, campaign, &model, source)?.plan,
        };
        remark_surge_search(campaign, &model, &mut made);
        let plan = match request.plan {
            None => made.clone(),
            Some(path) => stored_plan(path, &made)?,
        };
        let scripted = match &campaign.sequence {
            Some(source) if request.plan.is_none() => Some(ScriptedSteps::new(campaign, &model, source)?),
            _ => None,
        };
        let backend = self.registry.make_backend(campaign, &model)?;
        Ok(PreparedRun { request, model, made, plan, scripted, backend })
    }

    /// Prepares and runs.
    ///
    /// # Errors
    /// As [`Session::prepare`] and [`PreparedRun::run`].
    pub fn run(&self, request: RunRequest<'_>) -> Result<RunOutcome, SessionError> {
        self.prepare(request)?.run(self)
    }
}

impl PreparedRun<'_> {
    /// The plan that would be run.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The nominal model that it was made with.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The rig.
    pub fn rig(&self) -> RigDescription {
        self.backend.describe()
    }

    /// Drives the rig, records, identifies, reports.
    ///
    /// # Errors
    /// Where the run's files cannot be made. What ends the run itself is its outcome, not an error.
    pub fn run(mut self, session: &Session<'_>) -> Result<RunOutcome, SessionError> {
        let campaign = self.request.campaign;
        let directory =
            run_directory::create(self.request.parent, &campaign.name, self.request.started_name)?;
        let plan_json = json_text(&self.plan)?;
        write_new(&directory.join(run_directory::CAMPAIGN), self.request.campaign_text.as_bytes())?;
        write_new(&directory.join(run_directory::PLAN), plan_json.as_bytes())?;
        if let MapSource::Table { named, text, .. } = &campaign.machine.map {
            run_directory::keep_beside(&directory, named, text)?;
        }
        if let Some(source) = &campaign.sequence {
            write_new(&directory.join(run_directory::SEQUENCE), source.text.as_bytes())?;
        }
        let recording = directory.join(run_directory::RECORDING);
        let writer = RecordingWriter::create(&recording, &self.header(plan_json))?;
        let (end, finished) = self.drive_and_record(session, Recorder::new(writer));
        // A run that failed has its own reason; one that did not must have a whole file.
        if !matches!(end, Ended::Failed(_) | Ended::Interrupted { .. } | Ended::Tripped { .. }) {
            finished?;
        }
        let executed = self.executed(&directory);
        let results = executed.and_then(|plan| {
            session.results(campaign, &plan, &sentence(&end), self.request.started_ns, &directory, &recording)
        });
        Ok(RunOutcome { directory, recording, end, results })
    }

    fn drive_and_record(
        &mut self,
        session: &Session<'_>,
        mut recorder: Recorder,
    ) -> (Ended, Result<(), SessionError>) {
        let campaign = self.request.campaign;
        let mut planned = PlanSteps::new(&self.plan);
        let steps: &mut dyn StepSource = match &mut self.scripted {
            Some(scripted) => scripted,
            None => &mut planned,
        };
        let hold = |point| hold_near_surge(campaign, &self.model, point);
        let mut search;
        let steps: &mut dyn StepSource = match campaign.surge_search {
            None => steps,
            Some(seek) => {
                search = SurgeSearch::new(steps, seek, campaign.reference, &hold);
                &mut search
            }
        };
        let mut teller = Teller {
            on_event: session.on_event,
            steps: self.plan.steps.len(),
            duration_s: soak_s(campaign) + self.plan.duration_s(),
        };
        let mut observers: Vec<&mut dyn RunObserver> = vec![&mut recorder, &mut teller];
        let (end, drifted) = if campaign.on_drift.is_some()
            && let Some(mut watch) = drift_watch(campaign, steps)
        {
            let end =
                drive(campaign, &self.model, &mut watch, self.backend.as_mut(), &mut observers, session.stop);
            (end, watch.ended_by_drift().map(str::to_owned))
        } else {
            (drive(campaign, &self.model, steps, self.backend.as_mut(), &mut observers, session.stop), None)
        };
        let end = match (end, drifted) {
            (Ok(RunEnd::Completed), None) => Ended::Completed,
            (Ok(RunEnd::Completed), Some(reason)) => Ended::Drifted { reason },
            (Ok(RunEnd::Interrupted { t_s }), _) => Ended::Interrupted { t_s },
            (Ok(RunEnd::Tripped(trip)), _) => Ended::Tripped { t_s: trip.t_s, reason: trip.reason },
            (Err(error), _) => Ended::Failed(error),
        };
        (end, recorder.finish().map_err(SessionError::from))
    }

    /// The plan as it was run; a script's steps are written beside it.
    fn executed(&mut self, directory: &Path) -> Result<Plan, SessionError> {
        let Some(steps) = &self.scripted else { return Ok(self.plan.clone()) };
        let executed = steps.executed(&self.made);
        write_new(&directory.join(run_directory::EXECUTED), json_text(&executed)?.as_bytes())?;
        Ok(executed)
    }

    fn header(&self, plan_json: String) -> RecordingHeader {
        RecordingHeader {
            library: PROGRAM.to_owned(),
            profile: String::new(),
            // Simulated time starts at 0, so that equal seeds give equal bytes.
            start_time_ns: if self.rig().simulated_time { 0 } else { self.request.started_ns },
            metadata: metadata(self.request.campaign, &self.plan),
            plan_json: Some(plan_json.into_bytes()),
            campaign_yaml: Some(self.request.campaign_text.as_bytes().to_vec()),
        }
    }
}

/// How a run ended, in a sentence for its report.
fn sentence(end: &Ended) -> String {
    let what = match end {
        Ended::Completed => return "Completed.".to_owned(),
        Ended::Drifted { reason } => format!("({reason})"),
        Ended::Interrupted { t_s } => format!("by the operator at {t_s:.0} s"),
        Ended::Tripped { t_s, reason } => format!("by a guard at {t_s:.1} s ({reason})"),
        // A script's error shows its line below the first one.
        Ended::Failed(error) => {
            format!("by a fault ({})", error.to_string().lines().next().unwrap_or_default())
        }
    };
    format!("Stopped {what}: the map is not complete.")
}

/// What a recording says of its run.
fn metadata(campaign: &Campaign, plan: &Plan) -> BTreeMap<String, String> {
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
    let sometimes = [
        ("script_sha256", plan.made_from.script_sha256.clone()),
        ("serial_number", campaign.machine.serial_number.clone()),
        ("operator", campaign.report.operator.clone()),
    ];
    let sometimes = sometimes.into_iter().filter_map(|(key, value)| Some((key, value?)));
    always.into_iter().chain(sometimes).map(|(key, value)| (key.to_owned(), value)).collect()
}
