//! Linear mixed models with crossed groups: fixed effects, random effects of the groups, and the residual.

use crate::minimise::minimise;
use nalgebra::{DMatrix, DVector};

/// Maximum number of iterations over the variances. A few suffice, because crossed groups hardly interact. Bound: a few suffice, because
/// crossed groups hardly interact.
const MAX_ROUNDS: usize = 60;
/// The iteration has converged if no share changes by more than twice this. Bound: far below the standard error of any share.
const SHARE_TOLERANCE: f64 = 1e-7;
/// Largest ratio of a group's standard deviation to the residual's that is distinguished from infinity. Bound: no data distinguish it
/// from infinity.
const MAX_RATIO: f64 = 1e4;
/// Fraction of the sum of squares below which a residual is rounding error. Bound: some tens of roundings of f64.
const ROUNDING: f64 = 1e-14;
/// Minimum fraction of a column's square that is independent of the other columns; below it the columns count as linearly dependent.
/// Bound: its square root is a thousand roundings of f64.
const MIN_INDEPENDENT_RATIO: f64 = 1e-12;

/// Maximum level; a larger one is a mistake in the data and would need too much memory. Bound: a larger one is a mistake in the data and
/// would need too much memory.
const MAX_LEVELS: usize = 100_000;

/// Observations `y = fixed * coefficients + sum of the effect of each group's level + residual`. All effects and residuals are independent
/// and normal, and all residuals have the same variance.
#[derive(Debug, Clone)]
pub struct MixedModel<'a> {
    /// The response, n values in any unit.
    pub y: &'a [f64],
    /// Design matrix of the fixed effects: n rows, a column for each coefficient; of full rank.
    pub fixed: DMatrix<f64>,
    /// For each group the level of each observation, from 0. The first group may have many levels, the others some hundred together.
    pub groups: Vec<&'a [usize]>,
}

/// Result of a fit, in the unit of `y`; coefficients are per unit of their column of `fixed`.
#[derive(Debug, Clone, PartialEq)]
pub struct MixedFit {
    /// Coefficients of `fixed`.
    pub coefficients: Vec<Effect>,
    /// Standard deviation of each group's effects.
    pub group_sigmas: Vec<f64>,
    /// Standard deviation of the residual.
    pub residual_sigma: f64,
    /// The effect of each level of each group, shrunk towards 0 (best linear unbiased prediction).
    pub effects: Vec<Vec<Effect>>,
}

/// An estimate with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// Estimate.
    pub value: f64,
    /// Standard error if the variances are known.
    pub standard_error: f64,
}

/// Reason for the failure of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoFit {
    /// There are not more observations than coefficients.
    TooFew,
    /// Rows, levels and values differ in number, or a value is not finite.
    Invalid,
    /// Columns of `fixed` are linearly dependent.
    Collinear,
}

impl MixedModel<'_> {
    /// Fits by restricted maximum likelihood. A variance may be exactly 0.
    ///
    /// # Errors
    /// [`NoFit`].
    ///
    /// Source: Henderson's mixed model equations and the restricted likelihood that their factors give; e.g. Searle, Casella and
    /// McCulloch, Variance Components (1992), chapters 6 and 7. The levels of the first group are eliminated first, since their
    /// block is diagonal.
    pub fn fit(&self) -> Result<MixedFit, NoFit> {
        let sums = Sums::new(self)?;
        let mut shares = vec![0.5; self.groups.len()];
        for _ in 0..MAX_ROUNDS {
            let before = shares.clone();
            for group in 0..shares.len() {
                let mut at = |share: f64| {
                    shares[group] = share;
                    sums.criterion(&shares)
                };
                let value_at_zero = at(0.0);
                let minimum = minimise(0.0, MAX_RATIO / (1.0 + MAX_RATIO), SHARE_TOLERANCE, at);
                // The search does not evaluate the ends.
                shares[group] = if value_at_zero <= minimum.value { 0.0 } else { minimum.at };
            }
            if before.iter().zip(&shares).all(|(a, b)| (a - b).abs() <= 2.0 * SHARE_TOLERANCE) {
                break;
            }
        }
        sums.fit(&shares).ok_or(NoFit::Collinear)
    }
}

/// Ratio of a group's standard deviation to the residual's, from its share (0 to 1) of their sum.
fn ratio(share: f64) -> f64 {
    share / (1.0 - share)
}

/// Sums over the observations, independent of the variances.
struct Sums {
    observations: usize,
    coefficients: usize,
    /// Group of each column of `columns` after the coefficients, from 1.
    group_of: Vec<usize>,
    levels: Vec<usize>,
    /// Observations of each level of the first group.
    counts: Vec<f64>,
    /// Products of the levels of the first group with all other columns.
    cross_products: DMatrix<f64>,
    columns: DMatrix<f64>,
    first_y: DVector<f64>,
    columns_y: DVector<f64>,
    yy: f64,
}

/// The equations solved for one set of shares.
struct Solved {
    log_determinant: f64,
    square: f64,
    scale: DVector<f64>,
    first_ratio: f64,
    solution: DVector<f64>,
    first: DVector<f64>,
    inverse: DMatrix<f64>,
    diagonal: Vec<f64>,
    cross: DMatrix<f64>,
}

impl Sums {
    fn new(model: &MixedModel<'_>) -> Result<Sums, NoFit> {
        let (n, p) = model.fixed.shape();
        let lengths = model.groups.iter().all(|group| group.len() == n) && model.y.len() == n;
        let finite = model.y.iter().chain(model.fixed.iter()).all(|value| value.is_finite());
        if !lengths || !finite || model.groups.is_empty() || p == 0 {
            return Err(NoFit::Invalid);
        }
        if n <= p {
            return Err(NoFit::TooFew);
        }
        let levels: Vec<usize> = model
            .groups
            .iter()
            .map(|group| group.iter().max().map_or(0, |level| level.saturating_add(1)))
            .collect();
        if levels.iter().any(|count| *count > MAX_LEVELS) {
            return Err(NoFit::Invalid);
        }
        let group_of: Vec<usize> =
            (1..levels.len()).flat_map(|group| std::iter::repeat_n(group, levels[group])).collect();
        let starts: Vec<usize> = levels[1..]
            .iter()
            .scan(p, |next, count| {
                let start = *next;
                *next += count;
                Some(start)
            })
            .collect();
        let width = p + group_of.len();
        let mut sums = Sums {
            observations: n,
            coefficients: p,
            counts: vec![0.0; levels[0]],
            cross_products: DMatrix::zeros(levels[0], width),
            columns: DMatrix::zeros(width, width),
            first_y: DVector::zeros(levels[0]),
            columns_y: DVector::zeros(width),
            yy: 0.0,
            group_of,
            levels,
        };
        for (i, y) in model.y.iter().enumerate() {
            let fixed = (0..p).map(|column| (column, model.fixed[(i, column)]));
            let grouped = starts.iter().zip(&model.groups[1..]).map(|(start, group)| (start + group[i], 1.0));
            let row: Vec<(usize, f64)> = fixed.chain(grouped).collect();
            let first = model.groups[0][i];
            sums.counts[first] += 1.0;
            sums.first_y[first] += y;
            sums.yy += y * y;
            for (a, value) in &row {
                sums.cross_products[(first, *a)] += value;
                sums.columns_y[*a] += value * y;
                for (b, other) in &row {
                    sums.columns[(*a, *b)] += value * other;
                }
            }
        }
        Ok(sums)
    }

    /// Minus twice the restricted log-likelihood, up to a constant; infinite if the equations cannot be solved.
    fn criterion(&self, shares: &[f64]) -> f64 {
        let Some(solved) = self.solve(shares) else { return f64::INFINITY };
        let degrees_of_freedom = (self.observations - self.coefficients) as f64;
        solved.log_determinant + degrees_of_freedom * solved.square.ln()
    }

    /// Solves the equations. Effects are scaled by the standard deviation of their group, so that a zero variance causes no division by
    /// zero.
    fn solve(&self, shares: &[f64]) -> Option<Solved> {
        let p = self.coefficients;
        let first_ratio = ratio(shares[0]);
        let scale = DVector::from_fn(self.columns.nrows(), |column, _| {
            if column < p { 1.0 } else { ratio(shares[self.group_of[column - p]]) }
        });
        let diagonal: Vec<f64> =
            self.counts.iter().map(|count| first_ratio * first_ratio * count + 1.0).collect();
        let cross =
            DMatrix::from_fn(self.cross_products.nrows(), self.cross_products.ncols(), |row, column| {
                first_ratio * scale[column] * self.cross_products[(row, column)]
            });
        let mut matrix = DMatrix::from_fn(scale.len(), scale.len(), |row, column| {
            scale[row] * scale[column] * self.columns[(row, column)]
        });
        for column in p..scale.len() {
            matrix[(column, column)] += 1.0;
        }
        let mut scaled_cross = cross.clone();
        for (row, diagonal) in diagonal.iter().enumerate() {
            scaled_cross.row_mut(row).scale_mut(1.0 / diagonal);
        }
        matrix -= cross.transpose() * &scaled_cross;
        let first_y = first_ratio * &self.first_y;
        let right = scale.component_mul(&self.columns_y) - scaled_cross.transpose() * &first_y;
        let sizes = matrix.diagonal();
        let factors = matrix.cholesky()?;
        // Only rounding remains of a column that depends on the others.
        let pivots = factors.l_dirty().diagonal();
        if pivots.iter().zip(&sizes).any(|(pivot, size)| pivot * pivot < MIN_INDEPENDENT_RATIO * size) {
            return None;
        }
        let solution = factors.solve(&right);
        let first = DVector::from_fn(diagonal.len(), |row, _| {
            (first_y[row] - cross.row(row).transpose().dot(&solution)) / diagonal[row]
        });
        let square = self.yy - scale.component_mul(&self.columns_y).dot(&solution) - first_y.dot(&first);
        let diagonal_logs = diagonal.iter().map(|x| x.ln()).sum::<f64>();
        let factor_logs = factors.l_dirty().diagonal().iter().map(|x| 2.0 * x.ln()).sum::<f64>();
        Some(Solved {
            log_determinant: diagonal_logs + factor_logs,
            square: square.max(ROUNDING * self.yy).max(f64::MIN_POSITIVE),
            inverse: factors.inverse(),
            scale,
            first_ratio,
            solution,
            first,
            diagonal,
            cross,
        })
    }

    fn fit(&self, shares: &[f64]) -> Option<MixedFit> {
        let solved = self.solve(shares)?;
        let degrees_of_freedom = (self.observations - self.coefficients) as f64;
        let residual_sigma = (solved.square / degrees_of_freedom).sqrt();
        let column = |column: usize| Effect {
            value: solved.scale[column] * solved.solution[column],
            standard_error: residual_sigma
                * solved.scale[column]
                * solved.inverse[(column, column)].max(0.0).sqrt(),
        };
        let first = |row: usize| {
            let cross = solved.cross.row(row);
            let other_variance = (cross * &solved.inverse * cross.transpose())[(0, 0)];
            let diagonal = solved.diagonal[row];
            Effect {
                value: solved.first_ratio * solved.first[row],
                standard_error: residual_sigma
                    * solved.first_ratio
                    * (1.0 / diagonal + other_variance / (diagonal * diagonal)).sqrt(),
            }
        };
        let mut effects = vec![(0..self.counts.len()).map(first).collect::<Vec<_>>()];
        let mut next = self.coefficients;
        for count in &self.levels[1..] {
            effects.push((next..next + count).map(column).collect());
            next += count;
        }
        Some(MixedFit {
            coefficients: (0..self.coefficients).map(column).collect(),
            group_sigmas: shares.iter().map(|share| ratio(*share) * residual_sigma).collect(),
            residual_sigma,
            effects,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Numbers that look random and are the same everywhere (SplitMix64), of standard deviation 1.
    fn scattered(i: usize, of: u64) -> f64 {
        let mut z =
            (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ of.wrapping_mul(0xD1B5_4A32_D192_ED03);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        12.0_f64.sqrt() * ((z ^ (z >> 31)) as f64 / u64::MAX as f64 - 0.5)
    }

    struct Balanced {
        y: Vec<f64>,
        machines: Vec<usize>,
        nights: Vec<usize>,
    }

    fn balanced(machines: usize, nights: usize, sizes: [f64; 3]) -> Balanced {
        let mut balanced = Balanced { y: Vec::new(), machines: Vec::new(), nights: Vec::new() };
        for machine in 0..machines {
            for night in 0..nights {
                let rest = scattered(machine * nights + night, 1);
                balanced.y.push(
                    0.7 + sizes[0] * scattered(machine, 2) + sizes[1] * scattered(night, 3) + sizes[2] * rest,
                );
                balanced.machines.push(machine);
                balanced.nights.push(night);
            }
        }
        balanced
    }

    fn fitted(data: &Balanced) -> MixedFit {
        let fixed = DMatrix::from_element(data.y.len(), 1, 1.0);
        MixedModel { y: &data.y, fixed, groups: vec![&data.machines, &data.nights] }.fit().unwrap()
    }

    proptest! {
        /// Balanced data have closed forms: where all are positive, restricted maximum likelihood is the analysis of variance
        /// (Searle, Casella and McCulloch, 4.7d).
        #[test]
        fn balanced_data_give_the_analysis_of_variance(
            machines in 4_usize..30, nights in 4_usize..12, a in 0.5_f64..5.0, b in 0.5_f64..5.0
        ) {
            let data = balanced(machines, nights, [a, b, 1.0]);
            let (m, n) = (machines as f64, nights as f64);
            let mean = |keep: &dyn Fn(usize) -> bool| {
                let kept: Vec<f64> = (0..data.y.len()).filter(|i| keep(*i)).map(|i| data.y[i]).collect();
                kept.iter().sum::<f64>() / kept.len() as f64
            };
            let all = mean(&|_| true);
            let by_machine: Vec<f64> = (0..machines).map(|k| mean(&|i| data.machines[i] == k) - all).collect();
            let by_night: Vec<f64> = (0..nights).map(|k| mean(&|i| data.nights[i] == k) - all).collect();
            let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
            let rest: Vec<f64> = (0..data.y.len())
                .map(|i| data.y[i] - all - by_machine[data.machines[i]] - by_night[data.nights[i]])
                .collect();
            let rest = squares(&rest) / ((m - 1.0) * (n - 1.0));
            let of_machines = (n * squares(&by_machine) / (m - 1.0) - rest) / n;
            let of_nights = (m * squares(&by_night) / (n - 1.0) - rest) / m;
            prop_assume!(of_machines > 0.01 && of_nights > 0.01);
            let fit = fitted(&data);
            // The search ends at 1e-7 of the share.
            prop_assert!((fit.residual_sigma.powi(2) / rest - 1.0).abs() < 1e-5);
            prop_assert!((fit.group_sigmas[0].powi(2) / of_machines - 1.0).abs() < 1e-4);
            prop_assert!((fit.group_sigmas[1].powi(2) / of_nights - 1.0).abs() < 1e-4);
            prop_assert!((fit.coefficients[0].value - all).abs() < 1e-9);
            // And the prediction is the mean drawn towards zero by what is not known of it.
            let drawn = of_machines / (of_machines + rest / n);
            for (effect, mean) in fit.effects[0].iter().zip(&by_machine) {
                prop_assert!((effect.value - drawn * mean).abs() < 1e-4 * a);
            }
        }
    }

    #[test]
    fn what_is_not_there_is_nothing() {
        let mut data = balanced(12, 6, [1.0, 0.0, 0.5]);
        // Nights alike to the last digit: less than chance.
        for machine in 0..12 {
            let middle = (0..6).map(|night| data.y[machine * 6 + night]).sum::<f64>() / 6.0;
            for night in 0..6 {
                data.y[machine * 6 + night] = middle + 0.1 * f64::from(u8::from((night + machine) % 2 == 0));
            }
        }
        let fit = fitted(&data);
        assert_eq!(fit.group_sigmas[1], 0.0);
        assert!(fit.effects[1].iter().all(|effect| effect.value == 0.0 && effect.standard_error == 0.0));
    }

    /// Equal bytes every night: no rest at all.
    #[test]
    fn without_any_rest_machines_are_what_they_are() {
        let data = balanced(8, 3, [1.0, 0.0, 0.0]);
        let fit = fitted(&data);
        assert!(fit.residual_sigma < 1e-3 && fit.group_sigmas[0] > 0.5, "{fit:?}");
    }

    #[test]
    fn what_is_no_model_is_refused() {
        let groups: Vec<usize> = vec![0, 1, 2];
        let fit = |y: &[f64], columns: usize, groups: &[usize]| {
            let fixed =
                DMatrix::from_fn(y.len(), columns, |row, column| if column == 0 { 1.0 } else { row as f64 });
            MixedModel { y, fixed, groups: vec![groups] }.fit()
        };
        assert_eq!(fit(&[1.0, 2.0], 1, &groups), Err(NoFit::Invalid));
        assert_eq!(fit(&[1.0, f64::NAN, 1.0], 1, &groups), Err(NoFit::Invalid));
        assert_eq!(fit(&[1.0, 2.0, 3.0], 3, &groups), Err(NoFit::TooFew));
        assert_eq!(fit(&[1.0, 2.0, 3.0], 1, &[0, 1, usize::MAX - 1]), Err(NoFit::Invalid));
        let same = MixedModel {
            y: &[1.0, 2.0, 4.0],
            fixed: DMatrix::from_element(3, 2, 1.0),
            groups: vec![&groups],
        };
        assert_eq!(same.fit(), Err(NoFit::Collinear));
    }
}
