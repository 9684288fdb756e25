//! Runs on simulated rigs.

use crate::attended::{Attended, Shared, attend};
use crate::campaign::Campaign;
use crate::error::Fault;
use crate::map::Map;
use crate::plugins::plugins_with_rig;
use mapper::{RigDescription, RunEnding, RunOptions};
use mapper_session::SessionError;
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
    let (campaign, shared) = (campaign.inner.clone(), Shared::default());
    let of_worker = shared.clone();
    let attended = attend(py, shared, on_event.as_ref(), move |events| {
        let (stop, holds_rig) = (of_worker.stop.clone(), of_worker.holds_rig);
        let of_run = stop.clone();
        let before_arming = move |rig: &RigDescription| {
            if !rig.simulated_time {
                return Err(format!(
                    "backend `{}` is a rig in real time; run it with the command `mapper run`, which handles all signals",
                    rig.backend
                ));
            }
            holds_rig.store(true, Ordering::SeqCst);
            if stop.load(Ordering::SeqCst) {
                holds_rig.store(false, Ordering::SeqCst);
                return Err("stopped before the rig was armed".to_owned());
            }
            Ok(())
        };
        let options = RunOptions {
            started_name,
            started_ns,
            stop: of_run,
            observer: Some(events.observer()),
            before_arming: Some(Box::new(before_arming)),
            ..RunOptions::below(parent)
        };
        let campaign = match socket {
            Some(socket) => {
                let rig = campaign.settings().backend.name.clone();
                campaign.with_plugins(plugins_with_rig(rig, socket))
            }
            None => campaign,
        };
        outcome(&campaign.run_with(options)?)
    })?;
    match attended {
        Attended::Ended(result, None) => Ok(result?),
        Attended::Ended(Ok(outcome), Some(stopped_by)) => Err(noted(py, stopped_by, &outcome.recording)),
        Attended::Ended(Err(_), Some(stopped_by)) | Attended::Left(stopped_by) => Err(stopped_by),
    }
}

fn outcome(run: &mapper::Run) -> Result<Outcome, Fault> {
    let end = match run.ending() {
        RunEnding::Completed => "completed",
        RunEnding::Drifted { .. } => "drifted",
        RunEnding::Tripped { .. } => "tripped",
        RunEnding::Interrupted { .. } => "interrupted",
        RunEnding::Failed { .. } => "failed",
    };
    let json = mapper::with_messages(|| run.results().map(serde_json::to_value).transpose())
        .map_err(SessionError::from)?;
    Ok(Outcome {
        directory: run.directory().to_owned(),
        recording: run.recording_file().to_owned(),
        end,
        sentence: run.sentence().to_owned(),
        json: json.map(|json| json.to_string()),
        map: run.results().and_then(|results| results.compressor_map.clone()).map(|map| Map { map }),
    })
}

/// The exception, with a note on where the recording is (Python 3.11 and later).
fn noted(py: Python<'_>, error: PyErr, recording: &Path) -> PyErr {
    let note = format!("The rig is safe and the recording is kept: {}", recording.display());
    // An older Python has no notes.
    let _ = error.value(py).call_method1("add_note", (note,));
    error
}
