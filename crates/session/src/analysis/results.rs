//! Results of a run or recording as data and files: points, map, report, thermal model, turbine, and pictures of h and of errors.

use crate::analysis::identification::Identified;
use crate::recording::files::{Existing, json_text, program_and_commit, write_files, write_new};
use crate::recording::recording_file::{Recorded, merge_parts};
use crate::recording::run_directory::{self, TURBINE_MAP};
use crate::{Gap, Registry, Session, SessionError};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::Outputs;
use mapper_campaign::units::Kind;
use mapper_chart::Figure;
use mapper_core::{
    CompressorMap, ExportError, IdentifiedPoint, MapUnits, Method, Plan, ResultRemark, RunEnding,
    ThermalModel, with_sentences,
};
use mapper_maps::{MapFit, MapFitOptions, RepeatedJump};
use mapper_recording::score::ScoredTurbinePoint;
use mapper_recording::{ChannelMap, ReadOptions, ReadWarning, read_recording};
use mapper_report::{
    Display, OtherRun, PointResults, PointsOrigin, ReportSource, RunReport, ThermalExport, budget_csv,
    error_figure, heat_transfer_figure, instant, turbine_figure,
};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// All results of a run and their files. As JSON, this is the one object that a run prints.
#[derive(Debug, Serialize)]
pub struct Results {
    /// The run's directory.
    pub run: PathBuf,
    /// Its recording, or the first of several that were identified together.
    pub recording: PathBuf,
    /// The other recordings.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub further_recordings: Vec<PathBuf>,
    /// The identification, with every remark.
    #[serde(flatten)]
    pub identified: Identified,
    /// Files of the map by format.
    pub map: BTreeMap<String, PathBuf>,
    /// The test report.
    pub report: PathBuf,
    /// The extended report as a page for a browser.
    pub page: PathBuf,
    /// Jumps that were repeated.
    pub repeats: Vec<RepeatedJump>,
    /// Why a file of the results could not be written, and how to write it later; `None`: all were written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unwritten: Option<String>,
    /// The map itself; `None` if there is none.
    #[serde(skip)]
    pub compressor_map: Option<CompressorMap>,
}

pub(crate) struct Provenance {
    campaign: Option<Campaign>,
    plan: Option<Plan>,
    ending: Option<RunEnding>,
    machine: String,
    tested_at: Option<String>,
    sources: Vec<ReportSource>,
}

impl Provenance {
    pub(crate) fn of(recorded: &[Recorded]) -> Provenance {
        let campaign = recorded.first().and_then(|first| first.campaign.clone());
        // Recordings of one run have the same plan.
        let plans: Vec<Option<&[u8]>> =
            recorded.iter().map(|recording_part| recording_part.read.plan_json.as_deref()).collect();
        let plan = match plans.as_slice() {
            [Some(first), others @ ..] if others.iter().all(|other| *other == Some(*first)) => {
                serde_json::from_slice(first).ok()
            }
            _ => None,
        };
        let file = recorded.first().and_then(|first| first.path.file_stem());
        let named = || file.unwrap_or_default().to_string_lossy().into_owned();
        let sources: Vec<ReportSource> = recorded.iter().map(source).collect();
        Provenance {
            ending: None,
            machine: campaign.as_ref().map_or_else(named, |campaign| campaign.machine.name.clone()),
            // Simulated time has no date; the name of the run directory has one.
            tested_at: sources
                .first()
                .and_then(|source| instant(source.start_time_ns))
                .or_else(|| run_directory::started(recorded.first()?.path.parent()?)),
            campaign,
            plan,
            sources,
        }
    }

    fn map_units(&self) -> MapUnits {
        let Some(campaign) = &self.campaign else { return MapUnits::default() };
        let display = Display::new(&campaign.display);
        MapUnits {
            flow: campaign.display.flow.clone(),
            flow_of_one_kg_s: display.number(Kind::MassFlow, 1.0),
            speed: campaign.display.speed.clone(),
            speed_of_one_rpm: display.number(Kind::Speed, 1.0),
        }
    }

    fn formats(&self) -> Vec<String> {
        let default = Outputs::default();
        let outputs = self.campaign.as_ref().map_or(&default, |campaign| &campaign.outputs);
        outputs.formats.iter().map(|format| format.name().to_owned()).collect()
    }
}

pub(crate) struct RunPart {
    pub(crate) recording: PathBuf,
    pub(crate) soaked: bool,
    /// Valid steps of it; `None`: all.
    pub(crate) saved: Option<BTreeSet<usize>>,
}

impl Session<'_> {
    /// Reads the recording of a run, identifies, assembles, exports and reports. All files go into `directory`.
    pub(crate) fn results(
        &self,
        campaign: &Campaign,
        plan: &Plan,
        ending: RunEnding,
        started_ns: u64,
        directory: &Path,
        parts: &[RunPart],
    ) -> Result<Results, SessionError> {
        // A part of which nothing is used may be damaged.
        let has_data =
            |part: &&RunPart| part.soaked || part.saved.as_ref().is_none_or(|saved| !saved.is_empty());
        let parts: Vec<&RunPart> = parts.iter().filter(has_data).collect();
        let paths: Vec<PathBuf> = parts.iter().map(|part| part.recording.clone()).collect();
        let mut remarks = Vec::new();
        let mut all = Vec::new();
        for RunPart { recording, .. } in &parts {
            let read = read_recording(recording, &ChannelMap::native(), &ReadOptions::default())?;
            remarks.extend(read.warnings.iter().map(|warning| incomplete(None, warning)));
            all.push(Recorded::of(recording.clone(), read, Some(campaign.clone())));
        }
        let all = merge_parts(parts.iter().map(|part| (part.soaked, part.saved.as_ref())).zip(all));
        let identified = self.identify(all, &ChannelMap::native(), None)?;
        let mut files = paths.into_iter();
        let recording = files.next().ok_or(SessionError::NoRecording)?;
        let further: Vec<PathBuf> = files.collect();
        let origin = Provenance {
            campaign: Some(campaign.clone()),
            plan: Some(plan.clone()),
            ending: Some(ending),
            machine: campaign.machine.name.clone(),
            tested_at: instant(started_ns),
            sources: Vec::new(),
        };
        let (results, written) =
            self.write_results(&origin, identified, (recording, further), remarks, directory)?;
        let unwritten = written
            .err()
            .map(|error| format!("{error}; make room, then resume the run, which does not use the rig"));
        Ok(Results { unwritten, ..results })
    }

    /// Identifies recordings and writes the same results as a run to `directory`, created if missing. Existing results stop it.
    pub fn identify_into(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        method: Option<Method>,
        directory: &Path,
    ) -> Result<Results, SessionError> {
        self.write_identification(recorded, directory, |recorded| self.identify(recorded, map, method))
    }

    pub(crate) fn write_identification(
        &self,
        recorded: Vec<Recorded>,
        directory: &Path,
        identify: impl FnOnce(Vec<Recorded>) -> Result<Identified, SessionError>,
    ) -> Result<Results, SessionError> {
        for name in [run_directory::POINTS, run_directory::REPORT] {
            let path = directory.join(name);
            if path.exists() {
                return Err(SessionError::file("write", &path)(std::io::ErrorKind::AlreadyExists.into()));
            }
        }
        let remarks = recorded
            .iter()
            .flat_map(|recording_part| remarks_of(recording_part, recorded.len() > 1))
            .collect();
        let mut files = recorded.iter().map(|recording_part| recording_part.path.clone());
        let first = files.next().ok_or(SessionError::NoRecording)?;
        let further: Vec<PathBuf> = files.collect();
        let origin = Provenance::of(&recorded);
        let identified = identify(recorded)?;
        std::fs::create_dir_all(directory).map_err(SessionError::file("create", directory))?;
        let (results, written) =
            self.write_results(&origin, identified, (first, further), remarks, directory)?;
        written.map(|()| results)
    }

    /// The page of the run with recordings `shown`, with other runs' maps for comparison and its gap diagnosis, if any. Writes no file.
    pub fn page(
        &self,
        shown: Vec<Recorded>,
        others: Vec<Vec<Recorded>>,
        channels: &ChannelMap,
        gap: Option<&Gap>,
    ) -> Result<String, SessionError> {
        let origin = Provenance::of(&shown);
        let several = shown.len() > 1;
        let mut remarks: Vec<ResultRemark> =
            shown.iter().flat_map(|recording_part| remarks_of(recording_part, several)).collect();
        let identified = self.identify(shown, channels, None)?;
        remarks.extend(identified.remarks.iter().cloned());
        let map = compressor_map(&origin.machine, &identified, &mut remarks);
        let reference = identified.config.reference;
        let mut other_maps: Vec<(String, CompressorMap)> = Vec::new();
        for other in others {
            let name = other.first().map_or_else(String::new, |first| name_of(&first.path));
            let machine = Provenance::of(&other).machine;
            let identified = self.identify(other, channels, None)?;
            match compressor_map(&machine, &identified, &mut Vec::new()) {
                Some(map) => other_maps.push((name, map.at_reference(reference))),
                None => remarks.push(ResultRemark::NothingToCompare { run: name }),
            }
        }
        let others: Vec<OtherRun<'_>> =
            other_maps.iter().map(|(name, map)| OtherRun { name: name.clone(), map }).collect();
        let repeats = identified.repeats();
        let (map, program) = (map.as_ref(), program_and_commit(self.registry.commit));
        let results = identified.shown(map, &repeats, &remarks);
        let turbine_map = identified.turbine_map(&origin.machine);
        let report = RunReport {
            turbine_map: turbine_map.as_ref(),
            ..run_report(&origin, &identified, results, &program)
        };
        let evidence = gap.map(|gap| gap.diagnosed.evidence()).transpose()?;
        let gap = gap.zip(evidence.as_ref()).map(|(gap, evidence)| (&gap.diagnosed, evidence));
        Ok(RunReport { others: &others, gap, ..report }.page()?)
    }

    /// Writes the files of an identification. After a file that cannot be written, the others are not written; the results are still returned.
    fn write_results(
        &self,
        origin: &Provenance,
        mut identified: Identified,
        (recording_file, further_recordings): (PathBuf, Vec<PathBuf>),
        mut remarks: Vec<ResultRemark>,
        directory: &Path,
    ) -> Result<(Results, Result<(), SessionError>), SessionError> {
        remarks.extend(identified.remarks.iter().cloned());
        let compressor_map = compressor_map(&origin.machine, &identified, &mut remarks);
        let mut files = ResultFiles { directory, failed: Ok(()) };
        let map = match &compressor_map {
            Some(map) => {
                export(self.registry, &origin.formats(), map, &origin.map_units(), &mut files, &mut remarks)?
            }
            None => BTreeMap::new(),
        };
        let turbine_map = identified.turbine_map(&origin.machine);
        if let Some(turbine) = &turbine_map {
            for name in origin.formats() {
                let format = self.registry.written_format(&name)?;
                // A format without turbine maps has that of the compressor alone.
                let Ok(bytes) = format.write_turbine(turbine) else { continue };
                files.write(&format!("{TURBINE_MAP}.{}", format.extension), &bytes);
            }
        }
        if !identified.turbine.is_empty() {
            let figure = turbine_figure(&origin.machine, &identified.turbine, turbine_map.as_ref());
            files.write(&format!("{TURBINE_MAP}.svg"), figure.to_svg().as_bytes());
        }
        let points_file = match self.registry.sentences {
            Some(sentences) => with_sentences(sentences, || identified.points_json()),
            None => identified.points_json(),
        };
        files.write(run_directory::POINTS, json_text(&points_file)?.as_bytes());
        if !identified.budgets.is_empty() {
            let failed = SessionError::file("write", Path::new(run_directory::BUDGET));
            files.write(run_directory::BUDGET, &budget_csv(&identified.budgets).map_err(failed)?);
        }
        let (repeats, program) = (identified.repeats(), program_and_commit(self.registry.commit));
        let has_picture = map.contains_key("svg");
        let results = identified.shown(compressor_map.as_ref(), &repeats, &remarks);
        let shown = RunReport {
            has_picture,
            turbine_map: turbine_map.as_ref(),
            ..run_report(origin, &identified, results, &program)
        };
        let report = files.write(run_directory::REPORT, shown.markdown().as_bytes());
        let page = files.write(run_directory::PAGE, shown.page()?.as_bytes());
        identified.remarks = remarks;
        let results = Results {
            run: directory.to_owned(),
            recording: recording_file,
            further_recordings,
            identified,
            map,
            report,
            page,
            repeats,
            unwritten: None,
            compressor_map,
        };
        Ok((results, files.failed))
    }
}

struct ResultFiles<'a> {
    directory: &'a Path,
    /// The error of the first file that could not be written; none is written after it.
    failed: Result<(), SessionError>,
}

impl ResultFiles<'_> {
    fn write(&mut self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.directory.join(name);
        if self.failed.is_ok() {
            self.failed = write_new(&path, bytes);
        }
        path
    }
}

fn name_of(path: &Path) -> String {
    let named = match path.file_name() {
        Some(file) if file == run_directory::RECORDING => path.parent().and_then(Path::file_name),
        file => file,
    };
    named.unwrap_or_default().to_string_lossy().into_owned()
}

fn run_report<'a>(
    origin: &'a Provenance,
    identified: &'a Identified,
    results: PointResults<'a>,
    program: &'a str,
) -> RunReport<'a> {
    RunReport {
        machine: &origin.machine,
        campaign: origin.campaign.as_ref(),
        plan: origin.plan.as_ref(),
        tested_at: origin.tested_at.as_deref(),
        program,
        results,
        recording: &identified.recording,
        used: &identified.config.declared,
        budgets: &identified.budgets,
        corrections: &identified.corrections,
        sources: &origin.sources,
        origin: origin
            .ending
            .clone()
            .map_or(PointsOrigin::Recordings(identified.config.method), PointsOrigin::Run),
        reference: identified.config.reference,
        gases: identified.gases(),
        method: identified.config.method,
        alpha_area_ratio: identified.config.alpha_area_ratio,
        events: &identified.recording.events,
        has_picture: false,
        fitted: &identified.fitted,
        gap: None,
        turbine_map: None,
        others: &[],
    }
}

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

fn remarks_of(recorded: &Recorded, several: bool) -> impl Iterator<Item = ResultRemark> {
    let file = several.then(|| recorded.path.display().to_string());
    recorded.read.warnings.iter().map(move |warning| incomplete(file.clone(), warning))
}

fn incomplete(file: Option<String>, warning: &ReadWarning) -> ResultRemark {
    ResultRemark::RecordingIncomplete { file, reason: warning.to_string() }
}

/// The map of all points with map coordinates, with a fitted surface if there are enough of them. `None` without a map; a remark says why.
pub fn compressor_map(
    machine: &str,
    identified: &Identified,
    remarks: &mut Vec<ResultRemark>,
) -> Option<CompressorMap> {
    let map = identified
        .map(machine)
        .map_err(|error| remarks.push(ResultRemark::NoMap { reason: error.to_string() }))
        .ok()?;
    match MapFit::new(&map).and_then(|fit| fit.table(&MapFitOptions::default())) {
        Ok(table) => Some(CompressorMap { fitted: Some(table), ..map }),
        Err(error) => {
            remarks.push(ResultRemark::MapNotFitted { reason: error.to_string() });
            Some(map)
        }
    }
}

fn export(
    registry: &Registry,
    formats: &[String],
    map: &CompressorMap,
    units: &MapUnits,
    files: &mut ResultFiles<'_>,
    remarks: &mut Vec<ResultRemark>,
) -> Result<BTreeMap<String, PathBuf>, SessionError> {
    let mut paths = BTreeMap::new();
    for name in formats {
        let format = registry.written_format(name)?;
        let bytes = match format.write_in(map, units) {
            Ok(bytes) => bytes,
            // A campaign of a few points has a map but no fitted surface.
            Err(error @ ExportError::NeedsFit { .. }) => {
                remarks.push(ResultRemark::FormatNotWritten { reason: error.to_string() });
                continue;
            }
            Err(error) => return Err(error.into()),
        };
        let path = files.write(&format!("map.{}", format.extension), &bytes);
        if let Some((extension, write)) = format.companion {
            files.write(&format!("map.{extension}"), &write(map)?);
        }
        paths.insert(name.to_owned(), path);
    }
    Ok(paths)
}

#[derive(Debug, Serialize)]
pub struct RigFiles {
    pub files: Vec<PathBuf>,
    pub turbine: Vec<ScoredTurbinePoint>,
    pub thermal: Option<ThermalModel>,
}

impl Session<'_> {
    /// Identifies a recording by its campaign's method and writes the files to `out`. Creates the directory if missing.
    pub fn rig_files(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        out: &Path,
    ) -> Result<RigFiles, SessionError> {
        let first = recorded.first().ok_or(SessionError::NoRecording)?;
        let campaign = first.require_campaign()?.clone();
        let identified = self.identify(recorded, map, None)?;
        let points: Vec<IdentifiedPoint> = identified.points_alone().cloned().collect();
        let (machine, params) = (&campaign.machine.name, &campaign.machine.params);
        let thermal = ThermalExport {
            machine,
            params,
            found: identified.thermal.as_ref(),
            turbine_housing: identified.turbine_housing.as_ref(),
        };
        let law = identified.thermal.as_ref().and_then(|found| found.convection.as_ref()?.exponent.value);
        let heat = heat_transfer_figure(machine, &points, law.unwrap_or(params.compressor.nusselt_exponent));
        let mut contents: Vec<(&str, Vec<u8>)> = vec![
            ("thermal_model.json", thermal.json()?),
            ("heat_transfer.svg", heat.to_svg().into_bytes()),
            ("heat_transfer.png", png(&heat)?),
        ];
        if let Some(turbine) = identified.turbine_map(machine) {
            contents.push(("turbine.txt", self.registry.written_format("sae")?.write_turbine(&turbine)?));
        }
        if let Some(figure) = error_figure(machine, &identified.points) {
            contents.push(("error.svg", figure.to_svg().into_bytes()));
            contents.push(("error.png", png(&figure)?));
        }
        let files = write_files(out, &contents, Existing::Kept)?;
        Ok(RigFiles { files, turbine: identified.turbine, thermal: identified.thermal })
    }
}

pub(crate) fn png(figure: &Figure) -> Result<Vec<u8>, SessionError> {
    Ok(figure.to_png(2.0).map_err(ExportError::failed("png"))?)
}
