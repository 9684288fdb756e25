//! Levenberg-Marquardt on the joint fit's normal equations. Their matrix has arrow shape: a step's own parameters couple only with themselves
//! and the shared ones, so they are eliminated step by step.

use crate::joint::fit::input_noise::{InputNoise, Whitening};
use crate::joint::step_model::history::{PartsAtEnd, Prediction};
use crate::joint::step_model::linearised::{Model, StepHistory};
use crate::joint::step_model::parameters::{
    ETA, HOUSING, LOCAL, LocalVector, OFFSETS, Prior, SHARED, SharedVector, bounds, longest_move,
};
use crate::joint::step_model::parts::Parts;
use mapper_core::IdentifiedInlet;
use mapper_numerics::least_squares::{Arrow, ArrowBlock, DampedFit, ENOUGH, Reduced, inverse, minimise};
use mapper_numerics::parallel;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix4, Matrix4xX, Vector4};

/// Relative rounding error of the cost. Bound: some tens of roundings of f64.
const COST_ROUNDING: f64 = 1e-14;

/// Decrease of the cost for another iteration of an intermediate fit. Bound: the weights that follow change it by more.
const ROUGHLY: f64 = 1.0;

/// Largest part of the apparent information about a combination of parameters that counts as noise of the inputs. Bound: its scatter is then four
/// times the apparent one, and the part itself is known no better from some hundred values of smoothed inputs.
const MAX_NOISE_SHARE: f64 = 0.75;

/// One step in the fit.
#[derive(Debug, Clone)]
pub(crate) struct Member<'a> {
    pub(crate) history: StepHistory<'a>,
    /// Readings of T2 of each row, then of Tc, K.
    pub(crate) measured_k: Vec<f64>,
    pub(crate) whitening: Whitening,
    /// Contribution of the shared parameters to the point's efficiency: the surface terms at the step's end.
    pub(crate) coupling: SharedVector,
    pub(crate) local: LocalVector,
    /// Priors of the step's parameters; that of the efficiency is not used: see `surface_sigma`.
    pub(crate) priors: [Prior; LOCAL],
    /// Whether the step contributes to the shared parameters.
    pub(crate) contributes: bool,
    /// Whether the step is always excluded: its region of the map disagrees with the others.
    pub(crate) excluded: bool,
}

/// The whole fit.
#[derive(Debug, Clone)]
pub(crate) struct Problem<'a> {
    pub(crate) model: Model,
    pub(crate) members: Vec<Member<'a>>,
    pub(crate) shared: SharedVector,
    pub(crate) priors: [Prior; SHARED],
    pub(crate) active: [bool; SHARED],
    /// Spread of a point's efficiency about the surface, one standard deviation; infinite without a surface.
    pub(crate) surface_sigma: f64,
    /// Error that a housing of three parts leaves in each shared parameter, by its change from two parts; 0 for other housings.
    pub(crate) left_over: SharedVector,
    /// The expected sum of squares of input noise, which the cost is without.
    pub(crate) input_noise: InputNoise,
    /// Whether no noise is declared, so that a fit is exact.
    pub(crate) is_exact: bool,
    /// Whether the recording is to decide which law h before the wheel follows.
    pub(crate) inlet_sought: bool,
    /// Result of that decision; `None` if it makes no difference.
    pub(crate) inlet: Option<IdentifiedInlet>,
}

/// The normal equations and the cost at the current parameters.
struct Normal {
    cost: f64,
    equations: Arrow<LOCAL>,
}

/// A fit on its way to the minimum.
struct Descent<'p, 'a> {
    problem: &'p mut Problem<'a>,
    /// Indices of the fitted shared parameters.
    fitted: Vec<usize>,
}

impl DampedFit for Descent<'_, '_> {
    type Equations = Arrow<LOCAL>;
    type Place = (SharedVector, Vec<LocalVector>);

    fn linearise(&self) -> Option<(f64, Arrow<LOCAL>)> {
        let Normal { cost, equations } = self.problem.normal(&self.fitted);
        cost.is_finite().then_some((cost, equations))
    }

    fn step(&self, equations: &Arrow<LOCAL>, cost: f64, damping: f64) -> Option<(Self::Place, f64)> {
        let Descent { problem, fitted } = self;
        let (change, own) = equations.step(damping)?;
        // A step across a bound, or beyond where the model is linear, is cut there as a whole, which still reduces the cost.
        let reach = fitted.iter().enumerate().map(|(row, index)| {
            let (low, high) = bounds(*index);
            let bound = if change[row] > 0.0 { high } else { low };
            let share = (bound - problem.shared[*index]) / change[row];
            let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 };
            share.min(longest_move(*index) / change[row].abs().max(f64::MIN_POSITIVE))
        });
        let share = reach.fold(1.0, f64::min);
        let mut shared = problem.shared;
        for (row, index) in fitted.iter().enumerate() {
            let (low, high) = bounds(*index);
            shared[*index] = (shared[*index] + share * change[row]).clamp(low, high);
        }
        let locals: Vec<LocalVector> = problem
            .members
            .iter()
            .zip(&own)
            .map(|(member, change)| std::array::from_fn(|i| member.local[i] + share * change[i]))
            .collect();
        let next = problem.cost(&shared, &locals);
        (next <= cost + cost.abs() * COST_ROUNDING).then_some(((shared, locals), next))
    }

    fn move_to(&mut self, (shared, locals): Self::Place) -> Option<()> {
        let Descent { problem, fitted } = self;
        // A parameter on its bound stays there while the others are fitted.
        fitted.retain(|index| {
            let (low, high) = bounds(*index);
            shared[*index] > low && shared[*index] < high
        });
        // An excluded step is not in the cost: it moves only if its own fit improves.
        let mut moves = vec![true; problem.members.len()];
        if problem.members.iter().any(|member| !member.contributes) {
            let after = problem.local_costs(&shared, &locals);
            let before = problem.local_costs(&shared, &problem.locals());
            for (i, member) in problem.members.iter().enumerate() {
                moves[i] = member.contributes || after[i] <= before[i];
            }
        }
        problem.shared = shared;
        for ((member, local), moves) in problem.members.iter_mut().zip(locals).zip(moves) {
            if moves {
                member.local = local;
            }
        }
        Some(())
    }
}

/// Covariance of all parameters, as far as needed.
#[derive(Debug, Clone)]
pub(crate) struct Covariance {
    /// Indices of the fitted shared parameters.
    pub(crate) fitted: Vec<usize>,
    pub(crate) shared: DMatrix<f64>,
    /// For each step: covariance of its own parameters with the shared ones free, and of own with shared.
    pub(crate) own: Vec<(Matrix4<f64>, Matrix4xX<f64>)>,
    /// For each step: sensitivity of its own parameters to the shared ones.
    pub(crate) sensitivities: Vec<Matrix4xX<f64>>,
}

/// Factor of the information about the parameters without the noise of its derivatives, at most [`MAX_NOISE_SHARE`] of it.
fn without_noise(information: &DMatrix<f64>, noise: &DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let factor = information.clone().cholesky()?;
    if noise.iter().all(|value| *value == 0.0) {
        return Some(factor);
    }
    let lower = factor.l();
    let half = lower.solve_lower_triangular(noise)?;
    let relative = lower.solve_lower_triangular(&half.transpose())?.symmetric_eigen();
    let left = relative.eigenvalues.map(|share| 1.0 - share.clamp(0.0, MAX_NOISE_SHARE));
    let whole = &lower * relative.eigenvectors;
    (&whole * DMatrix::from_diagonal(&left) * whole.transpose()).cholesky()
}

impl Member<'_> {
    /// Whitened residual and derivatives; the latter are empty where the prediction has none.
    fn whitened(&self, prediction: &Prediction) -> (Vec<f64>, Vec<Vec<f64>>) {
        let rows = self.measured_k.len();
        let residual: Vec<f64> =
            self.measured_k.iter().zip(&prediction.readings_k).map(|(a, b)| a - b).collect();
        let known: Vec<usize> =
            (0..prediction.columns.len()).filter(|index| prediction.columns[*index].len() == rows).collect();
        let mut all = DMatrix::zeros(rows, known.len() + 1);
        all.column_mut(0).copy_from_slice(&residual);
        for (place, index) in known.iter().enumerate() {
            all.column_mut(place + 1).copy_from_slice(&prediction.columns[*index]);
        }
        let all = self.whitening.apply(&all);
        let column = |place: usize| all.column(place).iter().copied().collect::<Vec<f64>>();
        let mut columns = vec![Vec::new(); prediction.columns.len()];
        known.iter().enumerate().for_each(|(place, index)| columns[*index] = column(place + 1));
        (column(0), columns)
    }

    /// Deviation of the point's efficiency from the surface.
    pub(crate) fn off_surface(&self, shared: &SharedVector, local: &LocalVector) -> f64 {
        local[ETA] - self.coupling.iter().zip(shared).map(|(a, b)| a * b).sum::<f64>()
    }
}

impl Covariance {
    fn of(
        fitted: Vec<usize>,
        shared: DMatrix<f64>,
        equations: &Arrow<LOCAL>,
        inverses: &[Matrix4<f64>],
    ) -> Self {
        let sensitivities: Vec<Matrix4xX<f64>> =
            equations.blocks.iter().zip(inverses).map(|(block, inverse)| -(inverse * &block.mixed)).collect();
        let own = sensitivities
            .iter()
            .zip(inverses)
            .map(|(answer, inverse)| {
                let mixed = answer * &shared;
                (inverse + &mixed * answer.transpose(), mixed)
            })
            .collect();
        Covariance { fitted, shared, own, sensitivities }
    }

    /// Row of a shared parameter; `None` if it was not fitted.
    pub(crate) fn row_of(&self, index: usize) -> Option<usize> {
        self.fitted.iter().position(|fitted| *fitted == index)
    }

    /// Standard error of a shared parameter.
    pub(crate) fn error_of(&self, index: usize) -> Option<f64> {
        self.row_of(index).map(|row| self.shared[(row, row)].max(0.0).sqrt())
    }
}

impl Problem<'_> {
    pub(crate) fn fitted(&self) -> Vec<usize> {
        (0..SHARED).filter(|index| self.active[*index]).collect()
    }

    pub(crate) fn locals(&self) -> Vec<LocalVector> {
        self.members.iter().map(|member| member.local).collect()
    }

    /// The predictions of all steps, with derivatives by the parameters of the steps and the shared ones named in `by`. With several parts of the
    /// housing, step after step: each begins with the parts of the one before.
    pub(crate) fn predictions(
        &self,
        shared: &SharedVector,
        locals: &[LocalVector],
        by: Option<&[bool; SHARED]>,
    ) -> Vec<Prediction> {
        let none = [false; SHARED];
        let predict = |member: &Member<'_>, local: &LocalVector, before: Option<&PartsAtEnd>| {
            self.model.predict(&member.history, (shared, local), by.unwrap_or(&none), by.is_some(), before)
        };
        let members: Vec<_> = self.members.iter().zip(locals).collect();
        if self.model.parts == Parts::One {
            return parallel::map(&members, |(member, local)| predict(member, local, None));
        }
        let mut predictions: Vec<Prediction> = Vec::with_capacity(members.len());
        for (member, local) in members {
            let before = predictions.last().and_then(|prediction| prediction.parts.as_ref());
            let prediction = predict(member, local, before);
            predictions.push(prediction);
        }
        predictions
    }

    /// The other parts of the housing at the begin of each step.
    pub(crate) fn parts(&self, predictions: &[Prediction]) -> Vec<Option<PartsAtEnd>> {
        let ends = predictions.iter().map(|prediction| prediction.parts.clone());
        std::iter::once(None).chain(ends).take(self.members.len()).collect()
    }

    /// Whitened residuals of all steps (measured minus predicted), and whitened derivatives of the prediction.
    fn residuals(
        &self,
        shared: &SharedVector,
        locals: &[LocalVector],
        by: Option<&[bool; SHARED]>,
    ) -> Vec<(Vec<f64>, Vec<Vec<f64>>)> {
        let predictions = self.predictions(shared, locals, by);
        let members: Vec<_> = self.members.iter().zip(predictions).collect();
        parallel::map(&members, |(member, prediction)| member.whitened(prediction))
    }

    /// Whitened residuals of all steps at the current parameters: T2, then Tc.
    pub(crate) fn whitened(&self) -> Vec<Vec<f64>> {
        let residuals = self.residuals(&self.shared, &self.locals(), None);
        residuals.into_iter().map(|(residual, _)| residual).collect()
    }

    fn local_costs(&self, shared: &SharedVector, locals: &[LocalVector]) -> Vec<f64> {
        let residuals = self.residuals(shared, locals, None);
        let steps = self.members.iter().zip(locals).zip(residuals);
        steps
            .map(|((member, local), (residual, _))| {
                let mut cost: f64 = residual.iter().map(|r| r * r).sum();
                for (index, prior) in member.priors.iter().enumerate() {
                    if index != ETA {
                        cost += prior.weight() * (local[index] - prior.mean).powi(2);
                    }
                }
                let off = member.off_surface(shared, local);
                cost + off * off / (self.surface_sigma * self.surface_sigma)
            })
            .collect()
    }

    fn shared_cost(&self, shared: &SharedVector) -> f64 {
        let prior = |i: &usize| self.priors[*i].weight() * (shared[*i] - self.priors[*i].mean).powi(2);
        self.fitted().iter().map(prior).sum::<f64>() - self.input_noise.value(shared)
    }

    fn normal(&self, fitted: &[usize]) -> Normal {
        let m = fitted.len();
        let mut normal = Normal {
            cost: self.shared_cost(&self.shared),
            equations: Arrow {
                shared: DMatrix::zeros(m, m),
                right: DVector::zeros(m),
                blocks: Vec::with_capacity(self.members.len()),
            },
        };
        let equations = &mut normal.equations;
        for (row, index) in fitted.iter().enumerate() {
            let prior = self.priors[*index];
            equations.shared[(row, row)] += prior.weight();
            equations.right[row] += prior.weight() * (prior.mean - self.shared[*index]);
            equations.right[row] += 0.5 * self.input_noise.slope[*index];
        }
        let surface_weight = 1.0 / (self.surface_sigma * self.surface_sigma);
        let mut wanted = [false; SHARED];
        for index in fitted {
            wanted[*index] = true;
        }
        let evaluated = self.residuals(&self.shared, &self.locals(), Some(&wanted));
        for (member, (residual, columns)) in self.members.iter().zip(evaluated) {
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let mut block = ArrowBlock {
                own: Matrix4::zeros(),
                mixed: Matrix4xX::zeros(m),
                right: Vector4::zeros(),
                contributes: member.contributes,
            };
            for i in 0..LOCAL {
                let column = &columns[SHARED + i];
                for j in i..LOCAL {
                    let value = product(column, &columns[SHARED + j]);
                    block.own[(i, j)] += value;
                    if i != j {
                        block.own[(j, i)] += value;
                    }
                }
                block.right[i] += product(column, &residual);
                if i != ETA {
                    let prior = member.priors[i];
                    block.right[i] += prior.weight() * (prior.mean - member.local[i]);
                }
            }
            let off = member.off_surface(&self.shared, &member.local);
            block.right[ETA] -= surface_weight * off;
            if member.contributes {
                normal.cost += residual.iter().map(|r| r * r).sum::<f64>() + off * off * surface_weight;
                for i in (0..LOCAL).filter(|i| *i != ETA) {
                    normal.cost +=
                        member.priors[i].weight() * (member.local[i] - member.priors[i].mean).powi(2);
                }
            }
            for (a, index) in fitted.iter().enumerate() {
                for i in 0..LOCAL {
                    block.mixed[(i, a)] += product(&columns[SHARED + i], &columns[*index]);
                }
                let term = |index: usize| member.coupling[index];
                if !member.contributes {
                    continue;
                }
                equations.right[a] +=
                    product(&columns[*index], &residual) + surface_weight * off * term(*index);
                for (b, other) in fitted.iter().enumerate().skip(a) {
                    let value = product(&columns[*index], &columns[*other])
                        + surface_weight * term(*index) * term(*other);
                    equations.shared[(a, b)] += value;
                    if a != b {
                        equations.shared[(b, a)] += value;
                    }
                }
            }
            self.add_known(member, &member.coupling, fitted, &mut block.own, &mut block.mixed);
            equations.blocks.push(block);
        }
        normal
    }

    /// Adds the information of a step in addition to its readings: the priors of its own parameters, and the spread of its efficiency about
    /// the surface.
    pub(crate) fn add_known(
        &self,
        member: &Member<'_>,
        coupling: &SharedVector,
        fitted: &[usize],
        own: &mut Matrix4<f64>,
        mixed: &mut Matrix4xX<f64>,
    ) {
        let surface_weight = 1.0 / (self.surface_sigma * self.surface_sigma);
        for i in (0..LOCAL).filter(|i| *i != ETA) {
            own[(i, i)] += member.priors[i].weight();
        }
        own[(ETA, ETA)] += surface_weight;
        for (a, index) in fitted.iter().enumerate() {
            mixed[(ETA, a)] -= surface_weight * coupling[*index];
        }
    }

    fn cost(&self, shared: &SharedVector, locals: &[LocalVector]) -> f64 {
        let costs = self.local_costs(shared, locals);
        let sharing = self.members.iter().zip(costs).filter(|(member, _)| member.contributes);
        self.shared_cost(shared) + sharing.map(|(_, cost)| cost).sum::<f64>()
    }

    pub(crate) fn square(&self) -> f64 {
        self.cost(&self.shared, &self.locals())
    }

    /// ln of the density of the recording, by Laplace's method at the minimum, up to a constant of the recording. It counts the steps that a fit
    /// excludes because it does not describe them.
    pub(crate) fn ln_evidence(&self) -> Option<f64> {
        let mut whole = self.clone();
        whole.members.iter_mut().for_each(|member| member.contributes = !member.excluded);
        whole.ln_density()
    }

    fn ln_density(&self) -> Option<f64> {
        let fitted = self.fitted();
        let Normal { cost, equations } = self.normal(&fitted);
        let Reduced { matrix, inverses, .. } = equations.reduced(0.0)?;
        let factor = matrix.cholesky()?;
        let mut ln_volume: f64 = -factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let sharing = self.members.iter().zip(&inverses).filter(|(member, _)| member.contributes);
        let mut ln_prior: f64 =
            fitted.iter().map(|i| self.priors[*i].weight()).filter(|w| *w > 0.0).map(|w| 0.5 * w.ln()).sum();
        let mut ln_noise = 0.0;
        for (member, inverse) in sharing {
            ln_volume += 0.5 * inverse.determinant().ln();
            ln_noise += member.whitening.ln_spread;
            let own = (0..LOCAL).filter(|index| *index != ETA).map(|index| member.priors[index].sigma.ln());
            ln_prior -= own.sum::<f64>() + self.surface_sigma.ln();
        }
        Some(-0.5 * cost + ln_volume + ln_prior - ln_noise)
    }

    /// ln of the ratio of h before the wheel to h after it by the inlet's own law, at the end of each step.
    pub(crate) fn ln_inlet_ratios(&self) -> Vec<f64> {
        self.members
            .iter()
            .filter_map(|member| {
                let end = member.history.step.rows.last()?;
                Some(self.model.at_end(end, &self.shared, &member.local).ln_inlet_ratio)
            })
            .collect()
    }

    /// Finds the minimum from the current parameters; `None` if it does not converge. Noise-free recordings resolve less than any standard
    /// error.
    pub(crate) fn minimise(&mut self) -> Option<f64> {
        self.descend(if self.is_exact { 0.0 } else { ENOUGH })
    }

    /// The same for an intermediate fit.
    pub(crate) fn minimise_roughly(&mut self) -> Option<f64> {
        self.descend(if self.is_exact { ENOUGH } else { ROUGHLY })
    }

    /// Ends if an iteration decreases the cost by `enough` or less.
    fn descend(&mut self, enough: f64) -> Option<f64> {
        let fitted = self.fitted();
        minimise(&mut Descent { problem: self, fitted }, enough)
    }

    /// Values of some shared parameters after one undamped step, ignoring bounds.
    pub(crate) fn full_step(&self, indices: &[usize]) -> Option<Vec<f64>> {
        let fitted = self.fitted();
        let Reduced { matrix, right, .. } = self.normal(&fitted).equations.reduced(0.0)?;
        let without = without_noise(&matrix, &self.input_noise.square_of(&fitted))?;
        // The slopes of the noise are those where it was found: away from there its second derivatives, which `matrix` has in excess, change them.
        let moved = self.input_noise.change(&self.shared, &fitted);
        let change = without.solve(&(right + &matrix * &moved)) - moved;
        let row = |index: &usize| fitted.iter().position(|other| other == index);
        indices.iter().map(|index| Some(self.shared[*index] + change[row(index)?])).collect()
    }

    /// Covariance at the minimum, by the information without the noise of its derivatives; `None` if the equations are singular.
    pub(crate) fn covariance(&self) -> Option<Covariance> {
        let fitted = self.fitted();
        let equations = self.normal(&fitted).equations;
        let Reduced { matrix, inverses, .. } = equations.reduced(0.0)?;
        let shared = if fitted.is_empty() {
            DMatrix::zeros(0, 0)
        } else {
            inverse(&without_noise(&matrix, &self.input_noise.square_of(&fitted))?)
        };
        Some(Covariance::of(fitted, shared, &equations, &inverses))
    }

    /// Scatter of some shared parameters, as corrected least squares has it: the noise of the derivatives adds nothing to the information but
    /// scatters the gradient, so that the information with it stands between two inverses without it.
    pub(crate) fn scatter(&self, indices: &[usize]) -> Option<DMatrix<f64>> {
        let fitted = self.fitted();
        let Reduced { matrix, .. } = self.normal(&fitted).equations.reduced(0.0)?;
        let found = inverse(&without_noise(&matrix, &self.input_noise.square_of(&fitted))?);
        let scatter = &found * matrix * &found;
        let rows: Vec<usize> = indices
            .iter()
            .map(|index| fitted.iter().position(|other| other == index))
            .collect::<Option<_>>()?;
        Some(DMatrix::from_fn(rows.len(), rows.len(), |a, b| scatter[(rows[a], rows[b])]))
    }

    /// Covariance of a fit without the errors of the readings, which keep their declared spread: every other parameter responds to them as the
    /// fit does (Schmidt's consider covariance).
    pub(crate) fn considered(&self) -> Option<Covariance> {
        let is_error = |index: &usize| (OFFSETS..HOUSING).contains(index);
        let mut fitted = self.fitted();
        fitted.sort_by_key(is_error);
        let equations = self.normal(&fitted).equations;
        let Reduced { matrix: reduced, inverses, .. } = equations.reduced(0.0)?;
        let sought = fitted.iter().filter(|index| !is_error(index)).count();
        let carried = fitted.len() - sought;
        let found = if sought == 0 {
            DMatrix::zeros(0, 0)
        } else {
            inverse(&reduced.view((0, 0), (sought, sought)).into_owned().cholesky()?)
        };
        let answer = -(&found * reduced.view((0, sought), (sought, carried)));
        let spread = DMatrix::from_diagonal(&DVector::from_iterator(
            carried,
            fitted[sought..].iter().map(|index| self.priors[*index].sigma.powi(2)),
        ));
        let mixed = &answer * &spread;
        let mut shared = DMatrix::zeros(fitted.len(), fitted.len());
        shared.view_mut((0, 0), (sought, sought)).copy_from(&(found + &mixed * answer.transpose()));
        shared.view_mut((0, sought), (sought, carried)).copy_from(&mixed);
        shared.view_mut((sought, 0), (carried, sought)).copy_from(&mixed.transpose());
        shared.view_mut((sought, sought), (carried, carried)).copy_from(&spread);
        Some(Covariance::of(fitted, shared, &equations, &inverses))
    }
}
