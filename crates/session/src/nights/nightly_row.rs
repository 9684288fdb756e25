//! History entry of a nightly run.

use mapper_core::{Plan, Verdict};
use mapper_history::{Metric, PointRow};
use mapper_numerics::statistics::mean;
use mapper_recording::score::ScoredPoint;
use std::collections::BTreeMap;

/// The monitored metrics; those without a value are omitted.
pub(crate) fn metrics(points: &[ScoredPoint], plan: &Plan) -> BTreeMap<Metric, f64> {
    let score = mapper_recording::score::summarise(points);
    let good = points.iter().filter(|scored| scored.point.verdict == Verdict::Good).count();
    // Means of the truth use the same points as means of the results.
    let both = |scored: &&ScoredPoint| scored.point.eta.is_some() && scored.truth.is_some();
    let with_eta: Vec<&ScoredPoint> = points.iter().filter(both).collect();
    Metric::ALL
        .into_iter()
        .filter_map(|metric| {
            let value = match metric {
                Metric::GoodPoints => Some(good as f64),
                Metric::EtaMean => mean(with_eta.iter().filter_map(|scored| scored.point.eta)),
                Metric::EtaTrueMean => mean(with_eta.iter().filter_map(|scored| Some(scored.truth?.eta))),
                Metric::EtaMedianError => score.map(|score| score.eta_median_error),
                Metric::EtaWorstError => score.map(|score| score.eta_worst_error),
                Metric::EtaCoverage => score.map(|score| score.eta_coverage_ratio),
                Metric::HMean => mean(with_eta.iter().filter_map(|scored| scored.point.h_w_m2k)),
                Metric::HTrueMean => mean(with_eta.iter().filter_map(|scored| Some(scored.truth?.h_w_m2k))),
                Metric::HMedianError => score.and_then(|score| score.h_median_error_ratio),
                Metric::HWorstError => score.and_then(|score| score.h_worst_error_ratio),
                Metric::RigMinutes => Some(plan.duration_s() / 60.0),
            };
            Some((metric, value.filter(|value| value.is_finite())?))
        })
        .collect()
}

/// One row for each point; repeat visits are distinguished by their visit number.
pub(crate) fn point_rows(points: &[ScoredPoint]) -> Vec<PointRow> {
    let mut visits: BTreeMap<(u64, u64), usize> = BTreeMap::new();
    points
        .iter()
        .map(|ScoredPoint { point, truth }| {
            let speed_rpm = point.target.map_or(point.speed_rpm, |target| target.speed_rpm);
            let visits =
                visits.entry((speed_rpm.to_bits(), point.valve_opening_ratio.to_bits())).or_default();
            let visit = *visits;
            *visits += 1;
            PointRow {
                speed_rpm,
                valve_opening_ratio: point.valve_opening_ratio,
                visit,
                eta: point.eta,
                eta_true: truth.map(|truth| truth.eta),
                h_w_m2k: point.h_w_m2k,
                h_true_w_m2k: truth.map(|truth| truth.h_w_m2k),
            }
        })
        .collect()
}
