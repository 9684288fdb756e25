//! Runs on simulated rigs.

use crate::attended::{Attended, Shared, attend};
use crate::campaign::{Campaign, Inner};
use crate::error::Fault;
use crate::map::Map;
use crate::registry::{registry, registry_with_rig};
use mapper_session::{
    RunOutcome, RunRequest, RunTermination, Session, SessionError, SessionEvent, with_messages,
};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Outcome of a run: the rig is safe and the recording is kept.
#[pyclass(frozen, get_all, module = "mapper._mapper")]
pub struct Outcome {
    /// The run's directory.
    directory: PathBuf,
    /// Its recording.
    recording: PathBuf,
    /// How it ended: completed, drifted, tripped, interrupted or failed.
    end: &'static str,
    /// The same in a sentence.
    sentence: String,
    /// What `mapper run --json` prints; `None` without results.
    json: Option<String>,
    /// The map; `None` without one.
    map: Option<Map>,
}

/// Runs the campaign in a new directory in `parent`. `socket`: where its backend listens, if that is a rig in Python. Ctrl-C stops it at the next sample, and is raised again when the rig is safe.
#[pyfunction(name = "run")]
#[pyo3(signature = (campaign, parent, started_name, started_ns, on_event=None, socket=None))]
pub fn run_campaign(
    py: Python<'_>,
    campaign: &Campaign,
    parent: PathBuf,
    started_name: String,
    started_ns: u64,
    on_event: Option<Py<PyAny>>,
    socket: Option<PathBuf>,
) -> PyResult<Outcome> {
    let (inner, shared) = (campaign.inner.clone(), Shared::default());
    let of_worker = shared.clone();
    let attended = attend(py, shared, on_event.as_ref(), move |events| {
        let on_event = |event: &SessionEvent| events.show(event);
        let request = RunRequest {
            started_name: &started_name,
            started_ns,
            ..RunRequest::new(&inner.campaign, &inner.text, &parent)
        };
        run(&inner, request, &on_event, &of_worker, socket)
    })?;
    match attended {
        Attended::Ended(result, None) => Ok(result?),
        Attended::Ended(Ok(outcome), Some(stopped_by)) => Err(noted(py, stopped_by, &outcome.recording)),
        Attended::Ended(Err(_), Some(stopped_by)) | Attended::Left(stopped_by) => Err(stopped_by),
    }
}

fn run(
    inner: &Inner,
    request: RunRequest<'_>,
    on_event: &(dyn Fn(&SessionEvent) + Sync),
    shared: &Shared,
    socket: Option<PathBuf>,
) -> Result<Outcome, Fault> {
    let backend = inner.campaign.backend.name.clone();
    let registry = socket.map_or_else(registry, |socket| registry_with_rig((backend, socket)));
    let session = Session { on_event, stop: &shared.stop, ..Session::new(&registry) };
    let prepared = session.prepare(request).map_err(|error| inner.fault(error))?;
    let rig = prepared.rig();
    if !rig.simulated_time {
        return Err(Fault::Argument(format!(
            "backend `{}` is a rig in real time; run it with the command `mapper run`, which handles all signals",
            rig.backend
        )));
    }
    shared.holds_rig.store(true, Ordering::SeqCst);
    if shared.stop.load(Ordering::SeqCst) {
        shared.holds_rig.store(false, Ordering::SeqCst);
        return Err(Fault::Argument("stopped before the rig was armed".to_owned()));
    }
    let outcome = prepared.run(&session)?;
    let sentence = outcome.sentence();
    let RunOutcome { directory, recording, end, results } = outcome;
    let end = match end {
        RunTermination::Completed => "completed",
        RunTermination::Drifted { .. } => "drifted",
        RunTermination::Tripped { .. } => "tripped",
        RunTermination::Interrupted { .. } => "interrupted",
        RunTermination::Failed(source) => return Err(SessionError::Run { source, recording }.into()),
    };
    let (json, map) = match results {
        Ok(results) => {
            let json = serde_json::to_value(&results).map_err(SessionError::from)?;
            (Some(with_messages(json).to_string()), results.compressor_map.map(|map| Map { map }))
        }
        // Stopped before there was anything to identify.
        Err(_) if end != "completed" => (None, None),
        Err(error) => return Err(error.into()),
    };
    Ok(Outcome { directory, recording, end, sentence, json, map })
}

/// The exception, with a note on where the recording is (Python 3.11 and later).
fn noted(py: Python<'_>, error: PyErr, recording: &Path) -> PyErr {
    let note = format!("The rig is safe and the recording is kept: {}", recording.display());
    // An older Python has no notes.
    let _ = error.value(py).call_method1("add_note", (note,));
    error
}
