//! Error rates of the drift decision on simulated campaigns: `drift_study NULLS PER_CAUSE FIRST_SEED [FACTOR]`.
//!
//! Drifts are FACTOR (3) to twice FACTOR times the printed detection limit over the campaign, two of three as rates from
//! an onset in the first 40 %, one of three as a step in the middle half. Prints a confusion table as Markdown.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Planted, campaign, draw, judge};
use mapper_core::Channel;
use mapper_drift::{Cause, Course, CourseKind, RateOrStep};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    clear: bool,
    onset_right: bool,
    size_right: bool,
    shrink: Option<f64>,
    shrink_identified: Option<f64>,
    said: String,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, usual: f64| {
        arguments.get(index).map_or(usual, |text| text.parse().expect("arguments are numbers"))
    };
    let (nulls, per_cause, first) =
        (number(0, 20.0) as usize, number(1, 3.0) as usize, number(2, 1000.0) as u64);
    let factor = number(3, 3.0);
    let limits: BTreeMap<Cause, f64> = judge(&campaign(first, None).recording)
        .detection_limits
        .into_iter()
        .map(|limit| (limit.cause, limit.change))
        .collect();
    let total = nulls + per_cause * CAUSES.len();
    let next = AtomicUsize::new(0);
    let rows = Mutex::new(Vec::new());
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= total {
                return;
            }
            let cause = index.checked_sub(nulls).map(|index| CAUSES[index % CAUSES.len()]);
            let row = one(first + 1 + index as u64, cause, &limits, factor);
            rows.lock().unwrap().push((index, row));
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(work);
        scope.spawn(work);
    });
    let mut rows = rows.into_inner().unwrap();
    rows.sort_by_key(|(index, _)| *index);
    print(rows.into_iter().map(|(_, row)| row).collect());
}

fn one(seed: u64, cause: Option<Cause>, limits: &BTreeMap<Cause, f64>, factor: f64) -> Row {
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
    let campaign = campaign(seed, planted);
    let report = judge(&campaign.recording);
    let within = |low: Option<f64>, high: Option<f64>, value: f64| matches!((low, high), (Some(low), Some(high)) if (low..=high).contains(&value));
    // Two repeats: twice the time between visits of the reference jump.
    let two_repeats_s = 2.0 * 8.0 * common::DWELL_S;
    let onset_right = planted.is_some_and(|planted| {
        report.onset_s.is_some_and(|onset_s| (onset_s - planted.course.onset_s).abs() <= two_repeats_s)
    });
    let shrink = |eta: &dyn Fn(usize) -> Option<f64>| {
        let planted = planted?;
        let mut errors = Vec::new();
        for (step, (true_eta, point)) in campaign.eta_true.iter().zip(&report.corrected_points).enumerate() {
            let drift = planted.size * planted.course.at(campaign.recording.steps[step].end_s);
            let start = if planted.cause == Cause::Fouling { true_eta / (1.0 + drift) } else { *true_eta };
            // Steps that cannot be identified (the first one, and opening 0.5 near surge) have nothing to compare.
            if let (Some(now), Some(uncorrected)) = (eta(step), point.eta_uncorrected) {
                errors.push((now - start, uncorrected - start));
            }
        }
        let rms = |values: Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
        };
        let (corrected, uncorrected): (Vec<f64>, Vec<f64>) = errors.into_iter().unzip();
        Some(rms(corrected) / rms(uncorrected))
    };
    Row {
        cause,
        found: report.cause,
        clear: report.probability >= 0.5,
        onset_right,
        size_right: planted.is_some_and(|planted| {
            let same_kind = matches!(
                (report.size, planted.course.kind),
                (Some(RateOrStep::RatePerH(_)), CourseKind::Ramp)
                    | (Some(RateOrStep::Step(_)), CourseKind::Step)
            );
            same_kind && within(report.low, report.high, planted.size)
        }),
        shrink: shrink(&|step| Some(report.corrected_points.get(step)?.eta)),
        shrink_identified: shrink(&|step| report.corrected_points.get(step)?.eta_identified),
        said: format!("seed {seed}: {planted:?} -> {} p {:.2}", report.reason, report.probability),
    }
}

fn print(rows: Vec<Row>) {
    println!(
        "| planted | campaigns | right cause | other cause | nothing found | onset within two repeats | size in its interval | error of eta left (median) | the same, identified step by step |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|");
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
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            cause.map_or("nothing", Cause::name),
            own.len(),
            count(&|row| row.found == cause),
            count(&|row| row.found != cause && row.found.is_some()),
            count(&|row| row.found.is_none()),
            count(&|row| row.onset_right),
            count(&|row| row.size_right),
            median(&|row| row.shrink),
            median(&|row| row.shrink_identified),
        );
    }
    for row in rows.iter().filter(|row| row.found != row.cause || (row.found.is_some() && !row.clear)) {
        eprintln!("{}", row.said);
    }
}
