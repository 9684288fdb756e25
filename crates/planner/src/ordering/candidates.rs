//! Promising successors of a point.
//!
//! An assignment of successors gives each point a price, as if the housing settled at each point. The value of a jump minus the prices
//! of both ends shows how well the jump fits into a good order. The value alone would always select the same few extreme points.

use crate::ordering::objective::Objective;
use crate::thermal_memory::chain::Chain;
use crate::upper_bound::auction::run_auction;
use mapper_numerics::statistics::nearest_rank;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

const MAX_SUCCESSORS: usize = 10;
/// Maximum number of points with candidates: the table of weights grows with its square.
pub(crate) const MAX_POINTS: usize = 4000;
/// Lower limit of a weight: the assignment needs finite weights for forbidden jumps.
const MIN_VALUE: f64 = -1e9;

/// The best successors of each point of a chain.
pub(crate) struct Candidates {
    successors: Vec<Vec<usize>>,
}

impl Candidates {
    pub(crate) fn new<C: Chain>(chain: &C, given: &[usize], objective: Objective) -> Self {
        let n = given.len();
        let mut successors = vec![Vec::new(); chain.len()];
        if !(4..=MAX_POINTS).contains(&n) {
            return Candidates { successors };
        }
        let mut weight = Vec::with_capacity(n * n);
        for &from in given {
            let state = chain.settled(from);
            weight.extend(given.iter().map(|&to| {
                if from == to {
                    return MIN_VALUE;
                }
                objective.value(chain, from, to, chain.step(from, to, state).0).max(MIN_VALUE)
            }));
        }
        let finite: Vec<f64> = weight.iter().copied().filter(|weight| *weight > 0.5 * MIN_VALUE).collect();
        let quantile = |share| nearest_rank(&finite, share).unwrap_or(0.0);
        let spread = (quantile(0.98) - quantile(0.02)).max(1e-9);
        let prices = run_auction(n, &weight, (0.2 * spread, 2e-3 * spread));
        for (i, &from) in given.iter().enumerate() {
            let mut rated: Vec<(f64, usize)> = (0..n)
                .filter(|j| *j != i)
                .map(|j| (prices.profit[i] + prices.price[j] - weight[n * i + j], given[j]))
                .collect();
            if rated.len() > MAX_SUCCESSORS {
                rated.select_nth_unstable_by(MAX_SUCCESSORS, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                rated.truncate(MAX_SUCCESSORS);
            }
            rated.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            successors[from] = rated.into_iter().map(|(_, to)| to).collect();
        }
        Candidates { successors }
    }

    /// Draws a successor of `from`; `None` without candidates.
    pub(crate) fn draw(&self, from: usize, random: &mut Pcg64Mcg) -> Option<usize> {
        let successors = &self.successors[from];
        (!successors.is_empty()).then(|| successors[random.random_range(0..successors.len())])
    }
}
