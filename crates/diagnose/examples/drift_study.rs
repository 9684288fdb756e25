//! Error rates of the drift decision on simulated campaigns: `drift_study NULLS PER_CAUSE FIRST_SEED [FACTOR [METHOD [CAUSE]]]`,
//! or `drift_study pairs CAMPAIGNS FIRST_SEED` for two sensors that drift at once, each by 3 to 6 times its limit.
//!
//! Drifts are FACTOR (3) to twice FACTOR times the printed detection limit over the campaign, two of three as rates from
//! an onset in the first 40 %, one of three as a step in the middle half. Points are identified by METHOD (`dynamic`,
//! `joint` or `steady`). Prints a confusion table as Markdown.
//!
//! Each campaign has a twin: same seed, same noise, without the drift. The difference between the points of the two is the error due
//! to the drift; the difference that remains with the corrected points is the error that the correction does not remove.

// It prints its table.
#![allow(clippy::print_stdout)]

#[path = "../tests/drift/common/mod.rs"]
mod common;

use common::{Planted, campaign, draw, drift_reading, identification, judge, judge_by};
use mapper_core::{Channel, Method};
use mapper_diagnose::drift::{Cause, RATE_PER_H, RateOrStep};
use mapper_identify::{IdentifyConfig, identify_each};
use mapper_inference::hypotheses::{Shape, TimeHistory};
use std::collections::BTreeMap;

const CAUSES: [Cause; 8] = [
    Cause::Sensors(&[Channel::T1]),
    Cause::Sensors(&[Channel::T2]),
    Cause::Sensors(&[Channel::Tc]),
    Cause::Sensors(&[Channel::P2]),
    Cause::Sensors(&[Channel::CompressorFlow]),
    Cause::Sensors(&[Channel::TurbineFlow]),
    Cause::Fouling,
    Cause::BearingFriction,
];

struct Row {
    cause: Option<Cause>,
    found: Option<Cause>,
    /// Drifts found in addition to it.
    also: usize,
    probability: f64,
    onset_right: bool,
    size_right: bool,
    /// Size found over size planted, where the course is of the same kind.
    size_ratio: Option<f64>,
    /// Errors against the truth of `eta`, of `eta_identified`, and of the drift alone in `eta_identified`: over the same
    /// without correction.
    shrink: [Option<f64>; 3],
    summary: String,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let of_pairs = arguments.first().is_some_and(|first| first == "pairs");
    if of_pairs {
        arguments[0] = "0".to_owned();
    }
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
    if of_pairs {
        pairs(per_cause, first, &limits);
        return Ok(());
    }
    let causes: Vec<Cause> = CAUSES
        .into_iter()
        .filter(|cause| arguments.get(5).is_none_or(|only| cause.name() == *only))
        .collect();
    let total = nulls + per_cause * causes.len();
    let rows = mapper_numerics::parallel::map(&(0..total).collect::<Vec<_>>(), |index| {
        let cause = index.checked_sub(nulls).map(|index| causes[index % causes.len()]);
        one(first + 1 + *index as u64, cause, &limits, factor, &config)
    });
    print(rows);
    Ok(())
}

/// Two sensors that drift at once, each from an onset in the first 40 %.
fn pairs(campaigns: usize, first: u64, limits: &BTreeMap<Cause, f64>) {
    let sensors: Vec<Cause> = CAUSES.into_iter().filter(|cause| matches!(cause, Cause::Sensors(_))).collect();
    let named = mapper_numerics::parallel::map(&(0..campaigns).collect::<Vec<_>>(), |index| {
        let seed = first + *index as u64;
        let mut draw = draw(seed ^ 0xd21f);
        let one = (draw() * sensors.len() as f64) as usize;
        let other = (one + 1 + (draw() * (sensors.len() - 1) as f64) as usize) % sensors.len();
        let mut recording = campaign(seed, None).recording;
        let span_s = common::HOLD_S + 26.0 * common::DWELL_S;
        let causes = [sensors[one], sensors[other]];
        for cause in causes {
            let course = TimeHistory { onset: 0.4 * draw() * span_s, shape: RATE_PER_H };
            let sign = if draw() < 0.5 { 1.0 } else { -1.0 };
            let size = sign * 3.0 * (1.0 + draw()) * limits[&cause] / course.at(span_s);
            cause.channels().iter().for_each(|channel| drift_reading(&mut recording, *channel, course, size));
        }
        let report = judge(&recording);
        let found: Vec<Cause> = report.drifts.iter().map(|drift| drift.cause).collect();
        let right = causes.iter().filter(|cause| found.contains(cause)).count();
        if right < 2 || found.len() > 2 {
            eprintln!("seed {seed}: {causes:?} -> {}", report.reason);
        }
        (right, found.len() - right)
    });
    println!(
        "| pairs | both named, nothing else | one of them | none | another cause named |\n|---:|---:|---:|---:|---:|"
    );
    let count = |of: &dyn Fn(&(usize, usize)) -> bool| named.iter().filter(|one| of(one)).count();
    println!(
        "| {campaigns} | {} | {} | {} | {} |",
        count(&|one| *one == (2, 0)),
        count(&|(right, _)| *right == 1),
        count(&|(right, _)| *right == 0),
        count(&|(_, wrong)| *wrong > 0),
    );
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
        let shape = if draw() < 1.0 / 3.0 { Shape::Step } else { RATE_PER_H };
        let span_s = common::HOLD_S + 26.0 * common::DWELL_S;
        let share = if shape == RATE_PER_H {
            0.4 * draw() * f64::from(u8::from(draw() < 0.7))
        } else {
            0.25 + 0.5 * draw()
        };
        let course = TimeHistory { onset: share * span_s, shape };
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
    let main = report.drifts.first();
    // Two repeats: twice the time between visits of the reference jump.
    let two_repeats_s = 2.0 * 8.0 * common::DWELL_S;
    let onset_right = planted.is_some_and(|planted| {
        main.is_some_and(|found| (found.onset_s - planted.course.onset).abs() <= two_repeats_s)
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
        found: main.map(|found| found.cause),
        also: report.drifts.len().saturating_sub(1),
        probability: main.map_or(0.0, |found| found.probability),
        onset_right,
        size_right: planted.is_some_and(|planted| {
            main.is_some_and(|found| {
                let same_kind = matches!(
                    (found.size, planted.course.shape),
                    (RateOrStep::RatePerH(_), Shape::Ramp(_)) | (RateOrStep::Step(_), Shape::Step)
                );
                same_kind && (found.low..=found.high).contains(&planted.size)
            })
        }),
        size_ratio: planted.and_then(|planted| match (main?.size, planted.course.shape) {
            (RateOrStep::RatePerH(size), Shape::Ramp(_)) | (RateOrStep::Step(size), Shape::Step) => {
                Some(size / planted.size)
            }
            _ => None,
        }),
        shrink: [shrink(&fitted, &start), shrink(&identified, &start), shrink(&identified, &undrifted)],
        summary: format!("seed {seed}: {planted:?} -> {}", report.reason),
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
            cause.map_or_else(|| "nothing".to_owned(), Cause::name),
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
    for row in rows.iter().filter(|row| {
        row.found != row.cause || row.also > 0 || (row.found.is_some() && row.probability < 0.5)
    }) {
        eprintln!("{}", row.summary);
    }
}

/// Stated probability of the causes that were named, and how often they were right.
fn calibration(rows: &[Row]) {
    println!("\n| stated probability | named | mean probability | right |\n|---|---:|---:|---:|");
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
