//! `mapper map rig`: what a run gave beside the compressor's map.

use super::identify::{bad_recording, read_beside};
use crate::arguments::MapRigArguments;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::{assembly_line, output, run_directory};
use mapper_campaign::{Campaign, CampaignError};
use mapper_core::IdentifiedPoint;
use mapper_formats::{
    ErrorAtGradient, ThermalExport, error_figure, heat_transfer_figure, turbine_points, turbine_text,
};
use mapper_record::{ChannelMap, ReadOptions, ReadReport, read_recording};
use mapper_score::ScoredPoint;
use serde_json::json;
use std::path::PathBuf;

/// Identifies a recording by its campaign's method and writes thermal model, turbine and pictures.
pub fn rig(arguments: &MapRigArguments) -> Result<(), Failure> {
    let path = run_directory::recording_of(&arguments.recording);
    let report =
        read_recording(&path, &ChannelMap::native(), &ReadOptions::default()).map_err(bad_recording)?;
    let campaign = campaign(arguments, &report)?;
    let mut config = assembly_line::identification(&campaign);
    config.method = campaign.identification.method;
    let identified = mapper_identify::identify_recording(&report.recording, &config)
        .map_err(|error| Failure::new(Code::BadRecording, error))?;
    let points: Vec<IdentifiedPoint> = identified.points.into_iter().filter_map(Result::ok).collect();
    let scored =
        mapper_score::score(&path, &report.recording.steps, points.clone()).map_err(bad_recording)?;

    let machine = &campaign.machine.name;
    let params = &campaign.machine.params;
    let thermal = ThermalExport { machine, params, found: identified.thermal.as_ref() };
    let turbine = turbine_points(&report.recording, &points);
    let law = identified.thermal.as_ref().and_then(|found| found.convection.as_ref()?.exponent.value);
    let exponent = law.unwrap_or(params.compressor.nusselt_exponent);
    let heat = heat_transfer_figure(machine, &points, exponent);
    let export = |error: mapper_core::ExportError| Failure::new(Code::Failure, error);
    let png = |figure: &mapper_chart::Figure| figure.to_png(2.0).map_err(|e| Failure::new(Code::Failure, e));
    let mut files: Vec<(&str, Vec<u8>)> = vec![
        ("thermal_model.json", thermal.json().map_err(export)?),
        ("thermal_model.txt", thermal.text().into_bytes()),
        ("turbine.txt", turbine_text(machine, &turbine).into_bytes()),
        ("turbine.json", (output::to_json(&turbine)? + "\n").into_bytes()),
        ("heat_transfer.svg", heat.to_svg().into_bytes()),
        ("heat_transfer.png", png(&heat)?),
    ];
    let errors = errors(&scored);
    if !errors.is_empty() {
        let figure = error_figure(machine, &errors);
        files.push(("error.svg", figure.to_svg().into_bytes()));
        files.push(("error.png", png(&figure)?));
    }
    std::fs::create_dir_all(&arguments.out).map_err(|error| {
        Failure::new(Code::Failure, format!("failed to create {}: {error}", arguments.out.display()))
    })?;
    let mut written: Vec<PathBuf> = Vec::new();
    for (name, bytes) in &files {
        let path = arguments.out.join(name);
        output::write_new(&path, bytes)?;
        written.push(path);
    }
    if arguments.json {
        return output::print_json(&json!({
            "files": written,
            "turbine": turbine,
            "thermal": identified.thermal,
        }));
    }
    let lines: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    output::print(&(lines.join("\n") + "\n"))
}

/// Errors of the points whose truth is known.
fn errors(points: &[ScoredPoint]) -> Vec<ErrorAtGradient> {
    points
        .iter()
        .filter_map(|ScoredPoint { point, truth }| {
            Some(ErrorAtGradient {
                dt2_k: point.dt2_k?,
                eta_error: point.eta? - truth.as_ref()?.eta,
                eta_half_interval: point.eta_low.zip(point.eta_high).map(|(low, high)| 0.5 * (high - low)),
                verdict: point.verdict,
            })
        })
        .collect()
}

fn campaign(arguments: &MapRigArguments, report: &ReadReport) -> Result<Campaign, Failure> {
    if let Some(path) = &arguments.campaign {
        return mapper_campaign::load(path).map_err(Failure::of_campaign);
    }
    let Some(text) = &report.campaign_text else {
        let message = "the machine is not known: the recording carries no campaign; give `--campaign FILE`";
        return Err(Failure::new(Code::BadInput, message));
    };
    let origin = arguments.recording.join(run_directory::CAMPAIGN);
    mapper_campaign::check(text, &origin, &read_beside)
        .map_err(|findings| Failure::of_campaign(CampaignError::Mistakes(Box::new(findings))))
}
