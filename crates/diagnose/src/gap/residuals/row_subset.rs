//! A study restricted to some of its values.

use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Group, Study};

impl Study {
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
