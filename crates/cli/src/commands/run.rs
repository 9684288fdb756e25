//! `mapper run`: the whole way from a campaign to a map.

use crate::arguments::RunArguments;
use crate::commands::plan as plan_command;
use crate::drive::{self, soak_s};
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::observers::{Progress, Recorder};
use crate::registry::{BackendContext, make_backend};
use crate::results;
use crate::sequence_run::{ScriptedSteps, rehearse};
use crate::{assembly_line, interrupt, output, run_directory};
use mapper_campaign::Campaign;
use mapper_core::{Backend, Plan};
use mapper_record::{RecordingHeader, RecordingWriter};
use mapper_runner::{PlanSteps, RunEnd, RunError, RunObserver, StepSource};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Plans, runs, records, identifies, assembles, reports.
pub fn run(arguments: &RunArguments) -> Result<(), Failure> {
    let campaign = mapper_campaign::load(&arguments.campaign).map_err(Failure::of_campaign)?;
    let model = assembly_line::nominal_model(&campaign)?;
    // A script is rehearsed first: what fails on the nominal machine never touches the rig.
    let made = match &campaign.sequence {
        None => assembly_line::plan(&campaign, &model)?,
        Some(source) => rehearse(&campaign, &model, source)?.plan,
    };
    let plan = match &arguments.plan {
        None => made.clone(),
        Some(path) => stored_plan(path, &made)?,
    };
    let mut scripted = match &campaign.sequence {
        Some(source) if arguments.plan.is_none() => Some(ScriptedSteps::new(&campaign, &model, source)?),
        _ => None,
    };
    let mut backend = make_backend(&BackendContext { campaign: &campaign, model: &model })
        .map_err(|error| Failure::of_backend(&error, &arguments.campaign))?;
    Failure::check_formats(&campaign, &arguments.campaign)?;
    let parent = arguments.out.clone().unwrap_or_else(|| PathBuf::from(&campaign.outputs.directory));
    if arguments.dry_run {
        return dry_run(arguments, &campaign, &plan, backend.as_ref(), &parent);
    }
    let started = jiff::Timestamp::now();
    let directory =
        run_directory::create(&parent, &campaign.name, &started.strftime("%Y%m%dT%H%M%SZ").to_string())?;
    let campaign_text = std::fs::read(&arguments.campaign).map_err(|error| {
        Failure::new(Code::Failure, format!("failed to read {}: {error}", arguments.campaign.display()))
    })?;
    let plan_json = output::to_json(&plan)? + "\n";
    output::write_new(&directory.join(run_directory::CAMPAIGN), &campaign_text)?;
    output::write_new(&directory.join(run_directory::PLAN), plan_json.as_bytes())?;
    if let Some(source) = &campaign.sequence {
        output::write_new(&directory.join(run_directory::SEQUENCE), source.text.as_bytes())?;
    }

    let recording = directory.join(run_directory::RECORDING);
    let simulated = backend.describe().simulated_time;
    let header = RecordingHeader {
        library: concat!("mapper ", env!("CARGO_PKG_VERSION")).to_owned(),
        profile: String::new(),
        // Simulated time starts at 0, so that equal seeds give equal bytes.
        start_time_ns: if simulated { 0 } else { u64::try_from(started.as_nanosecond()).unwrap_or(0) },
        metadata: metadata(&campaign, &plan),
        plan_json: Some(plan_json.into_bytes()),
        campaign_yaml: Some(campaign_text),
    };
    let writer =
        RecordingWriter::create(&recording, &header).map_err(|error| Failure::new(Code::Failure, error))?;
    let mut planned = PlanSteps::new(&plan);
    let steps: &mut dyn StepSource = match &mut scripted {
        Some(scripted) => scripted,
        None => &mut planned,
    };
    let recorder = Recorder::new(writer);
    let mut drifted = None;
    let (end, recorder) = if campaign.on_drift.is_some()
        && let Some(mut watch) = assembly_line::drift_watch(&campaign, steps)
    {
        let driven = drive_and_show(&campaign, &plan, &mut watch, backend.as_mut(), recorder)?;
        drifted = watch.ended_by_drift().map(str::to_owned);
        driven
    } else {
        drive_and_show(&campaign, &plan, steps, backend.as_mut(), recorder)?
    };
    let finished = recorder.finish();
    if matches!(end, Ok(RunEnd::Completed)) {
        finished.map_err(|error| Failure::new(Code::Failure, error))?;
    }
    let plan = scripted.map_or(Ok(plan), |steps| -> Result<Plan, Failure> {
        let executed = steps.executed(&made);
        let text = output::to_json(&executed)? + "\n";
        output::write_new(&directory.join(run_directory::EXECUTED), text.as_bytes())?;
        Ok(executed)
    });
    let completed = matches!(end, Ok(RunEnd::Completed));
    // Whatever ended the run, what was recorded is identified.
    let outcome = match &drifted {
        Some(reason) => format!("Stopped ({reason}): the map is not complete."),
        None => outcome(&end),
    };
    let made = plan.and_then(|plan| results::make(&campaign, &plan, &outcome, &directory, &recording));
    match made {
        Ok(results) if arguments.json => output::print_json(&results.json())?,
        Ok(results) => output::print(&results.text(&campaign))?,
        Err(failure) if completed => return Err(failure),
        // Stopped before there was anything to identify: why it was stopped is what counts.
        Err(_) if arguments.json => {
            output::print_json(&json!({"run": directory, "recording": recording, "points": [], "map": {}}))?;
        }
        Err(_) => {}
    }
    match end {
        Ok(RunEnd::Completed) => match drifted {
            None => Ok(()),
            Some(reason) => {
                Err(Failure::new(Code::Rig, format!("{reason}. The rig is safe and the recording is kept")))
            }
        },
        Ok(RunEnd::Interrupted { t_s }) => Err(Failure::new(
            Code::Interrupted,
            format!("stopped by the operator at {t_s:.0} s; the rig is safe and the recording is kept"),
        )),
        Ok(RunEnd::Tripped(trip)) => Err(Failure::new(
            Code::Rig,
            format!(
                "stopped at {:.1} s: {}; the rig is safe and the recording is kept",
                trip.t_s, trip.reason
            ),
        )),
        Err(error) => Err(Failure::new(
            match error {
                RunError::Backend(_) => Code::Rig,
                RunError::Source(_) => Code::BadInput,
                RunError::Observer(_) => Code::Failure,
            },
            format!("{error}\nThe recording up to then is {}.", recording.display()),
        )),
    }
}

/// How a run ended, for its report.
fn outcome(end: &Result<RunEnd, RunError>) -> String {
    match end {
        Ok(RunEnd::Completed) => "Completed.".to_owned(),
        Ok(RunEnd::Interrupted { t_s }) => {
            format!("Stopped by the operator at {t_s:.0} s: the map is not complete.")
        }
        Ok(RunEnd::Tripped(trip)) => {
            format!("Stopped by a guard at {:.1} s ({}): the map is not complete.", trip.t_s, trip.reason)
        }
        // A script's error shows its line below the first one.
        Err(error) => {
            let text = error.to_string();
            let first = text.lines().next().unwrap_or_default();
            format!("Stopped by a fault ({first}): the map is not complete.")
        }
    }
}

type Driven = (Result<RunEnd, RunError>, Recorder);

fn drive_and_show(
    campaign: &Campaign,
    plan: &Plan,
    steps: &mut dyn StepSource,
    backend: &mut dyn Backend,
    mut recorder: Recorder,
) -> Result<Driven, Failure> {
    let stop = interrupt::stop_flag()?;
    let mut progress = Progress::new(plan, soak_s(campaign));
    let end = {
        let mut observers: Vec<&mut dyn RunObserver> = vec![&mut recorder, &mut progress];
        drive::drive(campaign, steps, backend, &mut observers, &stop)
    };
    progress.clear();
    Ok((end, recorder))
}

/// A plan from a file, refused when what it was made from has changed.
fn stored_plan(path: &Path, made: &Plan) -> Result<Plan, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        Failure::new(Code::Failure, format!("failed to read {}: {error}", path.display()))
    })?;
    let stored: Plan = serde_json::from_str(&text)
        .map_err(|error| Failure::new(Code::NoPlan, format!("{} is no plan: {error}", path.display())))?;
    let (then, now) = (&stored.made_from, &made.made_from);
    let changed: Vec<&str> = [
        ("the campaign", then.campaign_sha256 != now.campaign_sha256),
        ("the nominal model", then.model_sha256 != now.model_sha256),
        ("the sequence script", then.script_sha256 != now.script_sha256),
    ]
    .into_iter()
    .filter_map(|(what, changed)| changed.then_some(what))
    .collect();
    if changed.is_empty() {
        return Ok(stored);
    }
    Err(Failure::new(
        Code::NoPlan,
        format!(
            "{} is stale: {} changed since it was made; make it anew with `mapper plan CAMPAIGN --out FILE`",
            path.display(),
            changed.join(" and ")
        ),
    ))
}

fn metadata(campaign: &Campaign, plan: &Plan) -> BTreeMap<String, String> {
    let reference = campaign.reference;
    let mut metadata: BTreeMap<String, String> = [
        ("campaign", campaign.name.clone()),
        ("machine", campaign.machine.name.clone()),
        ("seed", campaign.seed.to_string()),
        ("program", concat!("mapper ", env!("CARGO_PKG_VERSION")).to_owned()),
        ("reference_temperature_k", reference.t_ref_k.to_string()),
        ("reference_pressure_pa", reference.p_ref_pa.to_string()),
        ("campaign_sha256", plan.made_from.campaign_sha256.clone()),
        ("model_sha256", plan.made_from.model_sha256.clone()),
    ]
    .into_iter()
    .map(|(key, value)| (key.to_owned(), value))
    .collect();
    let serial_number = campaign.machine.serial_number.clone();
    let script_sha256 = plan.made_from.script_sha256.clone();
    metadata.extend(script_sha256.map(|sha256| ("script_sha256".to_owned(), sha256)));
    metadata.extend(serial_number.map(|serial_number| ("serial_number".to_owned(), serial_number)));
    metadata.extend(campaign.report.operator.clone().map(|operator| ("operator".to_owned(), operator)));
    metadata
}

fn dry_run(
    arguments: &RunArguments,
    campaign: &Campaign,
    plan: &Plan,
    backend: &dyn Backend,
    parent: &Path,
) -> Result<(), Failure> {
    let rig = backend.describe();
    let would_write = parent.join(format!("{}-<time>", campaign.name));
    if arguments.json {
        return output::print_json(&json!({
            "dry_run": true,
            "rig": rig,
            "would_write": would_write,
            "soak_s": campaign.zero.map(|zero| zero.duration_s),
            "plan": plan,
        }));
    }
    let text = plan_command::text(campaign, plan);
    let samples = (soak_s(campaign) + plan.duration_s()) * rig.sample_rate_hz;
    output::print(&format!(
        "{text}Dry run: nothing was touched. The rig would be `{}` {}, {} channels at {} Hz ({samples:.0} samples), the \
         results would go to {}.\n",
        rig.backend,
        rig.version,
        rig.channels.len(),
        rig.sample_rate_hz,
        would_write.display(),
    ))
}
