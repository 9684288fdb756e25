//! What a run is connected to: observers, the operator, its protection in addition to its guards, and its errors.

use crate::guards::plausibility_watch::ReadingBounds;
use crate::run_control::transition_control::StandMotion;
use crate::step_source::StepSourceError;
use mapper_core::{
    BackendError, Event, RigDescription, RunEnding, SafeTrajectory, SampleBatch, SetpointRanges, SpeedBand,
    StepMarker,
};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Failure of an observer; the run ends in its safe state.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct ObserverError {
    /// The observer's own error: the failure and its remedy.
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl ObserverError {
    /// Wraps the observer's own error.
    pub fn new(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        ObserverError { source: Box::new(error) }
    }
}

/// Declares [`RunObserver`], and a list of observers as one observer.
macro_rules! run_observer {
    ($($(#[$doc:meta])+ $method:ident($news:ty);)+) => {
        /// Called by the runner in order of run time. Every method does nothing by default.
        pub trait RunObserver {
            $(
                $(#[$doc])+
                ///
                /// # Errors
                /// [`ObserverError`] ends the run in its safe state.
                fn $method(&mut self, _news: &$news) -> Result<(), ObserverError> {
                    Ok(())
                }
            )+
        }

        /// Calls each observer in turn; the first error skips the remaining ones.
        impl RunObserver for Vec<&mut dyn RunObserver> {
            $(
                fn $method(&mut self, news: &$news) -> Result<(), ObserverError> {
                    self.iter_mut().try_for_each(|observer| observer.$method(news))
                }
            )+
        }
    };
}

run_observer! {
    /// The rig is armed.
    on_start(RigDescription);
    /// A step begins; `end_s` of its marker is its planned end.
    on_step_start(StepMarker);
    /// New samples with the rig's own events; also called for warm-up and cool-down.
    on_batch(SampleBatch);
    /// A message of the runner: a guard that tripped, a stop, the safe state.
    on_event(Event);
    /// The rig must be inspected before the next run, whatever follows: why. Comes before anything else is told about it.
    on_lockout(Event);
    /// A guard has cut the step short: it does not count.
    on_step_abandoned(StepMarker);
    /// A step has ended; `end_s` of its marker is its real end.
    on_step_end(StepMarker);
    /// The step that has just ended was complete: neither a stop nor a fault cut it short.
    on_step_completed(StepMarker);
}

/// Maximum number of requests that wait to be recorded; further ones are dropped.
const MAX_WAITING: usize = 64;

/// Requests of the operator, from any thread. The run reads them after every batch of samples.
#[derive(Debug, Default)]
pub struct Operator {
    is_held: AtomicBool,
    requests: Mutex<Vec<String>>,
}

impl Operator {
    /// Holds the current step until [`Operator::release`].
    pub fn hold(&self) {
        self.is_held.store(true, Ordering::SeqCst);
    }

    /// Releases a held step.
    pub fn release(&self) {
        self.is_held.store(false, Ordering::SeqCst);
    }

    /// Whether the step is held.
    pub fn is_holding(&self) -> bool {
        self.is_held.load(Ordering::SeqCst)
    }

    /// Adds a sentence to the recording: the request and who made it.
    pub fn add_message(&self, sentence: String) {
        if let Ok(mut requests) = self.requests.lock()
            && requests.len() < MAX_WAITING
        {
            requests.push(sentence);
        }
    }

    /// The requests since the last call.
    pub(crate) fn take_messages(&self) -> Vec<String> {
        self.requests.lock().map(|mut requests| std::mem::take(&mut *requests)).unwrap_or_default()
    }
}

/// Failure of a run. The rig was commanded to its safe state before this is returned.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum RunError {
    #[error("the rig could not be armed, and no step was started: {0}")]
    NotArmed(#[source] BackendError),
    #[error("the rig failed: {0}")]
    Backend(#[from] BackendError),
    #[error("{0}")]
    Observer(#[from] ObserverError),
    #[error("{0}")]
    Source(#[from] StepSourceError),
    #[error(
        "the program failed during the run ({message}); the rig is safe. Please report this as a fault of the program"
    )]
    Panicked { message: String },
    #[error(
        "THE RIG DID NOT CONFIRM ITS SAFE STATE: {source}. Cut its air by hand. The run had ended because: {why}"
    )]
    NotSafe { why: String, source: BackendError },
}

impl RunError {
    /// Whether the state of the rig is unknown.
    pub fn leaves_rig_state_unknown(&self) -> bool {
        match self {
            RunError::NotSafe { .. } | RunError::Panicked { .. } => true,
            RunError::Backend(error) => {
                matches!(error, BackendError::Lost { .. } | BackendError::Deadline { .. })
            }
            // A rig that does not answer may still arm later.
            RunError::NotArmed(error) => matches!(error, BackendError::Deadline { .. }),
            RunError::Observer(_) | RunError::Source(_) => false,
        }
    }
}

/// Protection of a run; [`Protection::default`] applies none.
#[derive(Debug, Clone, Copy)]
pub struct Protection<'a> {
    /// The trajectory into the safe state.
    pub safe: SafeTrajectory,
    /// P3 at which the air is cut, Pa: the lowest setpoint that the rig accepts.
    pub p3_min_pa: f64,
    /// The stand, on which P3 and valve move on coordinated ramps; `None`: setpoints change at once.
    pub stand: Option<StandMotion>,
    /// Setpoint ranges that the rig accepts, also during safe shutdown; `None`: unlimited.
    pub accepts: Option<SetpointRanges>,
    /// Allowed deviation of a step's speed; `None`: not checked.
    pub speed: Option<SpeedBand>,
    /// Bounds for the plausibility check of every sample; `None`: not checked.
    pub readings: Option<ReadingBounds>,
    /// Set from outside to stop at the end of the step.
    pub stop_after_step: &'a AtomicBool,
    /// Polls the rig sample by sample. A simulated rig is otherwise polled so only while a guard is alert.
    pub each_sample: bool,
    /// Requests of the operator; `None`: no operator.
    pub operator: Option<&'a Operator>,
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl Default for Protection<'_> {
    fn default() -> Self {
        Protection {
            safe: SafeTrajectory::default(),
            p3_min_pa: 0.0,
            stand: None,
            accepts: None,
            speed: None,
            readings: None,
            stop_after_step: &NEVER,
            each_sample: false,
            operator: None,
        }
    }
}

/// What a run says of its end, from its reason (`end`, `message`), from the answer to the safe command, and from the record of both.
///
/// # Errors
/// [`RunError::NotSafe`] if the rig did not confirm, whatever the reason; otherwise the reason itself if it is an error, and that of the record
/// unless a guard ended the run: a full disk must not hide a trip, nor its lockout.
pub fn stated_end(
    end: Result<RunEnding, RunError>,
    safe: Result<(), BackendError>,
    message: String,
    reported: Result<(), RunError>,
) -> Result<RunEnding, RunError> {
    match (end, safe) {
        (Err(error), Err(source)) => Err(RunError::NotSafe { why: error.to_string(), source }),
        (Ok(_), Err(source)) => Err(RunError::NotSafe { why: message, source }),
        (Err(error), Ok(())) => Err(error),
        (Ok(end), Ok(())) => match reported {
            Err(error) if !matches!(end, RunEnding::Tripped(_)) || error.leaves_rig_state_unknown() => {
                Err(error)
            }
            _ => Ok(end),
        },
    }
}
