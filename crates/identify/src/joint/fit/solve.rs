//! Levenberg-Marquardt on the joint fit's normal equations. Their matrix has arrow shape: a step's own parameters couple only with themselves
//! and the shared ones, so they are eliminated step by step.

use crate::joint::fit::input_noise_spline::InputNoiseSpline;
use crate::joint::step_model::model::{Setting, StepHistory};
use crate::joint::step_model::parameters::{
    ETA, LOCAL, LocalVector, OFFSETS, PROBE_MM2, Prior, REFINEMENTS, SHARED, SURFACE, SharedVector,
};
use mapper_core::IdentifiedInlet;
use mapper_numerics::coloured_noise::WhiteningFilter;
use mapper_numerics::least_squares::descent::ENOUGH;
use mapper_numerics::least_squares::{Arrow, ArrowBlock, DampedFit, Reduced, minimise};
use mapper_numerics::parallel;
use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX, Vector4};

/// Relative rounding error of the cost. Bound: some tens of roundings of f64.
const COST_ROUNDING: f64 = 1e-14;

/// One step in the fit.
#[derive(Debug, Clone)]
pub(crate) struct Member<'a> {
    pub(crate) history: StepHistory<'a>,
    /// Measured T2 of each row, K.
    pub(crate) measured_k: Vec<f64>,
    pub(crate) whitening: WhiteningFilter,
    /// Contribution of the shared parameters to the point's efficiency: the surface terms at the step's end, and for each offset's bend the
    /// effect of that offset on the fitted efficiency.
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
    pub(crate) setting: Setting,
    pub(crate) members: Vec<Member<'a>>,
    pub(crate) shared: SharedVector,
    pub(crate) priors: [Prior; SHARED],
    pub(crate) active: [bool; SHARED],
    /// Lower bound of each shared parameter.
    pub(crate) lowest: SharedVector,
    /// Spread of a point's efficiency about the surface, one standard deviation; infinite without a surface.
    pub(crate) surface_sigma: f64,
    /// Contribution of noise in T1, Tc, flow and pressures to the sum of squares, as a function of the probe.
    pub(crate) input_noise: InputNoiseSpline,
    /// Whether the probe is fitted, even if it is currently on its bound.
    pub(crate) probe_fitted: bool,
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
        let mut shared = problem.shared;
        for (row, index) in fitted.iter().enumerate() {
            shared[*index] = (shared[*index] + change[row]).max(problem.lowest[*index]);
        }
        let locals: Vec<LocalVector> = problem
            .members
            .iter()
            .zip(&own)
            .map(|(member, change)| std::array::from_fn(|i| member.local[i] + change[i]))
            .collect();
        let next = problem.cost(&shared, &locals);
        (next <= cost * (1.0 + COST_ROUNDING)).then_some(((shared, locals), next))
    }

    fn move_to(&mut self, (shared, locals): Self::Place) -> Option<()> {
        let Descent { problem, fitted } = self;
        // A parameter on its bound stays there while the others are fitted.
        fitted.retain(|index| shared[*index] > problem.lowest[*index]);
        for (active, (value, lowest)) in problem.active.iter_mut().zip(shared.iter().zip(&problem.lowest)) {
            *active &= value > lowest;
        }
        // An excluded step is not in the cost: it moves only if its own fit improves.
        let moves: Vec<bool> = problem
            .members
            .iter()
            .zip(&locals)
            .map(|(member, local)| {
                member.contributes
                    || problem.local_cost(member, &shared, local)
                        <= problem.local_cost(member, &shared, &member.local)
            })
            .collect();
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
    /// Their covariance.
    pub(crate) shared: DMatrix<f64>,
    /// For each step: covariance of its own parameters with the shared ones free, and of own with shared.
    pub(crate) own: Vec<(Matrix4<f64>, Matrix4xX<f64>)>,
    /// For each step: sensitivity of its own parameters to the shared ones.
    pub(crate) sensitivities: Vec<Matrix4xX<f64>>,
}

impl Member<'_> {
    /// Deviation of the point's efficiency from the surface.
    pub(crate) fn off_surface(&self, shared: &SharedVector, local: &LocalVector) -> f64 {
        local[ETA] - self.coupling.iter().zip(shared).map(|(a, b)| a * b).sum::<f64>()
    }
}

impl Covariance {
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
    /// All uncertain shared parameters, offsets last.
    pub(crate) fn unknown(&self) -> Vec<usize> {
        let (carried, mut sought): (Vec<usize>, Vec<usize>) = (0..SHARED)
            .filter(|index| self.active[*index])
            .partition(|index| (OFFSETS..SURFACE).contains(index));
        sought.extend(carried);
        sought
    }

    /// The fitted parameters, without offsets and gains. A recording carries almost no information about those beyond the declaration, and
    /// small model errors would dominate it. They are propagated into the covariance.
    fn fitted(&self) -> Vec<usize> {
        (0..SHARED).filter(|index| self.active[*index] && !(OFFSETS..SURFACE).contains(index)).collect()
    }

    /// Whitened residuals of a step (measured minus predicted), and derivatives of the prediction by its own parameters and by the shared ones
    /// named in `by`.
    pub(crate) fn residual(
        &self,
        member: &Member<'_>,
        shared: &SharedVector,
        local: &LocalVector,
        by: Option<&[bool; SHARED]>,
    ) -> (Vec<f64>, Vec<Vec<f64>>) {
        // A fitted probe on its bound 0 still has its first reading.
        let mut none = [false; SHARED];
        none[PROBE_MM2] = self.active[PROBE_MM2];
        let prediction =
            self.setting.predict(&member.history, shared, local, by.unwrap_or(&none), by.is_some());
        let mut residual: Vec<f64> = member
            .measured_k
            .iter()
            .zip(&prediction.t2_k)
            .map(|(measured, predicted)| measured - predicted)
            .collect();
        member.whitening.apply(&mut residual);
        let mut columns = prediction.columns;
        for column in &mut columns {
            member.whitening.apply(column);
        }
        (residual, columns)
    }

    fn local_cost(&self, member: &Member<'_>, shared: &SharedVector, local: &LocalVector) -> f64 {
        let (residual, _) = self.residual(member, shared, local, None);
        let mut cost: f64 = residual.iter().map(|r| r * r).sum();
        for (index, prior) in member.priors.iter().enumerate() {
            if index != ETA {
                cost += prior.weight() * (local[index] - prior.mean).powi(2);
            }
        }
        let off = member.off_surface(shared, local);
        cost + off * off / (self.surface_sigma * self.surface_sigma)
    }

    fn shared_cost(&self, shared: &SharedVector) -> f64 {
        let priors: f64 = self
            .fitted()
            .iter()
            .map(|i| self.priors[*i].weight() * (shared[*i] - self.priors[*i].mean).powi(2))
            .sum();
        priors - self.input_noise.at(shared[PROBE_MM2]).0
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
            if *index == PROBE_MM2 {
                equations.right[row] += 0.5 * self.input_noise.at(self.shared[PROBE_MM2]).1;
            }
        }
        let surface_weight = 1.0 / (self.surface_sigma * self.surface_sigma);
        // Propagated parameters cost as many model evaluations as fitted ones, so the search skips them.
        let mut wanted = [false; SHARED];
        for index in fitted {
            wanted[*index] = true;
        }
        let evaluated = parallel::map(&self.members, |member| {
            self.residual(member, &self.shared, &member.local, Some(&wanted))
        });
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
        let sharing: Vec<_> =
            self.members.iter().zip(locals).filter(|(member, _)| member.contributes).collect();
        let costs = parallel::map(&sharing, |(member, local)| self.local_cost(member, shared, local));
        self.shared_cost(shared) + costs.iter().sum::<f64>()
    }

    /// The sum of squares at the current parameters.
    pub(crate) fn square(&self) -> f64 {
        let locals: Vec<LocalVector> = self.members.iter().map(|member| member.local).collect();
        self.cost(&self.shared, &locals)
    }

    /// ln of the ratio of h before the wheel to h after it by the inlet's own law, at the end of each step.
    pub(crate) fn ln_inlet_ratios(&self) -> Vec<f64> {
        self.members
            .iter()
            .filter_map(|member| {
                let end = member.history.rows.last()?;
                Some(self.setting.ln_inlet_ratio_at(end, &self.shared, &member.local))
            })
            .collect()
    }

    /// Finds the minimum from the current parameters; `None` if it does not converge. Noise-free recordings resolve less than any standard
    /// error.
    pub(crate) fn minimise(&mut self) -> Option<f64> {
        self.descend(0.0)
    }

    /// The same for an intermediate fit, or one that is compared with standard errors.
    pub(crate) fn minimise_roughly(&mut self) -> Option<f64> {
        self.descend(ENOUGH)
    }

    /// Ends if an iteration decreases the cost by `enough` or less.
    fn descend(&mut self, enough: f64) -> Option<f64> {
        let fitted = self.fitted();
        minimise(&mut Descent { problem: self, fitted }, enough)
    }

    /// Values of some shared parameters after one undamped step, ignoring bounds.
    pub(crate) fn full_step(&self, indices: &[usize]) -> Option<Vec<f64>> {
        let fitted = self.fitted();
        let (change, _) = self.normal(&fitted).equations.step(0.0)?;
        let row = |index: &usize| fitted.iter().position(|other| other == index);
        indices.iter().map(|index| Some(self.shared[*index] + change[row(index)?])).collect()
    }

    /// The problem at its minimum without the efficiency surface: the information of the steps and shared parameters alone.
    pub(crate) fn without_a_surface(&self) -> Option<Self> {
        let mut free = self.clone();
        free.surface_sigma = f64::INFINITY;
        free.active[SURFACE..].fill(false);
        for (index, _, slab_sigma, _) in REFINEMENTS {
            free.priors[index].sigma = slab_sigma;
        }
        free.minimise_roughly()?;
        Some(free)
    }

    /// The same problem with readings that have no offset and no gain error.
    pub(crate) fn with_exact_readings(&self) -> Self {
        let mut exact = self.clone();
        exact.active[OFFSETS..SURFACE].fill(false);
        exact
    }

    /// Covariance at the minimum; `None` if the equations are singular.
    ///
    /// Offsets keep their declared spread, and all other parameters respond to them as in the fit (Schmidt's consider covariance).
    pub(crate) fn covariance(&self) -> Option<Covariance> {
        let fitted = self.unknown();
        let equations = self.normal(&fitted).equations;
        let Reduced { matrix: reduced, inverses, .. } = equations.reduced(0.0)?;
        let sought = fitted.iter().filter(|index| !(OFFSETS..SURFACE).contains(*index)).count();
        let carried = fitted.len() - sought;
        let mut shared = DMatrix::zeros(fitted.len(), fitted.len());
        let inverse = if sought == 0 {
            DMatrix::zeros(0, 0)
        } else {
            reduced.view((0, 0), (sought, sought)).into_owned().cholesky()?.inverse()
        };
        let answer = -(&inverse * reduced.view((0, sought), (sought, carried)));
        // Input noise moves the probe more than least squares expects.
        let mut inverse = inverse;
        for (row, index) in fitted[..sought].iter().enumerate() {
            let pulled = inverse.column(row).into_owned();
            if *index == PROBE_MM2 {
                inverse += self.input_noise.half_slope_variance(self.shared[PROBE_MM2])
                    * &pulled
                    * pulled.transpose();
            }
        }
        let inverse = inverse;
        let spread = DMatrix::from_diagonal(&DVector::from_iterator(
            carried,
            fitted[sought..].iter().map(|index| self.priors[*index].sigma.powi(2)),
        ));
        let mixed = &answer * &spread;
        shared.view_mut((0, 0), (sought, sought)).copy_from(&(inverse + &mixed * answer.transpose()));
        shared.view_mut((0, sought), (sought, carried)).copy_from(&mixed);
        shared.view_mut((sought, 0), (carried, sought)).copy_from(&mixed.transpose());
        shared.view_mut((sought, sought), (carried, carried)).copy_from(&spread);
        let sensitivities: Vec<Matrix4xX<f64>> = equations
            .blocks
            .iter()
            .zip(&inverses)
            .map(|(block, inverse)| -(inverse * &block.mixed))
            .collect();
        let own = sensitivities
            .iter()
            .zip(&inverses)
            .map(|(answer, inverse)| {
                let mixed = answer * &shared;
                (inverse + &mixed * answer.transpose(), mixed)
            })
            .collect();
        Some(Covariance { fitted, shared, own, sensitivities })
    }
}
