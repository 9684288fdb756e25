//! Analyses one side of a machine from a log without steps: the cause that explains the residual, and the parameters.

use crate::analysis::results::png;
use crate::plan::planning::nominal_model;
use crate::recording::files::{DIAGNOSIS_FORMAT, Existing, Versioned, json_text, write_files};
use crate::recording::identification_config::declared;
use crate::recording::recording_file::{Recorded, check_machine};
use crate::{Session, SessionError};
use mapper_diagnose::driven::{Diagnosis, DrivenError, Side, SideRequest, diagnose};
use mapper_diagnose::gap::Calibration;
use mapper_observe::Declared;
use mapper_physics::rig::effect::{Effect, Rig};
use mapper_recording::ChannelMap;
use mapper_report::{Describe, why_figure};
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl Session<'_> {
    /// Determines which of `effects` explains one side in a log without steps, fitted up to `fit_until_s` (log time; default: all).
    pub fn transient(
        &self,
        recorded: &Recorded,
        map: &ChannelMap,
        side: Side,
        fit_until_s: Option<f64>,
        effects: &[Arc<dyn Effect>],
    ) -> Result<Diagnosis, SessionError> {
        let campaign = recorded.require_campaign()?;
        check_machine(recorded, campaign)?;
        let recording = &recorded.read.recording;
        // Jumps separate the heat balances; readings alone do not, and would blame a cause that is not there.
        let steps = recording.steps.iter().filter(|step| step.valve_opening_ratio.is_finite()).count();
        if steps > 1 {
            return Err(DrivenError::HasSteps { steps }.into());
        }
        Ok(diagnose(
            &SideRequest {
                recording,
                nominal: &Rig::new(nominal_model(campaign)?),
                effects,
                declared: &Declared {
                    sensors: declared(campaign, map),
                    noise_colour: map.noise_colour.unwrap_or_default(),
                    tolerances: campaign.tolerances,
                    nominal: campaign.boundary,
                    common_offsets: Vec::new(),
                    actuators: campaign.actuators,
                },
                calibration: &Calibration::shipped().map_err(SessionError::Calibration)?,
                fit_until_s: fit_until_s.unwrap_or(f64::INFINITY),
                seed: campaign.seed,
            },
            side,
        )?)
    }
}

/// Writes text, JSON and pictures of the result to a directory. Creates it if missing and returns the files.
pub fn write_transient(
    diagnosis: &Diagnosis,
    machine: &str,
    directory: &Path,
    existing: Existing,
) -> Result<Vec<PathBuf>, SessionError> {
    let figure = why_figure(machine, diagnosis);
    let contents = [
        (
            "transient.json",
            json_text(&Versioned { format_version: DIAGNOSIS_FORMAT, content: diagnosis })?.into_bytes(),
        ),
        ("transient.txt", diagnosis.document().to_string().into_bytes()),
        ("transient.svg", figure.to_svg().into_bytes()),
        ("transient.png", png(&figure)?),
    ];
    write_files(directory, &contents, existing)
}
