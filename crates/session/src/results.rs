//! What a run or a recording gives: points, map, report; data for whoever asks, files in its directory.

use crate::files::{json_text, write_new};
use crate::identified::{Identified, SoughtSurge};
use crate::recorded::Recorded;
use crate::{Registry, Session, SessionError, run_directory};
use mapper_assemble::{Grouping, MapFit, MapFitOptions, RepeatedJump, assemble, repeated_jumps};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::Outputs;
use mapper_core::{CompressorMap, ExportError, IdentifiedPoint, Method, Plan, ThermalModel};
use mapper_identify::{TwoParameter, ZeroOutcome};
use mapper_observe::FusedChannel;
use mapper_record::score::{ScoreSummary, ScoredPoint};
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_report::{ReportSource, RunReport, SurgeReport, run_report};
use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Everything that came of a run, with the files it was written to; written as JSON, the one object that a run prints.
#[derive(Debug, Serialize)]
pub struct Results {
    /// The run's directory.
    pub run: PathBuf,
    /// Its recording, or the first of those that were identified together.
    pub recording: PathBuf,
    /// The others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub further_recordings: Vec<PathBuf>,
    /// Identified points, repeats included.
    pub points: Vec<ScoredPoint>,
    /// Files of the map by format.
    pub map: BTreeMap<String, PathBuf>,
    /// The test report.
    pub report: PathBuf,
    /// How far the points are from the truth; `None` on a real rig.
    pub score: Option<ScoreSummary>,
    /// Jumps that were made more than once.
    pub repeats: Vec<RepeatedJump>,
    /// What the points share (joint method).
    pub thermal: Option<ThermalModel>,
    /// What the two-parameter method makes of the same steps (joint method).
    pub two_parameter: Vec<TwoParameter>,
    /// What became of channels with several sensors.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<FusedChannel>,
    /// What came of the isothermal zero.
    pub zero: ZeroOutcome,
    /// Surge-side ends that were sought; `None` where none were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surge: Option<SoughtSurge>,
    /// What else is to be known.
    pub remarks: Vec<String>,
    /// The map itself; `None` where there is none.
    #[serde(skip)]
    pub compressor_map: Option<CompressorMap>,
}

/// What is known of where recordings come from.
struct Told<'a> {
    campaign: Option<&'a Campaign>,
    plan: Option<&'a Plan>,
    /// How it ended, or how the points were made.
    outcome: &'a str,
    machine: &'a str,
    formats: Vec<&'a str>,
    sources: &'a [ReportSource],
}

/// One recording of a run.
pub(crate) struct RunPart {
    pub(crate) recording: PathBuf,
    /// Steps of it that hold; `None`: all.
    pub(crate) saved: Option<BTreeSet<usize>>,
}

impl Session<'_> {
    /// Reads the recording of a run back, identifies, assembles, exports and reports, all into `directory`.
    ///
    /// # Errors
    /// [`SessionError`] where the recording cannot be identified or a file cannot be written. A map that cannot be
    /// assembled or fitted is a remark.
    pub(crate) fn results(
        &self,
        campaign: &Campaign,
        plan: &Plan,
        outcome: &str,
        directory: &Path,
        parts: &[RunPart],
    ) -> Result<Results, SessionError> {
        let (mut together, mut remarks) = (Vec::new(), Vec::new());
        for part in parts {
            let mut read = read_recording(&part.recording, &ChannelMap::native(), &ReadOptions::default())?;
            remarks.extend(read.warnings.iter().map(ToString::to_string));
            if let Some(saved) = &part.saved {
                read.recording.steps.retain(|step| saved.contains(&step.index));
            }
            together.push(Recorded::of(part.recording.clone(), read, Some(campaign.clone())));
        }
        let mut files = parts.iter().map(|part| part.recording.clone());
        let recording = files.next().ok_or(SessionError::NoRecording)?;
        let further: Vec<PathBuf> = files.collect();
        let identified = self.identify(together, &ChannelMap::native(), None)?;
        let formats = campaign.outputs.formats.iter().map(|format| format.name()).collect();
        let machine = &campaign.machine.name;
        let told =
            Told { campaign: Some(campaign), plan: Some(plan), outcome, machine, formats, sources: &[] };
        self.written(&told, identified, (recording, further), remarks, directory)
    }

    /// Identifies recordings and leaves what a run leaves, points, map and report, in `directory`, which is made where it is
    /// missing. Nothing that is there is replaced: where it has results already, nothing is identified.
    ///
    /// # Errors
    /// As [`Session::identify`]; [`SessionError::File`] where a file is there or cannot be written.
    pub fn identify_into(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        method: Option<Method>,
        directory: &Path,
    ) -> Result<Results, SessionError> {
        for name in [run_directory::POINTS, run_directory::REPORT] {
            let path = directory.join(name);
            if path.exists() {
                return Err(SessionError::file("write", &path)(std::io::ErrorKind::AlreadyExists.into()));
            }
        }
        let campaign = recorded.first().and_then(|first| first.campaign.clone());
        let plan: Option<Plan> = match recorded.as_slice() {
            [only] => only.read.plan_json.as_deref().and_then(|json| serde_json::from_slice(json).ok()),
            _ => None,
        };
        let sources: Vec<ReportSource> = recorded.iter().map(source).collect();
        let remarks = recorded.iter().flat_map(|one| remarks_of(one, recorded.len() > 1)).collect();
        let mut files = recorded.iter().map(|one| one.path.clone());
        let first = files.next().ok_or(SessionError::NoRecording)?;
        let further: Vec<PathBuf> = files.collect();
        let named = first.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let identified = self.identify(recorded, map, method)?;
        let usual = Outputs::default();
        let outputs = campaign.as_ref().map_or(&usual, |campaign| &campaign.outputs);
        let told = Told {
            campaign: campaign.as_ref(),
            plan: plan.as_ref(),
            outcome: &format!("Identified by the method `{}`.", identified.config.method),
            machine: campaign.as_ref().map_or(&named, |campaign| &campaign.machine.name),
            formats: outputs.formats.iter().map(|format| format.name()).collect(),
            sources: &sources,
        };
        std::fs::create_dir_all(directory).map_err(SessionError::file("create", directory))?;
        self.written(&told, identified, (first, further), remarks, directory)
    }

    /// The files of what was identified.
    fn written(
        &self,
        told: &Told<'_>,
        identified: Identified,
        (recording_file, further_recordings): (PathBuf, Vec<PathBuf>),
        mut remarks: Vec<String>,
        directory: &Path,
    ) -> Result<Results, SessionError> {
        remarks.extend(identified.remarks.iter().cloned());
        let compressor_map = compressor_map(told.machine, &identified, &mut remarks);
        let map = match &compressor_map {
            Some(map) => export(self.registry, &told.formats, map, directory, &mut remarks)?,
            None => BTreeMap::new(),
        };
        let Identified {
            recording, config, points, thermal, two_parameter, sensors, zero, score, surge, ..
        } = identified;
        let mut points_file = json!({"reference": config.reference, "points": points, "thermal": thermal, "two_parameter": two_parameter, "zero": zero});
        if !sensors.is_empty() {
            points_file["sensors"] = json!(sensors);
        }
        if let Some(surge) = &surge {
            points_file["surge"] = json!(surge);
        }
        write_new(&directory.join(run_directory::POINTS), json_text(&points_file)?.as_bytes())?;
        let report = directory.join(run_directory::REPORT);
        let alone: Vec<IdentifiedPoint> = points.iter().map(|scored| scored.point.clone()).collect();
        let repeats = repeated_jumps(&recording.steps, &alone);
        let text = run_report(&RunReport {
            machine: told.machine,
            campaign: told.campaign,
            plan: told.plan,
            sources: told.sources,
            outcome: told.outcome,
            remarks: &remarks,
            reference: config.reference,
            method: config.method,
            alpha_area_ratio: config.alpha_area_ratio,
            events: &recording.events,
            points: &points,
            repeats: &repeats,
            two_parameter: &two_parameter,
            sensors: &sensors,
            score: score.as_ref(),
            surge: surge.as_ref().map(|surge| SurgeReport {
                marks: &surge.marks,
                remarks: &surge.remarks,
                surges: surge.surges,
            }),
            has_picture: map.contains_key("svg"),
        });
        write_new(&report, text.as_bytes())?;
        Ok(Results {
            run: directory.to_owned(),
            recording: recording_file,
            further_recordings,
            points,
            map,
            report,
            score,
            repeats,
            thermal,
            two_parameter,
            sensors,
            zero,
            surge,
            remarks,
            compressor_map,
        })
    }
}

/// A recording as a report names it.
fn source(recorded: &Recorded) -> ReportSource {
    let recording = &recorded.read.recording;
    let spans = recording.series.values().filter_map(|series| series.t_s.first().zip(series.t_s.last()));
    let (first_s, last_s) =
        spans.fold((f64::INFINITY, 0.0f64), |(first, last), (a, b)| (first.min(*a), last.max(*b)));
    ReportSource {
        file: recorded.path.display().to_string(),
        start_time_ns: recorded.read.start_time_ns,
        duration_s: (last_s - first_s).max(0.0),
        steps: recording.steps.len(),
    }
}

/// What was wrong with a file; its name in front where there are several.
fn remarks_of(recorded: &Recorded, several: bool) -> Vec<String> {
    let named = |warning: &mapper_record::ReadWarning| match several {
        true => format!("{}: {warning}", recorded.path.display()),
        false => warning.to_string(),
    };
    recorded.read.warnings.iter().map(named).collect()
}

/// The map of all points that have a place on it, with a surface through it where it has enough of them.
fn compressor_map(
    machine: &str,
    identified: &Identified,
    remarks: &mut Vec<String>,
) -> Option<CompressorMap> {
    let has_place = |point: &&IdentifiedPoint| {
        [point.flow_corrected_kg_s, point.pressure_ratio, point.speed_corrected_rpm]
            .iter()
            .all(|value| value.is_finite())
    };
    let placed: Vec<IdentifiedPoint> = identified.points_alone().filter(has_place).cloned().collect();
    let config = &identified.config;
    let map = assemble(&placed, machine, config.reference, config.method, Grouping::default())
        .map_err(|error| remarks.push(format!("there is no map: {error}")))
        .ok()?;
    let marks = identified.surge.iter().flat_map(|surge| surge.marks.iter().map(|scored| scored.mark));
    let map = CompressorMap { surge: marks.collect(), ..map };
    match MapFit::new(&map).and_then(|fit| fit.table(&MapFitOptions::default())) {
        Ok(table) => Some(CompressorMap { fitted: Some(table), ..map }),
        Err(error) => {
            remarks.push(format!("the map is not fitted: {error}"));
            Some(map)
        }
    }
}

/// Writes the map in these formats.
fn export(
    registry: &Registry,
    formats: &[&str],
    map: &CompressorMap,
    directory: &Path,
    remarks: &mut Vec<String>,
) -> Result<BTreeMap<String, PathBuf>, SessionError> {
    let mut files = BTreeMap::new();
    for name in formats.iter().copied() {
        let format = registry.written_format(name)?;
        let bytes = match format.write(map) {
            Ok(bytes) => bytes,
            // A campaign of a few points has a map, but no surface through it.
            Err(error @ ExportError::NeedsFit { .. }) => {
                remarks.push(error.to_string());
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        let path = directory.join(format!("map.{}", format.extension));
        write_new(&path, &bytes)?;
        files.insert(name.to_owned(), path);
    }
    Ok(files)
}
