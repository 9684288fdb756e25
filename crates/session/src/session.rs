//! The session with its plug-ins.

use crate::SessionError;
use crate::recording::identification_config::declared;
use mapper_campaign::Campaign;
use mapper_campaign::campaign::BackendChoice;
use mapper_core::{
    Backend, BackendError, Channel, DeclaredUncertainty, Event, IdentifiedPoint, MapFormats, RigDescription,
    Sentences, SetpointRanges, StepMarker,
};
use mapper_physics::rig::backend_plugin::{BackendPlugin, NominalRig, ReadEffect};
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_recording::logs::LogFormats;
use mapper_recording::{ChannelMap, DiskFaults};
use mapper_runner::Operator;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Plug-ins, an observer and stop flags.
#[derive(Clone, Copy)]
pub struct Session<'a> {
    /// The plug-ins.
    pub registry: &'a Registry,
    /// Called with every event.
    pub on_event: OnEvent<'a>,
    /// Set by the caller to stop at the next sample; the rig then goes to its safe state.
    pub stop: &'a AtomicBool,
    /// Set by the caller to stop a run at the end of its step.
    pub stop_after_step: &'a AtomicBool,
    /// Other operator requests during a run; `None` without an operator.
    pub operator: Option<&'a Operator>,
    /// Whether each step is identified separately as soon as it ends, for observers.
    pub estimates: bool,
}

/// Stop flag of a session that is never stopped.
static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Session<'a> {
    /// A session without observer and stop flag.
    pub fn new(registry: &'a Registry) -> Self {
        Session {
            registry,
            on_event: &|_| {},
            stop: &NEVER,
            stop_after_step: &NEVER,
            operator: None,
            estimates: false,
        }
    }

    pub(crate) fn send(&self, event: SessionEvent) {
        (self.on_event)(&event);
    }
}

/// One event.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum SessionEvent {
    /// A run begins on this rig.
    RunStarted {
        /// The rig.
        rig: RigDescription,
        /// Planned steps; a script may make more or fewer.
        steps: usize,
        /// Planned rig time including soak, warm-up and cool-down, s.
        duration_s: f64,
    },
    /// Current time of the rig.
    RigTime {
        /// Run time, s.
        t_s: f64,
    },
    /// A step begins; `end_s` of the marker is the planned end.
    StepStarted {
        /// The step.
        #[serde(flatten)]
        marker: StepMarker,
        /// Planned rig time from its start to the end of the run, s.
        left_s: f64,
    },
    /// A step has ended; `end_s` of the marker is the actual end.
    StepEnded(StepMarker),
    /// Message from the rig or the runner: tripped guard, surge, stop, safe state or note.
    Reported(Event),
    /// The rig is safe and released. All further work uses the recording.
    RigReleased,
    /// Latest valid reading of each channel.
    Readings {
        /// Run time, s.
        t_s: f64,
        /// Values in SI units.
        values: Vec<(Channel, f64)>,
    },
    /// Preliminary result of a step that has just ended, before zero subtraction and joint identification.
    PointEstimated(Box<IdentifiedPoint>),
    /// A point was identified.
    PointIdentified(Box<IdentifiedPoint>),
    /// Progress of long work that has no steps.
    Progress {
        /// Completed share, 0 to 1.
        done_ratio: f64,
        /// Description of the work.
        what: String,
    },
    /// Progress of work in separate pieces.
    PiecesDone {
        /// Completed pieces.
        done: usize,
        /// Total pieces.
        of: usize,
    },
}

/// Called with every event, from any thread that works for the session.
pub type OnEvent<'a> = &'a (dyn Fn(&SessionEvent) + Sync);

/// Creates a driver, a backend that is not a plug-in, from its name and settings.
pub type MakeDriver =
    Arc<dyn Fn(&str, &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> + Send + Sync>;

/// All plug-ins of a session, and the source commit of the program that creates it.
#[derive(Clone)]
pub struct Registry {
    /// Rigs, real and simulated.
    pub backends: Vec<BackendPlugin>,
    /// Factory for backends that are not plug-ins; `None` without drivers.
    pub driver: Option<MakeDriver>,
    /// The effect library.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Reads a suspected effect from a file.
    pub read_effect: ReadEffect,
    /// Map formats, read and written.
    pub formats: MapFormats,
    /// Log formats of other programs.
    pub logs: LogFormats,
    /// Sentences of warnings and remarks in written JSON; `None` writes their values alone.
    pub sentences: Option<Sentences>,
    /// Commit that the program was built from; empty if unknown.
    pub commit: &'static str,
    /// Faults of the disk of runs, for tests. A run waits for each of its writes then, so that equal faults give equal runs.
    pub disk: Option<DiskFaults>,
}

impl Registry {
    /// A registry without plug-ins, for its user to fill: without a backend it runs no campaign, without an effect library it diagnoses nothing.
    pub fn empty() -> Self {
        Registry {
            backends: Vec::new(),
            driver: None,
            effects: Vec::new(),
            read_effect: no_effect,
            formats: MapFormats(&[]),
            logs: LogFormats::default(),
            sentences: None,
            commit: "",
            disk: None,
        }
    }

    /// The backend that a campaign names: a plug-in, or a driver of that name.
    pub fn make_backend(&self, campaign: &Campaign, model: &Model) -> Result<Box<dyn Backend>, SessionError> {
        self.make_named_backend(&campaign.backend, campaign, model).map_err(SessionError::Backend)
    }

    /// Setpoint ranges of a campaign's rig, if they are known without starting a driver.
    pub(crate) fn setpoint_ranges(&self, campaign: &Campaign, model: &Model) -> Option<SetpointRanges> {
        let BackendChoice { name, settings, .. } = &campaign.backend;
        let nominal = nominal_rig(campaign, model, self);
        BackendPlugin::make_by_name(&self.backends, name, &nominal, settings).ok()?.describe().accepts
    }

    pub(crate) fn make_named_backend(
        &self,
        wanted: &BackendChoice,
        campaign: &Campaign,
        model: &Model,
    ) -> Result<Box<dyn Backend>, BackendError> {
        if let Some(driver) =
            self.driver.as_ref().filter(|_| !self.backends.iter().any(|plugin| plugin.name == wanted.name))
        {
            return driver(&wanted.name, &wanted.settings);
        }
        let nominal = nominal_rig(campaign, model, self);
        BackendPlugin::make_by_name(&self.backends, &wanted.name, &nominal, &wanted.settings)
    }

    /// The effect library with effects defined by scripts.
    pub fn effects_with(&self, scripts: &[PathBuf]) -> Result<Vec<Arc<dyn Effect>>, SessionError> {
        let mut effects = self.effects.clone();
        for path in scripts {
            let scripted = (self.read_effect)(path)
                .map_err(|error| error.downcast().map_or_else(SessionError::Effect, |known| *known))?;
            let id = &scripted.info().id;
            if effects.iter().any(|effect| effect.info().id == *id) {
                return Err(SessionError::DuplicateEffect { path: path.clone(), id: id.to_string() });
            }
            effects.push(scripted);
        }
        Ok(effects)
    }
}

fn no_effect(path: &Path) -> Result<Arc<dyn Effect>, Box<dyn std::error::Error + Send + Sync>> {
    Err(Box::new(SessionError::EffectFilesUnsupported(path.to_owned())))
}

fn nominal_rig(campaign: &Campaign, model: &Model, registry: &Registry) -> NominalRig {
    let sensors = || campaign.sensors.iter();
    // The errors that identification assumes are drawn too.
    let declared = declared(campaign, &ChannelMap::native());
    let assumed_gain = |channel: &Channel, sensor: &mut DeclaredUncertainty| {
        if sensor.gain_sigma_ratio == 0.0 {
            sensor.gain_sigma_ratio = declared.get(channel).map_or(0.0, |declared| declared.gain_sigma_ratio);
        }
    };
    NominalRig {
        model: model.clone(),
        boundary: campaign.boundary,
        actuators: campaign.rig_actuators(),
        speed_max_rpm: campaign.limits.speed_max_rpm,
        redundant: sensors()
            .filter_map(|(channel, sensor)| {
                let mut several = sensor.redundant.clone()?;
                several.elements.iter_mut().for_each(|one| assumed_gain(channel, &mut one.declared));
                Some((*channel, several))
            })
            .collect(),
        static_tap_pipe_diameters_m: sensors()
            .filter_map(|(channel, sensor)| Some((*channel, sensor.static_tap_pipe_diameter_m?)))
            .collect(),
        sensors: declared,
        tolerances: campaign.tolerances,
        soak: campaign.zero,
        effects: registry.effects.clone(),
        read_effect: registry.read_effect,
        seed: campaign.seed,
    }
}
