//! `mapper identify`: from a recording to points, without a rig.

use crate::arguments::IdentifyArguments;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::results;
use crate::thermal_text;
use crate::zero::{self, Zero};
use crate::{assembly_line, output, run_directory};
use mapper_campaign::{Campaign, CampaignError};
use mapper_core::ReferenceState;
use mapper_identify::{IdentifyConfig, WindowRule};
use mapper_record::{ChannelMap, ChannelMapError, ReadOptions, ReadReport, RecordError, read_recording};
use serde_json::json;
use std::path::Path;

/// Identifies all steps of a recording.
pub fn identify(arguments: &IdentifyArguments) -> Result<(), Failure> {
    let path = run_directory::recording_of(&arguments.recording);
    let map = match &arguments.channels {
        Some(file) => channel_map(file)?,
        None => ChannelMap::native(),
    };
    let report = read_recording(&path, &map, &ReadOptions::default()).map_err(bad_recording)?;
    let (mut config, campaign) = config(arguments, &map, &report)?;
    if let Some(method) = arguments.method {
        config.method = method.into();
    }
    let display = campaign.as_ref().map(|campaign| campaign.display.clone()).unwrap_or_default();
    let (recording, config, zero) = match &campaign {
        Some(campaign) => zero::apply(report.recording, config, campaign),
        None => (report.recording, config, Zero::NotAsked),
    };
    let identified = mapper_identify::identify_recording(&recording, &config)
        .map_err(|error| Failure::new(Code::BadRecording, error))?;
    let thermal = identified.thermal;
    let points = identified.points.into_iter().filter_map(Result::ok).collect();
    let points = mapper_score::score(&path, &recording.steps, points).map_err(bad_recording)?;
    if arguments.json {
        return output::print_json(&json!({
            "recording": path,
            "reference": config.reference,
            "points": points,
            "thermal": thermal,
            "zero": zero.json(),
            "score": mapper_score::summarise(&points),
            "recording_warnings": report.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        }));
    }
    let mut text = results::points_text(&points, &display);
    if let Some(thermal) = &thermal {
        text.push_str(&thermal_text::thermal_text(thermal));
    }
    text.push_str(&zero.text());
    for warning in &report.warnings {
        text.push_str(&format!("recording: {warning}\n"));
    }
    output::print(&text)
}

/// A file named by the campaign of a recording. The sequence script, which identification does not need, may be missing.
pub fn read_beside(path: &Path) -> std::io::Result<String> {
    let text = std::fs::read_to_string(path);
    if path.extension().is_some_and(|extension| extension == "rhai") {
        Ok(text.unwrap_or_default())
    } else {
        text
    }
}

pub(super) fn bad_recording(error: RecordError) -> Failure {
    let code = match error {
        RecordError::Read { .. } => Code::Failure,
        _ => Code::BadRecording,
    };
    Failure::new(code, error)
}

pub fn channel_map(file: &Path) -> Result<ChannelMap, Failure> {
    ChannelMap::load(file).map_err(|error| match error {
        ChannelMapError::Mistakes(findings) => Failure::of_campaign(CampaignError::Mistakes(findings)),
        error => Failure::new(Code::Failure, error),
    })
}

/// Machine, sensors and window: from the campaign given, the channel map, or the campaign in the recording.
fn config(
    arguments: &IdentifyArguments,
    map: &ChannelMap,
    report: &ReadReport,
) -> Result<(IdentifyConfig, Option<Campaign>), Failure> {
    if let Some(path) = &arguments.campaign {
        let campaign = mapper_campaign::load(path).map_err(Failure::of_campaign)?;
        return Ok((assembly_line::identification(&campaign), Some(campaign)));
    }
    if let Some(machine) = &map.machine {
        let config = IdentifyConfig {
            alpha_area_ratio: machine.alpha_area_ratio,
            internal_area_m2: machine.compressor_internal_area_m2,
            reference: map.reference.unwrap_or(ReferenceState::SAE),
            window: map.window.map_or_else(WindowRule::default, |window| WindowRule::Fixed {
                start_s: window.start_s,
                end_s: window.end_s,
            }),
            declared: map.sensors.clone(),
            noise_colour: map.noise_colour.unwrap_or_default(),
            ..IdentifyConfig::default()
        };
        return Ok((config, None));
    }
    if let Some(text) = &report.campaign_text {
        let origin = arguments.recording.join(run_directory::CAMPAIGN);
        let campaign = mapper_campaign::check(text, &origin, &read_beside).map_err(|findings| {
            Failure::of_campaign(mapper_campaign::CampaignError::Mistakes(Box::new(findings)))
        })?;
        return Ok((assembly_line::identification(&campaign), Some(campaign)));
    }
    Err(Failure::new(
        Code::BadInput,
        "the machine is not known: the recording carries no campaign. Give `--campaign FILE`, or `machine:` with \
         `compressor_internal_area` in the channel map",
    ))
}
