//! `mapper run`: the whole way from a campaign to a map.

use crate::output::detail_options::ShownArguments;
use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::terminal::results_text;
use crate::wall_clock::SystemWall;
use crate::{
    interrupt,
    output::{output_options, standard_output},
    registry, rig_states,
};
use clap::Args;
use mapper_campaign::Campaign;
use mapper_core::{PacedClock, Verdict};
use mapper_live::{Asked, LiveError, LiveRun, Observers, TlsFiles};
use mapper_report::{plan_text, with_messages};
use mapper_session::{
    BrokenOff, Ended, Operator, Phase, PreparedRun, RunOutcome, RunRequest, Session, SessionError,
    SessionEvent, recording::run_directory, soak_s, start_time_ns,
};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Run a campaign: plan, drive the rig, record, identify, assemble the map, report
#[derive(Debug, Args)]
pub struct Run {
    /// Campaign file (YAML)
    #[arg(required_unless_present = "resume")]
    pub campaign: Option<PathBuf>,
    /// Go on with a run that was broken off, from its directory; refused when machine, campaign, plan or backend are others
    #[arg(long, value_name = "RUN", conflicts_with_all = ["plan", "out", "dry_run"])]
    pub resume: Option<PathBuf>,
    /// Run this stored plan instead of making one; refused when campaign or model have changed since
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Show the plan and what would be written, and touch nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Directory for the run's own directory, instead of the campaign's `outputs.directory`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Run the rig's time by the clock: 1 is real time, 10 ten times as fast; as fast as it goes if it is left out and the rig is simulated
    #[arg(long, value_name = "FACTOR", hide_short_help = true)]
    pub pace: Option<f64>,
    /// Serve a live page with buttons to hold and to stop; from other machines by the token that is printed
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:7373")]
    pub live: Option<String>,
    /// Serve it over TLS with this certificate (PEM)
    #[arg(long, value_name = "FILE", requires_all = ["live", "live_key"], hide_short_help = true)]
    pub live_cert: Option<PathBuf>,
    /// Private key of that certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "live_cert", hide_short_help = true)]
    pub live_key: Option<PathBuf>,
    /// Send readings, steps and points to Foxglove or Lichtblick on this machine
    #[cfg(feature = "foxglove")]
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:8765")]
    pub foxglove: Option<String>,
    #[command(flatten)]
    pub shown: ShownArguments,
    /// End with one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Run {
    /// Plans, runs, records, identifies, assembles, reports.
    pub fn run(&self) -> Result<(), Failure> {
        let kept = self.resume.as_ref().map(|run| run.join(run_directory::CAMPAIGN));
        let Some(file) = self.campaign.clone().or(kept) else { return Ok(()) };
        let campaign = mapper_campaign::load(&file).map_err(Failure::of_campaign)?;
        let campaign_text = mapper_campaign::read_text(&file).map_err(|error| {
            Failure::new(Code::Failure, format!("failed to read {}: {error}", file.display()))
        })?;
        let resume = self.resume.as_deref().map(BrokenOff::read).transpose()?;
        if self.pace.is_some_and(|pace| !(pace.is_finite() && pace > 0.0)) {
            return Err(Failure::new(Code::BadInput, "--pace takes a number above 0"));
        }
        let parent = self.out.clone().unwrap_or_else(|| in_home(&campaign.outputs.directory));
        let started = jiff::Timestamp::now();
        let (registry, stop, progress) =
            (registry::registry(), interrupt::run_stop()?, output_options::progress());
        progress.begin("planning");
        let states = rig_states::directory(None);
        let started_ns = u64::try_from(started.as_nanosecond()).unwrap_or(0);
        let onlookers = self.onlookers().map_err(Failure::of_live)?;
        let on_event = |event: &SessionEvent| {
            if matches!(event, SessionEvent::RigReleased) {
                stop.enter(Phase::Results);
            }
            progress.show(event);
            onlookers.show(event);
        };
        let operator = Arc::new(Operator::default());
        let session = Session {
            operator: onlookers.have_buttons().then_some(&*operator),
            estimates: onlookers.are_there(),
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
            return self.dry(&campaign, &prepared, &parent);
        }
        stop.enter(Phase::Rig);
        let pace = self.pace.or((!prepared.rig().simulated_time).then_some(1.0));
        let looked_at = LiveRun {
            campaign: &campaign,
            plan: prepared.plan(),
            pace,
            channels: &prepared.rig().channels,
            start_time_ns: start_time_ns(&prepared.rig(), started_ns),
            operator: operator.clone(),
            after_step: stop.after_step.clone(),
            now: stop.now.clone(),
        };
        for line in onlookers.begin(&looked_at).map_err(Failure::of_live)? {
            standard_output::warn(&format!("{line}\n"));
        }
        let outcome = match pace {
            Some(pace) => {
                prepared.run_paced(&session, &mut PacedClock::new(SystemWall::new(), pace), true)?
            }
            None => prepared.run(&session)?,
        };
        progress.clear();
        onlookers
            .end(&outcome.sentence(), outcome.results.as_ref().ok().map(|results| results.page.as_path()));
        self.report_outcome(&campaign, outcome)
    }

    fn onlookers(&self) -> Result<Observers<'_>, LiveError> {
        let tls = self.live_cert.clone().zip(self.live_key.clone());
        Observers::open(Asked {
            page: self.live.as_deref(),
            tls: tls.map(|(certificate, key)| TlsFiles { certificate, key }),
            #[cfg(feature = "foxglove")]
            viewers: self.foxglove.as_deref(),
        })
    }

    fn report_outcome(&self, campaign: &Campaign, outcome: RunOutcome) -> Result<(), Failure> {
        let RunOutcome { directory, recording, end, results } = outcome;
        let unusable = results.as_ref().is_ok_and(|results| {
            results.points.iter().all(|scored| scored.point.verdict == Verdict::Unusable)
        });
        let unwritten = results.as_ref().ok().and_then(|results| results.unwritten.clone());
        let kept = "the rig is safe and the recording is kept";
        let failure = match end {
            Ended::Completed if unwritten.is_some() => {
                Some(Failure::new(Code::Failure, unwritten.unwrap_or_default()))
            }
            Ended::Completed if unusable => Some(Failure::new(
                Code::BadRecording,
                "no point is usable: the reasons stand above and in the report",
            )),
            Ended::Completed => None,
            Ended::Drifted { reason } => {
                Some(Failure::new(Code::Rig, format!("{reason}. The rig is safe and the recording is kept")))
            }
            Ended::Interrupted { t_s } => Some(Failure::new(
                Code::Interrupted,
                format!("stopped by the operator at {t_s:.0} s; {kept}"),
            )),
            Ended::Tripped { t_s, reason } => {
                Some(Failure::new(Code::Rig, format!("stopped at {t_s:.1} s: {reason}; {kept}")))
            }
            Ended::Failed(source) => {
                let recording = recording.clone();
                Some(SessionError::Run { source, recording }.into())
            }
        };
        match (results, &failure) {
            (Err(error), None) => return Err(error.into()),
            (Ok(results), _) if !self.json => {
                let more = format!("`mapper identify {} --full`", results.run.display());
                standard_output::print(&results_text(
                    &campaign.display,
                    &results,
                    &more,
                    self.shown.shown(),
                ))?;
            }
            // Stopped before there was anything to identify: why it was stopped is what counts.
            (Err(_), Some(_)) if !self.json => {}
            (results, failure) => {
                let mut value = match results {
                    Ok(results) => with_messages(serde_json::to_value(&results).map_err(SessionError::from)?),
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

    fn dry(&self, campaign: &Campaign, prepared: &PreparedRun<'_>, parent: &Path) -> Result<(), Failure> {
        let (rig, plan) = (prepared.rig(), prepared.plan());
        let would_write = parent.join(format!("{}-<time>", campaign.name));
        if self.json {
            return standard_output::print_json(&json!({
                "dry_run": true,
                "rig": rig,
                "would_write": would_write,
                "soak_s": campaign.zero.map(|zero| zero.duration_s),
                "plan": plan,
            }));
        }
        let samples = (soak_s(campaign) + plan.duration_s()) * rig.sample_rate_hz;
        standard_output::print(&format!(
            "{}Dry run: nothing was touched. The rig would be `{}` {}, {} channels at {} Hz ({samples:.0} samples), the \
             results would go to {}.\n",
            plan_text(campaign, plan),
            rig.backend,
            rig.version,
            rig.channels.len(),
            rig.sample_rate_hz,
            would_write.display(),
        ))
    }
}

/// A directory of a campaign, with `~` as in a shell.
fn in_home(directory: &str) -> PathBuf {
    let home = std::env::var_os("HOME").filter(|home| !home.is_empty());
    match (directory.strip_prefix("~/"), home) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => PathBuf::from(directory),
    }
}
