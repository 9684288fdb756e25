//! `mapper gap diagnose`: where a recording leaves the nominal model, why, how far that closes the gap, what is next.

use crate::failure::Failure;
use crate::given::channel_map;
use crate::progress::Progress;
use crate::{output, registry};
use clap::Args;
use mapper_drift::DriftReport;
use mapper_report::{gap_page, gap_text, sensors_text, zero_text};
use mapper_session::{Recorded, Session, SessionError, SessionEvent, write_new};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Say where a recording departs from the nominal model, which effect causes it, how far that closes the gap, what to do next
#[derive(Debug, Args)]
pub struct Diagnose {
    /// Campaign with machine, declared uncertainties and tolerances (YAML)
    pub campaign: PathBuf,
    /// Run directory, MCAP file, or log of another program
    #[arg(long, value_name = "FILE")]
    pub recording: PathBuf,
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "MAP")]
    pub channels: Option<PathBuf>,
    /// Also try a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    /// Also write an HTML page with pictures to this new file
    #[arg(long, value_name = "OUT")]
    pub html: Option<PathBuf>,
}

impl Diagnose {
    /// Diagnoses one recording.
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let map = channel_map(self.channels.as_deref())?;
        let (registry, progress) = (registry::registry(), Progress::new());
        progress.show(&SessionEvent::Progress { done_ratio: 0.0, what: "reading".to_owned() });
        let recorded = Recorded::read(&registry, &self.recording, &map, Some(&campaign))?;
        let on_event = |event: &_| progress.show(event);
        let session = Session { on_event: &on_event, ..Session::new(&registry) };
        let effects = registry.effects_with(&self.effects)?;
        let gap = session.diagnose_gap(&recorded, &campaign, &map, effects)?;
        progress.clear();
        if let Some(file) = &self.html {
            let title = recorded.path.display().to_string();
            write_new(file, gap_page(&title, &gap.diagnosed).as_bytes())?;
        }
        let diagnosis = &gap.diagnosed.diagnosis;
        if self.json {
            let mut value = serde_json::to_value(diagnosis).map_err(SessionError::from)?;
            value["drift"] = gap.drift.as_ref().map_or(Value::Null, drift_json);
            value["zero"] = json!(gap.zero);
            if !gap.sensors.is_empty() {
                value["sensors"] = json!(gap.sensors);
            }
            return output::print_json(&value);
        }
        output::print(&[gap_text(diagnosis), sensors_text(&gap.sensors), zero_text(&gap.zero)].concat())
    }
}

/// Verdict, cause, course and size of what drifted.
fn drift_json(drift: &DriftReport) -> Value {
    json!({
        "verdict": drift.verdict,
        "cause": drift.cause,
        "probability": drift.probability,
        "onset_s": drift.onset_s,
        "size": drift.size,
        "low": drift.low,
        "high": drift.high,
        "unit": drift.unit,
        "reason": drift.reason,
    })
}
