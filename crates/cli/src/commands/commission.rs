//! `mapper rig commission`.

use crate::commands::run::{ending_failure, expand_home};
use crate::environment::{SystemClock, registry, rig_states_directory, today};
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_campaign::{actuator_lines, read_named_file, with_actuators};
use mapper_core::{PacedClock, UnpacedClock};
use mapper_recording::ChannelMap;
use mapper_report::{
    commissioning_document, commissioning_json, plan_document, values_to_declare, with_messages,
};
use mapper_session::{
    Commissioning, Existing, Phase, Recorded, RecordedRun, RunRequest, Session, SessionError, SessionEvent,
    load_on, nominal_model, write_file,
};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Measure the motion of P3, valve and T3 with a few small steps, and compare it with the campaign
#[derive(Debug, Args)]
pub struct Commission {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Only show the steps and their duration; nothing moves
    #[arg(long)]
    pub dry_run: bool,
    /// Put the values that differ into the campaign file; comments stay
    #[arg(long, conflicts_with = "dry_run")]
    pub write: bool,
    /// Parent of the run directory, instead of the campaign's `outputs.directory`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

impl Commission {
    pub fn run(&self, states: Option<&Path>, as_json: bool) -> Result<(), Failure> {
        let (campaign, text) = load_on(&self.campaign, today()).map_err(Failure::of_campaign)?;
        let commissioning = Commissioning::new(&campaign, &nominal_model(&campaign)?)?;
        let parent = self.out.clone().unwrap_or_else(|| expand_home(&campaign.outputs.directory));
        let started = jiff::Timestamp::now();
        let (registry, stop, progress) = (registry(), interrupt::run_stop()?, output_options::progress());
        let states = rig_states_directory(states);
        let on_event = |event: &SessionEvent| {
            if matches!(event, SessionEvent::RigReleased) {
                stop.enter(Phase::Results);
            }
            progress.show(event);
        };
        let session = Session {
            on_event: &on_event,
            stop: &stop.now,
            stop_after_step: &stop.after_step,
            ..Session::new(&registry)
        };
        let name = format!("commissioning-{}", started.strftime("%Y%m%dT%H%M%SZ"));
        let request = RunRequest {
            started_ns: u64::try_from(started.as_nanosecond()).unwrap_or(0),
            started_name: &name,
            rig_states: Some(&states),
            ..RunRequest::new(&campaign, &text, &parent)
        };
        let prepared = session
            .prepare_commissioning(&commissioning, request)
            .map_err(|error| Failure::in_campaign(error, &self.campaign))?;
        if !as_json {
            standard_output::show(&plan_document(&commissioning.campaign, prepared.plan()))?;
        }
        if self.dry_run {
            let dry_run = || json!({"dry_run": true, "rig": prepared.rig(), "plan": prepared.plan()});
            return if as_json { standard_output::print_json(&with_messages(dry_run)) } else { Ok(()) };
        }
        stop.enter(Phase::Rig);
        let (_, run) = match prepared.rig().simulated_time {
            true => prepared.record_paced(&session, &mut UnpacedClock, false)?,
            false => prepared.record_paced(&session, &mut PacedClock::new(SystemClock::new(), 1.0), true)?,
        };
        let RecordedRun { directory, recording, end, .. } = run;
        progress.clear();
        let end = end.map_err(|source| SessionError::Run { source, recording: recording.clone() })?;
        if let Some(failure) = ending_failure(&end) {
            return Err(failure);
        }
        let read = Recorded::read(&registry, &directory, &ChannelMap::native(), Some(&campaign))?;
        let values = commissioning.measure(&read.read.recording);
        if values.is_empty() {
            let message = "no actuator could be measured: the rig must read P3, m_c, P2, T2 and T3";
            return Err(Failure::new(Code::BadRecording, message));
        }
        let lines = actuator_lines(&values_to_declare(&values));
        let different: Vec<_> = values.iter().copied().filter(|value| !value.agrees()).collect();
        if as_json {
            let actuators = commissioning_json(&values);
            let run =
                json!({"run": directory, "recording": recording, "lines": lines, "actuators": actuators});
            standard_output::print_json(&run)?;
        } else {
            standard_output::show(&commissioning_document(&values))?;
            if !self.write && !different.is_empty() {
                standard_output::print(&format!("\n{lines}"))?;
            }
        }
        if self.write && !different.is_empty() {
            self.write(&text, &values_to_declare(&different), as_json)?;
        }
        Ok(())
    }

    fn write(&self, text: &str, values: &[(&str, &str, String)], as_json: bool) -> Result<(), Failure> {
        let path = &self.campaign;
        let changed = with_actuators(text, path, values)
            .filter(|changed| mapper_campaign::check(changed, path, &read_named_file).is_ok());
        let Some(changed) = changed else {
            let lines = actuator_lines(values);
            let message =
                format!("the values do not fit into {}; enter them by hand:\n{lines}", path.display());
            return Err(Failure::new(Code::BadInput, message));
        };
        write_file(path, changed.as_bytes(), Existing::Replaced)?;
        if as_json {
            return Ok(());
        }
        standard_output::print(&format!("\n{}:\n{}", path.display(), difference(text, &changed)))
    }
}

/// The lines that only one of the texts has, those before with `-`, those after with `+`.
fn difference(before: &str, after: &str) -> String {
    let only = |mark: &str, lines: &str, others: &str| -> String {
        let new = lines.lines().filter(|line| !others.lines().any(|other| other == *line));
        new.map(|line| format!("{mark} {line}\n")).collect()
    };
    only("-", before, after) + only("+", after, before).as_str()
}
