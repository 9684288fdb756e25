//! Effects that a study gets on its way: laws, and causes that begin with a step.

use crate::course::Course;
use crate::study::Study;
use mapper_physics::effect::Effect;
use std::sync::Arc;

impl Study {
    /// Adds an effect that is in no catalogue and there throughout. Gives its index.
    pub fn add(&mut self, effect: Arc<dyn Effect>) -> usize {
        self.effects.push(effect);
        self.courses.push(Course::Throughout);
        self.effects.len() - 1
    }

    /// Adds a candidate: an effect of the catalogue that begins with a step. Gives its index.
    pub fn add_late(&mut self, effect: usize, course: Course) -> usize {
        let known = (self.catalogue..self.effects.len())
            .find(|i| self.courses[*i] == course && Arc::ptr_eq(&self.effects[*i], &self.effects[effect]));
        known.unwrap_or_else(|| {
            self.effects.push(self.effects[effect].clone());
            self.courses.push(course);
            self.effects.len() - 1
        })
    }
}
