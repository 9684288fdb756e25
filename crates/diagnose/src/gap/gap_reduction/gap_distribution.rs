//! Gap reduction by a cause over several steps: the share that it removes, with its confidence interval.

use mapper_numerics::statistics::{DOUBT_SIGMAS, share_interval_95};

/// Gap reduction over several steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GapReduction {
    /// Share of the whole gap removed.
    pub(crate) removed: f64,
    /// 95 % interval of this share for similar steps.
    pub(crate) interval: (f64, f64),
    pub(crate) steps: usize,
    /// Index of the step with most of the gap and its share; `None` if no step has a gap.
    pub(crate) largest: Option<(usize, f64)>,
}

/// Misfit `(|r|^2 - n)/n` of one step before and after, and its number of values.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepMisfit {
    pub(crate) before: f64,
    pub(crate) after: f64,
    pub(crate) values: usize,
}

impl StepMisfit {
    fn has_gap(&self) -> bool {
        // For noise, |r|^2 has mean n and variance 2 n.
        self.before > DOUBT_SIGMAS * (2.0 / self.values.max(1) as f64).sqrt()
    }

    /// Share of its own gap removed, 0..1.
    fn removed(&self) -> f64 {
        (1.0 - self.after.max(0.0) / self.before).clamp(0.0, 1.0)
    }
}

/// Every step with a gap counts as one trial, whatever its size. The interval is Clopper and Pearson's for the mean share removed. The
/// share of the whole gap is weighted by size, so one step may dominate it. The interval is then widened to include that share, and the
/// step is named.
pub(crate) fn gap_reduction(steps: &[StepMisfit]) -> GapReduction {
    let positive = |g: f64| g.max(0.0);
    let total: f64 = steps.iter().map(|step| positive(step.before)).sum();
    let remaining: f64 = steps.iter().map(|step| positive(step.after)).sum();
    let removed = if total > 0.0 { 1.0 - remaining / total } else { 0.0 };
    let shares: Vec<f64> = steps.iter().filter(|step| step.has_gap()).map(StepMisfit::removed).collect();
    let (low, high) = share_interval_95(shares.iter().sum(), shares.len() as f64);
    let whole = removed.clamp(0.0, 1.0);
    let largest = steps
        .iter()
        .enumerate()
        .filter(|(_, step)| step.has_gap())
        .map(|(index, step)| (index, positive(step.before) / total))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    GapReduction { removed, interval: (low.min(whole), high.max(whole)), steps: shares.len(), largest }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(before: f64, after: f64) -> StepMisfit {
        StepMisfit { before, after, values: 800 }
    }

    /// Clopper and Pearson (1934): 18 of 18 gives more than 0.025^(1/18) = 81.5 %, even if one of the 18 has most of the gap; 1 of 1 gives
    /// only more than 2.5 %.
    #[test]
    fn one_large_step_does_not_silence_the_others() {
        let mut steps = vec![step(2.0, 0.0); 18];
        let even = gap_reduction(&steps);
        steps[4] = step(1000.0, 0.0);
        let uneven = gap_reduction(&steps);
        for found in [even, uneven] {
            assert_eq!((found.removed, found.steps), (1.0, 18));
            assert!((found.interval.0 - 0.025f64.powf(1.0 / 18.0)).abs() < 1e-6, "{found:?}");
        }
        assert!(uneven.largest.is_some_and(|(index, share)| index == 4 && share > 0.96));
        // Steps without a gap carry no information.
        let mut alone = vec![step(0.0, 0.0); 17];
        alone.push(step(50.0, 0.0));
        let alone = gap_reduction(&alone);
        assert_eq!((alone.steps, alone.largest), (1, Some((17, 1.0))));
        assert!((alone.interval.0 - 0.025).abs() < 1e-6, "{alone:?}");
    }

    /// The step with most of the gap keeps it: the total share then lies outside the other steps' interval, and the interval includes both.
    #[test]
    fn the_interval_holds_the_share_of_the_whole() {
        let mut steps = vec![step(2.0, 0.0); 17];
        steps.push(step(500.0, 500.0));
        let found = gap_reduction(&steps);
        assert!(found.removed < 0.1 && found.interval.0 <= found.removed, "{found:?}");
        assert_eq!(gap_reduction(&[]).steps, 0);
    }
}
