//! Which of many hypotheses explain the residuals of linear balances.
//!
//! A balance is a vector of residuals `r` that would be zero but for errors: `r = C x + e`, with `e ~ N(0, S)` and one column of `C` for
//! each parameter `x`. Some parameters always differ from zero by as much as is declared of them (`x ~ N(0, sigma^2)`). The others are
//! hypotheses: each is exactly zero unless it is a member of the explanation, and then `x ~ N(0, sigma^2)` as well. Beforehand each
//! hypothesis is a member with probability `expected / count`, independent of the others.
//!
//! The evidence of a set has a closed form (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, sect. 2.7), so that
//! nothing is drawn and nothing is fitted. If the residuals are as described, a single member that is more probable than none comes up in at
//! most a share `expected` of all recordings in which nothing is wrong, by Markov's inequality, for a Bayes factor has mean 1 there. In
//! fact far less: it takes some 4.5 standard errors, and 30 hypotheses have that in one of 5,000.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Most members of an explanation: bounds the search. Judgement.
const MAX_MEMBERS: usize = 4;

/// Residuals with what may move them.
#[derive(Debug, Clone, PartialEq)]
pub struct Balance {
    /// One for each row.
    pub residual: DVector<f64>,
    /// Covariance of the rows without any of the parameters, rows x rows, positive definite.
    pub covariance: DMatrix<f64>,
    /// By how much each parameter moves the residuals, rows x parameters.
    pub columns: DMatrix<f64>,
}

/// What all balances together say of the parameters: precision and pull of one Gaussian likelihood.
#[derive(Debug, Clone, PartialEq)]
pub struct Likelihood {
    precision: DMatrix<f64>,
    pull: DVector<f64>,
}

/// One standard deviation of each parameter beforehand, in the order of the balances' columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Priors {
    /// Of the parameters that always differ from zero: the first columns.
    pub always: Vec<f64>,
    /// Of the hypotheses: the columns after them.
    pub hypotheses: Vec<f64>,
    /// Expected number of members, above 0 and at most 1.
    pub expected: f64,
}

/// A hypothesis that belongs to the explanation.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Position among the hypotheses.
    pub index: usize,
    /// Its size: mean and standard deviation, given the other members.
    pub value: f64,
    /// One standard deviation of `value`.
    pub sigma: f64,
    /// Hypotheses that could stand in its place, most probable first, with their probability relative to it (at most about 1).
    pub alternatives: Vec<(usize, f64)>,
}

/// The most probable explanation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Explanation {
    /// Empty where nothing is wrong.
    pub members: Vec<Member>,
    /// ln of its probability over that of the empty one.
    pub ln_odds: f64,
}

impl Likelihood {
    /// Of this number of parameters, without any balance.
    pub fn new(parameters: usize) -> Self {
        Likelihood { precision: DMatrix::zeros(parameters, parameters), pull: DVector::zeros(parameters) }
    }

    /// Adds a balance that errs independently of the others. `None` where its covariance is not positive definite, a number is not finite or
    /// the shapes do not agree; nothing is added then.
    pub fn add(&mut self, balance: &Balance) -> Option<()> {
        let Balance { residual, covariance, columns } = balance;
        let rows = residual.len();
        if covariance.shape() != (rows, rows) || columns.shape() != (rows, self.pull.len()) {
            return None;
        }
        let numbers = residual.iter().chain(covariance.iter()).chain(columns.iter());
        if !numbers.clone().all(|number| number.is_finite()) {
            return None;
        }
        let lower = covariance.clone().cholesky()?.unpack();
        let columns = lower.solve_lower_triangular(columns)?;
        let residual = lower.solve_lower_triangular(residual)?;
        self.precision += columns.tr_mul(&columns);
        self.pull += columns.tr_mul(&residual);
        Some(())
    }

    /// The scaled posterior precision `1 + D H D` of some parameters, factored, and their scaled pull.
    fn posterior(&self, free: &[(usize, f64)]) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
        let count = free.len();
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            let ((a, of_a), (b, of_b)) = (free[i], free[j]);
            of_a * of_b * self.precision[(a, b)] + f64::from(u8::from(i == j))
        });
        let pull = DVector::from_iterator(count, free.iter().map(|(a, sigma)| sigma * self.pull[*a]));
        Some((matrix.cholesky()?, pull))
    }

    /// ln of the evidence of these parameters (index, standard deviation beforehand) over that of none.
    fn ln_evidence(&self, free: &[(usize, f64)]) -> Option<f64> {
        let (factor, pull) = self.posterior(free)?;
        let ln_root_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        Some(0.5 * pull.dot(&factor.solve(&pull)) - ln_root_determinant)
    }

    /// Standard error with which the balances tell the size of each hypothesis by itself; infinite where they do not.
    pub fn standard_errors(&self, priors: &Priors) -> Option<Vec<f64>> {
        let always: Vec<(usize, f64)> = priors.always.iter().copied().enumerate().collect();
        let (factor, _) = self.posterior(&always)?;
        let error = |index: usize| {
            let own = always.len() + index;
            let shared = DVector::from_iterator(
                always.len(),
                always.iter().map(|(other, sigma)| sigma * self.precision[(*other, own)]),
            );
            let information = self.precision[(own, own)] - shared.dot(&factor.solve(&shared));
            information.max(0.0).sqrt().recip()
        };
        Some((0..priors.hypotheses.len()).map(error).collect())
    }

    /// The most probable set of hypotheses, found by adding, swapping and removing members until nothing is more probable.
    pub fn explain(&self, priors: &Priors) -> Option<Explanation> {
        let always: Vec<(usize, f64)> = priors.always.iter().copied().enumerate().collect();
        let count = priors.hypotheses.len();
        let cost = (count as f64 / priors.expected).ln();
        let free = |members: &[usize]| -> Vec<(usize, f64)> {
            let hypotheses = members.iter().map(|i| (always.len() + i, priors.hypotheses[*i]));
            always.iter().copied().chain(hypotheses).collect()
        };
        let nothing = self.ln_evidence(&always)?;
        let ln_odds = |members: &[usize]| {
            let evidence = self.ln_evidence(&free(members)).unwrap_or(f64::NEG_INFINITY);
            evidence - nothing - cost * members.len() as f64
        };
        let (mut members, mut best) = (Vec::new(), 0.0);
        while let Some((odds, better)) = neighbours(&members, count)
            .into_iter()
            .map(|set| (ln_odds(&set), set))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(odds, _)| *odds > best + 1e-9)
        {
            (best, members) = (odds, better);
        }
        let (factor, pull) = self.posterior(&free(&members))?;
        let (solved, inverse) = (factor.solve(&pull), factor.inverse());
        let member = |(place, index): (usize, &usize)| {
            let row = always.len() + place;
            let sigma = priors.hypotheses[*index];
            let mut alternatives: Vec<(usize, f64)> = (0..count)
                .filter(|other| !members.contains(other))
                .map(|other| {
                    let mut set = members.clone();
                    set[place] = other;
                    (other, (ln_odds(&set) - best).exp())
                })
                .collect();
            alternatives.sort_by(|a, b| b.1.total_cmp(&a.1));
            Member {
                index: *index,
                value: sigma * solved[row],
                sigma: sigma * inverse[(row, row)].max(0.0).sqrt(),
                alternatives,
            }
        };
        Some(Explanation { members: members.iter().enumerate().map(member).collect(), ln_odds: best })
    }
}

/// All sets that differ from this one by a member more, a member less or one member in another's place.
fn neighbours(members: &[usize], count: usize) -> Vec<Vec<usize>> {
    let without = |place: usize| -> Vec<usize> {
        members.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, member)| *member).collect()
    };
    let others = || (0..count).filter(|other| !members.contains(other));
    let with = |set: Vec<usize>, other: usize| set.into_iter().chain([other]).collect::<Vec<usize>>();
    let mut sets: Vec<Vec<usize>> = (0..members.len()).map(without).collect();
    sets.extend((0..members.len()).flat_map(|place| others().map(move |other| with(without(place), other))));
    if members.len() < MAX_MEMBERS {
        sets.extend(others().map(|other| with(members.to_vec(), other)));
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn columns(rows: usize, parameters: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, parameters, |i, j| ((i + 1) as f64 * (j as f64 + 1.3)).sin())
    }

    /// ln of a zero-mean normal density.
    fn ln_density(r: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let factor = covariance.clone().cholesky().unwrap();
        -0.5 * r.dot(&factor.solve(r)) - factor.l().diagonal().iter().map(|x| x.ln()).sum::<f64>()
    }

    proptest! {
        /// Against the density of the residuals with the parameters' covariance written out.
        #[test]
        fn evidence_is_that_of_the_whole_density(
            residual in proptest::collection::vec(-3.0..3.0_f64, 6),
            sigmas in proptest::collection::vec(0.1..3.0_f64, 3),
        ) {
            let residual = DVector::from_vec(residual);
            let alike = DMatrix::from_fn(6, 6, |i, j| (-((i as f64 - j as f64) / 2.0).powi(2)).exp());
            let covariance = alike + DMatrix::identity(6, 6);
            let columns = columns(6, 3);
            let mut likelihood = Likelihood::new(3);
            let balance = Balance { residual, covariance, columns };
            likelihood.add(&balance).unwrap();
            let free: Vec<(usize, f64)> = sigmas.iter().copied().enumerate().collect();
            let scaled = &balance.columns * DMatrix::from_diagonal(&DVector::from_vec(sigmas.clone()));
            let whole = &balance.covariance + &scaled * scaled.transpose();
            let expected =
                ln_density(&balance.residual, &whole) - ln_density(&balance.residual, &balance.covariance);
            prop_assert!((likelihood.ln_evidence(&free).unwrap() - expected).abs() < 1e-9);
            // Generalised least squares of the last parameter with the others in the covariance.
            let priors = Priors { always: sigmas[..2].to_vec(), hypotheses: vec![1.0], expected: 0.1 };
            let first = balance.columns.columns(0, 2) * DMatrix::from_diagonal(&DVector::from_row_slice(&sigmas[..2]));
            let factor = (&balance.covariance + &first * first.transpose()).cholesky().unwrap();
            let last = balance.columns.column(2).into_owned();
            let error = last.dot(&factor.solve(&last)).sqrt().recip();
            prop_assert!((likelihood.standard_errors(&priors).unwrap()[0] / error - 1.0).abs() < 1e-9);
        }
    }

    /// Draws without a fault alarm in less than one of a hundred; a fault of eight standard errors is found and sized.
    #[test]
    fn sound_draws_are_quiet_and_a_fault_is_named() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_pcg::Pcg64::seed_from_u64(7);
        let columns = columns(30, 9);
        let priors = Priors { always: vec![0.3; 2], hypotheses: vec![2.0; 7], expected: 0.1 };
        let (mut alarms, mut named) = (0, 0);
        let draws = 2000;
        for _ in 0..draws {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let declared = DVector::from_fn(2, |_, _| 0.3 * normal());
            let sound = DVector::from_fn(30, |_, _| normal()) + columns.columns(0, 2) * declared;
            let explain = |residual: DVector<f64>| {
                let covariance = DMatrix::identity(30, 30);
                let mut likelihood = Likelihood::new(9);
                likelihood.add(&Balance { residual, covariance, columns: columns.clone() }).unwrap();
                likelihood.explain(&priors).unwrap()
            };
            alarms += usize::from(!explain(sound.clone()).members.is_empty());
            let size = 8.0 / columns.column(4).norm();
            let found = explain(sound + size * columns.column(4)).members;
            let right =
                |member: &Member| member.index == 2 && (member.value - size).abs() < 4.0 * member.sigma;
            named += usize::from(found.len() == 1 && found.iter().all(right));
        }
        assert!(alarms <= draws / 100, "{alarms} alarms in {draws} sound draws");
        // Two of the columns are nearly one, so that a few draws name the other.
        assert!(named > draws * 9 / 10, "{named} of {draws} named");
    }

    #[test]
    fn a_balance_without_a_density_is_not_added() {
        let singular = Balance {
            residual: DVector::zeros(2),
            covariance: DMatrix::from_element(2, 2, 1.0),
            columns: DMatrix::zeros(2, 1),
        };
        let mut likelihood = Likelihood::new(1);
        assert_eq!(likelihood.add(&singular), None);
        assert_eq!(likelihood, Likelihood::new(1));
    }
}
