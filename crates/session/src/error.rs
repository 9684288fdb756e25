//! Why a session could not do what it was asked.

use crate::error_kind::ErrorKind;
use crate::variant::VariantError;
use mapper_campaign::{CampaignError, NightlyError};
use mapper_core::{BackendError, ExportError, ImportError};
use mapper_drift::DriftError;
use mapper_gap::diagnose::GapError;
use mapper_gap::twin::TwinError;
use mapper_history::HistoryError;
use mapper_identify::IdentifyError;
use mapper_logs::{LogError, OptionError};
use mapper_observe::OtherMachine;
use mapper_planner::PlanError;
use mapper_record::{ChannelMapError, RecordError};
use mapper_runner::{RunError, StepSourceError};
use mapper_sequence::SequenceError;
use std::io;
use std::path::{Path, PathBuf};

/// A name as a shell takes it for one word.
fn word(name: &str) -> String {
    let plain = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "-_./:@".contains(c));
    if plain { name.to_owned() } else { format!("'{}'", name.replace('\'', r"'\''")) }
}

fn in_doubt_text(rigs: &[String]) -> String {
    if rigs.is_empty() { "no rig is in doubt".to_owned() } else { format!("in doubt: {}", rigs.join(", ")) }
}

/// Why a session could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The campaign cannot be read, or has mistakes.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The nightly campaign cannot be read, or has mistakes.
    #[error(transparent)]
    Nightly(#[from] NightlyError),
    /// A nightly campaign names one whose steps come from a script.
    #[error(
        "{}: a nightly run compares the same points night after night; the steps of this campaign come from a script, \
         which may visit others. Give it a grid instead of `sequence`", .path.display()
    )]
    NightlySequence {
        /// The campaign.
        path: PathBuf,
    },
    /// The machines of a nightly campaign are wrong.
    #[error(transparent)]
    Variant(#[from] VariantError),
    /// Two runs of a night have the same campaign, machine, method and seed.
    #[error("{key} appears twice in the nightly campaign; give each campaign its own name")]
    NightlyTwice {
        /// The run.
        key: String,
    },
    /// Runs that were made elsewhere are not those of the night.
    #[error(
        "the runs that were made elsewhere are not those of this nightly campaign: {lacks}; make the study again from it"
    )]
    OtherNight {
        /// What differs.
        lacks: String,
    },
    /// A log without steps has too little.
    #[error(transparent)]
    Driven(#[from] mapper_driven::DrivenError),
    /// Nothing to identify was given.
    #[error("no recording was given; name a run directory or a recording")]
    NoRecording,
    /// Recordings that cannot be identified together.
    #[error(
        "{} and {} cannot be identified together: their campaigns have another {differs}; identify each by itself, or give the campaign \
         that holds for all with `--campaign`", .first.display(), .other.display()
    )]
    NotTogether {
        /// The first recording.
        first: PathBuf,
        /// The one that differs from it.
        other: PathBuf,
        /// What differs.
        differs: &'static str,
    },
    /// A method that does not exist.
    #[error("`{name}` is not a method: {source}")]
    Method {
        /// What was written.
        name: String,
        /// The methods that exist.
        source: serde_json::Error,
    },
    /// The campaign's map is not usable.
    #[error("the nominal model has no map: {0}")]
    Model(#[from] mapper_campaign::NominalTableError),
    /// There is no plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A file does not hold a plan.
    #[error("{} is not a plan: {source}", .path.display())]
    NotAPlan {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// A stored plan was made from something else.
    #[error(
        "{} is stale: {} changed since it was made; make it again with `mapper plan CAMPAIGN --out FILE`",
        .path.display(), .changed.join(" and ")
    )]
    StalePlan {
        /// The file.
        path: PathBuf,
        /// What has changed.
        changed: Vec<&'static str>,
    },
    /// A backend could not be made: its name or its settings are wrong.
    #[error(transparent)]
    Backend(BackendError),
    /// A source beside the rig cannot be made, or gives what it should not.
    #[error("the reader at `{at}`: {source}")]
    Reader {
        /// Keys of the campaign down to it.
        at: String,
        /// Path below that, where it is one of the backend's own settings.
        setting: String,
        /// What is wrong.
        source: mapper_core::BackendCause,
    },
    /// A stored plan that no plan may be like.
    #[error("{}: {why}; make it again with `mapper plan CAMPAIGN --out FILE`", .path.display())]
    WrongPlan {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// Nothing came of a recording.
    #[error("no point was identified: the recording has no step that is long enough to be one. {why}")]
    NoPoints {
        /// What is known of it.
        why: String,
    },
    /// A recording that was given twice.
    #[error(
        "{} and {} hold the same readings; give each recording once, or its noise would count as new evidence",
        .first.display(),
        .second.display()
    )]
    SameRecording {
        /// One of them.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
    /// A run that cannot go on.
    #[error("{} cannot be resumed: {why}", .run.display())]
    NotResumable {
        /// Its directory.
        run: PathBuf,
        /// Why.
        why: String,
    },
    /// Another runner has the rig.
    #[error("the rig `{rig}` is in use by {owner}; wait for its end, or stop it there")]
    RigInUse {
        /// The rig.
        rig: String,
        /// Who has it.
        owner: String,
    },
    /// A runner died with the rig in its hands.
    #[error(
        "the rig `{rig}` was left by {owner}, which ended with the rig in its hands; a driver makes it safe by itself then. Look at the rig; then go on with \
         `mapper run --resume {}`, or clear it with `mapper rig acknowledge {}`", .run.display(), word(.rig)
    )]
    RigAbandoned {
        /// The rig.
        rig: String,
        /// The run it was left by.
        run: PathBuf,
        /// Who left it.
        owner: String,
    },
    /// A rig that nobody has looked at since it was in doubt.
    #[error(
        "the rig `{rig}` is latched since the run {}: {reason}. Look at the rig; then clear it with `mapper rig acknowledge {}`",
        .run.display(), word(.rig)
    )]
    RigLatched {
        /// The rig.
        rig: String,
        /// Why.
        reason: String,
        /// The run.
        run: PathBuf,
    },
    /// A rig without latch and without a runner that died, or no rig of that name.
    #[error("nothing was acknowledged: the rig `{rig}` is in no doubt, or its name is another; {}", in_doubt_text(.in_doubt))]
    NothingToAcknowledge {
        /// The rig.
        rig: String,
        /// Those that are in doubt.
        in_doubt: Vec<String>,
    },
    /// The rig was never had: there is no run.
    #[error(transparent)]
    NotArmed(RunError),
    /// The run cannot begin as things are.
    #[error("the run was not begun: {0}")]
    Preflight(String),
    /// A rig that needs a guard that the campaign does not have.
    #[error(
        "backend `{backend}` must not be run without these guards: {guards}; give their limits in `limits:` or `guards:` of the \
         campaign, with a reaction that ends the run"
    )]
    Unguarded {
        /// The backend.
        backend: String,
        /// What is missing.
        guards: String,
    },
    /// A guard over a channel that the rig does not deliver.
    #[error("backend `{backend}` does not deliver what is to be guarded: {channels}")]
    GuardBlind {
        /// The backend.
        backend: String,
        /// Channels and their guards.
        channels: String,
    },
    /// A run could not go on; the rig is safe.
    #[error("{source}\nThe recording up to then is {}.", .recording.display())]
    Run {
        /// Why.
        source: RunError,
        /// What was recorded.
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
    #[error("in the rehearsal on the nominal machine at {t_s:.1} s {reason}")]
    RehearsalTripped {
        /// Run time, s.
        t_s: f64,
        /// What tripped it.
        reason: String,
    },
    /// A script that makes no step.
    #[error("the sequence script {} makes no step", .path.display())]
    NoSteps {
        /// The script.
        path: PathBuf,
    },
    /// A suspected effect is not an effect.
    #[error(transparent)]
    Effect(Box<dyn std::error::Error + Send + Sync>),
    /// This program has no way to read effects.
    #[error("{}: this program does not read effects from files", .path.display())]
    EffectUnread {
        /// The file.
        path: PathBuf,
    },
    /// A suspected effect has the name of another.
    #[error("{}: there is already an effect `{id}`; choose another name", .path.display())]
    EffectTaken {
        /// The script.
        path: PathBuf,
        /// The name.
        id: String,
    },
    /// A recording cannot be read or written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A log of another program cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// What was said about how to read a log is wrong.
    #[error(transparent)]
    LogOption(#[from] OptionError),
    /// The channel map cannot be read, or has mistakes.
    #[error(transparent)]
    ChannelMap(#[from] ChannelMapError),
    /// Nobody says what machine was recorded.
    #[error("the machine is not known: the recording carries no campaign. {remedy}")]
    MachineUnknown {
        /// What to do.
        remedy: &'static str,
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
    /// A diagnosis cannot be held against a recording.
    #[error(transparent)]
    Twin(#[from] TwinError),
    /// The calibration that ships cannot be read.
    #[error("failed to read the calibration of the diagnosis: {0}")]
    Calibration(#[source] serde_json::Error),
    /// A history cannot be opened or written.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// A map cannot be written in a format.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A file that is no diagnosis, or no forecast, or not the one that was sealed.
    #[error("{}: {why}", .path.display())]
    TwinFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A map file has mistakes.
    #[error("{}: {source}", .path.display())]
    Import {
        /// The file.
        path: PathBuf,
        /// Its mistakes.
        source: ImportError,
    },
    /// A map format that does not exist.
    #[error("there is no map format `{name}`; the formats are {}", .known.join(", "))]
    UnknownFormat {
        /// What was asked for.
        name: String,
        /// The formats.
        known: Vec<&'static str>,
    },
    /// A file that is of no known map format.
    #[error("{}: maps are read from files with the extension {}; this one has `{extension}`", .path.display(), .known.join(", "))]
    UnknownExtension {
        /// The file.
        path: PathBuf,
        /// Its extension.
        extension: String,
        /// The extensions that are read.
        known: Vec<&'static str>,
    },
    /// A new file of no known map format.
    #[error("{}: give the format by the extension or by `--to`: {}", .path.display(), .known.join(", "))]
    FormatUnsaid {
        /// The file.
        path: PathBuf,
        /// Formats and their extensions.
        known: Vec<String>,
    },
    /// A map cannot be fitted.
    #[error("`{format}` needs a fitted map: {source}")]
    Fit {
        /// The format.
        format: &'static str,
        /// Why.
        source: mapper_assemble::MapFitError,
    },
    /// A machine is no FMU.
    #[error(transparent)]
    Fmu(#[from] crate::fmu_error::FmuExportError),
    /// A file is there already.
    #[error("{} is there already and is kept; choose another name", .path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file or directory could not be read, written or made.
    #[error("failed to {action} {}: {source}", .path.display())]
    File {
        /// What was tried: "read", "write", "create".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A parent directory is full of runs.
    #[error("{} already holds 999 runs from this second", .parent.display())]
    TooManyRuns {
        /// The directory.
        parent: PathBuf,
    },
    /// Data could not be written as JSON: a fault of the program.
    #[error("failed to write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The operator stopped it.
    #[error("stopped by the operator")]
    Interrupted,
}

impl SessionError {
    /// A file that could not be read, written or created.
    pub(crate) fn file(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| match source.kind() {
            io::ErrorKind::AlreadyExists => SessionError::Exists { path },
            _ => SessionError::File { action, path, source },
        }
    }

    /// What kind of trouble it is.
    pub fn kind(&self) -> ErrorKind {
        use SessionError as E;
        match self {
            E::Campaign(CampaignError::Read { .. })
            | E::Nightly(NightlyError::Read { .. })
            | E::ChannelMap(ChannelMapError::Read { .. }) => ErrorKind::Failure,
            E::Campaign(CampaignError::Mistakes(_))
            | E::Nightly(NightlyError::Mistakes(_))
            | E::NightlySequence { .. }
            | E::NightlyTwice { .. }
            | E::Variant(_)
            | E::OtherNight { .. }
            | E::NoRecording
            | E::NotTogether { .. }
            | E::Method { .. }
            | E::Model(_)
            | E::Backend(_)
            | E::Reader { .. }
            | E::Effect(_)
            | E::EffectTaken { .. }
            | E::EffectUnread { .. }
            | E::ChannelMap(ChannelMapError::Mistakes(_))
            | E::MachineUnknown { .. }
            | E::NothingToAcknowledge { .. }
            | E::Import { .. }
            | E::UnknownFormat { .. }
            | E::UnknownExtension { .. }
            | E::FormatUnsaid { .. }
            | E::Fit { .. }
            | E::Fmu(_)
            | E::Drift(DriftError::NoRun)
            | E::Export(ExportError::NeedsFit { .. })
            | E::Script(_)
            | E::SameRecording { .. } => ErrorKind::BadInput,
            E::Unguarded { .. }
            | E::GuardBlind { .. }
            | E::RigInUse { .. }
            | E::RigAbandoned { .. }
            | E::RigLatched { .. }
            | E::NotArmed(_)
            | E::Preflight(_) => ErrorKind::Rig,
            E::Plan(_)
            | E::NotAPlan { .. }
            | E::StalePlan { .. }
            | E::WrongPlan { .. }
            | E::NotResumable { .. }
            | E::RehearsalTripped { .. }
            | E::NoSteps { .. } => ErrorKind::NoPlan,
            E::Run { source, .. } => match source {
                RunError::Backend(_) | RunError::NotArmed(_) => ErrorKind::Rig,
                RunError::Source(_) => ErrorKind::BadInput,
                RunError::Observer(_) | RunError::Panicked { .. } => ErrorKind::Failure,
                RunError::NotSafe { .. } => ErrorKind::Rig,
            },
            // Only reading fails for reasons that are not the recording's.
            E::Record(RecordError::Read { .. } | RecordError::Exists { .. } | RecordError::Create { .. })
            | E::Record(RecordError::Write { .. } | RecordError::BadInput { .. }) => ErrorKind::Failure,
            E::Record(RecordError::ChannelMap(_) | RecordError::LogWithoutMap { .. }) => ErrorKind::BadInput,
            E::Record(RecordError::Log(LogError::Read { .. })) | E::Log(LogError::Read { .. }) => {
                ErrorKind::Failure
            }
            E::LogOption(_) => ErrorKind::BadInput,
            E::Log(_) | E::NoPoints { .. } => ErrorKind::BadRecording,
            E::Twin(_) | E::TwinFile { .. } => ErrorKind::BadInput,
            E::Record(_) | E::Driven(_) | E::OtherMachine(_) | E::Identify(_) | E::Drift(_) | E::Gap(_) => {
                ErrorKind::BadRecording
            }
            E::Sequence(_)
            | E::Rehearsal(_)
            | E::Calibration(_)
            | E::History(_)
            | E::Export(_)
            | E::File { .. }
            | E::Exists { .. }
            | E::TooManyRuns { .. }
            | E::Json(_) => ErrorKind::Failure,
            E::Interrupted => ErrorKind::Interrupted,
        }
    }
}
