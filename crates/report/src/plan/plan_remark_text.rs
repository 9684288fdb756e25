//! Sentences of the remarks of plans.

use crate::formatting::Message;
use mapper_core::{Channel, OperatingPoint, PlanRemark, with_unit};
use std::collections::BTreeMap;

impl Message for PlanRemark {
    fn message(&self) -> String {
        match self {
            PlanRemark::RepeatedJump { from, to, times } => {
                format!(
                    "the jump from {} to {} is made {times} times to show drift",
                    from.in_words(),
                    to.in_words()
                )
            }
            PlanRemark::NoRepeatedJump => {
                "no jump between the points can be repeated, so that drift would not show".to_owned()
            }
            PlanRemark::AppendedJump { from, to } => {
                format!(
                    "the jump from {} to {} is made after all others, and is not a point of the map",
                    from.in_words(),
                    to.in_words()
                )
            }
            PlanRemark::WayAround { from, to, over } => {
                let over: Vec<String> = over.iter().map(OperatingPoint::in_words).collect();
                let (from, to) = (from.in_words(), to.in_words());
                format!(
                    "a limit forbids the jump from {from} to {to}; the plan leads over {}",
                    over.join(", ")
                )
            }
            PlanRemark::FirstPointAgain { point } => {
                format!(
                    "the first point, {}, is visited again at the end: no jump led to it at the start",
                    point.in_words()
                )
            }
            PlanRemark::FirstPointWithoutJump { point } => {
                format!(
                    "no jump leads to the first point, {}: it has no transient to identify",
                    point.in_words()
                )
            }
            PlanRemark::NoWayBack => "a limit forbids the way back to the first point at the end".to_owned(),
            PlanRemark::PriorDominated { eta_error, max_eta_error } => format!(
                "no expected error is stated, and the points will be doubtful (`prior_dominated`): these steps determine the efficiencies \
                 only to {:.1} points if alpha_A, probe and heating/cooling ratio have to be found, and {:.2} are needed; lengthen the \
                 dwell, add points, or set known ones to `fixed` in `identification.joint`",
                100.0 * eta_error,
                100.0 * max_eta_error
            ),
            PlanRemark::RequiredErrorNotReached { dwell_s, eta_sigma, required_eta_sigma } => format!(
                "steps of {dwell_s:.0} s, the longest that are chosen, reach an expected error of {:.2} points of efficiency (rms), not the \
                 required {:.2}",
                100.0 * eta_sigma,
                100.0 * required_eta_sigma
            ),
            PlanRemark::AvoidedCrossing { step, from_rpm, to_rpm, inside_s, longest_s } => format!(
                "no step stays within the speeds to avoid; the slowest crossing of {} to {} krpm takes {inside_s:.1} s (step {step}, {:.1} \
                 krpm/s), {} the {longest_s:.1} s that are allowed",
                from_rpm / 1e3,
                to_rpm / 1e3,
                1e-3 * (to_rpm - from_rpm) / inside_s,
                if inside_s > longest_s { "longer than" } else { "within" }
            ),
            PlanRemark::SurgeSearch { lines, closest_margin_ratio, steps, duration_s } => format!(
                "a search for surge follows at the ends of {lines} speed lines, no nearer than a margin of {:.1} %: about {steps} steps, \
                 {:.0} min, included in the rig time",
                100.0 * closest_margin_ratio,
                duration_s / 60.0
            ),
            PlanRemark::GuardTrip { .. } => {
                let (trip, remedy) = guard_trip_text(self);
                format!("{trip}; {remedy}")
            }
            PlanRemark::OffsetsAfterSoak { soak_s, offset_sigmas, longer_soak_s, longer_offset_sigmas } => {
                let left = format!(
                    "offsets that remain after the soak of {:.0} min (one standard deviation): {}",
                    soak_s / 60.0,
                    list_sigmas(offset_sigmas)
                );
                match longer_offset_sigmas.is_empty() {
                    true => left,
                    false => {
                        format!(
                            "{left}; after {:.0} min: {}",
                            longer_soak_s / 60.0,
                            list_sigmas(longer_offset_sigmas)
                        )
                    }
                }
            }
            PlanRemark::Other { message, .. } => message.clone(),
            other => other.code().to_owned(),
        }
    }
}

/// The sentence of a forecast guard trip, and its remedy.
pub fn guard_trip_text(remark: &PlanRemark) -> (String, String) {
    let PlanRemark::GuardTrip { guard, to, reason, highest_speed_rpm } = remark else {
        return (remark.message(), String::new());
    };
    let trip = format!(
        "the guard `{guard}` will probably end the run in the step to {}: in a rehearsal on the nominal machine, {reason}",
        to.in_words()
    );
    let remedy = match highest_speed_rpm {
        Some(rpm) => format!(
            "if the machine permits it, raise `limits.speed` above {:.1} krpm, the highest speed of the rehearsal; otherwise lower the \
             fastest lines",
            1e-3 * rpm
        ),
        None => format!(
            "if the machine permits it, raise the limit of `{guard}`; otherwise leave out the points beyond it"
        ),
    };
    (trip, remedy)
}

fn list_sigmas(sigmas: &BTreeMap<Channel, f64>) -> String {
    let named = |(channel, sigma): (&Channel, &f64)| {
        let digits = if channel.unit() == "K" { 3 } else { 1 };
        format!("{channel} {}", with_unit(format!("{sigma:.digits$}"), channel.unit()))
    };
    sigmas.iter().map(named).collect::<Vec<_>>().join(", ")
}
