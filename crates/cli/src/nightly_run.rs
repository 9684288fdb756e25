//! One run of the night: the assembly line of `mapper run`, in this process, its files in a directory of its own.

use crate::drive::drive;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::observers::Recorder;
use crate::registry::{BackendContext, make_backend};
use crate::{assembly_line, output, run_directory, zero};
use mapper_campaign::Campaign;
use mapper_core::{Plan, Verdict};
use mapper_history::{Metric, PointRow, RunKey, RunRow};
use mapper_physics::model::Model;
use mapper_record::{ChannelMap, ReadOptions, RecordingHeader, RecordingWriter, read_recording};
use mapper_runner::{PlanSteps, RunEnd};
use mapper_score::ScoredPoint;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A campaign with method and seed set, ready to run.
pub struct NightlyRun {
    /// The campaign.
    pub campaign: Campaign,
    /// Its nominal model.
    pub model: Model,
    /// Which run it is.
    pub key: RunKey,
}

impl NightlyRun {
    /// Plans, runs, records, identifies and scores. What fails stands in the row; `None` where the operator stopped it.
    pub fn run(&self, directory: &Path, stop: &AtomicBool) -> Option<RunRow> {
        let mut row = RunRow {
            key: self.key.clone(),
            campaign_sha256: String::new(),
            model_sha256: String::new(),
            failure: None,
            figures: BTreeMap::new(),
            points: Vec::new(),
        };
        match self.fill(&mut row, directory, stop) {
            Ok(RunEnd::Completed) => {}
            Ok(RunEnd::Interrupted { .. }) => return None,
            Ok(RunEnd::Tripped(trip)) => {
                row.failure = Some(format!("stopped at {:.1} s: {}", trip.t_s, trip.reason))
            }
            Err(failure) => row.failure = Some(failure.message().to_owned()),
        }
        Some(row)
    }

    fn fill(&self, row: &mut RunRow, directory: &Path, stop: &AtomicBool) -> Result<RunEnd, Failure> {
        let plan = assembly_line::plan(&self.campaign, &self.model)?;
        row.campaign_sha256 = plan.made_from.campaign_sha256.clone();
        row.model_sha256 = plan.made_from.model_sha256.clone();
        let recording = directory.join(run_directory::RECORDING);
        let end = self.record(&plan, &recording, stop)?;
        if end != RunEnd::Completed {
            return Ok(end);
        }
        let points = self.identify(&recording)?;
        row.figures = figures(&points, &plan);
        row.points = point_rows(&points);
        Ok(end)
    }

    fn record(&self, plan: &Plan, recording: &Path, stop: &AtomicBool) -> Result<RunEnd, Failure> {
        let context = BackendContext { campaign: &self.campaign, model: &self.model };
        let mut backend = make_backend(&context).map_err(|error| Failure::new(Code::BadInput, error))?;
        let header = RecordingHeader {
            library: concat!("mapper ", env!("CARGO_PKG_VERSION")).to_owned(),
            profile: String::new(),
            start_time_ns: 0,
            metadata: BTreeMap::new(),
            plan_json: Some((output::to_json(plan)? + "\n").into_bytes()),
            campaign_yaml: None,
        };
        let failed = |error| Failure::new(Code::Failure, error);
        let mut recorder = Recorder::new(RecordingWriter::create(recording, &header).map_err(failed)?);
        let end = drive(&self.campaign, &mut PlanSteps::new(plan), backend.as_mut(), &mut recorder, stop)
            .map_err(|error| Failure::new(Code::Rig, error))?;
        recorder.finish().map_err(failed)?;
        Ok(end)
    }

    fn identify(&self, recording: &Path) -> Result<Vec<ScoredPoint>, Failure> {
        let bad = |error| Failure::new(Code::BadRecording, error);
        let read = read_recording(recording, &ChannelMap::native(), &ReadOptions::default()).map_err(bad)?;
        let config = assembly_line::identification(&self.campaign);
        let (recorded, config, _) = zero::apply(read.recording, config, &self.campaign);
        let points = mapper_identify::identify(&recorded, &config)
            .map_err(|error| Failure::new(Code::BadRecording, error))?;
        mapper_score::score(recording, &recorded.steps, points).map_err(bad)
    }
}

/// The figures that are watched; those without a value are left out.
fn figures(points: &[ScoredPoint], plan: &Plan) -> BTreeMap<Metric, f64> {
    let mean = |values: Vec<f64>| {
        let count = values.len() as f64;
        (count > 0.0).then(|| values.iter().sum::<f64>() / count)
    };
    let score = mapper_score::summarise(points);
    let good = points.iter().filter(|scored| scored.point.verdict == Verdict::Good).count();
    // True means over the points that have a result as well: the same points in both.
    let both = |scored: &&ScoredPoint| scored.point.eta.is_some() && scored.truth.is_some();
    let with_eta: Vec<&ScoredPoint> = points.iter().filter(both).collect();
    Metric::ALL
        .into_iter()
        .filter_map(|figure| {
            let value = match figure {
                Metric::GoodPoints => Some(good as f64),
                Metric::EtaMean => mean(with_eta.iter().filter_map(|scored| scored.point.eta).collect()),
                Metric::EtaTrueMean => {
                    mean(with_eta.iter().filter_map(|scored| Some(scored.truth?.eta)).collect())
                }
                Metric::EtaMedianError => score.map(|score| score.eta_median_error),
                Metric::EtaWorstError => score.map(|score| score.eta_worst_error),
                Metric::EtaCoverage => score.map(|score| score.eta_coverage_ratio),
                Metric::HMean => mean(with_eta.iter().filter_map(|scored| scored.point.h_w_m2k).collect()),
                Metric::HTrueMean => {
                    mean(with_eta.iter().filter_map(|scored| Some(scored.truth?.h_w_m2k)).collect())
                }
                Metric::HMedianError => score.and_then(|score| score.h_median_error_ratio),
                Metric::HWorstError => score.and_then(|score| score.h_worst_error_ratio),
                Metric::RigMinutes => Some(plan.duration_s() / 60.0),
            };
            Some((figure, value.filter(|value| value.is_finite())?))
        })
        .collect()
}

/// One row a point; a point that is visited again is told apart by its visit.
fn point_rows(points: &[ScoredPoint]) -> Vec<PointRow> {
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
