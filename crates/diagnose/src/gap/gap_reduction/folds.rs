//! Cross-validation folds, chosen by operating point before any fit.

use crate::gap::residuals::study::Study;

/// Number of folds.
pub(crate) const FOLDS: usize = 3;

/// Groups of steps, each to be predicted by a fit to the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folds {
    /// Step indices of each fold, ascending; a single fold means no hold-out.
    pub steps: Vec<Vec<usize>>,
}

impl Folds {
    /// The folds of a recording. Each fold covers every opening and speed range as far as the number of steps allows. Empty if there are
    /// too few steps.
    pub fn of(study: &Study) -> Folds {
        let places = study.steps.iter().map(|step| (step.marker.valve_opening_ratio, step.marker.p3_pa));
        Folds::latin_square(&places.collect::<Vec<_>>())
    }

    /// Assigns steps to folds: along each opening in order of pressure (and so speed), starting with a different fold
    /// at each opening.
    fn latin_square(places: &[(f64, f64)]) -> Folds {
        if places.len() < 2 * FOLDS {
            return Folds { steps: vec![(0..places.len()).collect()] };
        }
        let mut openings: Vec<f64> = places.iter().map(|(opening, _)| *opening).collect();
        openings.sort_by(f64::total_cmp);
        openings.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        let mut steps = vec![Vec::new(); FOLDS];
        // A single step at an opening continues the order of the previous opening.
        let mut assigned = 0;
        for (row, opening) in openings.iter().enumerate() {
            let mut here: Vec<usize> =
                (0..places.len()).filter(|i| (places[*i].0 - opening).abs() < 1e-6).collect();
            here.sort_by(|a, b| places[*a].1.total_cmp(&places[*b].1).then(a.cmp(b)));
            let first = if here.len() < FOLDS { assigned } else { row };
            for (rank, step) in here.iter().enumerate() {
                steps[(first + rank) % FOLDS].push(*step);
            }
            assigned += here.len();
        }
        for fold in &mut steps {
            fold.sort_unstable();
        }
        Folds { steps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six speeds at three openings, shuffled: each fold has every speed once and every opening twice.
    #[test]
    fn every_fold_has_every_speed_and_every_opening() {
        let mut places = Vec::new();
        for opening in [0.5, 0.7, 1.0] {
            for speed in [90.0, 150.0, 50.0, 130.0, 70.0, 110.0] {
                places.push((opening, 1e3 * speed * (1.0 + 0.1 * opening)));
            }
        }
        let folds = Folds::latin_square(&places).steps;
        assert_eq!(folds.iter().map(Vec::len).collect::<Vec<_>>(), [6, 6, 6]);
        for fold in &folds {
            for opening in [0.5, 0.7, 1.0] {
                assert_eq!(fold.iter().filter(|i| places[**i].0 == opening).count(), 2);
            }
            let mut speeds: Vec<usize> = fold.iter().map(|i| i % 6).collect();
            speeds.sort_unstable();
            assert_eq!(speeds, [0, 1, 2, 3, 4, 5]);
        }
        let mut all = folds.concat();
        all.sort_unstable();
        assert_eq!(all, (0..18).collect::<Vec<_>>());
        // One step per opening still gives three folds of two.
        let single: Vec<(f64, f64)> = (0..6).map(|i| (0.5 + 0.1 * f64::from(i), 1e5)).collect();
        assert!(Folds::latin_square(&single).steps.iter().all(|fold| fold.len() == 2));
    }
}
