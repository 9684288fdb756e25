//! Errors of a session.

use crate::errors::map_work_error::MapWorkError;
use crate::variant::VariantError;
use mapper_campaign::{CampaignError, NightlyError};
use mapper_core::{BackendError, ExportError, ImportError};
use mapper_diagnose::drift::DriftError;
use mapper_diagnose::gap::calibrated_model::CalibratedModelError;
use mapper_diagnose::gap::diagnose::GapError;
use mapper_history::HistoryError;
use mapper_identify::IdentifyError;
use mapper_maps::table::DescriptionError;
use mapper_observe::OtherMachine;
use mapper_planner::PlanError;
use mapper_recording::logs::LogError;
use mapper_recording::{ChannelMapError, RecordError};
use mapper_runner::{RunError, StepSourceError};
use mapper_sequence::SequenceError;
use mapper_yaml::keys::KeyError;
use std::io;
use std::path::{Path, PathBuf};

/// Category of an error, for exit codes and status pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file could not be read or written, or the program has a defect.
    Failure,
    /// The campaign or another input has mistakes.
    BadInput,
    /// No plan is possible, or the given plan is stale.
    NoPlan,
    /// The rig failed.
    Rig,
    /// The recording does not contain the required data.
    BadRecording,
    /// Stopped by the operator.
    Interrupted,
}

/// Why a session could not complete a request.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The campaign cannot be read or has mistakes.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The nightly campaign cannot be read or has mistakes.
    #[error(transparent)]
    Nightly(#[from] NightlyError),
    /// A nightly campaign lists a campaign whose steps come from a script.
    #[error("{}: the points of a script may differ between nights; replace `sequence` by a grid", .0.display())]
    NightlySequence(PathBuf),
    /// The machine list of a nightly campaign is wrong.
    #[error(transparent)]
    Variant(#[from] VariantError),
    /// Two runs of a night have the same campaign, machine, method and seed.
    #[error("{0} appears twice in the nightly campaign; give each campaign its own name")]
    DuplicateNightlyRun(String),
    /// Rows of a study do not match the runs of this night.
    #[error("the study does not belong to this nightly campaign: {0}; make a new study")]
    NightlyMismatch(String),
    /// A log without steps has too little data.
    #[error(transparent)]
    Driven(#[from] mapper_diagnose::driven::DrivenError),
    /// A first campaign cannot get its nominal map.
    #[error(transparent)]
    FirstMap(#[from] Box<crate::errors::first_map_error::FirstMapError>),
    /// No recording was given.
    #[error("no recording was given; name a run directory or a recording")]
    NoRecording,
    /// The recordings cannot be identified together.
    #[error(
        "{} and {} cannot be identified together: the {differs} of their campaigns differs; identify each separately, or give one campaign \
         for all", .first.display(), .other.display()
    )]
    DifferentCampaigns {
        /// The first recording.
        first: PathBuf,
        /// The recording that differs from it.
        other: PathBuf,
        /// What differs.
        differs: &'static str,
    },
    /// An unknown method.
    #[error("`{0}` is not a method: {1}")]
    Method(String, #[source] serde_json::Error),
    /// The campaign's map is unusable.
    #[error("the nominal model has no map: {0}")]
    Model(#[from] mapper_campaign::NominalTableError),
    /// No plan is possible.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A file does not contain a plan.
    #[error("{} is not a plan: {}", .0.display(), .1)]
    NotAPlan(PathBuf, #[source] serde_json::Error),
    /// A stored plan no longer matches its inputs.
    #[error("{} is stale: {} changed since it was made; make a new plan", .path.display(), .changed.join(" and "))]
    StalePlan {
        /// The file.
        path: PathBuf,
        /// What has changed.
        changed: Vec<&'static str>,
    },
    /// A backend could not be made because its name or its settings are wrong.
    #[error(transparent)]
    Backend(BackendError),
    /// An auxiliary instrument cannot be created, or delivers the wrong channels.
    #[error("the auxiliary instrument at `{at}`: {source}")]
    Reader {
        /// Key path of the instrument in the campaign.
        at: String,
        /// Path below that, if the fault is in one of the backend's own settings.
        setting: String,
        /// What is wrong.
        source: mapper_core::BackendCause,
    },
    /// A stored plan violates a limit that applies to every plan.
    #[error("{} is not a valid plan: {why}; make a new plan", .path.display())]
    InvalidPlan {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// No point was identified from a recording; what is known about it.
    #[error("no point was identified: no step of the recording is long enough. {0}")]
    NoPoints(String),
    /// A recording was given twice.
    #[error("{} and {} contain the same readings, whose noise would count as independent evidence; give each recording once",
        .0[0].display(), .0[1].display())]
    SameRecording([PathBuf; 2]),
    /// A resumed run was given to a command that follows one recording.
    #[error("{run} was resumed and has several recordings; give one of them, e.g. {run}/recording.mcap", run = .0.display())]
    SeveralRecordings(PathBuf),
    /// A run cannot be resumed.
    #[error("{} cannot be resumed: {why}", .run.display())]
    NotResumable {
        /// Its directory.
        run: PathBuf,
        /// The reason.
        why: String,
    },
    /// Another runner uses the rig.
    #[error("the rig `{rig}` is in use by {owner}; wait until that run ends, or stop it")]
    RigInUse {
        /// The rig.
        rig: String,
        /// The current owner.
        owner: String,
    },
    /// A runner ended without releasing the rig.
    #[error(
        "the rig `{rig}` was not released by {owner}, which has ended; its driver should have made it safe. Inspect the rig; then resume \
         that run, or acknowledge that the rig is safe"
    )]
    RigAbandoned {
        /// The rig.
        rig: String,
        /// The run that did not release it.
        run: PathBuf,
        /// The process that did not release it.
        owner: String,
    },
    /// The rig is locked out, and the lockout has not been acknowledged.
    #[error(
        "the rig `{rig}` has been locked out{}: {reason}. Inspect the rig; then acknowledge that it is safe", since_text(.run)
    )]
    RigLockedOut {
        /// The rig.
        rig: String,
        /// The reason.
        reason: String,
        /// The run.
        run: PathBuf,
    },
    /// The rig has no lockout and no abandoned run, or no rig has this name.
    #[error("the rig `{rig}` needs no acknowledgement, or there is no rig of that name; {}", awaiting_text(.awaiting))]
    NothingToAcknowledge {
        /// The rig.
        rig: String,
        /// Rigs that wait for acknowledgement.
        awaiting: Vec<String>,
    },
    /// The rig could not be armed, so the run did not start.
    #[error(transparent)]
    NotArmed(RunError),
    /// The preflight check refused the run.
    #[error("the run was not started: {0}")]
    Preflight(String),
    /// The rig needs a guard that the campaign does not have.
    #[error(
        "backend `{backend}` requires guards that the campaign does not have: {guards}; set their limits under `limits:` or `guards:`, \
         with a reaction that ends the run"
    )]
    MissingGuards {
        /// The backend.
        backend: String,
        /// What is missing.
        guards: String,
    },
    /// A guard watches a channel that the rig does not deliver.
    #[error("backend `{backend}` does not deliver these guarded channels: {channels}")]
    GuardWithoutChannel {
        /// The backend.
        backend: String,
        /// Channels and their guards.
        channels: String,
    },
    /// A run failed; the rig is safe.
    #[error("{source}\nThe recording up to the failure is {}.", .recording.display())]
    Run {
        /// The reason.
        source: RunError,
        /// The recording up to the failure.
        recording: PathBuf,
    },
    /// A sequence script has a mistake.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// A sequence script failed at one of its steps.
    #[error(transparent)]
    Script(StepSourceError),
    /// The rehearsal of a sequence script failed.
    #[error("the rehearsal failed: {0}")]
    Rehearsal(#[source] RunError),
    /// A guard tripped in the rehearsal of a script.
    #[error("a guard tripped at {t_s:.1} s of the rehearsal on the nominal machine: {reason}")]
    RehearsalTripped {
        /// Run time, s.
        t_s: f64,
        /// What tripped it.
        reason: String,
    },
    /// A script makes no step.
    #[error("the sequence script {} makes no step", .0.display())]
    NoSteps(PathBuf),
    /// A suspected effect is not a valid effect.
    #[error(transparent)]
    Effect(Box<dyn std::error::Error + Send + Sync>),
    /// This program cannot read effects from files.
    #[error("{}: this program does not read effects from files", .0.display())]
    EffectFilesUnsupported(PathBuf),
    /// A suspected effect has the same name as another.
    #[error("{}: there is already an effect `{id}`; choose another name", .path.display())]
    DuplicateEffect {
        /// The script.
        path: PathBuf,
        /// The name.
        id: String,
    },
    /// A recording cannot be read or written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The log of another program cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log option is wrong.
    #[error(transparent)]
    LogOption(#[from] KeyError),
    /// The channel map cannot be read or has mistakes.
    #[error(transparent)]
    ChannelMap(#[from] ChannelMapError),
    /// The recorded machine is unknown.
    #[error(
        "the recorded machine is unknown, because the recording has no campaign; give its campaign{}",
        if *.channel_map_suffices { ", or a channel map with `machine:` and its `compressor_internal_area`" } else { "" }
    )]
    MachineUnknown {
        /// Whether the machine of a channel map is sufficient.
        channel_map_suffices: bool,
    },
    /// The recording is of another machine.
    #[error("{0}: use the campaign of the machine that was recorded")]
    OtherMachine(#[from] OtherMachine),
    /// A recording cannot be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// Recordings cannot be searched for drift.
    #[error(transparent)]
    Drift(#[from] DriftError),
    /// A recording cannot be diagnosed.
    #[error(transparent)]
    Gap(#[from] GapError),
    /// A diagnosis cannot be validated against a recording.
    #[error(transparent)]
    CalibratedModel(#[from] CalibratedModelError),
    /// The built-in calibration cannot be read.
    #[error("failed to read the calibration of the diagnosis: {0}")]
    Calibration(#[source] serde_json::Error),
    /// A history cannot be opened or written.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// A map cannot be written in a format.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The file is not a diagnosis or forecast, or has another hash than the pre-registered one.
    #[error("{}: {why}", .path.display())]
    CalibratedModelFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A command on map files ended early.
    #[error(transparent)]
    MapWork(#[from] MapWorkError),
    /// A map file has mistakes.
    #[error("{}: {}", .0.display(), .1)]
    Import(PathBuf, #[source] ImportError),
    /// An unknown map format.
    #[error("there is no map format `{name}`; the formats are {}", .known.join(", "))]
    UnknownFormat {
        /// The name given.
        name: String,
        /// The formats.
        known: Vec<&'static str>,
    },
    /// The extension of a file matches no known map format.
    #[error("{}: maps are read from files with the extension {}; this one has `{extension}`", .path.display(), .known.join(", "))]
    UnknownExtension {
        /// The file.
        path: PathBuf,
        /// Its extension.
        extension: String,
        /// The readable extensions.
        known: Vec<&'static str>,
    },
    /// The extension of a new file matches no known map format.
    #[error("{}: the extension belongs to no map format; use another extension, or name one of the formats {}", .path.display(), .known.join(", "))]
    UnknownOutputFormat {
        /// The file.
        path: PathBuf,
        /// Formats and their extensions.
        known: Vec<String>,
    },
    /// A map cannot be fitted.
    #[error("`{0}` needs a fitted map: {1}")]
    Fit(&'static str, #[source] mapper_maps::MapFitError),
    /// A machine cannot be written as an FMU.
    #[error(transparent)]
    Fmu(#[from] crate::errors::fmu_error::FmuExportError),
    /// The file already exists.
    #[error("{} already exists and is not replaced; choose another name", .0.display())]
    Exists(PathBuf),
    /// A file or directory could not be read, written or made.
    #[error("failed to {action} {}: {source}", .path.display())]
    File {
        /// The attempted action: "read", "write" or "create".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A parent directory has too many runs.
    #[error("{} already contains 999 runs from this second", .0.display())]
    TooManyRuns(PathBuf),
    /// Data could not be written as YAML: a defect of the program.
    #[error("failed to write YAML: {0}")]
    Yaml(#[from] serde_yaml::Error),
    /// Data could not be written as JSON: a defect of the program.
    #[error("failed to write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The operator stopped the work.
    #[error("stopped by the operator")]
    Interrupted,
}

/// The run of a lockout; empty if it is unknown, because the entry cannot be read.
pub fn since_text(run: &Path) -> String {
    if run.as_os_str().is_empty() { String::new() } else { format!(" since the run {}", run.display()) }
}

/// The rigs that wait for acknowledgement.
fn awaiting_text(rigs: &[String]) -> String {
    match rigs {
        [] => "no rig waits for one".to_owned(),
        rigs => format!("these wait for one: {}", rigs.join(", ")),
    }
}

impl SessionError {
    /// A file that could not be read, written or created.
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| match source.kind() {
            io::ErrorKind::AlreadyExists => SessionError::Exists(path),
            _ => SessionError::File { action, path, source },
        }
    }

    /// Category of the error.
    pub fn kind(&self) -> ErrorKind {
        use SessionError as E;
        match self {
            E::Campaign(CampaignError::Read { .. })
            | E::Nightly(NightlyError::Read { .. })
            | E::MapWork(MapWorkError::Description(DescriptionError::Read(..)))
            | E::ChannelMap(ChannelMapError::Read { .. }) => ErrorKind::Failure,
            E::Campaign(CampaignError::Mistakes(_))
            | E::Nightly(NightlyError::Mistakes(_))
            | E::NightlySequence(..)
            | E::DuplicateNightlyRun(..)
            | E::Variant(_)
            | E::NightlyMismatch(..)
            | E::NoRecording
            | E::DifferentCampaigns { .. }
            | E::Method(..)
            | E::Model(_)
            | E::Backend(_)
            | E::Reader { .. }
            | E::Effect(_)
            | E::DuplicateEffect { .. }
            | E::EffectFilesUnsupported(..)
            | E::ChannelMap(ChannelMapError::Mistakes(_))
            | E::MachineUnknown { .. }
            | E::NothingToAcknowledge { .. }
            | E::Import(..)
            | E::MapWork(_)
            | E::UnknownFormat { .. }
            | E::UnknownExtension { .. }
            | E::UnknownOutputFormat { .. }
            | E::Fit(..)
            | E::Fmu(_)
            | E::FirstMap(_)
            | E::Drift(DriftError::NoRun)
            | E::Export(ExportError::NeedsFit { .. })
            | E::Script(_)
            | E::SameRecording(_)
            | E::SeveralRecordings(_) => ErrorKind::BadInput,
            E::MissingGuards { .. }
            | E::GuardWithoutChannel { .. }
            | E::RigInUse { .. }
            | E::RigAbandoned { .. }
            | E::RigLockedOut { .. }
            | E::NotArmed(_)
            | E::Preflight(_) => ErrorKind::Rig,
            E::Plan(_)
            | E::NotAPlan(..)
            | E::StalePlan { .. }
            | E::InvalidPlan { .. }
            | E::NotResumable { .. }
            | E::RehearsalTripped { .. }
            | E::NoSteps(..) => ErrorKind::NoPlan,
            E::Run { source, .. } => match source {
                RunError::Backend(_) | RunError::NotArmed(_) => ErrorKind::Rig,
                RunError::Source(_) => ErrorKind::BadInput,
                RunError::Observer(_) | RunError::Panicked { .. } => ErrorKind::Failure,
                RunError::NotSafe { .. } => ErrorKind::Rig,
            },
            // Only these errors come from the file system; all others come from the recording itself.
            E::Record(RecordError::Read { .. } | RecordError::Exists { .. } | RecordError::Create { .. })
            | E::Record(RecordError::Write { .. } | RecordError::BadInput { .. }) => ErrorKind::Failure,
            E::Record(RecordError::ChannelMap(_) | RecordError::LogWithoutMap { .. }) => ErrorKind::BadInput,
            E::Record(RecordError::Log(LogError::Read { .. })) | E::Log(LogError::Read { .. }) => {
                ErrorKind::Failure
            }
            E::Log(_) | E::NoPoints(..) => ErrorKind::BadRecording,
            E::LogOption(_) | E::CalibratedModel(_) | E::CalibratedModelFile { .. } => ErrorKind::BadInput,
            E::Record(_) | E::Driven(_) | E::OtherMachine(_) | E::Identify(_) | E::Drift(_) | E::Gap(_) => {
                ErrorKind::BadRecording
            }
            E::Sequence(_)
            | E::Rehearsal(_)
            | E::Calibration(_)
            | E::History(_)
            | E::Export(_)
            | E::File { .. }
            | E::Exists(_)
            | E::TooManyRuns(..)
            | E::Yaml(_)
            | E::Json(_) => ErrorKind::Failure,
            E::Interrupted => ErrorKind::Interrupted,
        }
    }
}
