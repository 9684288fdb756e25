//! `mapper run`: runs a campaign and makes the map.

use crate::environment::{SystemClock, registry, rig_states_directory, today};
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use crate::terminal::{DetailLevel, results_text};
use clap::Args;
use mapper_campaign::Campaign;
use mapper_core::{PacedClock, RunEnding, Trip, Verdict};
use mapper_live::{Live, LiveRun, TlsFiles, parse_address};
use mapper_report::{plan_document, with_messages};
use mapper_session::recording::run_directory;
use mapper_session::{
    InterruptedRun, Operator, Phase, PreparedRun, RunOutcome, RunRequest, Session, SessionError,
    SessionEvent, load_on, soak_s,
};
use serde_json::json;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Run a campaign: plan, drive the rig, record, identify, assemble the map, report
#[derive(Debug, Args)]
pub struct Run {
    /// Campaign file (YAML)
    #[arg(required_unless_present = "resume")]
    pub campaign: Option<PathBuf>,
    /// Resume an interrupted run from its directory; machine, campaign, plan and backend must be unchanged
    #[arg(long, value_name = "RUN", conflicts_with_all = ["plan", "out", "dry_run"])]
    pub resume: Option<PathBuf>,
    /// With --resume: run steps again that the journal lists as saved and no recording contains
    #[arg(long, requires = "resume")]
    pub repeat_lost: bool,
    /// Run this stored plan instead of making one; campaign and model must be unchanged
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Only show the plan and the files that would be written
    #[arg(long)]
    pub dry_run: bool,
    /// Parent of the run directory, instead of the campaign's `outputs.directory`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Pace of the rig's time: 1 is real time, 10 ten times as fast [default: real time; as fast as possible for a simulated rig]
    #[arg(long, value_name = "FACTOR", value_parser = parse_pace, hide_short_help = true)]
    pub pace: Option<f64>,
    /// Serve a live page with buttons to hold and to stop; other computers need the printed token
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "7373", value_parser = parse_address)]
    pub live: Option<SocketAddr>,
    /// Serve it over TLS with this certificate (PEM)
    #[arg(long, value_name = "FILE", requires_all = ["live", "live_key"], hide_short_help = true)]
    pub live_cert: Option<PathBuf>,
    /// Private key of that certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "live_cert", hide_short_help = true)]
    pub live_key: Option<PathBuf>,
    #[command(flatten)]
    pub shown: DetailLevel,
    /// End with one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

fn parse_pace(text: &str) -> Result<f64, String> {
    let pace = text.parse().ok().filter(|pace: &f64| pace.is_finite() && *pace > 0.0);
    pace.ok_or_else(|| "write a number above 0: 1 is real time, 10 ten times as fast".to_owned())
}

impl Run {
    pub fn run(&self) -> Result<(), Failure> {
        let stored_campaign = self.resume.as_ref().map(|run| run.join(run_directory::CAMPAIGN));
        let Some(file) = self.campaign.clone().or(stored_campaign) else { return Ok(()) };
        let (campaign, campaign_text) = load_on(&file, today()).map_err(Failure::of_campaign)?;
        let mut resume = self.resume.as_deref().map(InterruptedRun::read).transpose()?;
        resume.iter_mut().for_each(|interrupted| interrupted.repeats_lost = self.repeat_lost);
        let parent = self.out.clone().unwrap_or_else(|| expand_home(&campaign.outputs.directory));
        let started = jiff::Timestamp::now();
        let (registry, stop, progress) = (registry(), interrupt::run_stop()?, output_options::progress());
        progress.begin("planning");
        let states = rig_states_directory(None);
        let started_ns = u64::try_from(started.as_nanosecond()).unwrap_or(0);
        let tls = self.live_cert.clone().zip(self.live_key.clone());
        let tls = tls.map(|(certificate, key)| TlsFiles { certificate, key });
        let live = self.live.map(|address| Live::open(address, tls.as_ref())).transpose();
        let live = live.map_err(Failure::of_live)?;
        let on_event = |event: &SessionEvent| {
            if matches!(event, SessionEvent::RigReleased) {
                stop.enter(Phase::Results);
            }
            progress.show(event);
            live.iter().for_each(|live| live.show(event));
        };
        let operator = Arc::new(Operator::default());
        let session = Session {
            operator: live.is_some().then_some(&*operator),
            estimates: live.is_some(),
            registry: &registry,
            on_event: &on_event,
            stop: &stop.now,
            stop_after_step: &stop.after_step,
        };
        let request = RunRequest {
            campaign: &campaign,
            campaign_text: &campaign_text,
            plan: self.plan.as_deref(),
            parent: &parent,
            started_ns,
            started_name: &started.strftime("%Y%m%dT%H%M%SZ").to_string(),
            rig_states: Some(&states),
            resume,
        };
        let prepared = session.prepare(request).map_err(|error| Failure::in_campaign(error, &file))?;
        if self.dry_run {
            progress.clear();
            return self.print_dry_run(&campaign, &prepared, &parent);
        }
        stop.enter(Phase::Rig);
        let pace = self.pace.or((!prepared.rig().simulated_time).then_some(1.0));
        let live_run = LiveRun {
            campaign: &campaign,
            plan: prepared.plan(),
            pace,
            operator: operator.clone(),
            after_step: stop.after_step.clone(),
            now: stop.now.clone(),
        };
        if let Some(live) = &live {
            live.start(&live_run).map_err(Failure::of_live)?;
            live.warning().iter().for_each(|warning| standard_output::say(&format!("warning: {warning}\n")));
            standard_output::say(&format!("live page: {}\n", live.url()));
        }
        let outcome = match pace {
            Some(pace) => {
                prepared.run_paced(&session, &mut PacedClock::new(SystemClock::new(), pace), true)?
            }
            None => prepared.run(&session)?,
        };
        progress.clear();
        if let Some(live) = &live {
            let page = outcome.results.as_ref().ok().map(|results| results.page.as_path());
            live.end(&outcome.sentence(), page);
        }
        self.report_outcome(&campaign, outcome)
    }

    fn report_outcome(&self, campaign: &Campaign, outcome: RunOutcome) -> Result<(), Failure> {
        let RunOutcome { directory, recording, end, results } = outcome;
        let unusable = results.as_ref().is_ok_and(|results| {
            results.identified.points_alone().all(|point| point.verdict == Verdict::Unusable)
        });
        let unwritten = results.as_ref().ok().and_then(|results| results.unwritten.clone());
        let failure = match end {
            Ok(RunEnding::Completed) if unwritten.is_some() => {
                let unwritten = unwritten.unwrap_or_default();
                let message = format!("{unwritten} (`mapper run --resume {}`)", directory.display());
                Some(Failure::new(Code::Failure, message))
            }
            Ok(RunEnding::Completed) if unusable => Some(Failure::new(
                Code::BadRecording,
                "no point is usable; the reasons are listed above and in the report",
            )),
            Ok(ending) => ending_failure(&ending),
            Err(source) => {
                let recording = recording.clone();
                Some(SessionError::Run { source, recording }.into())
            }
        };
        match (results, &failure) {
            (Err(error), None) => return Err(error.into()),
            (Ok(results), _) if !self.json => {
                let full_command = format!("`mapper identify {} --full`", results.run.display());
                standard_output::show(&results_text(&campaign.display, &results, &full_command, self.shown))?;
            }
            // Without results, only the reason for the stop matters.
            (Err(_), Some(_)) if !self.json => {}
            (results, failure) => {
                let mut value = match results {
                    Ok(results) => {
                        with_messages(|| serde_json::to_value(&results)).map_err(SessionError::from)?
                    }
                    Err(_) => json!({"run": directory, "recording": recording, "points": [], "map": {}}),
                };
                if let Some(failure) = failure {
                    value["failure"] = failure.json();
                }
                standard_output::print_json(&value)?;
            }
        }
        failure.map_or(Ok(()), Err)
    }

    fn print_dry_run(&self, campaign: &Campaign, run: &PreparedRun<'_>, out: &Path) -> Result<(), Failure> {
        let (rig, plan) = (run.rig(), run.plan());
        let would_write = out.join(format!("{}-<time>", campaign.name));
        if self.json {
            let dry_run = || {
                json!({
                    "dry_run": true,
                    "rig": rig,
                    "would_write": would_write,
                    "soak_s": campaign.zero.map(|zero| zero.duration_s),
                    "plan": plan,
                })
            };
            return standard_output::print_json(&with_messages(dry_run));
        }
        let samples = (soak_s(campaign) + plan.duration_s()) * rig.sample_rate_hz;
        let mut document = plan_document(campaign, plan);
        document.text(format!(
            "Dry run: nothing was started or written. The rig is `{}` {}, {} channels at {} Hz ({samples:.0} samples); the results would be \
             in {}.",
            rig.backend,
            rig.version,
            rig.channels.len(),
            rig.sample_rate_hz,
            would_write.display(),
        ));
        standard_output::show(&document)
    }
}

pub(crate) fn ending_failure(ending: &RunEnding) -> Option<Failure> {
    const KEPT: &str = "the rig is safe and the recording is kept";
    Some(match ending {
        RunEnding::Completed => return None,
        RunEnding::Drifted { reason } => {
            Failure::new(Code::Rig, format!("{reason}. The rig is safe and the recording is kept"))
        }
        RunEnding::Interrupted { t_s } => {
            Failure::new(Code::Interrupted, format!("stopped by the operator at {t_s:.0} s; {KEPT}"))
        }
        RunEnding::Tripped(Trip { t_s, reason, .. }) => {
            Failure::new(Code::Rig, format!("stopped at {t_s:.1} s: {reason}; {KEPT}"))
        }
        // The runner reports a failure as an error; this is one that a file remembers.
        RunEnding::Failed { reason } => Failure::new(Code::Rig, format!("{reason}; {KEPT}")),
    })
}

/// A directory of a campaign, with `~` as in a shell.
pub(crate) fn expand_home(directory: &str) -> PathBuf {
    let home = std::env::var_os("HOME").filter(|home| !home.is_empty());
    match (directory.strip_prefix("~/"), home) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => PathBuf::from(directory),
    }
}
