//! Resumes an interrupted run: determines the valid parts and the steps to repeat.

use crate::recording::journal::{Identity, JournalPart, read_journal};
use crate::{SessionError, recording::run_directory};
use mapper_campaign::Campaign;
use mapper_core::{EventKind, Plan, PlanStep, StepKind, StepMarker, step_number};
use mapper_fleet::number_ranges;
use mapper_recording::{ReadOptions, read_marks};
use mapper_runner::{StepSource, StepSourceError};
use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

/// First index for steps that are repeated only to approach a missing step from its planned predecessor.
pub(crate) const FIRST_REPEAT_INDEX: usize = StepMarker::FIRST_REPEAT_INDEX;

pub(crate) fn depends_on_readings(campaign: &Campaign) -> bool {
    campaign.sequence.is_some() || campaign.surge_search.is_some() || campaign.on_drift.is_some()
}

/// State of an interrupted run.
#[derive(Debug, Clone)]
pub struct InterruptedRun {
    /// Its directory.
    pub directory: PathBuf,
    pub(crate) parts: Vec<JournalPart>,
    /// Whether steps that the journal lists and no recording contains are run again; otherwise such a run is not resumed.
    pub repeats_lost: bool,
}

impl InterruptedRun {
    /// Reads the journal of a run directory.
    pub fn read(directory: &Path) -> Result<Self, SessionError> {
        let not_resumable = |why: String| SessionError::NotResumable { run: directory.to_owned(), why };
        let path = directory.join(run_directory::JOURNAL);
        let mut parts = read_journal(&path)
            .map_err(|error| not_resumable(format!("its journal cannot be read: {error}")))?;
        if parts.is_empty() {
            return Err(not_resumable("its journal contains no run".to_owned()));
        }
        for part in parts.iter_mut().filter(|part| !part.is_empty()) {
            // A step or soak that is in the journal but not completely in the recording is lost.
            let marks = read_marks(&directory.join(&part.recording), &ReadOptions::default());
            part.unreadable = marks.is_err();
            let (steps, events) = marks.unwrap_or_default();
            part.lost_soak = part.soaked;
            part.soaked = events.iter().any(|event| event.kind == EventKind::SoakEnded);
            let complete = steps.iter().filter(|step| step.end_s > step.start_s).map(|step| step.index);
            let complete: BTreeSet<usize> = complete.collect();
            (part.saved, part.lost) =
                std::mem::take(&mut part.saved).into_iter().partition(|index| complete.contains(index));
        }
        let mut run = InterruptedRun { directory: directory.to_owned(), parts, repeats_lost: false };
        // Lost steps may have been repeated since.
        let (recorded, has_soak) = (run.saved(), run.has_soak());
        for part in &mut run.parts {
            part.lost.retain(|index| !recorded.contains(index));
            part.lost_soak &= !has_soak;
            part.unreadable &= part.has_losses();
        }
        let is_whole = !run.parts.iter().any(JournalPart::has_losses);
        run.parts.iter_mut().for_each(|part| part.completed &= is_whole);
        Ok(run)
    }

    /// Removes repeated steps, those after a lost step, and the last line of the surge search, which restarts because it depends on its data.
    pub(crate) fn discard_superseded_steps(&mut self, campaign: &Campaign) -> Result<(), SessionError> {
        if !depends_on_readings(campaign) {
            return Ok(());
        }
        // The source of the steps received the readings of a lost step before it made the later ones.
        let lost = self.parts.iter().flat_map(|part| part.lost.iter().copied()).min();
        let lost = lost.filter(|_| self.repeats_lost);
        let mut first_later = lost.unwrap_or(FIRST_REPEAT_INDEX).min(FIRST_REPEAT_INDEX);
        for part in self.parts.iter_mut().rev() {
            part.saved.retain(|index| *index < first_later || *index >= FIRST_REPEAT_INDEX);
            first_later = part.saved.iter().copied().next().unwrap_or(first_later).min(first_later);
        }
        let last = self
            .parts
            .iter_mut()
            .rev()
            .find(|part| part.saved.iter().any(|index| *index < FIRST_REPEAT_INDEX));
        let Some(part) = last.filter(|part| campaign.surge_search.is_some() && !part.completed) else {
            return Ok(());
        };
        let path = self.directory.join(&part.recording);
        let (steps, _) = read_marks(&path, &ReadOptions::default())?;
        let is_complete =
            |step: &&StepMarker| step.index < FIRST_REPEAT_INDEX && part.saved.contains(&step.index);
        let complete_steps: Vec<StepMarker> = steps.iter().filter(is_complete).copied().collect();
        let speed = |step: &StepMarker| step.to.map(|to| to.speed_rpm.to_bits());
        let line = complete_steps.last().and_then(speed);
        let sought = |step: &&StepMarker| step.kind == StepKind::Approach && speed(step) == line;
        let open: Vec<usize> =
            complete_steps.iter().rev().take_while(sought).map(|step| step.index).collect();
        part.saved.retain(|index| !open.contains(index));
        Ok(())
    }

    pub(crate) fn saved(&self) -> BTreeSet<usize> {
        self.parts.iter().flat_map(|part| part.saved.iter().copied()).collect()
    }

    /// Whether one of the recordings contains the soak.
    pub fn has_soak(&self) -> bool {
        self.parts.iter().any(|part| part.soaked)
    }

    pub(crate) fn check(
        &mut self,
        campaign: &Campaign,
        plan: &Plan,
        now: &Identity,
    ) -> Result<(), SessionError> {
        let run = self.directory.clone();
        let not_resumable = |why: String| Err(SessionError::NotResumable { run: run.clone(), why });
        for part in &self.parts {
            let differences = part.identity.differences(now);
            if !differences.is_empty() {
                return not_resumable(format!("{} changed since", differences.join(" and ")));
            }
        }
        // A step that was only repeated to approach another one need not be measured again.
        let is_due = |index: &usize| plan.steps.iter().any(|step| step.index == *index);
        let is_any = depends_on_readings(campaign);
        self.parts.iter_mut().for_each(|part| part.lost.retain(|index| is_any || is_due(index)));
        let lost = self.lost_text();
        if let Some(lost) = lost.filter(|_| !self.repeats_lost) {
            return Err(SessionError::LostSteps { run: self.directory.clone(), lost });
        }
        // Results may be those of an earlier part, or gone since.
        let results = [run_directory::POINTS, run_directory::REPORT, run_directory::PAGE];
        let exist = results.iter().all(|name| self.directory.join(name).exists());
        let written = exist && self.parts.last().is_some_and(|part| part.has_results);
        if written && self.is_complete(campaign, plan) {
            return not_resumable("all its steps and results are complete".to_owned());
        }
        Ok(())
    }

    pub(crate) fn lost_text(&self) -> Option<String> {
        let of_part = |part: &JournalPart| {
            let numbers: Vec<u64> = part
                .lost
                .iter()
                .filter(|index| **index < FIRST_REPEAT_INDEX)
                .map(|index| step_number(*index) as u64)
                .collect();
            let steps = (!numbers.is_empty()).then(|| format!("the steps {}", number_ranges(&numbers)));
            let what = steps.into_iter().chain(part.lost_soak.then(|| "the soak".to_owned()));
            let file = &part.recording;
            let why = if self.directory.join(file).exists() { "does not contain them" } else { "is missing" };
            format!("{} ({file} {why})", what.collect::<Vec<_>>().join(" and "))
        };
        let parts: Vec<String> = self.parts.iter().filter(|part| part.has_losses()).map(of_part).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }

    pub(crate) fn is_complete(&self, campaign: &Campaign, plan: &Plan) -> bool {
        if depends_on_readings(campaign) {
            // Only a completed run shows that no further step was due.
            return self.parts.last().is_some_and(|part| part.completed);
        }
        let saved = self.saved();
        plan.steps.iter().all(|step| saved.contains(&step.index))
    }

    pub(crate) fn summary(&self, campaign: &Campaign, plan: &Plan, saved: &BTreeSet<usize>) -> String {
        let soak = match (campaign.zero.is_some(), self.has_soak()) {
            (false, _) => "the campaign has no soak",
            (true, true) => "the recorded soak applies to the whole run and is not repeated",
            (true, false) => "the soak is repeated, because its recording is incomplete",
        };
        let lost = self.lost_text().map(|lost| format!("; lost and run again: {lost}")).unwrap_or_default();
        format!(
            "resumed: {} of {} steps are recorded{lost}; {soak}; the housings are warmed up again, because they may have cooled, and the step before \
             the first missing one is repeated",
            plan.steps.iter().filter(|step| saved.contains(&step.index)).count(),
            plan.steps.len()
        )
    }
}

/// The missing steps of a plan, each after its planned predecessor.
pub(crate) struct MissingSteps<'a> {
    plan: &'a Plan,
    next: VecDeque<PlanStep>,
    notes: Vec<String>,
}

impl<'a> MissingSteps<'a> {
    pub(crate) fn new(plan: &'a Plan, saved: &BTreeSet<usize>, note: String) -> Self {
        let mut next: VecDeque<PlanStep> = VecDeque::new();
        for (place, step) in plan.steps.iter().enumerate() {
            if saved.contains(&step.index) {
                continue;
            }
            // If the rig is not at the planned predecessor, that step is repeated first.
            let comes_from = place.checked_sub(1).and_then(|before| plan.steps.get(before));
            if let Some(before) = comes_from
                && next.back().is_none_or(|last| last.index != before.index)
            {
                let index = plan.steps.len() + next.len();
                next.push_back(PlanStep { index, kind: StepKind::Repeat, from: None, ..before.clone() });
            }
            next.push_back(step.clone());
        }
        MissingSteps { plan, next, notes: vec![note] }
    }

    pub(crate) fn duration_s(&self) -> f64 {
        let dwells_s: f64 = self.next.iter().map(|step| step.dwell_s).sum();
        self.plan.warm_up_s + dwells_s + self.plan.cool_down_s
    }
}

impl StepSource for MissingSteps<'_> {
    fn warm_up_s(&self) -> f64 {
        self.plan.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        self.plan.cool_down_s
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        Ok(self.next.pop_front())
    }

    fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }
}
