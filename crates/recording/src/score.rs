//! Errors of identified points relative to the simulator's truth: the only access to `/truth`.
//!
//! Code that identifies, corrects or diagnoses must not use this module; a test of the source tree lists its users.

use crate::log_reader::is_mcap;
use crate::logs::LogFile;
use crate::mcap::{ChannelDefinition, FieldValue, Sink, read_fields};
use crate::recording_reader::open;
use crate::samples::series_builder::run_time_s;
use crate::scan::scan;
use crate::topics::{METADATA_NAME, START_KEY, TRUTH_TOPIC};
use crate::{ReadOptions, ReadWarning, RecordError};
use mapper_core::{
    Channel, IdentifiedPoint, Recording, ReferenceState, StepMarker, SurgeMark, TruthColumn, TurbinePoint,
};
use mapper_numerics::statistics::{mean, median};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::thread::ScopedJoinHandle;

/// One point of efficiency. Source: definition.
const ONE_POINT_ETA: f64 = 0.01;

/// True values at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PointTruth {
    /// Isentropic efficiency, total to total, fraction.
    pub eta: f64,
    /// Heat-transfer coefficient between gas and compressor housing, W/(m2 K).
    pub h_w_m2k: f64,
}

/// An identified point with its truth, if there is one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoredPoint {
    /// The identified point.
    #[serde(flatten)]
    pub point: IdentifiedPoint,
    /// The truth; `None` on a real rig.
    pub truth: Option<PointTruth>,
}

/// Errors of all points that have both a result and a truth. Efficiencies as fractions, h relative.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScoreSummary {
    /// Number of points with both.
    pub points: usize,
    /// Median absolute error of the efficiency, fraction.
    pub eta_median_error: f64,
    /// Share of the points whose efficiency is within 0.01, ratio.
    pub eta_within_one_point_ratio: f64,
    /// Largest absolute error of the efficiency, fraction.
    pub eta_worst_error: f64,
    /// Share of the points whose 95 % interval of the efficiency covers the truth, ratio.
    pub eta_coverage_ratio: f64,
    /// Share of the points with an h whose 95 % interval of it covers the truth, ratio; `None` if no point has one.
    pub h_coverage_ratio: Option<f64>,
    /// Median absolute relative error of h; `None` if no point has h.
    pub h_median_error_ratio: Option<f64>,
    /// Largest absolute relative error of h; `None` if no point has h.
    pub h_worst_error_ratio: Option<f64>,
}

/// Truths of recordings that another thread is reading.
pub struct PendingTruths<'scope>(ScopedJoinHandle<'scope, Result<Vec<Truth>, RecordError>>);

impl PendingTruths<'_> {
    /// Waits until they are read.
    pub fn wait(self) -> Result<Vec<Truth>, RecordError> {
        self.0.join().unwrap_or_else(|panicked| std::panic::resume_unwind(panicked))
    }
}

/// Runs `work` while another thread reads the truths of the recordings at `paths`, in that order.
pub fn with_truths<T>(paths: &[PathBuf], work: impl FnOnce(PendingTruths<'_>) -> T) -> T {
    std::thread::scope(|scope| {
        work(PendingTruths(scope.spawn(|| paths.iter().map(|path| read_truth(path)).collect())))
    })
}

/// Pairs identified points with the truth of their recording; `truth` is `None` everywhere on a real rig.
pub fn score(truth: &Truth, steps: &[StepMarker], points: Vec<IdentifiedPoint>) -> Vec<ScoredPoint> {
    let scored = |point: IdentifiedPoint| {
        let marker = steps.iter().find(|marker| marker.index == point.step);
        let truth = marker.and_then(|marker| truth_at(truth, marker.end_s));
        ScoredPoint { point, truth }
    };
    points.into_iter().map(scored).collect()
}

fn truth_at(truth: &Truth, t_s: f64) -> Option<PointTruth> {
    let value = |name: &str| true_value(truth, t_s, name);
    Some(PointTruth { eta: value("eta")?, h_w_m2k: value("h_w_m2k")? })
}

fn true_value(truth: &Truth, t_s: f64, name: &str) -> Option<f64> {
    let index = truth.t_s.partition_point(|sample_s| *sample_s <= t_s).checked_sub(1)?;
    truth.column(name)?.get(index).copied().filter(|value| value.is_finite())
}

/// The turbine at a point with its truth, if there is one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoredTurbinePoint {
    /// The turbine.
    #[serde(flatten)]
    pub point: TurbinePoint,
    /// True efficiency of turbine and bearings, fraction; `None` on a real rig.
    pub truth_efficiency: Option<f64>,
}

/// Pairs turbine points with the truth of their recording.
pub fn score_turbine(
    truth: &Truth,
    steps: &[StepMarker],
    points: Vec<TurbinePoint>,
) -> Vec<ScoredTurbinePoint> {
    let scored = |point: TurbinePoint| {
        let marker = steps.iter().find(|marker| marker.index == point.step);
        let truth_efficiency =
            marker.and_then(|marker| true_value(truth, marker.end_s, "turbine_efficiency"));
        ScoredTurbinePoint { point, truth_efficiency }
    };
    points.into_iter().map(scored).collect()
}

/// A surge mark with its truth, if there is one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScoredMark {
    /// The mark.
    #[serde(flatten)]
    pub mark: SurgeMark,
    /// True corrected flow at surge at that speed, kg/s; `None` on a real rig.
    pub truth_flow_corrected_kg_s: Option<f64>,
}

/// Time of the truth before the end of the measurement nearest surge, s. Bound: several settling times of pressure and flow.
const TRUTH_LEAD_S: f64 = 10.0;

/// Pairs surge marks with the truth of their recording; `approaches` give the inlet's state, which corrects the true flow.
pub fn score_marks(
    truth: &Truth,
    approaches: &Recording,
    reference: ReferenceState,
    marks: Vec<SurgeMark>,
) -> Vec<ScoredMark> {
    let scored = |mark: SurgeMark| {
        let (start_s, end_s) = (mark.closest_end_s - TRUTH_LEAD_S, mark.closest_end_s);
        let true_flow_kg_s = || {
            let flows_kg_s = truth.column("surge_flow_kg_s")?;
            let within = truth.t_s.iter().zip(flows_kg_s).filter(|(t_s, _)| (start_s..=end_s).contains(*t_s));
            mean(within.map(|(_, flow)| *flow)).filter(|flow| flow.is_finite())
        };
        let level = |channel: Channel| mean(approaches.series.get(&channel)?.slice(start_s, end_s).1);
        let corrected = || {
            let (t1_k, p1_pa) = (level(Channel::T1)?, level(Channel::P1)?);
            Some(reference.corrected_flow_kg_s(true_flow_kg_s()?, t1_k, p1_pa))
        };
        ScoredMark { mark, truth_flow_corrected_kg_s: corrected() }
    };
    marks.into_iter().map(scored).collect()
}

/// Summary of the errors of all points; `None` if no point has both a result and a truth.
pub fn summarise(points: &[ScoredPoint]) -> Option<ScoreSummary> {
    let mut eta_errors = Vec::new();
    let mut h_errors = Vec::new();
    let mut covered = 0;
    let mut h_covered = Vec::new();
    for ScoredPoint { point, truth } in points {
        let (Some(eta), Some(truth)) = (point.eta, truth) else { continue };
        eta_errors.push((eta - truth.eta).abs());
        if let (Some(low), Some(high)) = (point.eta_low, point.eta_high) {
            covered += usize::from((low..=high).contains(&truth.eta));
        }
        if let Some(h_w_m2k) = point.h_w_m2k {
            h_errors.push((h_w_m2k / truth.h_w_m2k - 1.0).abs());
            if let (Some(low), Some(high)) = (point.h_low_w_m2k, point.h_high_w_m2k) {
                h_covered.push(f64::from(u8::from((low..=high).contains(&truth.h_w_m2k))));
            }
        }
    }
    let count = eta_errors.len();
    let share = |part: usize| part as f64 / count as f64;
    Some(ScoreSummary {
        points: count,
        eta_median_error: median(&eta_errors)?,
        eta_within_one_point_ratio: share(eta_errors.iter().filter(|error| **error <= ONE_POINT_ETA).count()),
        eta_worst_error: eta_errors.iter().copied().fold(0.0, f64::max),
        eta_coverage_ratio: share(covered),
        h_coverage_ratio: mean(&h_covered),
        h_median_error_ratio: median(&h_errors),
        h_worst_error_ratio: h_errors.iter().copied().reduce(f64::max),
    })
}

/// The truth of a simulated run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// Run times, s, in the order of the file.
    pub t_s: Vec<f64>,
    /// Quantities in order of their names, each as long as `t_s`; NaN if a message had none.
    pub columns: Vec<TruthColumn>,
    /// Problems of the file.
    pub warnings: Vec<ReadWarning>,
}

impl Truth {
    /// The values of one quantity.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|column| column.name == name).map(|column| column.values.as_slice())
    }
}

/// Reads the truth of a recording; empty if it has none, like the log of another program.
pub fn read_truth(path: &Path) -> Result<Truth, RecordError> {
    if !is_mcap(&LogFile::from_path(path).head(8)?) {
        return Ok(Truth::default());
    }
    let options = ReadOptions::default();
    let (sink, scanned) = scan(path, &|| open(path), &options, TruthSink::default)?;
    let rows = sink.times_ns.len();
    let zero_ns = sink.start_time_ns.or(sink.times_ns.iter().copied().min()).unwrap_or(0);
    let column = |(name, (unit, mut values)): (String, (String, Vec<f64>))| {
        values.resize(rows, f64::NAN);
        TruthColumn { name, unit, values }
    };
    Ok(Truth {
        t_s: sink.times_ns.into_iter().map(|time_ns| run_time_s(time_ns, zero_ns)).collect(),
        columns: sink.columns.into_iter().map(column).collect(),
        warnings: scanned.warnings,
    })
}

#[derive(Default)]
struct TruthSink {
    /// Names of the fields, by channel of the file.
    fields: BTreeMap<u16, Vec<String>>,
    start_time_ns: Option<u64>,
    times_ns: Vec<u64>,
    /// Unit and values by name; padded if a message had none.
    columns: BTreeMap<String, (String, Vec<f64>)>,
}

impl Sink for TruthSink {
    type SinkMessage = Vec<FieldValue>;

    fn define(&mut self, definition: &ChannelDefinition) {
        if definition.topic != TRUTH_TOPIC || definition.encoding != "json" {
            return;
        }
        self.fields.insert(definition.id, definition.metadata.keys().cloned().collect());
        for (name, unit) in &definition.metadata {
            self.columns.entry(name.clone()).or_insert_with(|| (unit.clone(), Vec::new()));
        }
    }

    fn read(&self, channel_id: u16, data: &[u8]) -> Option<Vec<FieldValue>> {
        let (fields, mut values) = (self.fields.get(&channel_id)?, Vec::new());
        read_fields(data, fields, &mut values).then_some(values)
    }

    fn take(&mut self, channel_id: u16, log_time_ns: u64, content: Vec<FieldValue>) {
        let Some(fields) = self.fields.get(&channel_id) else { return };
        let row = self.times_ns.len();
        self.times_ns.push(log_time_ns);
        for (field, value) in fields.iter().zip(&content) {
            if let (Some((_, values)), FieldValue::Number(value)) = (self.columns.get_mut(field), value) {
                values.resize(row, f64::NAN);
                values.push(*value);
            }
        }
    }

    fn metadata(&mut self, name: String, pairs: BTreeMap<String, String>) {
        if name == METADATA_NAME && self.start_time_ns.is_none() {
            self.start_time_ns = pairs.get(START_KEY).and_then(|text| text.parse().ok());
        }
    }

    fn attachment(&mut self, _name: String, _data: &[u8]) {}

    fn value_count(&self) -> u64 {
        // Columns must finally be as long as the times.
        let width = u64::try_from(self.columns.len()).unwrap_or(u64::MAX).saturating_add(1);
        u64::try_from(self.times_ns.len()).unwrap_or(u64::MAX).saturating_mul(width)
    }
}
