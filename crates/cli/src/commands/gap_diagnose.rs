//! `mapper gap diagnose`: where a recording leaves the nominal model, why, how far that closes the gap, what is next.

use super::{gap_drift, gap_page, gap_text};
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::gap_arguments::DiagnoseArguments;
use crate::{assembly_line, output, registry, run_directory, zero};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mapper_campaign::Campaign;
use mapper_gap::calibration::Calibration;
use mapper_gap::diagnose::{Diagnosed, GapError, Question};
use mapper_gap::outlook::AllowedJump;
use mapper_observe::{Declared, same_machine};
use mapper_physics::model::Model;
use mapper_planner::PlanRequest;
use mapper_record::{ChannelMap, ReadOptions, ReadReport, RecordError, read_recording};
use std::io::IsTerminal;

/// Diagnoses one recording.
pub fn diagnose(arguments: &DiagnoseArguments) -> Result<(), Failure> {
    let campaign = mapper_campaign::load(&arguments.campaign).map_err(Failure::of_campaign)?;
    let map = match &arguments.channels {
        Some(file) => {
            let text = std::fs::read_to_string(file).map_err(|error| {
                Failure::new(Code::Failure, format!("failed to read {}: {error}", file.display()))
            })?;
            ChannelMap::from_yaml(&text)
                .map_err(|error| Failure::new(Code::BadInput, format!("{}: {error}", file.display())))?
        }
        None => ChannelMap::native(),
    };
    let path = run_directory::recording_of(&arguments.recording);
    let report = read_recording(&path, &map, &ReadOptions::default()).map_err(|error| {
        let code = if matches!(error, RecordError::Read { .. }) { Code::Failure } else { Code::BadRecording };
        Failure::new(code, error)
    })?;
    let machine = &campaign.machine;
    same_machine(&report.metadata, &machine.name, machine.serial_number.as_deref())
        .map_err(|error| Failure::new(Code::BadRecording, error))?;
    let model =
        mapper_campaign::nominal_model(&campaign).map_err(|error| Failure::new(Code::BadInput, error))?;
    let drift = gap_drift::of(&report, &path, &campaign, &map);
    let recording = gap_drift::taken_off(report.recording.clone(), drift.as_ref());
    let mut identification = assembly_line::identification(&campaign);
    identification.declared = assembly_line::declared(&campaign, &map.sensors);
    // A zero leaves less of the offsets.
    let (recording, zeroed, zero) = zero::apply(recording, identification, &campaign);
    let declared = Declared {
        sensors: zeroed.declared,
        noise_colour: map.noise_colour.unwrap_or_default(),
        tolerances: campaign.tolerances,
        nominal: campaign.boundary,
    };
    let jumps = allowed_jumps(&campaign, &model)?;
    let bar = bar();
    let progress = |share: f64, what: &str| {
        bar.set_position((share * 100.0) as u64);
        bar.set_message(what.to_owned());
    };
    let done = mapper_gap::diagnose::diagnose(Question {
        recording: &recording,
        declared,
        model,
        effects: registry::effects_with(&arguments.effects)?,
        jumps,
        calibration: Calibration::shipped().map_err(|error| Failure::new(Code::Failure, error))?,
        progress: &progress,
    });
    bar.finish_and_clear();
    let mut done = done.map_err(|error: GapError| Failure::new(Code::BadRecording, error))?;
    note_reading(&report, &mut done);
    gap_drift::note(&mut done.diagnosis, drift.as_ref());
    if let Some(file) = &arguments.html {
        let title = path.display().to_string();
        output::write_new(file, gap_page::page(&title, &done).as_bytes())?;
    }
    if arguments.json {
        let mut value = gap_drift::json(&done.diagnosis, drift.as_ref())?;
        value["zero"] = zero.json();
        return output::print_json(&value);
    }
    output::print(&(gap_text::page(&done.diagnosis) + zero.text().as_str()))
}

/// Points up to which every jump between them is simulated to see whether it is allowed.
const MOST_POINTS: usize = 40;

/// The jumps that the planner allows between the points of the campaign; none for grids too large to simulate them all,
/// and for campaigns that are no grid.
fn allowed_jumps(campaign: &Campaign, model: &Model) -> Result<Vec<AllowedJump>, Failure> {
    if campaign.points.len() > MOST_POINTS {
        return Ok(Vec::new());
    }
    assembly_line::with_plan_request(campaign, model, |request| {
        // Whether a jump is allowed does not hang on what it would tell.
        let request = PlanRequest { method: None, ..request.clone() };
        let Ok(graph) = mapper_planner::jump_graph(&request) else { return Ok(Vec::new()) };
        let allowed = graph.edge_weights().filter(|jump| jump.rejections.is_empty());
        Ok(allowed
            .map(|jump| AllowedJump {
                from: jump.from,
                to: jump.to,
                from_p3_pa: jump.p3_pa - jump.p3_change_pa,
                to_p3_pa: jump.p3_pa,
                dwell_s: request.timing.dwell_s,
            })
            .collect())
    })
}

/// What was wrong with the file belongs to what is said about it.
fn note_reading(report: &ReadReport, done: &mut Diagnosed) {
    done.diagnosis.warnings.extend(report.warnings.iter().map(ToString::to_string));
}

/// A bar that draws on a terminal alone.
fn bar() -> ProgressBar {
    let terminal = std::io::stderr().is_terminal();
    let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(100), target);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} % {msg}") {
        bar.set_style(style);
    }
    bar
}
