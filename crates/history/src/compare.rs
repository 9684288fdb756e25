//! Compares a night with the nights before, and states the probable cause of a change.

use crate::{Band, Metric, Night, PointQuantity, PointRow, RunKey, RunRow};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// A metric of a run outside its band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MetricOutsideBand {
    /// The run.
    pub run: RunKey,
    /// The metric.
    pub figure: Metric,
    /// Tonight's value; `None` if only the nights before have one.
    pub value: Option<f64>,
    /// Its range in the nights before.
    pub band: Band,
}

/// A point outside its band.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shift {
    /// The point, in words.
    pub place: String,
    /// Tonight's value.
    pub value: f64,
    /// Its range in the nights before.
    pub band: Band,
}

/// Points of a run outside their bands, in one quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointsOutsideBand {
    /// The run.
    pub run: RunKey,
    /// The quantity.
    pub quantity: PointQuantity,
    /// Number of points outside their band or without a value tonight.
    pub moved: usize,
    /// Number of compared points.
    pub compared: usize,
    /// Mean shift of all points compared, unit of the quantity.
    pub mean_shift: f64,
    /// Mean of the bands' medians, unit of the quantity.
    pub mean_level: f64,
    /// The largest shift; `None` if values are only missing.
    pub largest: Option<Shift>,
}

/// A night compared with the nights before.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Comparison {
    /// Largest number of earlier nights with figures of a run of tonight, also of one that failed tonight.
    pub nights: usize,
    /// Number of earlier nights in the history; 0 on the first night.
    pub stored_nights: usize,
    /// Runs that failed tonight, each with its reason.
    pub failed: Vec<(RunKey, String)>,
    /// Runs of the last nights that tonight does not have.
    pub missing: Vec<RunKey>,
    /// Metrics outside their band.
    pub moved: Vec<MetricOutsideBand>,
    /// Points outside their band.
    pub moved_points: Vec<PointsOutsideBand>,
    /// Probable causes, one sentence each.
    pub conclusions: Vec<String>,
}

impl Comparison {
    /// Whether nothing failed and nothing is outside its band.
    pub fn is_quiet(&self) -> bool {
        self.failed.is_empty()
            && self.missing.is_empty()
            && self.moved.is_empty()
            && self.moved_points.is_empty()
    }
}

/// Compares a night with the runs of the nights before, newest first within a key.
pub fn compare(night: &Night, earlier: &BTreeMap<RunKey, Vec<RunRow>>) -> Comparison {
    let mut comparison = Comparison::default();
    let tonight: BTreeSet<&RunKey> = night.runs.iter().map(|run| &run.key).collect();
    comparison.missing = earlier.keys().filter(|key| !tonight.contains(key)).cloned().collect();
    for run in &night.runs {
        let before: Vec<&RunRow> =
            earlier.get(&run.key).into_iter().flatten().filter(|run| run.failure.is_none()).collect();
        comparison.nights = comparison.nights.max(before.len());
        if let Some(failure) = &run.failure {
            comparison.failed.push((run.key.clone(), failure.clone()));
            continue;
        }
        if before.is_empty() {
            continue;
        }
        compare_figures(run, &before, &mut comparison.moved);
        compare_points(run, &before, &mut comparison.moved_points);
    }
    comparison.conclusions = conclusions(night, earlier, &comparison);
    comparison
}

fn compare_figures(run: &RunRow, before: &[&RunRow], moved: &mut Vec<MetricOutsideBand>) {
    for figure in Metric::ALL {
        let values: Vec<f64> =
            before.iter().filter_map(|earlier| earlier.figures.get(&figure).copied()).collect();
        let Some(band) = Band::of(&values, figure.floor()) else { continue };
        let value = run.figures.get(&figure).copied().filter(|value| value.is_finite());
        if value.is_none_or(|value| !band.contains(value)) {
            moved.push(MetricOutsideBand { run: run.key.clone(), figure, value, band });
        }
    }
}

/// Identity of a point from night to night: speed and opening bit for bit, because they come from the same file each night, and visit.
type PointKey = (u64, u64, usize);

fn point_key(point: &PointRow) -> PointKey {
    (point.speed_rpm.to_bits(), point.valve_opening_ratio.to_bits(), point.visit)
}

fn compare_points(run: &RunRow, before: &[&RunRow], moved: &mut Vec<PointsOutsideBand>) {
    let mut earlier: BTreeMap<PointKey, Vec<&PointRow>> = BTreeMap::new();
    for point in before.iter().flat_map(|run| &run.points) {
        earlier.entry(point_key(point)).or_default().push(point);
    }
    let tonight: BTreeMap<PointKey, &PointRow> =
        run.points.iter().map(|point| (point_key(point), point)).collect();
    for quantity in PointQuantity::ALL {
        let (mut outside, mut missing, mut compared) = (0, 0, 0);
        let (mut shift_sum, mut level_sum) = (0.0, 0.0);
        let mut largest: Option<(f64, Shift)> = None;
        for (point_key, points) in &earlier {
            let values: Vec<f64> = points.iter().filter_map(|point| quantity.of(point)).collect();
            // A point with values in only a few nights is not compared.
            let is_usual = 2 * values.len() > before.len();
            let Some(band) = Band::of(&values, quantity.floor()).filter(|_| is_usual) else { continue };
            let point = tonight.get(point_key);
            let Some((point, value)) = point.and_then(|point| Some((point, quantity.of(point)?))) else {
                missing += 1;
                continue;
            };
            compared += 1;
            let shift = value - band.median;
            shift_sum += shift;
            level_sum += band.median;
            if band.contains(value) {
                continue;
            }
            outside += 1;
            if largest.as_ref().is_none_or(|(size, _)| shift.abs() > *size) {
                largest = Some((shift.abs(), Shift { place: point.label(), value, band }));
            }
        }
        if outside + missing > 0 {
            let count = f64::from(u32::try_from(compared.max(1)).unwrap_or(u32::MAX));
            moved.push(PointsOutsideBand {
                run: run.key.clone(),
                quantity,
                moved: outside + missing,
                compared: compared + missing,
                mean_shift: shift_sum / count,
                mean_level: level_sum / count,
                largest: largest.map(|(_, shift)| shift),
            });
        }
    }
}

fn conclusions(
    night: &Night,
    earlier: &BTreeMap<RunKey, Vec<RunRow>>,
    comparison: &Comparison,
) -> Vec<String> {
    let mut sentences = changed_inputs(night, earlier);
    let campaigns: BTreeSet<&str> = night.runs.iter().map(|run| run.key.campaign.as_str()).collect();
    for campaign in campaigns {
        for (truth, result, name) in [
            (PointQuantity::EtaTrue, PointQuantity::Eta, "efficiency"),
            (PointQuantity::HTrue, PointQuantity::H, "heat-transfer coefficient"),
        ] {
            let moved_in = |quantity| {
                comparison
                    .moved_points
                    .iter()
                    .filter(move |moved| moved.run.campaign == campaign && moved.quantity == quantity)
            };
            let summarise = |quantity: PointQuantity| {
                let (mut shift, mut level, mut points) = (0.0, 0.0, 0);
                let mut methods = BTreeSet::new();
                for moved in moved_in(quantity) {
                    let count = moved.compared as f64;
                    shift += count * moved.mean_shift;
                    level += count * moved.mean_level;
                    points += moved.compared;
                    methods.insert(moved.run.method.as_str());
                }
                let count = (points as f64).max(1.0);
                let methods = methods.into_iter().collect::<Vec<_>>().join(" and ");
                (quantity.format_shift(shift / count, level / count), points, methods)
            };
            let (truth_shift, truth_points, _) = summarise(truth);
            let (result_shift, result_points, methods) = summarise(result);
            if truth_points > 0 {
                let followed = if result_points > 0 {
                    format!("the results moved by {result_shift} with it")
                } else {
                    "the results stayed".to_owned()
                };
                sentences.push(format!(
                    "{campaign}: the true {name} moved by {truth_shift} on average over {truth_points} points, and {followed}: the simulated machine or its model changed."
                ));
            } else if result_points > 0 {
                sentences.push(format!(
                    "{campaign}: the identified {name} moved by {result_shift} on average over {result_points} points ({methods}), the true one stayed: planning, recording or identification changed."
                ));
            }
        }
    }
    sentences
}

fn changed_inputs(night: &Night, earlier: &BTreeMap<RunKey, Vec<RunRow>>) -> Vec<String> {
    let mut campaigns = BTreeSet::new();
    let mut models = BTreeSet::new();
    for run in night.runs.iter().filter(|run| run.failure.is_none()) {
        let Some(last) = earlier.get(&run.key).into_iter().flatten().find(|run| run.failure.is_none()) else {
            continue;
        };
        if last.campaign_sha256 != run.campaign_sha256 {
            campaigns.insert(run.key.campaign.as_str());
        }
        if last.model_sha256 != run.model_sha256 {
            models.insert(run.key.machine.as_str());
        }
    }
    let list = |names: &BTreeSet<&str>| names.iter().copied().collect::<Vec<_>>().join(", ");
    let mut sentences = Vec::new();
    if !campaigns.is_empty() {
        sentences.push(format!("The campaign differs from the last night's: {}.", list(&campaigns)));
    }
    if !models.is_empty() {
        sentences.push(format!(
            "The nominal model's parameters or map differ from the last night's: {}.",
            list(&models)
        ));
    }
    sentences
}
