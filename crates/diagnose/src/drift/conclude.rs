//! The report, with its reason in words.

use crate::drift::causes::cause::{Cause, CauseKind};
use crate::drift::causes::drift::Drift;
use crate::drift::correction::corrected::{corrected_points, identified};
use crate::drift::correction::visits::group;
use crate::drift::likelihood::decide::{Decision, DetectedCause};
use crate::drift::likelihood::fit::FittedDrift;
use crate::drift::likelihood::refinement::Refinement;
use crate::drift::report::{DriftReport, DriftVerdict, FoundDrift, RateOrStep};
use crate::drift::runs::request::DriftRequest;
use mapper_core::{IdentifiedPoint, Recording, probability_text};
use mapper_inference::time_history::Shape;

pub(crate) fn conclude(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refinement,
    groups: &[Vec<usize>],
) -> DriftReport {
    let decision = &refined.decision;
    let points: Vec<Vec<IdentifiedPoint>> =
        recordings.iter().map(|recording| identified(recording, request)).collect();
    let groups =
        groups.iter().map(|visits| group(request, recordings, &refined.readings, &points, visits)).collect();
    let drifts: Vec<FoundDrift> =
        decision.detected.iter().zip(&refined.fits.drifts).map(|(cause, fit)| drift(cause, fit)).collect();
    let verdict = verdict(&drifts);
    let corrected_points =
        if drifts.is_empty() { Vec::new() } else { corrected_points(request, recordings, refined, &points) };
    DriftReport {
        verdict,
        reason: reason(decision, &drifts, verdict),
        drifts,
        alone: decision.alone.clone(),
        detection_limits: decision.limits.clone(),
        groups,
        corrected_points,
    }
}

fn drift(detected: &DetectedCause, fit: &FittedDrift) -> FoundDrift {
    let Drift { cause, history, size } = fit.drift;
    FoundDrift {
        cause,
        probability: detected.probability,
        alternatives: detected.alternatives.clone(),
        onset_s: history.onset,
        onset_low_s: fit.onset_low_s,
        onset_high_s: fit.onset_high_s,
        size: match history.shape {
            Shape::Ramp(_) => RateOrStep::RatePerH(size),
            Shape::Step | Shape::Decay(_) => RateOrStep::Step(size),
        },
        low: fit.low,
        high: fit.high,
        unit: cause.unit(),
    }
}

fn verdict(drifts: &[FoundDrift]) -> DriftVerdict {
    let any = |kind: CauseKind| drifts.iter().any(|drift| drift.cause.kind() == kind);
    match (any(CauseKind::Sensor), any(CauseKind::Machine)) {
        (false, false) => DriftVerdict::None,
        _ if !drifts.iter().all(FoundDrift::is_clear) => DriftVerdict::Unclear,
        (true, false) => DriftVerdict::Sensor,
        (false, true) => DriftVerdict::Machine,
        (true, true) => DriftVerdict::SensorAndMachine,
    }
}

fn reason(decision: &Decision, drifts: &[FoundDrift], verdict: DriftVerdict) -> String {
    let left_out = match decision.left_out {
        (0, _) => String::new(),
        (count, all) => {
            format!(" {count} of {all} segments are left out because the model cannot follow them.")
        }
    };
    if verdict == DriftVerdict::None {
        let probability =
            decision.alone.iter().find(|one| one.cause.is_none()).map_or(1.0, |none| none.probability);
        return format!(
            "Nothing drifted, with a probability of {}.{left_out}",
            probability_text(probability)
        );
    }
    let descriptions: Vec<String> = drifts.iter().map(describe).collect();
    let corrections: Vec<String> = drifts.iter().map(|drift| describe_correction(drift.cause)).collect();
    let (drifts, corrections) = (descriptions.join("; "), corrections.join(" "));
    match verdict {
        DriftVerdict::Unclear => format!(
            "Something drifted, but the recording does not show what; most probable: {drifts}. {corrections}{left_out}"
        ),
        _ => format!("{drifts}. {corrections}{left_out}"),
    }
}

fn describe(drift: &FoundDrift) -> String {
    let size = match drift.size {
        RateOrStep::RatePerH(rate) => format!("drifts by {} per hour from", drift.cause.show(rate)),
        RateOrStep::Step(step) => format!("steps by {} at", drift.cause.show(step)),
    };
    format!(
        "{} {size} {:.0} s on, with a probability of {}",
        drift.cause,
        drift.onset_s,
        probability_text(drift.probability)
    )
}

fn describe_correction(cause: Cause) -> String {
    match cause {
        Cause::Sensors(_) => format!(
            "For the corrected points this is subtracted from the reading of {cause}; the recording is unchanged."
        ),
        Cause::Fouling => {
            "The efficiency of the corrected points is that of the machine at the campaign's start."
                .to_owned()
        }
        Cause::BearingFriction => {
            "Friction does not change the compressor's efficiency; the corrected points are the fitted ones."
                .to_owned()
        }
    }
}
