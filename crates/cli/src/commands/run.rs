//! `mapper run`: the whole way from a campaign to a map.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::shown::ShownArguments;
use crate::wall::SystemWall;
use crate::{interrupt, manner, output, registry, rig_states};
use clap::Args;
use mapper_campaign::Campaign;
use mapper_core::{PacedClock, Verdict};
use mapper_live::{Live, LiveRun};
use mapper_report::plan_text;
use mapper_session::{
    BrokenOff, Ended, Operator, PreparedRun, RunOutcome, RunRequest, Session, SessionError, run_directory,
    soak_s,
};
use mapper_terminal::results_text;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

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
        let parent = self.out.clone().unwrap_or_else(|| PathBuf::from(&campaign.outputs.directory));
        let started = jiff::Timestamp::now();
        let (registry, stop, progress) = (registry::registry(), interrupt::run_stop()?, manner::progress());
        progress.begin("planning");
        let states = rig_states::directory(None);
        let mut live = self.live.as_deref().map(Live::open).transpose().map_err(Failure::of_live)?;
        let told: OnceLock<&Live> = OnceLock::new();
        let on_event = |event: &_| {
            progress.show(event);
            if let Some(live) = told.get() {
                live.show(event);
            }
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
            started_ns: u64::try_from(started.as_nanosecond()).unwrap_or(0),
            started_name: &started.strftime("%Y%m%dT%H%M%SZ").to_string(),
            rig_states: Some(&states),
            resume,
        };
        let prepared = session.prepare(request).map_err(|error| Failure::in_campaign(error, &file))?;
        if self.dry_run {
            progress.clear();
            return self.dry(&campaign, &prepared, &parent);
        }
        let pace = self.pace.or((!prepared.rig().simulated_time).then_some(1.0));
        if let Some(live) = &mut live {
            live.begin(&LiveRun {
                campaign: &campaign,
                plan: prepared.plan(),
                pace,
                operator: operator.clone(),
                after_step: stop.after_step.clone(),
                now: stop.now.clone(),
            })
            .map_err(Failure::of_live)?;
            output::warn(&format!("live page: {}\n", live.url()));
            let _ = told.set(live);
        }
        let outcome = match pace {
            Some(pace) => {
                prepared.run_paced(&session, &mut PacedClock::new(SystemWall::new(), pace), true)?
            }
            None => prepared.run(&session)?,
        };
        progress.clear();
        if let Some(live) = told.get() {
            live.end(
                &outcome.sentence(),
                outcome.results.as_ref().ok().map(|results| results.page.as_path()),
            );
        }
        self.tell(&campaign, outcome)
    }

    fn tell(&self, campaign: &Campaign, outcome: RunOutcome) -> Result<(), Failure> {
        let RunOutcome { directory, recording, end, results } = outcome;
        let unusable = results.as_ref().is_ok_and(|results| {
            results.points.iter().all(|scored| scored.point.verdict == Verdict::Unusable)
        });
        let kept = "the rig is safe and the recording is kept";
        let failure = match end {
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
                output::print(&results_text(&campaign.display, &results, self.shown.shown()))?;
            }
            // Stopped before there was anything to identify: why it was stopped is what counts.
            (Err(_), Some(_)) if !self.json => {}
            (results, failure) => {
                let mut value = match results {
                    Ok(results) => serde_json::to_value(&results).map_err(SessionError::from)?,
                    Err(_) => json!({"run": directory, "recording": recording, "points": [], "map": {}}),
                };
                if let Some(failure) = failure {
                    value["failure"] = failure.json();
                }
                output::print_json(&value)?;
            }
        }
        failure.map_or(Ok(()), Err)
    }

    fn dry(&self, campaign: &Campaign, prepared: &PreparedRun<'_>, parent: &Path) -> Result<(), Failure> {
        let (rig, plan) = (prepared.rig(), prepared.plan());
        let would_write = parent.join(format!("{}-<time>", campaign.name));
        if self.json {
            return output::print_json(&json!({
                "dry_run": true,
                "rig": rig,
                "would_write": would_write,
                "soak_s": campaign.zero.map(|zero| zero.duration_s),
                "plan": plan,
            }));
        }
        let samples = (soak_s(campaign) + plan.duration_s()) * rig.sample_rate_hz;
        output::print(&format!(
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
