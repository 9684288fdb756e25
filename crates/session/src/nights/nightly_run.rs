//! One run of a nightly campaign, with its files in a separate directory.

use crate::nights::nightly_row::{metrics, point_rows};
use crate::recording::files::json_text;
use crate::recording::program::PROGRAM;
use crate::recording::recording_file::Recorded;
use crate::rig::drive::drive;
use crate::rig::observers::Recorder;
use crate::variant::{Variant, VariantError};
use crate::{ErrorKind, Session, SessionError, plan::planning, recording::run_directory};
use mapper_campaign::Campaign;
use mapper_core::{Method, Plan, RunEnding};
use mapper_history::{RunKey, RunRow};
use mapper_physics::simulation::model::Model;
use mapper_recording::{ChannelMap, ReadOptions, RecordingHeader, RecordingWriter, read_recording};
use mapper_runner::{PlanSteps, RunEnd};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// A campaign with method and seed set, ready to run.
pub struct NightlyRun {
    /// The campaign, with method and seed.
    pub campaign: Campaign,
    /// Its nominal model.
    pub model: Model,
    /// The machine, if it is one of several.
    pub machine: Option<Variant>,
    /// Key of the run, the same every night.
    pub key: RunKey,
}

impl NightlyRun {
    /// A campaign with a method, a seed and, optionally, one of several machines.
    ///
    /// # Errors
    /// [`VariantError`] if the machine cannot be put into the campaign.
    pub fn new(
        mut campaign: Campaign,
        model: Model,
        method: Method,
        seed: u64,
        machine: Option<Variant>,
    ) -> Result<NightlyRun, VariantError> {
        campaign.identification.method = method;
        campaign.seed = seed;
        if let Some(machine) = &machine {
            machine.apply_to(&mut campaign)?;
        }
        let key = RunKey {
            campaign: campaign.name.clone(),
            machine: machine
                .as_ref()
                .map_or_else(|| campaign.machine.name.clone(), |machine| machine.serial_number.clone()),
            method: method.to_string(),
            seed,
        };
        Ok(NightlyRun { campaign, model, machine, key })
    }

    /// Plans, runs, records, identifies and scores. A failure becomes part of the row.
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
        let plan = planning::plan(&self.campaign, &self.model)?;
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

    /// Identifies one recording by each of the methods and returns the points with their truth, as in a run's `points.json`. The inner `Err` is
    /// the reason if a guard stopped the run.
    ///
    /// # Errors
    /// [`SessionError`] if the campaign cannot be planned, run or identified.
    pub fn points(
        &self,
        session: &Session<'_>,
        directory: &Path,
        methods: &[Method],
    ) -> Result<Result<Vec<Value>, String>, SessionError> {
        let plan = planning::plan(&self.campaign, &self.model)?;
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
            RunEnd::Completed => Ok(Ok(self.read(&recording)?)),
            RunEnd::Interrupted { .. } => Err(SessionError::Interrupted),
            RunEnd::Tripped(trip) => Ok(Err(format!("stopped at {:.1} s: {}", trip.t_s, trip.reason))),
        }
    }

    fn read(&self, recording: &Path) -> Result<Recorded, SessionError> {
        let read = read_recording(recording, &ChannelMap::native(), &ReadOptions::default())?;
        Ok(Recorded::of(recording.to_owned(), read, Some(self.campaign.clone())))
    }

    fn record(&self, plan: &Plan, session: &Session<'_>, recording: &Path) -> Result<RunEnd, SessionError> {
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
