//! A study with further effects (closure terms, and effects that begin with a step), or with some of its values.

use crate::gap::residuals::hypothesis::{from_step, growing_from, onset_step};
use crate::gap::residuals::machine_run::acts_on_machine;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Group, Study};
use mapper_inference::time_history::TimeHistory;
use mapper_physics::rig::effect::Effect;
use std::sync::Arc;

impl Study {
    /// Adds an effect that is not in the library and acts throughout. Returns its index.
    pub fn add(&mut self, effect: Arc<dyn Effect>) -> usize {
        self.on_machine.push(acts_on_machine(&self.nominal, effect.as_ref()));
        self.effects.push(effect);
        self.histories.push(TimeHistory::THROUGHOUT);
        self.effects.len() - 1
    }

    /// Adds candidates for every library effect beginning with a step after the first, or growing from it.
    pub(crate) fn add_onsets(&mut self) {
        let last = self.steps.len().saturating_sub(1);
        for effect in 0..self.catalogue {
            // Growth over a single step equals an onset there.
            let histories = (1..=last)
                .map(from_step)
                .chain((1..last).map(|first| growing_from(first, self.steps.len())))
                .collect::<Vec<_>>();
            for history in histories {
                self.effects.push(self.effects[effect].clone());
                self.on_machine.push(self.on_machine[effect]);
                self.histories.push(history);
            }
        }
    }

    /// Candidates with an onset of one library effect.
    pub(crate) fn onsets_of(&self, effect: usize) -> impl Iterator<Item = usize> {
        let is_one = move |index: &usize| {
            onset_step(self.histories[*index]).is_some()
                && Arc::ptr_eq(&self.effects[*index], &self.effects[effect])
        };
        (self.catalogue..self.effects.len()).filter(is_one)
    }

    /// The library effect behind a candidate with any onset; the candidate itself if it is not in the library.
    pub(crate) fn family(&self, index: usize) -> usize {
        let same = |known: &usize| Arc::ptr_eq(&self.effects[*known], &self.effects[index]);
        (0..self.catalogue).find(same).unwrap_or(index)
    }

    /// Keeps only these rows; `keep` uses the layout of the residuals.
    pub(crate) fn with_rows(mut self, keep: &[bool]) -> Study {
        let (mut groups, mut measured) = (Vec::new(), Vec::new());
        for of_step in &mut self.rows {
            of_step.fill([None; OUTPUTS.len()]);
        }
        for group in &self.groups {
            let start = measured.len();
            let mut blocks = Vec::new();
            for (row, block) in group.rows.clone().zip(&group.blocks).filter(|(row, _)| keep[*row]) {
                self.rows[group.step][*block][group.output] = Some(measured.len() as u32);
                measured.push(self.measured[row]);
                blocks.push(*block);
            }
            if !blocks.is_empty() {
                groups.push(Group { rows: start..measured.len(), blocks, ..*group });
            }
        }
        (self.groups, self.measured) = (groups, measured);
        self
    }
}
