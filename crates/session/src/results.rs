//! What a run gives: points, map, report; data for whoever asks, files in its directory.

use crate::files::{json_text, write_new};
use crate::identified::{Identified, SoughtSurge};
use crate::recorded::Recorded;
use crate::{Registry, Session, SessionError, run_directory};
use mapper_assemble::{Grouping, MapFit, MapFitOptions, RepeatedJump, assemble, repeated_jumps};
use mapper_campaign::Campaign;
use mapper_core::{CompressorMap, ExportError, IdentifiedPoint, Plan, ThermalModel};
use mapper_identify::{TwoParameter, ZeroOutcome};
use mapper_observe::FusedChannel;
use mapper_record::score::{ScoreSummary, ScoredPoint};
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_report::{RunReport, SurgeReport, run_report};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Everything that came of a run, with the files it was written to; written as JSON, the one object that a run prints.
#[derive(Debug, Serialize)]
pub struct Results {
    /// The run's directory.
    pub run: PathBuf,
    /// Its recording.
    pub recording: PathBuf,
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

impl Session<'_> {
    /// Reads the recording back, identifies, assembles, exports and reports, all into `directory`.
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
        recording: &Path,
    ) -> Result<Results, SessionError> {
        let read = read_recording(recording, &ChannelMap::native(), &ReadOptions::default())?;
        let mut remarks: Vec<String> = read.warnings.iter().map(ToString::to_string).collect();
        let recorded = Recorded::of(recording.to_owned(), read, Some(campaign.clone()));
        let identified = self.identify(recorded, &ChannelMap::native(), None)?;
        let compressor_map = compressor_map(campaign, &identified, &mut remarks);
        let map = match &compressor_map {
            Some(map) => export(self.registry, campaign, map, directory, &mut remarks)?,
            None => BTreeMap::new(),
        };
        let Identified {
            recording: recorded,
            config,
            points,
            thermal,
            two_parameter,
            sensors,
            zero,
            score,
            surge,
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
        let repeats = repeated_jumps(&recorded.steps, &alone);
        let text = run_report(&RunReport {
            campaign,
            plan,
            outcome,
            events: &recorded.events,
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
            recording: recording.to_owned(),
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

/// The map of all points that have a place on it, with a surface through it where it has enough of them.
fn compressor_map(
    campaign: &Campaign,
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
    let map = assemble(&placed, &campaign.machine.name, config.reference, config.method, Grouping::default())
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

/// Writes the map in every format that the campaign names.
fn export(
    registry: &Registry,
    campaign: &Campaign,
    map: &CompressorMap,
    directory: &Path,
    remarks: &mut Vec<String>,
) -> Result<BTreeMap<String, PathBuf>, SessionError> {
    let mut files = BTreeMap::new();
    for name in campaign.outputs.formats.iter().map(|format| format.name()) {
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
