//! `mapper drift`: whether the rig stayed the same while a map was made.

use crate::arguments::DriftArguments;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::zero::Zero;
use crate::{assembly_line, output, run_directory, table};
use mapper_campaign::Campaign;
use mapper_core::Recording;
use mapper_drift::{DriftError, DriftReport, DriftRequest, RecordedRun, RepeatGroup, diagnose};
use mapper_identify::{IdentifyConfig, WindowRule, ZeroSettings, isothermal_zero, zeroed};
use mapper_record::{ChannelMap, ReadOptions, ReadReport, RecordError, read_recording};
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Reads, judges, prints.
pub fn drift(arguments: &DriftArguments) -> Result<(), Failure> {
    let (files, campaign, map) = sources(arguments)?;
    let read =
        files.iter().map(|file| read_recording(file, &map, &ReadOptions::default()).map_err(bad_recording));
    let read: Vec<ReadReport> = read.collect::<Result<_, _>>()?;
    let campaign = match campaign {
        Some(campaign) => campaign,
        None => attached_campaign(&read, &files)?,
    };
    let (report, zero) = judge(&read, &files, &campaign, &map)?;
    if let Some(path) = &arguments.corrected {
        output::write_new(path, corrected_csv(&report).as_bytes())?;
    }
    let warnings: Vec<String> =
        read.iter().flat_map(|read| &read.warnings).map(ToString::to_string).collect();
    if arguments.json {
        let mut value = serde_json::to_value(&report).map_err(|error| Failure::new(Code::Failure, error))?;
        if let Some(object) = value.as_object_mut() {
            object.insert("recordings".to_owned(), json!(files));
            object.insert("zero".to_owned(), zero.json());
            object.insert("recording_warnings".to_owned(), json!(warnings));
        }
        return output::print_json(&value);
    }
    let mut text = text(&report);
    text.push_str(&zero.text());
    for warning in warnings {
        let _ = writeln!(text, "recording: {warning}");
    }
    output::print(&text)
}

/// Recordings, the campaign where one is given, and how the recordings are read.
fn sources(arguments: &DriftArguments) -> Result<(Vec<PathBuf>, Option<Campaign>, ChannelMap), Failure> {
    let map = match &arguments.channels {
        Some(file) => super::identify::channel_map(file)?,
        None => ChannelMap::native(),
    };
    if arguments.recording.is_empty() {
        let files = arguments.paths.iter().map(|path| run_directory::recording_of(path)).collect();
        return Ok((files, None, map));
    }
    let [campaign] = arguments.paths.as_slice() else {
        return Err(Failure::new(
            Code::BadInput,
            "with `--recording` one campaign is needed, which says what machine was recorded",
        ));
    };
    let campaign = mapper_campaign::load(campaign).map_err(Failure::of_campaign)?;
    let files = arguments.recording.iter().map(|path| run_directory::recording_of(path)).collect();
    Ok((files, Some(campaign), map))
}

fn bad_recording(error: RecordError) -> Failure {
    let code = match error {
        RecordError::Read { .. } => Code::Failure,
        _ => Code::BadRecording,
    };
    Failure::new(code, error)
}

/// The campaign attached to the first recording.
fn attached_campaign(read: &[ReadReport], files: &[PathBuf]) -> Result<Campaign, Failure> {
    let Some((text, file)) = read.first().and_then(|read| read.campaign_text.as_ref()).zip(files.first())
    else {
        return Err(Failure::new(
            Code::BadInput,
            "the machine is not known: the recording carries no campaign. Give it with \
             `mapper drift --recording FILE CAMPAIGN`",
        ));
    };
    let origin = file.with_file_name(run_directory::CAMPAIGN);
    mapper_campaign::check(text, &origin, &super::identify::read_beside).map_err(|findings| {
        Failure::of_campaign(mapper_campaign::CampaignError::Mistakes(Box::new(findings)))
    })
}

/// Why the campaign's machine is not the one recorded; `None` where it may be.
fn other_machine(read: &[ReadReport], campaign: &Campaign) -> Option<String> {
    let machine = &campaign.machine;
    for (index, read) in read.iter().enumerate() {
        let recorded = |key: &str| read.metadata.get(key);
        let named = recorded("machine").filter(|name| **name != machine.name);
        let numbered =
            recorded("serial_number").filter(|number| Some(*number) != machine.serial_number.as_ref());
        if let Some(other) = named.or(numbered) {
            return Some(format!(
                "No verdict: recording {} was made on machine `{other}`, the campaign names `{}`{}.",
                index + 1,
                machine.name,
                machine.serial_number.as_ref().map_or_else(String::new, |number| format!(" ({number})")),
            ));
        }
    }
    None
}

/// What is said of the recordings, in the order in which they were made, and the zero that was taken off them.
pub fn judge(
    read: &[ReadReport],
    files: &[PathBuf],
    campaign: &Campaign,
    map: &ChannelMap,
) -> Result<(DriftReport, Zero), Failure> {
    if let Some(reason) = other_machine(read, campaign) {
        return Ok((DriftReport::without_verdict(reason), Zero::NotAsked));
    }
    let model = assembly_line::nominal_model(campaign)?;
    let identification = identification(campaign, map);
    let (recordings, identification, zero) = zeroed_alike(read, identification, campaign);
    let fingerprints: Vec<Option<String>> =
        read.iter().zip(files).map(|(read, file)| fingerprint(read, file)).collect();
    let runs: Vec<RecordedRun<'_>> = recordings
        .iter()
        .zip(&fingerprints)
        .map(|(recording, fingerprint)| RecordedRun { recording, fingerprint: fingerprint.as_deref() })
        .collect();
    let report = diagnose(&DriftRequest {
        runs: &runs,
        model: &model,
        boundary: campaign.boundary,
        identification: &identification,
        seed: campaign.seed,
    })
    .map_err(|error| {
        let code = match error {
            DriftError::NoRun => Code::BadInput,
            _ => Code::BadRecording,
        };
        Failure::new(code, error)
    })?;
    Ok((report, zero))
}

/// What the campaign declares, and what the channel map says of the sensors of this very recording before it.
fn identification(campaign: &Campaign, map: &ChannelMap) -> IdentifyConfig {
    let mut identification = assembly_line::identification(campaign);
    for (channel, declared) in &map.sensors {
        let known = identification.declared.get(channel).map_or(0.0, |known| known.gain_sigma_ratio);
        let gain_sigma_ratio = declared.gain_sigma_ratio.max(known);
        identification
            .declared
            .insert(*channel, mapper_core::DeclaredUncertainty { gain_sigma_ratio, ..*declared });
    }
    identification.noise_colour = map.noise_colour.unwrap_or(identification.noise_colour);
    if let Some(window) = map.window {
        identification.window = WindowRule::Fixed { start_s: window.start_s, end_s: window.end_s };
    }
    identification
}

/// The zero of the first run, taken off all: a zero of its own for each would hide what drifted between them.
fn zeroed_alike(
    read: &[ReadReport],
    config: IdentifyConfig,
    campaign: &Campaign,
) -> (Vec<Recording>, IdentifyConfig, Zero) {
    let as_read = || read.iter().map(|read| read.recording.clone()).collect();
    let Some(first) = read.first().filter(|_| campaign.zero.is_some()) else {
        return (as_read(), config, Zero::NotAsked);
    };
    match isothermal_zero(&first.recording, &config, &ZeroSettings::default()) {
        Ok(zero) => {
            let off = |read: &ReadReport| zeroed(read.recording.clone(), config.clone(), &zero).0;
            let recordings = read.iter().map(off).collect();
            let config = zeroed(Recording::default(), config, &zero).1;
            (recordings, config, Zero::Found(zero))
        }
        Err(error) => (as_read(), config, Zero::Refused(error.to_string())),
    }
}

/// What has to be the same in all runs: machine, boundary conditions, points and their timing. Seed, name, rig and what is
/// written may differ from night to night.
fn fingerprint(read: &ReadReport, file: &Path) -> Option<String> {
    let of_campaign = |text: &String| {
        let origin = file.with_file_name(run_directory::CAMPAIGN);
        let campaign = mapper_campaign::check(text, &origin, &super::identify::read_beside).ok()?;
        let mapper_core::Timing { dwell_s, .. } = campaign.timing;
        let same = (&campaign.machine, campaign.boundary, campaign.follow_outlet, &campaign.points, dwell_s);
        serde_json::to_string(&same).ok()
    };
    let of_hashes =
        || Some(format!("{} {}", read.metadata.get("campaign_sha256")?, read.metadata.get("model_sha256")?));
    read.campaign_text.as_ref().and_then(of_campaign).or_else(of_hashes)
}

/// The answer for people.
fn text(report: &DriftReport) -> String {
    let mut text = format!("{}\n", report.reason);
    if let (Some(low), Some(high), Some(unit)) = (report.low, report.high, report.unit) {
        let _ = writeln!(
            text,
            "95 % interval: {low:.4} to {high:.4} {unit}{}",
            match report.size {
                Some(mapper_drift::RateOrStep::RatePerH(_)) => " per hour",
                _ => "",
            }
        );
    }
    if let (Some(low_s), Some(high_s)) = (report.onset_low_s, report.onset_high_s) {
        let _ = writeln!(text, "Onset: {low_s:.0} s to {high_s:.0} s of the campaign.");
    }
    if report.probability > 0.0 {
        let cause = |cause: Option<mapper_drift::Cause>| cause.map_or("no drift", mapper_drift::Cause::name);
        let _ = write!(text, "Probability: {} {:.1} %", cause(report.cause), 100.0 * report.probability);
        for alternative in report.alternatives.iter().filter(|other| other.probability > 5e-4).take(4) {
            let _ = write!(text, ", {} {:.1} %", cause(alternative.cause), 100.0 * alternative.probability);
        }
        text.push_str(".\n");
    }
    for group in &report.groups {
        let _ = write!(text, "\nFrom {} to {}\n{}\n", group.from, group.to, group_table(group));
    }
    if !report.detection_limits.is_empty() {
        text.push_str("\nSmallest steady drift over the campaign that is seen:");
        for limit in &report.detection_limits {
            let _ = match limit.unit {
                "1" => write!(text, " {} {:.2} %,", limit.cause, 100.0 * limit.change),
                unit if limit.change < 1e-3 => write!(text, " {} {:.1e} {unit},", limit.cause, limit.change),
                unit => write!(text, " {} {:.3} {unit},", limit.cause, limit.change),
            };
        }
        text.pop();
        text.push_str(".\n");
    }
    text
}

fn group_table(group: &RepeatGroup) -> comfy_table::Table {
    let symbols: Vec<&str> =
        group.visits.first().map(|visit| visit.channels.keys().copied().collect()).unwrap_or_default();
    let mut heads: Vec<String> =
        ["t s", "eta %", "+/- points", "h W/(m2 K)", "+/- W/(m2 K)"].map(str::to_owned).to_vec();
    heads.extend(symbols.iter().map(|symbol| format!("d {symbol}")));
    let mut table = table::with_heads(&heads);
    for visit in &group.visits {
        let mut row = vec![
            format!("{:.0}", visit.t_s),
            table::number(visit.eta.map(|eta| 100.0 * eta), 2),
            table::number(visit.sigma_eta.map(|sigma| 196.0 * sigma), 2),
            table::number(visit.h_w_m2k, 0),
            table::number(visit.sigma_h_w_m2k.map(|sigma| 1.96 * sigma), 0),
        ];
        row.extend(symbols.iter().map(|symbol| {
            // Against the first visit, what the boundary conditions do taken out.
            let first = group.visits.first().and_then(|first| first.channels.get(symbol));
            let change = visit
                .channels
                .get(symbol)
                .zip(first)
                .map(|(now, first)| now.end_less_model - first.end_less_model);
            let decimals = if symbol.starts_with("m_") { 6 } else { 2 };
            table::number(change, decimals)
        }));
        table.add_row(row);
    }
    table
}

/// Corrected points for other programs.
fn corrected_csv(report: &DriftReport) -> String {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let mut text =
        "run,step,speed_rpm,valve,eta,sigma_eta,h_w_m2k,eta_identified,eta_uncorrected,correction\n"
            .to_owned();
    for point in &report.corrected_points {
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{}",
            point.run,
            point.step,
            point.speed_rpm,
            point.valve,
            point.eta,
            point.sigma_eta,
            point.h_w_m2k,
            number(point.eta_identified),
            number(point.eta_uncorrected),
            point.correction,
        );
    }
    text
}
