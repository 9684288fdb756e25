//! A recording read from a file, with the campaign that describes the recorded machine; the log of another program, inspected.

use crate::recording::resume::InterruptedRun;
use crate::recording::run_directory;
use crate::{Registry, SessionError};
use mapper_campaign::{Campaign, CampaignError};
use mapper_core::{Channel, JsonMessages, Recording};
use mapper_observe::OtherMachine;
use mapper_recording::logs::proposal::{NominalFlows, Proposal, channel_map_text, propose};
use mapper_recording::logs::{Layout, LogFile, LogOptions, Survey, survey};
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, read_recording, read_recording_from};
use serde_json::{Value, json};
use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// A recording, its file and its campaign.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// The file.
    pub path: PathBuf,
    /// The contents.
    pub read: ReadReport,
    /// The campaign given by the caller, or the one attached to the recording.
    pub campaign: Option<Campaign>,
    /// The surge approaches, which are not identified; `None` if there are none.
    pub approaches: Option<Recording>,
}

impl Recorded {
    /// Reads a run directory, MCAP file or log. The machine: by the campaign given, else the channel map, else the campaign attached.
    pub fn read(
        registry: &Registry,
        path: &Path,
        map: &ChannelMap,
        given: Option<&Campaign>,
    ) -> Result<Recorded, SessionError> {
        if resumed_run(path)?.is_some() {
            return Err(SessionError::SeveralRecordings(path.to_owned()));
        }
        let file = run_directory::recording_of(path);
        if path.is_dir() && !file.exists() {
            return Err(SessionError::file("read", path)(run_directory::no_recording_in(path)));
        }
        let options = ReadOptions { logs: registry.logs, ..ReadOptions::default() };
        let read = read_recording(&file, map, &options)?;
        Recorded::described(file, read, map, given)
    }

    /// Same as [`read`](Recorded::read), from memory; messages call it `name`.
    pub fn read_bytes(
        registry: &Registry,
        bytes: &[u8],
        name: &Path,
        map: &ChannelMap,
        given: Option<&Campaign>,
    ) -> Result<Recorded, SessionError> {
        let options = ReadOptions { logs: registry.logs, ..ReadOptions::default() };
        let read = read_recording_from(bytes, name, map, &options)?;
        Recorded::described(name.to_owned(), read, map, given)
    }

    fn described(
        file: PathBuf,
        read: ReadReport,
        map: &ChannelMap,
        given: Option<&Campaign>,
    ) -> Result<Recorded, SessionError> {
        let campaign = match given {
            Some(campaign) => Some(campaign.clone()),
            None if map.machine.is_some() => None,
            None => attached_campaign(&read, &file)?,
        };
        Ok(Recorded::of(file, read, campaign))
    }

    /// As [`read`](Recorded::read), for all recordings of a run directory, each with its valid steps: a resumed run has several.
    pub fn read_run(
        registry: &Registry,
        path: &Path,
        map: &ChannelMap,
        given: Option<&Campaign>,
    ) -> Result<Vec<Recorded>, SessionError> {
        let Some(mut interrupted) = resumed_run(path)? else {
            return Ok(vec![Recorded::read(registry, path, map, given)?]);
        };
        let mut recorded = Vec::new();
        for (place, part) in interrupted.parts.iter().enumerate() {
            match Recorded::read(registry, &path.join(&part.recording), map, given) {
                Err(_) if part.is_empty() => {}
                read => recorded.push((place, read?)),
            }
        }
        if let Some(campaign) = recorded.first().and_then(|(_, first)| first.campaign.as_ref()) {
            interrupted.discard_superseded_steps(campaign)?;
        }
        let parts = &interrupted.parts;
        let with_parts = recorded.into_iter().map(|(place, recorded)| {
            (parts.get(place).map_or((false, None), |part| (part.soaked, Some(&part.saved))), recorded)
        });
        Ok(merge_parts(with_parts))
    }

    pub(crate) fn of(path: PathBuf, mut read: ReadReport, campaign: Option<Campaign>) -> Recorded {
        let approaches = read.recording.split_off_approaches();
        Recorded { path, read, campaign, approaches }
    }

    /// Returns the campaign, or an error if the machine is unknown.
    pub fn require_campaign(&self) -> Result<&Campaign, SessionError> {
        self.campaign.as_ref().ok_or(SessionError::MachineUnknown { channel_map_suffices: false })
    }
}

/// The recordings of a run, each with its valid steps (of the last all complete ones); no empty parts, nothing twice.
pub(crate) fn merge_parts<'a>(
    parts: impl ExactSizeIterator<Item = ((bool, Option<&'a BTreeSet<usize>>), Recorded)>,
) -> Vec<Recorded> {
    let last_part = parts.len().saturating_sub(1);
    let mut all: Vec<Recorded> = Vec::with_capacity(parts.len());
    for (place, ((soaked, saved), mut recorded)) in parts.enumerate() {
        if let Some(saved) = saved.filter(|_| place < last_part) {
            let approaches = recorded.approaches.iter_mut().map(|approaches| &mut approaches.steps);
            let steps = std::iter::once(&mut recorded.read.recording.steps).chain(approaches);
            steps.for_each(|steps| steps.retain(|step| saved.contains(&step.index)));
            if !soaked && saved.is_empty() {
                continue;
            }
        }
        let Recording { series, steps, .. } = &mut recorded.read.recording;
        // What a simulator has repeated is one recording, with the steps of both.
        all.retain(|Recorded { read: ReadReport { recording: earlier, .. }, .. }| {
            let is_repeated = !series.is_empty() && earlier.series == *series;
            for step in earlier.steps.iter().filter(|_| is_repeated) {
                steps.retain(|later| later.end_s <= step.start_s || step.end_s <= later.start_s);
                steps.push(*step);
            }
            steps.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
            !is_repeated
        });
        all.push(recorded);
    }
    all
}

fn resumed_run(path: &Path) -> Result<Option<InterruptedRun>, SessionError> {
    match InterruptedRun::read(path) {
        Ok(interrupted) => Ok(Some(interrupted).filter(|interrupted| interrupted.parts.len() > 1)),
        Err(_) if path.join(run_directory::further_recording(2)).exists() => {
            Err(SessionError::SeveralRecordings(path.to_owned()))
        }
        Err(_) => Ok(None),
    }
}

/// Rejects a recording given twice, even renamed or cut: its noise is no new evidence. Parts of a run may share noiseless samples.
pub fn check_all_distinct<'a>(recorded: impl IntoIterator<Item = &'a Recorded>) -> Result<(), SessionError> {
    let recorded: Vec<&Recorded> = recorded.into_iter().collect();
    if recorded.len() < 2 {
        return Ok(());
    }
    let rows: Vec<_> = recorded.iter().map(|one| distinct_rows(&one.read.recording)).collect();
    let part_of = |one: &Recorded| {
        run_directory::is_recording(&one.path).then(|| one.path.parent().map(Path::to_owned)).flatten()
    };
    for (second, first) in
        (0..recorded.len()).flat_map(|second| (0..second).map(move |first| (second, first)))
    {
        let (a, b) = (recorded[first], recorded[second]);
        let common = || rows[first].intersection(&rows[second]).count();
        let same = a.read.recording.series == b.read.recording.series && !b.read.recording.series.is_empty();
        let of_one_run = a.path != b.path && part_of(a).is_some() && part_of(a) == part_of(b);
        if same || (!of_one_run && 2 * common() > rows[first].len().min(rows[second].len())) {
            return Err(SessionError::SameRecording([a.path.clone(), b.path.clone()]));
        }
    }
    Ok(())
}

/// The samples of N, m_c, P2 and T2 within steps to five digits, each once, so that a constant signal counts as one. With noise, two recordings have
/// hardly any in common; five digits survive an export as single-precision numbers. Soaks do not count: of simulated rigs with one seed they are equal.
fn distinct_rows(recording: &Recording) -> HashSet<[i64; 4]> {
    let five_digits = |value: f64| {
        let exponent = value.abs().log10().floor().clamp(-300.0, 300.0);
        (value / 10f64.powf(exponent - 4.0)).round() as i64
    };
    let channels = [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P2, Channel::T2];
    let series = channels.map(|channel| recording.series.get(&channel));
    let row = |t_s: f64| series.map(|one| one.and_then(|one| one.interpolate(t_s)).map_or(0, five_digits));
    let steps = recording.steps.iter();
    let times = steps.filter_map(|step| Some(series[3]?.slice(step.start_s, step.end_s).0));
    times.flatten().map(|t_s| row(*t_s)).collect()
}

pub(crate) fn attached_campaign(read: &ReadReport, file: &Path) -> Result<Option<Campaign>, SessionError> {
    let Some(text) = &read.campaign_text else { return Ok(None) };
    let origin = file.with_file_name(run_directory::CAMPAIGN);
    let checked = mapper_campaign::check(text, &origin, &read_next_to);
    Ok(Some(checked.map_err(|findings| CampaignError::Mistakes(Box::new(findings)))?))
}

/// Reads a file named by the campaign of a recording. A missing sequence script is not an error, because it is not needed here.
fn read_next_to(path: &Path) -> std::io::Result<String> {
    let text = mapper_campaign::read_text(path);
    if path.extension().is_some_and(|extension| extension == "rhai") {
        Ok(text.unwrap_or_default())
    } else {
        text
    }
}

/// Reads a channel map from a file.
pub fn channel_map(file: &Path) -> Result<ChannelMap, SessionError> {
    Ok(ChannelMap::load(file)?)
}

pub(crate) fn check_machine(recorded: &Recorded, campaign: &Campaign) -> Result<(), OtherMachine> {
    let machine = &campaign.machine;
    mapper_observe::same_machine(&recorded.read.metadata, &machine.name, machine.serial_number.as_deref())
}

#[derive(Debug)]
pub struct LogInspection {
    pub path: PathBuf,
    pub format: &'static str,
    pub layout: Layout,
    pub survey: Survey,
    pub proposal: Proposal,
    pub options: Vec<(String, String)>,
}

/// Reads a log once and proposes a channel map; `options`: of the log reader, `machine`: its campaign, whose map shows the unit of a flow.
pub fn inspect_log(
    registry: &Registry,
    path: &Path,
    options: Vec<(String, String)>,
    machine: Option<&Path>,
) -> Result<LogInspection, SessionError> {
    let mut reader_options = LogOptions::default();
    for (key, value) in &options {
        reader_options.set(key, value)?;
    }
    let (format, mut log) = registry.logs.open(&LogFile::from_path(path), &reader_options)?;
    let survey = survey(log.as_mut())?;
    let layout = log.layout().clone();
    let model = match machine {
        Some(campaign) => Some(mapper_campaign::nominal_model(&mapper_campaign::load(campaign)?)?),
        None => None,
    };
    let flows = model.as_ref().map(|model| {
        move |speed_rpm: f64| {
            (model.map.surge_point(speed_rpm).0, model.map.choke_flow_corrected_kg_s(speed_rpm))
        }
    });
    let proposal = propose(&layout, &survey, flows.as_ref().map(|flows| flows as NominalFlows<'_>));
    Ok(LogInspection { path: path.to_owned(), format: format.name, layout, survey, proposal, options })
}

impl LogInspection {
    /// Machine-readable output; missing numbers are null.
    pub fn json(&self) -> Value {
        let columns = self.layout.columns.iter().zip(&self.survey.columns).map(|(column, data)| {
            json!({
                "name": column.name,
                "header": column.header,
                "unit": column.unit,
                "description": column.description,
                "group": column.group,
                "count": data.count,
                "missing": data.missing,
                "min": data.min,
                "max": data.max,
            })
        });
        json!({
            "log": self.path,
            "format": self.format,
            "findings": JsonMessages(&self.layout.findings),
            "start_time_ns": self.layout.start_time_ns,
            "groups": self.layout.groups.iter().zip(&self.survey.groups).map(|(group, data)| {
                let mut value = json!(data);
                value["name"] = json!(group.name);
                value["clock"] = json!(group.clock);
                value
            }).collect::<Vec<_>>(),
            "columns": columns.collect::<Vec<_>>(),
            "proposal": self.proposal,
            "channel_map": self.channel_map(),
        })
    }

    pub fn channel_map(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        channel_map_text(&name, &self.layout, &self.proposal, &self.options)
    }
}
