//! Errors of a session, their category and the input that they are about.

use mapper_campaign::{
    CampaignError, Findings, MapMisfit, NightlyError, NominalTableError, USUAL_WHEEL_DIAMETERS_M,
};
use mapper_core::{BackendError, ExportError, ImportError};
use mapper_diagnose::drift::DriftError;
use mapper_diagnose::gap::{CalibratedModelError, GapError, RestoreError};
use mapper_fmu::FmuError;
use mapper_history::HistoryError;
use mapper_identify::IdentifyError;
use mapper_maps::table::DescriptionError;
use mapper_maps::{AssembleError, MapFitError, ScaleError, TurbineFitError};
use mapper_observe::OtherMachine;
use mapper_physics::compressor_map::tabulated_map::MapError;
use mapper_physics::simulation::steady::SteadyError;
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
#[non_exhaustive]
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

/// The input that an error is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Input {
    /// A campaign cannot be read, has mistakes, or has no plan.
    Campaign,
    /// A recording or its channel map cannot be read.
    Recording,
    /// A recording does not contain the required data.
    RecordedData,
}

/// Why a session could not complete a request.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SessionError {
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    #[error(transparent)]
    Nightly(#[from] NightlyError),
    #[error("{}: the points of a script may differ between nights; replace `sequence` by a grid", .0.display())]
    NightlySequence(PathBuf),
    #[error("{0} appears twice in the nightly campaign; give each campaign its own name")]
    DuplicateNightlyRun(String),
    #[error("the study does not belong to this nightly campaign: {0}; make a new study")]
    NightlyMismatch(String),
    #[error(transparent)]
    Driven(#[from] mapper_diagnose::driven::DrivenError),
    #[error(transparent)]
    FirstMap(#[from] Box<FirstMapError>),
    #[error("no recording was given; name a run directory or a recording")]
    NoRecording,
    #[error(
        "{} and {} cannot be identified together: the {differs} of their campaigns differs; identify each separately, or give one campaign \
         for all", .first.display(), .other.display()
    )]
    DifferentCampaigns { first: PathBuf, other: PathBuf, differs: &'static str },
    #[error("recordings that are identified together need the same channel map; identify each separately")]
    DifferentChannelMaps,
    #[error("the points make no map: {0}")]
    NoMap(String),
    #[error(
        "there is no effect library, so a diagnosis would find no cause; pass the effects of the registry, or effects of your own"
    )]
    NoEffects,
    #[error("`{0}` is not a method: {1}")]
    Method(String, #[source] serde_json::Error),
    #[error("the nominal model has no map: {0}")]
    Model(#[from] mapper_campaign::NominalTableError),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error("{} is not a plan: {}", .0.display(), .1)]
    NotAPlan(PathBuf, #[source] serde_json::Error),
    #[error("{} is stale: {} changed since it was made; make a new plan", .path.display(), .changed.join(" and "))]
    StalePlan { path: PathBuf, changed: Vec<&'static str> },
    #[error(transparent)]
    Backend(BackendError),
    /// `at`: key path of the instrument in the campaign; `setting`: path below it if one of the backend's own settings is wrong.
    #[error("the auxiliary instrument at `{at}`: {source}")]
    Reader { at: String, setting: String, source: mapper_core::BackendCause },
    #[error("{} is not a valid plan: {why}; make a new plan", .path.display())]
    InvalidPlan { path: PathBuf, why: String },
    #[error("no point was identified: no step of the recording is long enough. {0}")]
    NoPoints(String),
    #[error("{} and {} contain the same readings, whose noise would count as independent evidence; give each recording once",
        .0[0].display(), .0[1].display())]
    SameRecording([PathBuf; 2]),
    #[error("{run} was resumed and has several recordings; give one of them, e.g. {run}/recording.mcap", run = .0.display())]
    SeveralRecordings(PathBuf),
    #[error("{} cannot be resumed: {why}", .run.display())]
    NotResumable { run: PathBuf, why: String },
    #[error("{}: the journal lists steps that no recording contains: {lost}. Restore the file, or run these steps again", .run.display())]
    LostSteps { run: PathBuf, lost: String },
    #[error("the rig `{rig}` is in use by {owner}; wait until that run ends, or stop it")]
    RigInUse { rig: String, owner: String },
    #[error(
        "the rig `{rig}` was not released by {owner}, which has ended; its driver should have made it safe. Inspect the rig; then resume \
         that run, or acknowledge that the rig is safe"
    )]
    RigAbandoned { rig: String, run: PathBuf, owner: String },
    #[error(
        "the rig `{rig}` has been locked out{}: {reason}. Inspect the rig; then acknowledge that it is safe", since_text(.run)
    )]
    RigLockedOut { rig: String, reason: String, run: PathBuf },
    #[error("the rig `{rig}` has been locked out: {reason}")]
    RigFileDoubtful { rig: String, reason: String },
    /// `awaiting`: rigs that wait for acknowledgement.
    #[error("the rig `{rig}` needs no acknowledgement, or there is no rig of that name; {}", awaiting_text(.awaiting))]
    NothingToAcknowledge { rig: String, awaiting: Vec<String> },
    #[error(transparent)]
    NotArmed(RunError),
    #[error("the run was not started: {0}")]
    Preflight(String),
    #[error(
        "backend `{backend}` requires guards that the campaign does not have: {guards}; set their limits under `limits:` or `guards:`, \
         with a reaction that ends the run"
    )]
    MissingGuards { backend: String, guards: String },
    #[error("backend `{backend}` does not deliver these guarded channels: {channels}")]
    GuardWithoutChannel { backend: String, channels: String },
    /// The rig is safe.
    #[error("{source}\nThe recording up to the failure is {}.", .recording.display())]
    Run { source: RunError, recording: PathBuf },
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    #[error(transparent)]
    Script(StepSourceError),
    #[error("the rehearsal failed: {0}")]
    Rehearsal(#[source] RunError),
    #[error("a guard tripped at {t_s:.1} s of the rehearsal on the nominal machine: {reason}")]
    RehearsalTripped { t_s: f64, reason: String },
    #[error("the sequence script {} makes no step", .0.display())]
    NoSteps(PathBuf),
    #[error(transparent)]
    Effect(Box<dyn std::error::Error + Send + Sync>),
    #[error("{}: this program does not read effects from files", .0.display())]
    EffectFilesUnsupported(PathBuf),
    #[error("{}: there is already an effect `{id}`; choose another name", .path.display())]
    DuplicateEffect { path: PathBuf, id: String },
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    LogOption(#[from] KeyError),
    #[error(transparent)]
    ChannelMap(#[from] ChannelMapError),
    /// `channel_map_suffices`: the machine of a channel map is sufficient.
    #[error(
        "the recorded machine is unknown, because the recording has no campaign; give its campaign{}",
        if *.channel_map_suffices { ", or a channel map with `machine:` and its `compressor_internal_area`" } else { "" }
    )]
    MachineUnknown { channel_map_suffices: bool },
    #[error("{0}: use the campaign of the machine that was recorded")]
    OtherMachine(#[from] OtherMachine),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    #[error(transparent)]
    Drift(#[from] DriftError),
    #[error(transparent)]
    Gap(#[from] GapError),
    #[error(transparent)]
    CalibratedModel(#[from] CalibratedModelError),
    #[error("failed to read the calibration of the diagnosis: {0}")]
    Calibration(#[source] serde_json::Error),
    #[error(transparent)]
    History(#[from] HistoryError),
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The file is not a diagnosis or forecast, or has another hash than the pre-registered one.
    #[error("{}: {why}", .path.display())]
    CalibratedModelFile { path: PathBuf, why: String },
    #[error("{}: {source}", .path.display())]
    StoredDiagnosis { path: PathBuf, source: Box<StoredDiagnosisError> },
    #[error(transparent)]
    MapWork(#[from] MapWorkError),
    #[error("{}: {}", .0.display(), .1)]
    Import(PathBuf, #[source] ImportError),
    #[error("there is no map format `{name}`; the formats are {}", .known.join(", "))]
    UnknownFormat { name: String, known: Vec<&'static str> },
    #[error("{}: maps are read from files with the extension {}; this one has `{extension}`", .path.display(), .known.join(", "))]
    UnknownExtension { path: PathBuf, extension: String, known: Vec<&'static str> },
    #[error("{}: the extension belongs to no map format; use another extension, or name one of the formats {}", .path.display(), .known.join(", "))]
    UnknownOutputFormat { path: PathBuf, known: Vec<String> },
    #[error("{}: samples are written to files with the extension {}", .path.display(), .known.join(", "))]
    UnknownSampleFormat { path: PathBuf, known: Vec<&'static str> },
    #[error("`{0}` needs a fitted map: {1}")]
    Fit(&'static str, #[source] mapper_maps::MapFitError),
    #[error(transparent)]
    Fmu(#[from] FmuExportError),
    #[error("{} already exists and is not replaced; choose another name", .0.display())]
    Exists(PathBuf),
    #[error("failed to {action} {}: {source}", .path.display())]
    File { action: &'static str, path: PathBuf, source: io::Error },
    #[error("{} already contains 999 runs from this second", .0.display())]
    TooManyRuns(PathBuf),
    /// A defect of the program.
    #[error("failed to write YAML: {0}")]
    Yaml(#[from] serde_yaml::Error),
    /// A defect of the program.
    #[error("failed to write JSON: {0}")]
    Json(#[from] serde_json::Error),
    #[error("stopped by the operator")]
    Interrupted,
}

/// The run of a lockout; empty if it is unknown, because the entry cannot be read.
pub fn since_text(run: &Path) -> String {
    if run.as_os_str().is_empty() { String::new() } else { format!(" since the run {}", run.display()) }
}

fn awaiting_text(rigs: &[String]) -> String {
    match rigs {
        [] => "no rig waits for one".to_owned(),
        rigs => format!("these wait for one: {}", rigs.join(", ")),
    }
}

impl SessionError {
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| match source.kind() {
            io::ErrorKind::AlreadyExists => SessionError::Exists(path),
            _ => SessionError::File { action, path, source },
        }
    }

    /// The mistakes of a file that people write, each with its place.
    pub fn findings(&self) -> Option<&Findings> {
        match self {
            SessionError::Campaign(CampaignError::Mistakes(findings))
            | SessionError::Nightly(NightlyError::Mistakes(findings))
            | SessionError::ChannelMap(ChannelMapError::Mistakes(findings))
            | SessionError::MapWork(MapWorkError::Description(DescriptionError::Mistakes(findings)))
            | SessionError::Record(RecordError::ChannelMap(findings)) => Some(findings),
            _ => None,
        }
    }

    /// The input that the error is about; `None` for any other than a campaign or a recording.
    pub fn input(&self) -> Option<Input> {
        self.kind_and_input().1
    }

    /// Category of the error.
    pub fn kind(&self) -> ErrorKind {
        self.kind_and_input().0
    }

    fn kind_and_input(&self) -> (ErrorKind, Option<Input>) {
        use ErrorKind as K;
        use SessionError as E;
        let (campaign, recording, data) =
            (Some(Input::Campaign), Some(Input::Recording), Some(Input::RecordedData));
        match self {
            E::Campaign(CampaignError::Read { .. }) | E::Sequence(_) | E::Rehearsal(_) => {
                (K::Failure, campaign)
            }
            // Only these errors come from the file system; all others come from the recording itself.
            E::Record(RecordError::Read { .. } | RecordError::Exists { .. } | RecordError::Create { .. })
            | E::Record(RecordError::Write { .. } | RecordError::BadInput { .. })
            | E::Record(RecordError::Log(LogError::Read { .. }))
            | E::Log(LogError::Read { .. })
            | E::ChannelMap(ChannelMapError::Read { .. }) => (K::Failure, recording),
            E::Nightly(NightlyError::Read { .. })
            | E::MapWork(MapWorkError::Description(DescriptionError::Read(..)))
            | E::Calibration(_)
            | E::History(_)
            | E::File { .. }
            | E::Exists(_)
            | E::TooManyRuns(..)
            | E::Yaml(_)
            | E::Json(_) => (K::Failure, None),
            E::Campaign(CampaignError::Mistakes(_))
            | E::Model(_)
            | E::Backend(_)
            | E::Reader { .. }
            | E::FirstMap(_)
            | E::Script(_) => (K::BadInput, campaign),
            E::NoRecording
            | E::ChannelMap(ChannelMapError::Mistakes(_))
            | E::SameRecording(_)
            | E::LogOption(_)
            | E::Record(RecordError::ChannelMap(_) | RecordError::LogWithoutMap { .. }) => {
                (K::BadInput, recording)
            }
            E::DifferentCampaigns { .. }
            | E::Method(..)
            | E::MachineUnknown { .. }
            | E::Drift(DriftError::NoRun) => (K::BadInput, data),
            E::MissingGuards { .. } | E::GuardWithoutChannel { .. } => (K::Rig, campaign),
            E::RigInUse { .. }
            | E::RigAbandoned { .. }
            | E::RigLockedOut { .. }
            | E::RigFileDoubtful { .. }
            | E::NotArmed(_)
            | E::Preflight(_) => (K::Rig, None),
            E::Plan(_) | E::RehearsalTripped { .. } | E::NoSteps(..) => (K::NoPlan, campaign),
            E::NotAPlan(..)
            | E::StalePlan { .. }
            | E::InvalidPlan { .. }
            | E::NotResumable { .. }
            | E::LostSteps { .. } => (K::NoPlan, None),
            E::Run { source, .. } => match source {
                RunError::Backend(_) | RunError::NotArmed(_) | RunError::NotSafe { .. } => (K::Rig, None),
                RunError::Source(_) => (K::BadInput, None),
                RunError::Observer(_) | RunError::Panicked { .. } => (K::Failure, None),
            },
            E::Log(_) | E::Record(_) => (K::BadRecording, recording),
            E::NoPoints(..) | E::NoMap(..) | E::Driven(_) | E::OtherMachine(_) => (K::BadRecording, data),
            E::Identify(_) | E::Drift(_) | E::Gap(_) => (K::BadRecording, data),
            E::CalibratedModel(CalibratedModelError::Gap(_)) => (K::BadRecording, None),
            E::Export(ExportError::NeedsFit { .. }) => (K::BadInput, None),
            E::Export(_) => (K::Failure, None),
            E::Nightly(NightlyError::Mistakes(_))
            | E::NightlySequence(..)
            | E::DuplicateNightlyRun(..)
            | E::NightlyMismatch(..)
            | E::DifferentChannelMaps
            | E::NoEffects
            | E::Effect(_)
            | E::DuplicateEffect { .. }
            | E::EffectFilesUnsupported(..)
            | E::NothingToAcknowledge { .. }
            | E::Import(..)
            | E::MapWork(_)
            | E::UnknownFormat { .. }
            | E::UnknownExtension { .. }
            | E::UnknownOutputFormat { .. }
            | E::UnknownSampleFormat { .. }
            | E::Fit(..)
            | E::Fmu(_)
            | E::SeveralRecordings(_)
            | E::CalibratedModel(_)
            | E::CalibratedModelFile { .. }
            | E::StoredDiagnosis { .. } => (K::BadInput, None),
            E::Interrupted => (K::Interrupted, None),
        }
    }
}

/// Why the file of a diagnosis cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum StoredDiagnosisError {
    #[error(
        "it is not the file of a diagnosis of one recording ({0}): diagnose the recording, and keep that file"
    )]
    NotADiagnosis(String),
    #[error(
        "it was changed after it was written: its content does not have the SHA-256 in it; diagnose again"
    )]
    Changed,
    #[error("it is of another version ({theirs}; this program is {ours}): diagnose again")]
    Outdated { theirs: String, ours: String },
    #[error(
        "it belongs to another recording, or this one was changed or is read with another channel map: diagnose this one"
    )]
    OtherRecording,
    #[error(
        "the campaign is not the one of the diagnosis, or was changed since: give that campaign, or diagnose again"
    )]
    OtherCampaign,
    #[error("it was made with other effects: give the same files of effects, or diagnose again")]
    OtherEffects,
    #[error("it has only the changes since a reference recording: diagnose without one")]
    WithBaseline,
    #[error(transparent)]
    Restore(#[from] RestoreError),
}

/// Why a first campaign cannot get its nominal map.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FirstMapError {
    #[error(
        "a compressor wheel of {} mm is unusual: turbochargers have {:.0} to {:.0} mm; give its diameter at the exit, with its unit",
        (1e7 * .wheel_m).round() / 1e4, 1e3 * USUAL_WHEEL_DIAMETERS_M.0, 1e3 * USUAL_WHEEL_DIAMETERS_M.1
    )]
    Wheel { wheel_m: f64 },
    #[error(
        "the file {} is not a map: {}; write a table of corrected speed, corrected flow, pressure ratio and efficiency, with units \
         in its header, or convert a map of another format", .0.display(), .1
    )]
    NotAMap(PathBuf, #[source] NominalTableError),
    #[error("the map {}: {misfit}; {}", .path.display(), .misfit.remedy())]
    Misfit { path: PathBuf, misfit: MapMisfit },
    #[error(
        "the map has no speed line between {:.1} and {:.1} krpm; choose speeds between {:.1} and {:.1} krpm",
        .requested_rpm.0 / 1e3, .requested_rpm.1 / 1e3, .map_rpm.0 / 1e3, .map_rpm.1 / 1e3
    )]
    NoLines { requested_rpm: (f64, f64), map_rpm: (f64, f64) },
}

/// Why a machine cannot be written as an FMU.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FmuExportError {
    #[error("an FMU needs a map of the whole machine: {0}")]
    NoMap(String),
    #[error("the map cannot be simulated: {0}")]
    Map(#[from] MapError),
    #[error("the model has no steady state to start from: {0}")]
    Start(#[from] SteadyError),
    #[error(transparent)]
    Fmu(#[from] FmuError),
    #[error(
        "FMI 2.0 has no name for libraries of this platform; export the sources only and let the importer compile them"
    )]
    Platform,
    #[error(
        "the sources cannot be compiled with `{compiler}`: {why}; install a C compiler, name it in CC, or export the sources only"
    )]
    Compiler { compiler: String, why: String },
}

/// Errors of commands on map files.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum MapWorkError {
    #[error(transparent)]
    Description(#[from] DescriptionError),
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error("{}: {}", .0.display(), .1)]
    NotFitted(PathBuf, #[source] MapFitError),
    #[error(transparent)]
    NotCompared(#[from] MapFitError),
    #[error("{}: {}", .0.display(), .1)]
    TurbineNotFitted(PathBuf, #[source] TurbineFitError),
    #[error("{}: {}", .0.display(), .1)]
    NotScaled(PathBuf, #[source] ScaleError),
    /// A table whose points are corrected already.
    #[error(
        "{} is not a table of measured points, which has columns for N, flow, P1, T1, P2 and T2 (of a turbine N, flow, P3, T3, P4 and T4); inspect the columns that were recognised",
        .0.display()
    )]
    NotMeasured(PathBuf),
    #[error("{}: {}", .0.display(), .1)]
    NotAssembled(PathBuf, #[source] AssembleError),
    #[error(
        "the file does not state how its efficiencies are defined; state the definition, e.g. `constant_gamma 1.4`"
    )]
    NoDefinition,
    #[error("{} is a turbine map, the other file a compressor map; give two maps of the same machine", .0.display())]
    TwoMachines(PathBuf),
    #[error("{} is a turbine map and has no {property}; leave that out", .path.display())]
    NotOfTurbine { path: PathBuf, property: &'static str },
    #[error("failed to draw the picture: {0}")]
    Picture(String),
}
