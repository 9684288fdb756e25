//! The invariants: safe or declared unsafe, nothing lost or altered, the truth stated, a resumed run whole.

use super::faulty_backend::Fault;
use super::scenario::{Damage, Life, Scenario};
use super::simulation::Lived;
use super::world::{COMPARED, Ledger, RIG, must_end};
use mapper_core::{Channel, Reaction, RunEnding};
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, read_recording};
use mapper_session::{RigStates, RigStatus, SessionError};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What the program says of its end.
#[derive(Debug)]
#[allow(dead_code, reason = "the errors are shown when a seed fails")]
pub enum StatedEnd {
    Ended(RunEnding),
    /// Complete, but its results could not be written.
    NoResults(String),
    Failed {
        is_unknown: bool,
        error: String,
    },
    NotArmed {
        is_unknown: bool,
        error: String,
    },
    Refused(Box<SessionError>),
}

impl StatedEnd {
    pub fn is_complete(&self) -> bool {
        matches!(self, StatedEnd::Ended(RunEnding::Completed))
    }

    /// Whether the rig has to be inspected before the next run.
    fn locks_out(&self) -> bool {
        match self {
            StatedEnd::Ended(RunEnding::Tripped(trip)) => trip.reaction == Reaction::Latch,
            StatedEnd::Failed { is_unknown, .. } | StatedEnd::NotArmed { is_unknown, .. } => *is_unknown,
            _ => false,
        }
    }

    pub fn word(&self) -> String {
        match self {
            StatedEnd::Ended(end) => serde_json::to_value(end).unwrap()["code"].as_str().unwrap().to_owned(),
            StatedEnd::NoResults(_) => "no results".to_owned(),
            StatedEnd::Failed { is_unknown: true, .. } => "failed, rig unknown".to_owned(),
            StatedEnd::Failed { .. } => "failed".to_owned(),
            StatedEnd::NotArmed { .. } => "not armed".to_owned(),
            StatedEnd::Refused(_) => "refused".to_owned(),
        }
    }
}

/// What the operator does after a refusal.
pub enum Refusal {
    /// It should not have been refused.
    Wrong(String),
    /// The disk failed before the rig was armed.
    Failed,
    Acknowledge,
    RepeatLost,
    StartAgain,
    /// There is nothing left to do.
    Complete,
}

pub fn refusal(
    error: &SessionError,
    life: &Lived,
    run: Option<&Path>,
    damages: &[Damage],
    status: &RigStatus,
    points: usize,
    was_killed: bool,
) -> Refusal {
    let recording_damaged = damages.iter().any(|damage| matches!(damage, Damage::Cut(_) | Damage::Gone));
    let journal_damaged =
        damages.iter().any(|damage| matches!(damage, Damage::JournalCut(_) | Damage::JournalGone));
    let wrong = || {
        let points = run.map(|run| whole(run, points));
        Refusal::Wrong(format!("refused without a reason: {error}; points: {points:?}"))
    };
    let has_parts = run.is_some_and(|run| !parts(run).is_empty());
    match error {
        SessionError::RigLockedOut { .. } if status.latch.is_some() => Refusal::Acknowledge,
        SessionError::RigAbandoned { .. } if status.owner.is_some() && was_killed => Refusal::Acknowledge,
        SessionError::LostSteps { .. } if recording_damaged => Refusal::RepeatLost,
        SessionError::NotResumable { .. } if run.is_some_and(|run| whole(run, points).is_ok()) => {
            Refusal::Complete
        }
        SessionError::NotResumable { .. } if journal_damaged || !has_parts => Refusal::StartAgain,
        _ if life.ledger.disk_failed => Refusal::Failed,
        _ => wrong(),
    }
}

/// A part of a run in its journal.
struct Part {
    recording: PathBuf,
    saved: Vec<usize>,
    ended: Option<Value>,
}

fn parts(run: &Path) -> Vec<Part> {
    let text = std::fs::read_to_string(run.join("journal.jsonl")).unwrap_or_default();
    let mut parts: Vec<Part> = Vec::new();
    for line in text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()) {
        if let Some(name) = line["part"]["recording"].as_str() {
            parts.push(Part { recording: run.join(name), saved: Vec::new(), ended: None });
        } else if let Some(part) = parts.last_mut() {
            part.saved.extend(line["step_saved"].as_u64().map(|number| number as usize - 1));
            part.ended = line.get("ended").cloned().or(part.ended.take());
        }
    }
    parts
}

fn ns(t_s: f64) -> i64 {
    (t_s * 1e9).round() as i64
}

/// Checks one life: `live` is the folder of its files.
pub fn life(scenario: &Scenario, life: &Life, lived: &Lived, live: &Path) -> Result<(), String> {
    let Lived { stated, ledger, .. } = lived;
    let because = |what: String| Err(format!("{what}\nstated: {stated:?}\nkilled: {}", lived.is_killed));
    if let Some(wrong) = ledger.wrong.first() {
        return because(wrong.clone());
    }
    if !lived.is_killed {
        safe(scenario, life, lived, live).or_else(because)?;
        stated_truly(life, lived).or_else(because)?;
    }
    let Some(run) = &lived.directory else { return Ok(()) };
    let parts = parts(run);
    // A life that was refused has left no part.
    let (Some(part), false) = (parts.last(), ledger.received.is_empty()) else { return Ok(()) };
    recorded(life, lived, part).or_else(because)
}

fn safe(scenario: &Scenario, life: &Life, lived: &Lived, live: &Path) -> Result<(), String> {
    let Lived { stated, ledger, .. } = lived;
    // A safe command that is acknowledged without effect shows only where P3 was above its lowest value.
    let is_deaf = life.faults.iter().any(|(_, fault)| *fault == Fault::NotMadeSafe);
    if ledger.air_on && !stated.locks_out() && !is_deaf {
        return Err("the air is on, and the run does not say so".to_owned());
    }
    let status = RigStates::new(&live.join("states")).status(RIG).map_err(|error| error.to_string())?;
    // Refused, or only identified, or not armed after a kill: the rig's state stays unknown.
    let is_without_rig = !ledger.was_on
        && match stated {
            StatedEnd::Refused(_) => true,
            StatedEnd::NotArmed { is_unknown, .. } => lived.was_abandoned && !is_unknown,
            StatedEnd::Ended(_) | StatedEnd::NoResults(_) | StatedEnd::Failed { .. } => {
                ledger.received.is_empty()
            }
        };
    if scenario.is_exclusive && is_without_rig && status.owner.is_some() != lived.was_abandoned {
        return Err("the rig was not used, and its owner changed".to_owned());
    }
    if scenario.is_exclusive && !is_without_rig {
        if status.latch.is_some() != stated.locks_out() {
            return Err(format!("the lockout is {:?}", status.latch.is_some()));
        }
        if status.owner.is_some() || status.in_use {
            return Err("the rig was not released".to_owned());
        }
    }
    // Overspeed, and a rig that trips by itself, latch: whatever else fails then.
    if let ([(begin_s, Fault::Reads(Channel::ShaftSpeed, _) | Fault::Trips { is_reported: true })], None) =
        (life.faults.as_slice(), life.stop)
        && scenario.is_exclusive
        && ledger.air_was_on_at(*begin_s)
        && status.latch.is_none()
    {
        return Err(format!("a fault at {begin_s} s that latches has left no lockout"));
    }
    // A batch of one sample has no order.
    let ending = life
        .faults
        .iter()
        .filter(|(_, fault)| must_end(fault) && !(life.is_real_time && *fault == Fault::Reordered));
    let begin_s = ending.map(|(begin_s, _)| *begin_s).fold(f64::INFINITY, f64::min);
    if stated.is_complete() && begin_s + 6.0 < ledger.now_s {
        return Err(format!("a fault at {begin_s} s did not end the run"));
    }
    // Age, a poll, and the run-down of the lab.
    let latest_s = begin_s + 4.0 + 1.5 + 20.0 + 2.0;
    if !stated.locks_out() && ledger.was_on && ledger.cut_s > latest_s && !is_deaf {
        return Err(format!("a fault at {begin_s} s, the air off at {} s", ledger.cut_s));
    }
    Ok(())
}

fn stated_truly(life: &Life, lived: &Lived) -> Result<(), String> {
    let Lived { stated, ledger, .. } = lived;
    let fault_by = |t_s: f64| life.faults.iter().any(|(begin_s, _)| *begin_s <= t_s + 1.5);
    let is_true = match stated {
        StatedEnd::Ended(RunEnding::Completed) => true,
        StatedEnd::Ended(RunEnding::Interrupted { .. }) => ledger.stopped_s.is_some(),
        StatedEnd::Ended(RunEnding::Tripped(trip)) => fault_by(trip.t_s),
        StatedEnd::Ended(_) => false,
        StatedEnd::NoResults(_) => ledger.disk_failed,
        StatedEnd::Failed { .. } => {
            // Times that go back to before the start cannot be recorded.
            let is_fatal = |fault: &Fault| matches!(fault, Fault::Panics | Fault::Backward(_));
            ledger.failed_s.is_some()
                || ledger.disk_failed
                || life
                    .faults
                    .iter()
                    .any(|(begin_s, fault)| is_fatal(fault) && *begin_s <= ledger.now_s + 1.5)
        }
        StatedEnd::NotArmed { .. } => life.arm_fails.is_some(),
        StatedEnd::Refused(_) => ledger.disk_failed,
    };
    if !is_true {
        return Err("the stated end has no cause".to_owned());
    }
    if life.is_undisturbed() && !stated.is_complete() {
        return Err("an undisturbed run is not complete".to_owned());
    }
    Ok(())
}

/// Whether the samples of this life arrive as no recording can keep them.
fn is_garbled(life: &Life) -> bool {
    life.faults.iter().any(|(_, fault)| {
        matches!(fault, Fault::Doubled | Fault::Reordered | Fault::Backward(_) | Fault::Torn(_))
    })
}

fn recorded(life: &Life, lived: &Lived, part: &Part) -> Result<(), String> {
    let Lived { stated, ledger, .. } = lived;
    let read = read_recording(&part.recording, &ChannelMap::native(), &ReadOptions::default());
    let first_s = ledger.received.first().map_or(0.0, |(t_s, _)| *t_s);
    let last_s = ledger.received.last().map_or(0.0, |(t_s, _)| *t_s);
    let report = match read {
        Ok(report) => report,
        Err(_) if ledger.disk_failed || lived.is_killed && last_s < first_s + 3.0 => return Ok(()),
        Err(error) => return Err(format!("the recording cannot be read: {error}")),
    };
    if !is_garbled(life) {
        samples(life, ledger, &report, lived.is_killed)?;
    }
    let ended: BTreeSet<usize> = lived.ended.iter().map(|marker| marker.index).collect();
    for index in &part.saved {
        let step = report.recording.steps.iter().find(|step| step.index == *index);
        let is_whole = step.is_some_and(|step| {
            let speed = report.recording.series.get(&COMPARED[0]);
            let times = speed.map(|speed| speed.t_s.as_slice()).unwrap_or_default();
            let within = times.iter().filter(|t_s| (step.start_s..=step.end_s).contains(*t_s)).count();
            let received = ledger.received.iter().filter(|(_, values)| values[0].is_finite());
            let received = received.map(|(t_s, _)| *t_s);
            let due = received.filter(|t_s| (step.start_s..=step.end_s).contains(t_s)).count();
            step.end_s > step.start_s && within + 1 >= due
        });
        if !ended.contains(index) || !is_whole && !is_garbled(life) {
            return Err(format!("the journal lists step {} as saved: {step:?}", index + 1));
        }
    }
    if let (Some(ended), false) = (&part.ended, lived.is_killed) {
        let code = ended["code"].as_str().unwrap_or_default();
        let same = match stated {
            StatedEnd::Ended(end) => serde_json::to_value(end).unwrap()["code"] == code,
            StatedEnd::NoResults(_) => code == "completed",
            _ => code == "failed",
        };
        if !same {
            return Err(format!("the journal says {code}"));
        }
    }
    Ok(())
}

/// Compares the samples that the run received with those in its recording.
fn samples(life: &Life, ledger: &Ledger, report: &ReadReport, is_killed: bool) -> Result<(), String> {
    let received: BTreeMap<i64, &[f64; COMPARED.len()]> =
        ledger.received.iter().map(|(t_s, values)| (ns(*t_s), values)).collect();
    let mut last_ns = i64::MIN;
    for (place, channel) in COMPARED.iter().enumerate() {
        let Some(series) = report.recording.series.get(channel) else { continue };
        if !series.t_s.is_sorted_by(|a, b| a < b) {
            return Err(format!("{channel}: samples are doubled or out of order"));
        }
        last_ns = last_ns.max(series.t_s.last().map_or(i64::MIN, |t_s| ns(*t_s)));
        let mut kept = BTreeSet::new();
        for (t_s, value) in series.t_s.iter().zip(&series.values) {
            let Some(original) = received.get(&ns(*t_s)) else {
                return Err(format!("{channel} at {t_s} s was never received"));
            };
            // One that contradicts physics is kept as bad.
            if value.is_finite() && value.to_bits() != original[place].to_bits() {
                return Err(format!("{channel} at {t_s} s: {} was recorded as {value}", original[place]));
            }
            kept.insert(ns(*t_s));
        }
        let until_ns = if is_killed || ledger.disk_failed { last_ns } else { i64::MAX };
        let mut due =
            received.iter().filter(|(t_ns, values)| **t_ns <= until_ns && values[place].is_finite());
        if let Some((t_ns, _)) = due.find(|(t_ns, _)| !kept.contains(t_ns)) {
            return Err(format!("{channel} at {} s was received and is not recorded", *t_ns as f64 / 1e9));
        }
    }
    // Between two readings that are further apart the rig was silent, so that nothing was lost.
    let lost: Vec<i64> =
        ledger.received.iter().map(|(t_s, _)| ns(*t_s)).filter(|t_ns| *t_ns > last_ns).collect();
    let lost_ns: i64 =
        lost.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap_ns| *gap_ns < 1_000_000_000).sum();
    // Readings that come late come all at once, and the kill may be before they are recorded.
    let late_s = |fault: &Fault| if let Fault::Late(by_s) = fault { *by_s } else { 0.0 };
    let late_ns = life.faults.iter().map(|(_, fault)| ns(late_s(fault))).max().unwrap_or_default();
    if is_killed && !ledger.disk_failed && lost_ns > 2_200_000_000 + late_ns {
        let (lost_s, last_s) = (lost_ns as f64 / 1e9, last_ns.max(0) as f64 / 1e9);
        return Err(format!("a kill lost {lost_s} s of readings, recorded until {last_s} s"));
    }
    Ok(())
}

/// Whether a finished run has each point once.
pub fn whole(run: &Path, points: usize) -> Result<(), String> {
    let text =
        std::fs::read_to_string(run.join("points.json")).map_err(|error| format!("points.json: {error}"))?;
    let found: Value = serde_json::from_str(&text).map_err(|error| format!("points.json: {error}"))?;
    let found = found["points"].as_array().cloned().unwrap_or_default();
    let found: Vec<String> = found
        .iter()
        .filter(|point| point["kind"] == "point")
        .map(|point| format!("{} {}", point["target"], point["valve"]))
        .collect();
    let distinct: BTreeSet<&String> = found.iter().collect();
    match found.len() == points && distinct.len() == points && run.join("report.html").exists() {
        true => Ok(()),
        false => Err(format!("{} points, {} of them different, of {points}", found.len(), distinct.len())),
    }
}
