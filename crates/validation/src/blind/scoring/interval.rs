//! Shares with their exact intervals.

use mapper_numerics::statistics::share_interval_95;
use std::fmt;

/// `hits` out of `trials`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Share {
    /// Number of hits.
    pub hits: usize,
    /// Number of trials.
    pub trials: usize,
}

impl Share {
    pub(crate) fn count(&mut self, hit: bool) {
        self.trials += 1;
        self.hits += usize::from(hit);
    }
}

/// Both ends of the exact 95 % interval of a binomial share (Clopper and Pearson 1934); 0 and 1 without trials.
pub fn clopper_pearson_95(share: Share) -> (f64, f64) {
    share_interval_95(share.hits as f64, share.trials as f64)
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.trials == 0 {
            return f.write_str("0/0");
        }
        let (low, high) = clopper_pearson_95(*self);
        write!(f, "{}/{}  [{:.0}, {:.0}] %", self.hits, self.trials, 100.0 * low, 100.0 * high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without a miss in n trials the lower end is 0.025^(1/n), in closed form; and by symmetry without a hit. For 19 of
    /// 20 the textbook values 0.7513 and 0.9987 (e.g. Hollander and Wolfe, table of binomial intervals).
    #[test]
    fn intervals_are_exact() {
        for n in [1, 5, 20, 300] {
            let closed = 0.025f64.powf(1.0 / n as f64);
            let (low, high) = clopper_pearson_95(Share { hits: n, trials: n });
            assert!((low - closed).abs() < 1e-9 && high == 1.0, "{n}: {low}");
            let (low, high) = clopper_pearson_95(Share { hits: 0, trials: n });
            assert!((high - (1.0 - closed)).abs() < 1e-9 && low == 0.0);
        }
        let (low, high) = clopper_pearson_95(Share { hits: 19, trials: 20 });
        assert!((low - 0.7513).abs() < 5e-5 && (high - 0.9987).abs() < 5e-5, "{low} {high}");
        assert_eq!(clopper_pearson_95(Share::default()), (0.0, 1.0));
    }
}
