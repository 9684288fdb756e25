//! Drift before the gap: what changed while a recording was made must not be taken for an effect that is always there.

use super::drift;
use crate::output;
use mapper_campaign::Campaign;
use mapper_core::Recording;
use mapper_drift::{DriftReport, without_drift};
use mapper_gap::report::{Diagnosis, Verdict};
use mapper_record::{ChannelMap, ReadReport};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// What `mapper drift` says of the recording; `None` where it cannot say anything, as without repeats.
pub fn of(read: &ReadReport, path: &Path, campaign: &Campaign, map: &ChannelMap) -> Option<DriftReport> {
    let files = [PathBuf::from(path)];
    // A recording that `mapper drift` cannot follow may still have a gap: that is then the diagnosis' business.
    let (report, _) = drift::judge(std::slice::from_ref(read), &files, campaign, map).ok()?;
    report.cause.is_some().then_some(report)
}

/// The recording to be diagnosed: a sensor's drift is taken off.
pub fn taken_off(recording: Recording, drift: Option<&DriftReport>) -> Recording {
    drift.and_then(|drift| without_drift(&recording, drift)).unwrap_or(recording)
}

/// Probability of a cause outside the catalogue below which nothing is made of it where a drift was taken off: how well the
/// drift's course is known is in no tolerance of the diagnosis, and what is left of it looks like a small unknown cause.
const SURELY_OUTSIDE: f64 = 0.9;

/// Puts what drifted beside the diagnosis, which names no culprit for it.
pub fn note(diagnosis: &mut Diagnosis, drift: Option<&DriftReport>) {
    let Some(drift) = drift else { return };
    let taken_off = drift.cause.is_some_and(|cause| cause.kind() == mapper_drift::CauseKind::Sensor);
    let consequence = if taken_off {
        "this was taken off its reading before the diagnosis"
    } else {
        "the diagnosis looks for what does not change, so that no cause is named while this is so"
    };
    diagnosis
        .warnings
        .insert(0, format!("Drift while the recording was made: {} Here {consequence}.", drift.reason));
    if taken_off
        && diagnosis.verdict == Verdict::Unexplained
        && diagnosis.probability_outside < SURELY_OUTSIDE
    {
        diagnosis.verdict = Verdict::WithinTolerance;
        diagnosis.r#where.clear();
        diagnosis.next = None;
    }
    if !taken_off && matches!(diagnosis.verdict, Verdict::Explained | Verdict::PartlyExplained) {
        diagnosis.verdict = Verdict::Unexplained;
    }
}

/// The diagnosis as JSON, with the key `drift`: verdict, cause, course and size, or `null` where none was found.
pub fn json(diagnosis: &Diagnosis, drift: Option<&DriftReport>) -> Result<Value, crate::failure::Failure> {
    let mut value: Value = serde_json::from_str(&output::to_json(diagnosis)?)
        .map_err(|error| crate::failure::Failure::new(crate::exit_code::Code::Failure, error))?;
    let drift = drift.map(|drift| {
        json!({
            "verdict": drift.verdict,
            "cause": drift.cause,
            "probability": drift.probability,
            "onset_s": drift.onset_s,
            "size": drift.size,
            "low": drift.low,
            "high": drift.high,
            "unit": drift.unit,
            "reason": drift.reason,
        })
    });
    if let Some(object) = value.as_object_mut() {
        object.insert("drift".to_owned(), json!(drift));
    }
    Ok(value)
}
