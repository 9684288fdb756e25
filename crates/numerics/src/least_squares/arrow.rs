//! Normal equations with an arrow-shaped matrix: many groups of a few parameters each, coupled only through parameters that all groups
//! share. The groups are eliminated one by one, so that the work grows with their number, not with its cube.
//!
//! Source: B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, "Bundle adjustment - a modern synthesis" (2000), section 6.1,
//! which calls the result the reduced camera system.

use nalgebra::{Const, DMatrix, DVector, Dyn, OMatrix, SMatrix, SVector};

/// The normal equations of one group with `L` own parameters.
#[derive(Debug, Clone)]
pub struct ArrowBlock<const L: usize> {
    /// Block of the group's own parameters.
    pub own: SMatrix<f64, L, L>,
    /// Block between the group's own parameters and the shared ones.
    pub mixed: OMatrix<f64, Const<L>, Dyn>,
    /// Right-hand side.
    pub right: SVector<f64, L>,
    /// Whether the group contributes to the estimate of the shared parameters.
    pub contributes: bool,
}

/// The normal equations of all parameters.
#[derive(Debug, Clone)]
pub struct Arrow<const L: usize> {
    /// Block of the shared parameters, before the groups are eliminated.
    pub shared: DMatrix<f64>,
    /// Right-hand side of the shared parameters.
    pub right: DVector<f64>,
    /// The groups.
    pub blocks: Vec<ArrowBlock<L>>,
}

/// The equations of the shared parameters after elimination of the groups.
#[derive(Debug, Clone)]
pub struct Reduced<const L: usize> {
    /// The Schur complement.
    pub matrix: DMatrix<f64>,
    /// Right-hand side.
    pub right: DVector<f64>,
    /// Inverse of each group's own matrix.
    pub inverses: Vec<SMatrix<f64, L, L>>,
}

impl<const L: usize> Arrow<L> {
    /// Eliminates the groups, with the diagonal multiplied by `1 + damping`; `None` if a group's own matrix is not
    /// positive definite.
    pub fn reduced(&self, damping: f64) -> Option<Reduced<L>> {
        let (mut matrix, mut right) = (self.shared.clone(), self.right.clone());
        for i in 0..matrix.nrows() {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let mut inverses = Vec::with_capacity(self.blocks.len());
        for block in &self.blocks {
            let mut own = block.own;
            for i in 0..L {
                own[(i, i)] *= 1.0 + damping;
            }
            let inverse = own.cholesky()?.inverse();
            if block.contributes {
                let eliminated = block.mixed.transpose() * inverse;
                matrix -= &eliminated * &block.mixed;
                right -= &eliminated * block.right;
            }
            inverses.push(inverse);
        }
        Some(Reduced { matrix, right, inverses })
    }

    /// The damped step of the shared parameters and of each group's own; `None` if the equations cannot be solved.
    pub fn step(&self, damping: f64) -> Option<(DVector<f64>, Vec<SVector<f64, L>>)> {
        let Reduced { matrix, right, inverses } = self.reduced(damping)?;
        let shared = if matrix.nrows() == 0 { DVector::zeros(0) } else { matrix.cholesky()?.solve(&right) };
        let own = self
            .blocks
            .iter()
            .zip(&inverses)
            .map(|(block, inverse)| inverse * (block.right - &block.mixed * &shared))
            .collect();
        Some((shared, own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::least_squares::damped_step;

    /// Any numbers that make a matrix of full rank.
    fn column(row: usize, column: usize) -> f64 {
        ((1 + row * 7 + column * 13 + row * column) as f64).sin()
    }

    /// Three groups of two parameters under three shared ones, from an explicit Jacobian of 30 rows.
    fn example() -> (Arrow<2>, DMatrix<f64>, DVector<f64>) {
        let mut jacobian = DMatrix::zeros(30, 9);
        for row in 0..30 {
            for shared in 0..3 {
                jacobian[(row, shared)] = column(row, shared);
            }
            for own in 0..2 {
                jacobian[(row, 3 + 2 * (row / 10) + own)] = column(row, 3 + own);
            }
        }
        let residual = DVector::from_fn(30, |row, _| column(row, 40));
        let (normal, right) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&residual));
        let blocks = (0..3)
            .map(|group| ArrowBlock {
                own: normal.fixed_view::<2, 2>(3 + 2 * group, 3 + 2 * group).into_owned(),
                mixed: normal.fixed_rows::<2>(3 + 2 * group).columns(0, 3).into_owned(),
                right: right.fixed_rows::<2>(3 + 2 * group).into_owned(),
                contributes: true,
            })
            .collect();
        let arrow = Arrow {
            shared: normal.view((0, 0), (3, 3)).into_owned(),
            right: right.rows(0, 3).into_owned(),
            blocks,
        };
        (arrow, normal, right)
    }

    #[test]
    fn the_step_is_that_of_the_full_equations() {
        let (arrow, normal, right) = example();
        for damping in [0.0, 1e-3, 10.0] {
            let full = damped_step(&normal, &right, damping).unwrap();
            let (shared, own) = arrow.step(damping).unwrap();
            let own = own.iter().flat_map(|part| part.iter());
            for (found, expected) in shared.iter().chain(own).zip(full.iter()) {
                assert!((found - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_reduced_matrix_is_the_inverse_of_the_shared_covariance() {
        let (arrow, normal, _) = example();
        let covariance = arrow.reduced(0.0).unwrap().matrix.cholesky().unwrap().inverse();
        let full = normal.cholesky().unwrap().inverse();
        assert!((covariance - full.view((0, 0), (3, 3))).abs().max() < 1e-12);
    }

    /// A group without a say leaves the shared step as if it were not there, and takes its own best place for that step.
    #[test]
    fn a_group_without_a_say_only_follows() {
        let (mut arrow, ..) = example();
        let without = Arrow { blocks: arrow.blocks[..2].to_vec(), ..arrow.clone() };
        arrow.blocks[2].contributes = false;
        let ((shared, own), (expected, _)) = (arrow.step(0.0).unwrap(), without.step(0.0).unwrap());
        assert_eq!(shared, expected);
        let last = &arrow.blocks[2];
        assert!((last.own * own[2] - (last.right - &last.mixed * shared)).norm() < 1e-12);
    }

    #[test]
    fn without_shared_parameters_and_without_a_solution() {
        let (arrow, ..) = example();
        let blocks = arrow
            .blocks
            .iter()
            .map(|block| ArrowBlock { mixed: OMatrix::<f64, Const<2>, Dyn>::zeros(0), ..block.clone() });
        let alone =
            Arrow { shared: DMatrix::zeros(0, 0), right: DVector::zeros(0), blocks: blocks.collect() };
        let (shared, own) = alone.step(0.0).unwrap();
        assert!(shared.is_empty() && own.len() == 3);
        let mut broken = arrow;
        broken.blocks[0].own = SMatrix::zeros();
        assert!(broken.step(1.0).is_none());
    }
}
