//! The report in words and numbers.

use crate::cause::Cause;
use crate::corrected::{corrected_points, identified};
use crate::course::CourseKind;
use crate::decide::Decision;
use crate::fit::Fit;
use crate::refine::Refined;
use crate::report::{DriftReport, DriftVerdict, RateOrStep};
use crate::request::DriftRequest;
use crate::visits::group;
use mapper_core::{IdentifiedPoint, Recording};

pub(crate) fn conclude(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    refined: &Refined,
    groups: &[Vec<usize>],
    decision: &Decision,
) -> DriftReport {
    let points: Vec<Vec<IdentifiedPoint>> =
        recordings.iter().map(|recording| identified(recording, request)).collect();
    let (readings, fit) = (&refined.readings, &refined.fit);
    let groups = groups.iter().map(|visits| group(request, recordings, readings, &points, visits)).collect();
    let verdict = match (decision.flagged, decision.clear) {
        (false, _) => DriftVerdict::None,
        (true, false) => DriftVerdict::Unclear,
        (true, true) => decision.cause.kind().into(),
    };
    let found = decision.flagged.then_some(decision.cause);
    let (own, others): (Vec<_>, Vec<_>) =
        decision.probabilities.iter().copied().partition(|alternative| alternative.cause == found);
    let corrected_points = if decision.flagged {
        corrected_points(request, recordings, refined, &points, decision.cause)
    } else {
        Vec::new()
    };
    let only_found = |value: f64| decision.flagged.then_some(value);
    DriftReport {
        verdict,
        cause: found,
        probability: own.first().map_or(0.0, |alternative| alternative.probability),
        alternatives: others,
        onset_s: only_found(fit.course.onset_s),
        onset_low_s: only_found(fit.onset_low_s),
        onset_high_s: only_found(fit.onset_high_s),
        size: decision.flagged.then(|| size(fit)),
        low: only_found(fit.low),
        high: only_found(fit.high),
        unit: found.map(Cause::unit),
        reason: reason(decision, fit, verdict),
        evidence: decision.evidence,
        threshold: decision.threshold,
        detection_limits: decision.limits.clone(),
        groups,
        corrected_points,
    }
}

fn reason(decision: &Decision, fit: &Fit, verdict: DriftVerdict) -> String {
    let left_out = match decision.left_out {
        (0, _) => String::new(),
        (count, all) => {
            format!("; {count} of {all} stretches are left out because the model cannot follow them")
        }
    };
    let compared = format!(
        "the best cause has an evidence of {:.1}; one drift-free campaign in a hundred reaches {:.1}{left_out}",
        decision.evidence, decision.threshold
    );
    if verdict == DriftVerdict::None {
        return format!("Nothing drifted: {compared}.");
    }
    let size = match size(fit) {
        RateOrStep::RatePerH(rate) => format!("drifts by {} per hour from", decision.cause.show(rate)),
        RateOrStep::Step(step) => format!("steps by {} at", decision.cause.show(step)),
    };
    let what = format!("{} {size} {:.0} s on", decision.cause, fit.course.onset_s);
    let corrected = match decision.cause {
        Cause::Sensor(channel) => format!(
            "The corrected points have this subtracted from the reading of {}; the recording is unchanged.",
            channel.symbol()
        ),
        Cause::Fouling => {
            "The efficiency of the corrected points is that of the machine at the campaign's start."
                .to_owned()
        }
        Cause::BearingFriction => {
            "Friction does not change the compressor's efficiency; the corrected points are the fitted ones."
                .to_owned()
        }
    };
    match verdict {
        DriftVerdict::Unclear => format!(
            "Something drifted ({compared}), but the recording does not show what; most probable: {what}. {corrected}"
        ),
        _ => format!("{what} ({compared}). {corrected}"),
    }
}

/// Rate or step of a fit.
fn size(fit: &Fit) -> RateOrStep {
    match fit.course.kind {
        CourseKind::Ramp => RateOrStep::RatePerH(fit.size),
        CourseKind::Step => RateOrStep::Step(fit.size),
    }
}
