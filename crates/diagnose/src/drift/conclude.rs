//! The report as text and numbers.

use crate::drift::causes::cause::{Cause, CauseKind};
use crate::drift::causes::time_history::CourseKind;
use crate::drift::correction::corrected::{corrected_points, identified};
use crate::drift::correction::visits::group;
use crate::drift::likelihood::decide::{Decision, FoundDrifts};
use crate::drift::likelihood::fit::Fit;
use crate::drift::likelihood::refine::Refined;
use crate::drift::report::{DriftReport, DriftVerdict, FoundDrift, RateOrStep};
use crate::drift::runs::request::DriftRequest;
use mapper_core::{IdentifiedPoint, Recording, probability_text};

pub(crate) fn conclude(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refined,
    groups: &[Vec<usize>],
) -> DriftReport {
    let decision = &refined.decision;
    let points: Vec<Vec<IdentifiedPoint>> =
        recordings.iter().map(|recording| identified(recording, request)).collect();
    let groups =
        groups.iter().map(|visits| group(request, recordings, &refined.readings, &points, visits)).collect();
    let drifts: Vec<FoundDrift> =
        decision.found.iter().zip(&refined.fits.drifts).map(|(found, fit)| drift(found, fit)).collect();
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

fn drift(found: &FoundDrifts, fit: &Fit) -> FoundDrift {
    FoundDrift {
        cause: found.cause,
        probability: found.probability,
        alternatives: found.alternatives.clone(),
        onset_s: fit.course.onset_s,
        onset_low_s: fit.onset_low_s,
        onset_high_s: fit.onset_high_s,
        size: match fit.course.kind {
            CourseKind::Ramp => RateOrStep::RatePerH(fit.size),
            CourseKind::Step => RateOrStep::Step(fit.size),
        },
        low: fit.low,
        high: fit.high,
        unit: found.cause.unit(),
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
            format!(" {count} of {all} stretches are left out because the model cannot follow them.")
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
    let what: Vec<String> = drifts.iter().map(described).collect();
    let corrected: Vec<String> = drifts.iter().map(|drift| correction(drift.cause)).collect();
    let (what, corrected) = (what.join("; "), corrected.join(" "));
    match verdict {
        DriftVerdict::Unclear => format!(
            "Something drifted, but the recording does not show what; most probable: {what}. {corrected}{left_out}"
        ),
        _ => format!("{what}. {corrected}{left_out}"),
    }
}

fn described(drift: &FoundDrift) -> String {
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

fn correction(cause: Cause) -> String {
    match cause {
        Cause::Sensors(_) => format!(
            "The corrected points have this subtracted from the reading of {cause}; the recording is unchanged."
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
