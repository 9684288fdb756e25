//! Error rates of the drift decision on simulated campaigns: `drift_study NULLS PER_CAUSE FIRST_SEED [FACTOR [METHOD [CAUSE]]]`.
//!
//! Drifts are FACTOR (3) to twice FACTOR times the printed detection limit over the campaign, two of three as rates from
//! an onset in the first 40 %, one of three as a step in the middle half. Points are identified by METHOD (`dynamic`,
//! `joint` or `steady`). Prints a confusion table as Markdown.
//!
//! Each campaign has a twin: same seed, same noise, without the drift. What the points of the drifting one differ by is the
//! error that the drift makes; what its corrected points still differ by is what the correction leaves of it.

// It prints its table.
#![allow(clippy::print_stdout)]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Planted, campaign, draw, identification, judge, judge_by};
use mapper_core::{Channel, Method};
use mapper_drift::{Cause, Course, CourseKind, RateOrStep};
use mapper_identify::{IdentifyConfig, identify_each};
use std::collections::BTreeMap;

const CAUSES: [Cause; 8] = [
    Cause::Sensor(Channel::T1),
    Cause::Sensor(Channel::T2),
    Cause::Sensor(Channel::Tc),
    Cause::Sensor(Channel::P2),
    Cause::Sensor(Channel::CompressorFlow),
    Cause::Sensor(Channel::TurbineFlow),
    Cause::Fouling,
    Cause::BearingFriction,
];

struct Row {
    cause: Option<Cause>,
    found: Option<Cause>,
    probability: f64,
    onset_right: bool,
    size_right: bool,
    /// Size found over size planted, where the course is of the same kind.
    size_ratio: Option<f64>,
    /// Errors against the truth of `eta`, of `eta_identified`, and of the drift alone in `eta_identified`: over the same
    /// without correction.
    shrink: [Option<f64>; 3],
    said: String,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, usual: f64| {
        let given = arguments.get(index);
        given.map_or(Ok(usual), |text| text.parse::<f64>().map_err(|_| format!("`{text}` is not a number")))
    };
    let (nulls, per_cause, first) =
        (number(0, 20.0)? as usize, number(1, 3.0)? as usize, number(2, 1000.0)? as u64);
    let factor = number(3, 3.0)?;
    let method = match arguments.get(4).map(String::as_str) {
        None | Some("dynamic") => Method::Dynamic,
        Some("joint") => Method::Joint,
        Some("steady") => Method::Steady,
        Some(other) => return Err(format!("`{other}` is not a method: dynamic, joint, steady").into()),
    };
    let config = IdentifyConfig { method, ..identification() };
    let limits: BTreeMap<Cause, f64> = judge(&campaign(first, None).recording)
        .detection_limits
        .into_iter()
        .map(|limit| (limit.cause, limit.change))
        .collect();
    let causes: Vec<Cause> = CAUSES
        .into_iter()
        .filter(|cause| arguments.get(5).is_none_or(|only| cause.name() == only.as_str()))
        .collect();
    let total = nulls + per_cause * causes.len();
    let rows = mapper_numerics::parallel::map(&(0..total).collect::<Vec<_>>(), |index| {
        let cause = index.checked_sub(nulls).map(|index| causes[index % causes.len()]);
        one(first + 1 + *index as u64, cause, &limits, factor, &config)
    });
    print(rows);
    Ok(())
}

fn one(
    seed: u64,
    cause: Option<Cause>,
    limits: &BTreeMap<Cause, f64>,
    factor: f64,
    config: &IdentifyConfig,
) -> Row {
    let mut draw = draw(seed ^ 0xd21f);
    let planted = cause.map(|cause| {
        let kind = if draw() < 1.0 / 3.0 { CourseKind::Step } else { CourseKind::Ramp };
        let span_s = common::HOLD_S + 26.0 * common::DWELL_S;
        let share = match kind {
            CourseKind::Ramp => 0.4 * draw() * f64::from(u8::from(draw() < 0.7)),
            CourseKind::Step => 0.25 + 0.5 * draw(),
        };
        let course = Course { kind, onset_s: share * span_s };
        let sign = if draw() < 0.5 || cause == Cause::BearingFriction { 1.0 } else { -1.0 };
        let sign = if cause == Cause::Fouling { -1.0 } else { sign };
        let change = sign * factor * (1.0 + draw()) * limits[&cause];
        Planted { cause, course, size: change / course.at(span_s) }
    });
    let (campaign, twin) = (campaign(seed, planted), campaign(seed, None));
    let report = judge_by(&campaign.recording, config);
    let of_twin: Vec<Option<f64>> = identify_each(&twin.recording, config)
        .map(|points| points.into_iter().map(|point| point.ok()?.eta).collect())
        .unwrap_or_default();
    let within = |low: Option<f64>, high: Option<f64>, value: f64| matches!((low, high), (Some(low), Some(high)) if (low..=high).contains(&value));
    // Two repeats: twice the time between visits of the reference jump.
    let two_repeats_s = 2.0 * 8.0 * common::DWELL_S;
    let onset_right = planted.is_some_and(|planted| {
        report.onset_s.is_some_and(|onset_s| (onset_s - planted.course.onset_s).abs() <= two_repeats_s)
    });
    // The mean is taken out: a constant bias is not the correction's business.
    let rms = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    let shrink = |eta: &dyn Fn(usize) -> Option<f64>, right: &dyn Fn(usize) -> Option<f64>| {
        let steps = 0..campaign.eta_true.len();
        // Steps that cannot be identified (the first one, and some near surge) have nothing to compare.
        let errors = steps.filter_map(|step| {
            let right = right(step)?;
            Some((eta(step)? - right, report.corrected_points.get(step)?.eta_uncorrected? - right))
        });
        let (corrected, uncorrected): (Vec<f64>, Vec<f64>) = errors.unzip();
        (!corrected.is_empty()).then(|| rms(&corrected) / rms(&uncorrected))
    };
    let planted_at = |step: usize| {
        planted.map_or(0.0, |planted| planted.size * planted.course.at(campaign.recording.steps[step].end_s))
    };
    let fouled = |step: usize| if cause == Some(Cause::Fouling) { 1.0 + planted_at(step) } else { 1.0 };
    let start = |step: usize| Some(campaign.eta_true[step] / fouled(step));
    let fitted = |step: usize| Some(report.corrected_points.get(step)?.eta);
    let identified = |step: usize| report.corrected_points.get(step)?.eta_identified;
    let undrifted = |step: usize| *of_twin.get(step)?;
    Row {
        cause,
        found: report.cause,
        probability: report.probability,
        onset_right,
        size_right: planted.is_some_and(|planted| {
            let same_kind = matches!(
                (report.size, planted.course.kind),
                (Some(RateOrStep::RatePerH(_)), CourseKind::Ramp)
                    | (Some(RateOrStep::Step(_)), CourseKind::Step)
            );
            same_kind && within(report.low, report.high, planted.size)
        }),
        size_ratio: planted.and_then(|planted| match (report.size?, planted.course.kind) {
            (RateOrStep::RatePerH(size), CourseKind::Ramp) | (RateOrStep::Step(size), CourseKind::Step) => {
                Some(size / planted.size)
            }
            _ => None,
        }),
        shrink: [shrink(&fitted, &start), shrink(&identified, &start), shrink(&identified, &undrifted)],
        said: format!("seed {seed}: {planted:?} -> {} p {:.2}", report.reason, report.probability),
    }
}

fn print(rows: Vec<Row>) {
    println!(
        "| planted | campaigns | right cause | other cause | nothing found | onset within two repeats | size in its interval | size found over planted (median) | error of `eta` left | of `eta_identified` | of the drift alone |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    let causes = std::iter::once(None).chain(CAUSES.into_iter().map(Some));
    for cause in causes {
        let own: Vec<&Row> = rows.iter().filter(|row| row.cause == cause).collect();
        if own.is_empty() {
            continue;
        }
        let count = |of: &dyn Fn(&Row) -> bool| own.iter().filter(|row| of(row)).count();
        let median = |of: &dyn Fn(&Row) -> Option<f64>| {
            let mut values: Vec<f64> = own.iter().filter_map(|row| of(row)).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"))
        };
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            cause.map_or("nothing", Cause::name),
            own.len(),
            count(&|row| row.found == cause),
            count(&|row| row.found != cause && row.found.is_some()),
            count(&|row| row.found.is_none()),
            count(&|row| row.onset_right),
            count(&|row| row.size_right),
            median(&|row| row.size_ratio),
            median(&|row| row.shrink[0]),
            median(&|row| row.shrink[1]),
            median(&|row| row.shrink[2]),
        );
    }
    calibration(&rows);
    for row in
        rows.iter().filter(|row| row.found != row.cause || (row.found.is_some() && row.probability < 0.5))
    {
        eprintln!("{}", row.said);
    }
}

/// Of the causes that were named: how probable they were said to be, and how often they were right.
fn calibration(rows: &[Row]) {
    println!("\n| said to be probable | named | mean probability | right |\n|---|---:|---:|---:|");
    for (low, high) in [(0.0, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)] {
        let named: Vec<&Row> =
            rows.iter().filter(|row| row.found.is_some() && (low..high).contains(&row.probability)).collect();
        if named.is_empty() {
            continue;
        }
        let mean = named.iter().map(|row| row.probability).sum::<f64>() / named.len() as f64;
        let right = named.iter().filter(|row| row.found == row.cause).count();
        println!("| {low:.2} to {:.2} | {} | {mean:.2} | {right} |", f64::min(high, 1.0), named.len());
    }
}
