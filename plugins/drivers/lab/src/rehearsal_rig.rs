//! The lab as a rig to rehearse on: in real time, and with a log of its commands to check them afterwards; the
//! settings of the driver.

use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError, RigDescription, RigMode, SampleBatch, Setpoints};
use mapper_session::{Registry, nominal_model};
use serde::Deserialize;
use serde_json::Value;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

pub(crate) struct RehearsalRig {
    pub(crate) lab: Box<dyn Backend>,
    /// Whether its samples arrive unrequested, in wall time, as those of a physical rig.
    pub(crate) real_time: bool,
    pub(crate) log: Option<File>,
    /// Run time of the last poll, s.
    now_s: f64,
}

impl RehearsalRig {
    fn write(&mut self, text: &str) {
        if let Some(file) = &mut self.log {
            // A full disk must not block the rig's setpoints.
            let _ = writeln!(file, "{:.1} s: {text}", self.now_s);
        }
    }
}

impl Backend for RehearsalRig {
    fn describe(&self) -> RigDescription {
        let lab = self.lab.describe();
        RigDescription { simulated_time: lab.simulated_time && !self.real_time, ..lab }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        self.now_s = 0.0;
        self.write("arm");
        self.lab.arm()
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        let Setpoints { mode, p3_pa, t3_k, valve_opening_ratio, .. } = setpoints;
        let air = if *mode == RigMode::Running { "on" } else { "off" };
        self.write(&format!(
            "set air {air}, P3 {p3_pa:.0} Pa, T3 {t3_k:.0} K, valve {valve_opening_ratio:.2}"
        ));
        self.lab.set(setpoints)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.now_s = self.now_s.max(until_s);
        self.lab.poll(until_s)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.write("hold");
        self.lab.hold()
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.write("make safe");
        self.lab.make_safe()
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.write("disarm");
        self.lab.disarm()
    }
}

/// Name of the driver.
pub(crate) const NAME: &str = "lab";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    campaign: PathBuf,
    #[serde(default)]
    real_time: bool,
    command_log: Option<PathBuf>,
}

#[derive(Debug, thiserror::Error)]
enum LabError {
    #[error(
        "write {{campaign: FILE}}, a campaign whose machine the lab is; also: real_time: true, command_log: FILE. {0}"
    )]
    Form(serde_json::Error),
    #[error("{0}")]
    Campaign(String),
    #[error("failed to write {}: {source}", path.display())]
    CommandLog { path: PathBuf, source: std::io::Error },
}

pub(crate) fn open(settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let settings_error = |path: &str, error: LabError| BackendError::Settings {
        backend: NAME.to_owned(),
        path: path.to_owned(),
        source: Box::new(error),
    };
    let settings =
        Settings::deserialize(settings).map_err(|error| settings_error("", LabError::Form(error)))?;
    let of_campaign = |message: String| settings_error("campaign", LabError::Campaign(message));
    // A driver at a socket may run in another directory than the campaign, so the error shows the absolute path.
    let path = std::path::absolute(&settings.campaign).unwrap_or(settings.campaign);
    let campaign = mapper_campaign::load(&path).map_err(|error| of_campaign(error.to_string()))?;
    let registry =
        Registry { backends: BACKENDS.to_vec(), effects: mapper_effects::catalogue(), ..Registry::empty() };
    let model = nominal_model(&campaign).map_err(|error| of_campaign(error.to_string()))?;
    let lab = registry.make_backend(&campaign, &model).map_err(|error| of_campaign(error.to_string()))?;
    let log = settings.command_log.map(|path| {
        let error =
            |source| settings_error("command_log", LabError::CommandLog { path: path.clone(), source });
        std::fs::File::create(&path).map_err(error)
    });
    Ok(Box::new(RehearsalRig { lab, real_time: settings.real_time, log: log.transpose()?, now_s: 0.0 }))
}
