//! Damping of the steps, and the search for a step that reduces the cost.

/// How the damping changes. All are ratios of the normal matrix's diagonal, or factors on them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DampingRule {
    /// Initial value.
    pub start: f64,
    /// Factor after a rejected step, above 1.
    pub growth: f64,
    /// Factor after an accepted step, below 1.
    pub relief: f64,
    /// Minimum value after a rejected step, so that a very small damping recovers in few steps.
    pub renewed: f64,
    /// Minimum value after an accepted step.
    pub least: f64,
    /// Maximum value; beyond it steps are too short to change anything, and the search ends.
    pub most: f64,
    /// Steps tried before the search ends.
    pub tries: usize,
}

impl DampingRule {
    /// For a good start and a nearly linear model: small, and quickly negligible.
    pub const GOOD_START: DampingRule = DampingRule {
        start: 1e-4,
        growth: 10.0,
        relief: 0.1,
        renewed: 1e-8,
        least: 1e-12,
        most: 1e8,
        tries: 12,
    };
}

/// Maximum number of iterations of a fit: a good start needs about ten.
pub const MAX_ITERATIONS: usize = 60;

/// The damping during a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Damping {
    rule: DampingRule,
    value: f64,
}

impl Damping {
    /// Damping at its start.
    pub fn new(rule: DampingRule) -> Self {
        Damping { rule, value: rule.start }
    }

    /// Tries steps with increasing damping until `trial` accepts one. `trial` gets the damping and returns `None` if the equations cannot
    /// be solved or the step does not reduce the cost. Returns `None` if no step is accepted.
    ///
    /// The next search starts from the accepted damping, reduced.
    pub fn search<T>(&mut self, mut trial: impl FnMut(f64) -> Option<T>) -> Option<T> {
        for _ in 0..self.rule.tries {
            if let Some(found) = trial(self.value) {
                self.value = (self.value * self.rule.relief).max(self.rule.least);
                return Some(found);
            }
            self.value = (self.value * self.rule.growth).max(self.rule.renewed);
            if self.value > self.rule.most {
                break;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: DampingRule = DampingRule {
        start: 1e-2,
        growth: 10.0,
        relief: 0.1,
        renewed: 1e-6,
        least: 1e-8,
        most: 1e3,
        tries: 12,
    };

    #[test]
    fn the_search_grows_until_something_helps_and_starts_relieved_next_time() {
        let mut damping = Damping::new(RULE);
        let mut tried = Vec::new();
        let found = damping.search(|value| {
            tried.push(value);
            (value > 0.5).then_some("helps")
        });
        assert_eq!((found, tried.len()), (Some("helps"), 3));
        assert_eq!(damping.search(Some), Some(tried[2] * 0.1));
    }

    #[test]
    fn it_ends_at_the_largest_damping_and_after_so_many_tries() {
        let mut count = 0;
        let mut never = |_: f64| -> Option<()> {
            count += 1;
            None
        };
        assert_eq!(Damping::new(RULE).search(&mut never), None);
        assert_eq!(Damping::new(DampingRule { most: f64::INFINITY, ..RULE }).search(&mut never), None);
        // 1e-2 to 1e3 in factors of ten, and the tries allowed.
        assert!((6..=7).contains(&(count - 12)), "{count}");
    }

    #[test]
    fn relief_and_renewal_have_their_floors() {
        let mut damping = Damping::new(RULE);
        for _ in 0..20 {
            damping.search(Some);
        }
        assert_eq!(damping.search(Some), Some(1e-8));
        let mut tried = Vec::new();
        damping.search(|value| {
            tried.push(value);
            (tried.len() == 2).then_some(())
        });
        assert_eq!(tried, [1e-8, 1e-6]);
    }
}
