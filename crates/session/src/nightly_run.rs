//! One run of the night: as any other run, its files in a directory of its own.

use crate::drive::drive;
use crate::files::json_text;
use crate::nightly_row::{figures, point_rows};
use crate::observers::Recorder;
use crate::program::PROGRAM;
use crate::recorded::Recorded;
use crate::{ErrorKind, Session, SessionError, planned, run_directory};
use mapper_campaign::Campaign;
use mapper_core::Plan;
use mapper_history::{RunKey, RunRow};
use mapper_physics::model::Model;
use mapper_record::{ChannelMap, ReadOptions, RecordingHeader, RecordingWriter, read_recording};
use mapper_runner::{PlanSteps, RunEnd};
use std::collections::BTreeMap;
use std::path::Path;

/// A campaign with method and seed set, ready to run.
pub(crate) struct NightlyRun {
    pub campaign: Campaign,
    pub model: Model,
    pub key: RunKey,
}

impl NightlyRun {
    /// Plans, runs, records, identifies and scores. What fails stands in the row.
    ///
    /// # Errors
    /// [`SessionError::Interrupted`] where the operator stopped it.
    pub fn run(&self, session: &Session<'_>, directory: &Path) -> Result<RunRow, SessionError> {
        let mut row = RunRow {
            key: self.key.clone(),
            campaign_sha256: String::new(),
            model_sha256: String::new(),
            failure: None,
            figures: BTreeMap::new(),
            points: Vec::new(),
        };
        match self.fill(&mut row, session, directory) {
            Err(error) if error.kind() == ErrorKind::Interrupted => return Err(error),
            Err(error) => row.failure = Some(error.to_string()),
            Ok(()) => {}
        }
        Ok(row)
    }

    fn fill(&self, row: &mut RunRow, session: &Session<'_>, directory: &Path) -> Result<(), SessionError> {
        let plan = planned::plan(&self.campaign, &self.model)?;
        row.campaign_sha256 = plan.made_from.campaign_sha256.clone();
        row.model_sha256 = plan.made_from.model_sha256.clone();
        let recording = directory.join(run_directory::RECORDING);
        match self.record(&plan, session, &recording)? {
            RunEnd::Completed => {}
            RunEnd::Interrupted { .. } => return Err(SessionError::Interrupted),
            RunEnd::Tripped(trip) => {
                row.failure = Some(format!("stopped at {:.1} s: {}", trip.t_s, trip.reason));
                return Ok(());
            }
        }
        let read = read_recording(&recording, &ChannelMap::native(), &ReadOptions::default())?;
        let recorded = Recorded::of(recording, read, Some(self.campaign.clone()));
        let identified = session.identify(vec![recorded], &ChannelMap::native(), None)?;
        row.figures = figures(&identified.points, &plan);
        row.points = point_rows(&identified.points);
        Ok(())
    }

    fn record(&self, plan: &Plan, session: &Session<'_>, recording: &Path) -> Result<RunEnd, SessionError> {
        let mut backend = session.registry.make_backend(&self.campaign, &self.model)?;
        let header = RecordingHeader {
            library: PROGRAM.to_owned(),
            plan_json: Some(json_text(plan)?.into_bytes()),
            ..RecordingHeader::default()
        };
        let mut recorder = Recorder::new(RecordingWriter::create(recording, &header)?);
        // A night runs many at once: nobody could follow their steps.
        let mut steps = PlanSteps::new(plan);
        let end =
            drive(&self.campaign, &self.model, &mut steps, backend.as_mut(), &mut recorder, session.stop)
                .map_err(|source| SessionError::Run { source, recording: recording.to_owned() })?;
        recorder.finish("")?;
        Ok(end)
    }
}
