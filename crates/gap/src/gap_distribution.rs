//! How many steps carry the gap, and what a handful of them can know of the share that a cause removes.

use mapper_numerics::statistics::share_interval_95;

/// A step shows a gap where its misfit is beyond what noise makes of it by so many standard deviations.
const SHOWS_SIGMAS: f64 = 3.0;

/// The share of the gap that is removed, step by step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Carried {
    /// Share removed of the whole gap.
    pub(crate) removed: f64,
    /// 95 % interval of the share in steps like these.
    pub(crate) interval: (f64, f64),
    /// Number of steps that show a gap.
    pub(crate) steps: usize,
    /// The step that has most of it, by index, and its share of the whole; `None` where no step shows any.
    pub(crate) largest: Option<(usize, f64)>,
}

/// One step's misfit `(|r|^2 - n)/n` before and after, and its number of values.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepMisfit {
    pub(crate) before: f64,
    pub(crate) after: f64,
    pub(crate) values: usize,
}

impl StepMisfit {
    fn shows(&self) -> bool {
        // |r|^2 of noise has mean n and variance 2 n.
        self.before > SHOWS_SIGMAS * (2.0 / self.values.max(1) as f64).sqrt()
    }

    /// Share of its own gap that is removed, 0..1.
    fn removed(&self) -> f64 {
        (1.0 - self.after.max(0.0) / self.before).clamp(0.0, 1.0)
    }
}

/// Every step that shows a gap is one witness, however large its gap is: the interval is Clopper and Pearson's for the mean
/// share that they have removed, in as many trials. The whole gap is weighted by its size, so one step may carry most of it;
/// the interval is then widened to hold the share of the whole, and the step is named.
pub(crate) fn carried(steps: &[StepMisfit]) -> Carried {
    let positive = |g: f64| g.max(0.0);
    let total: f64 = steps.iter().map(|step| positive(step.before)).sum();
    let left: f64 = steps.iter().map(|step| positive(step.after)).sum();
    let removed = if total > 0.0 { 1.0 - left / total } else { 0.0 };
    let witnesses: Vec<f64> = steps.iter().filter(|step| step.shows()).map(StepMisfit::removed).collect();
    let (low, high) = share_interval_95(witnesses.iter().sum(), witnesses.len() as f64);
    let whole = removed.clamp(0.0, 1.0);
    let largest = steps
        .iter()
        .enumerate()
        .filter(|(_, step)| step.shows())
        .map(|(index, step)| (index, positive(step.before) / total))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    Carried { removed, interval: (low.min(whole), high.max(whole)), steps: witnesses.len(), largest }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(before: f64, after: f64) -> StepMisfit {
        StepMisfit { before, after, values: 800 }
    }

    /// Clopper and Pearson (1934): 18 of 18 is more than 0.025^(1/18) = 81.5 %, whether or not one of the 18 has most of the
    /// gap; 1 of 1 is more than 2.5 %, which is all that one step says.
    #[test]
    fn one_large_step_does_not_silence_the_others() {
        let mut steps = vec![step(2.0, 0.0); 18];
        let even = carried(&steps);
        steps[4] = step(1000.0, 0.0);
        let uneven = carried(&steps);
        for found in [even, uneven] {
            assert_eq!((found.removed, found.steps), (1.0, 18));
            assert!((found.interval.0 - 0.025f64.powf(1.0 / 18.0)).abs() < 1e-6, "{found:?}");
        }
        assert!(uneven.largest.is_some_and(|(index, share)| index == 4 && share > 0.96));
        // Steps without a gap say nothing.
        let mut alone = vec![step(0.0, 0.0); 17];
        alone.push(step(50.0, 0.0));
        let alone = carried(&alone);
        assert_eq!((alone.steps, alone.largest), (1, Some((17, 1.0))));
        assert!((alone.interval.0 - 0.025).abs() < 1e-6, "{alone:?}");
    }

    /// The one step that has most of the gap keeps it: the whole is then outside of what the others say, and the interval
    /// holds both.
    #[test]
    fn the_interval_holds_the_share_of_the_whole() {
        let mut steps = vec![step(2.0, 0.0); 17];
        steps.push(step(500.0, 500.0));
        let found = carried(&steps);
        assert!(found.removed < 0.1 && found.interval.0 <= found.removed, "{found:?}");
        assert_eq!(carried(&[]).steps, 0);
    }
}
