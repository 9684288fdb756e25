//! Checks whether the rig stayed the same over one or more recordings.

use crate::recording::fusing::{FusedRecordings, fuse_sensors, recordings, take_air_and_probe};
use crate::recording::identification_config::identification_with;
use crate::recording::recording_file::{Recorded, attached_campaign, check_all_distinct, check_machine};
use crate::{Session, SessionError, plan::planning};
use mapper_campaign::Campaign;
use mapper_core::Recording;
use mapper_diagnose::drift::{DriftReport, DriftRequest, RecordedRun, diagnose};
use mapper_identify::ZeroOutcome;
use mapper_observe::FusedChannel;
use mapper_recording::ChannelMap;

/// Drift report of the recordings, with the zero that was subtracted from them.
#[derive(Debug)]
pub struct Drift {
    /// The drift report.
    pub report: DriftReport,
    /// Result of sensor fusion. A sensor excluded from one recording is excluded from all.
    pub sensors: Vec<FusedChannel>,
    /// Result of the isothermal zero.
    pub zero: ZeroOutcome,
}

impl Session<'_> {
    /// Compares recordings in the order in which they were made. They must be of the machine in `campaign`.
    pub fn drift(
        &self,
        recorded: &[Recorded],
        campaign: &Campaign,
        map: &ChannelMap,
    ) -> Result<Drift, SessionError> {
        for (index, recorded) in recorded.iter().enumerate() {
            if let Err(other) = check_machine(recorded, campaign) {
                let reason = format!("No verdict: recording {}: {other}.", index + 1);
                return Ok(Drift {
                    report: DriftReport::without_verdict(reason),
                    sensors: Vec::new(),
                    zero: ZeroOutcome::NotRequested,
                });
            }
        }
        check_all_distinct(recorded)?;
        let mut model = planning::nominal_model(campaign)?;
        let config = identification_with(campaign, map);
        let FusedRecordings { recordings, config, channels } =
            fuse_sensors(recordings(recorded), config, Some(campaign), map).with_total_pressures(campaign);
        let sensors = channels.into_iter().next().unwrap_or_default();
        take_air_and_probe(&mut model, &config);
        // A separate zero for each run would hide drift between them.
        let zero = recordings.first().map_or(ZeroOutcome::NotRequested, |first| {
            ZeroOutcome::of(first, &config, campaign.zero.map(Into::into))
        });
        // Declared offsets are kept: the zero determines them far better than the model, whose own errors would appear as changes.
        let recordings: Vec<Recording> =
            recordings.into_iter().map(|recording| zero.subtract(recording, config.clone()).0).collect();
        let fingerprints: Vec<Option<String>> = recorded.iter().map(fingerprint).collect();
        // The first recording of a run that was resumed after its soak contains only the soak.
        let directory = |place: usize| recorded.get(place).map(|recorded_run| recorded_run.path.parent());
        let is_soak_only = |(place, recording): (usize, &Recording)| {
            recording.steps.is_empty() && directory(place) == directory(place + 1)
        };
        let runs: Vec<RecordedRun<'_>> = recordings
            .iter()
            .zip(&fingerprints)
            .enumerate()
            .filter(|(place, (recording, _))| !is_soak_only((*place, recording)))
            .map(|(_, (recording, fingerprint))| RecordedRun {
                recording,
                fingerprint: fingerprint.as_deref(),
            })
            .collect();
        let report = diagnose(&DriftRequest {
            runs: &runs,
            model: &model,
            boundary: campaign.boundary,
            tolerances: campaign.tolerances,
            identification: &config,
            actuators: campaign.actuators,
        })?;
        Ok(Drift { report, sensors, zero })
    }
}

/// Fingerprint of what must be the same in all runs: machine, boundary conditions, points and timing. Seed, name, rig and output may differ.
fn fingerprint(recorded: &Recorded) -> Option<String> {
    let (read, file) = (&recorded.read, &recorded.path);
    let of_campaign = || {
        let campaign = attached_campaign(read, file).ok()??;
        let dwell = campaign.timing.dwell;
        let same = (&campaign.machine, campaign.boundary, campaign.follow_outlet, &campaign.points, dwell);
        serde_json::to_string(&same).ok()
    };
    let of_hashes =
        || Some(format!("{} {}", read.metadata.get("campaign_sha256")?, read.metadata.get("model_sha256")?));
    of_campaign().or_else(of_hashes)
}
