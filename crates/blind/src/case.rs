//! Draws what a case has: which causes, how strong.

use crate::{CaseKind, OutsideUse, outside_kinds};
use mapper_physics::effect::{Effect, EffectParameter};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

/// One cause with its strength.
#[derive(Debug, Clone)]
pub struct Cause {
    /// The effect.
    pub effect: Arc<dyn Effect>,
    /// Its values.
    pub values: Vec<f64>,
}

/// One case before it is run.
#[derive(Debug, Clone)]
pub struct Case {
    /// Name of its files.
    pub name: String,
    /// What it is a case of.
    pub kind: CaseKind,
    /// Its causes.
    pub causes: Vec<Cause>,
    /// Seed of its noise, offsets, tolerances and weather.
    pub seed: u64,
}

/// How cases are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draw {
    /// Seed of everything.
    pub seed: u64,
    /// Number of cases.
    pub cases: usize,
    /// Which outside causes are drawn from.
    pub outside: OutsideUse,
}

/// Weakest and strongest draw, in the effect's own plain steps: from barely visible to gross.
const STRENGTH_RANGE: [f64; 2] = [0.15, 2.5];

impl Draw {
    /// The cases: kinds by turns in random order, causes and strengths at random. Equal draws give equal cases.
    pub fn cases(&self, catalogue: &[Arc<dyn Effect>]) -> Vec<Case> {
        let mut random = Pcg64::seed_from_u64(self.seed);
        let outside = outside_kinds(self.outside);
        (0..self.cases)
            .map(|index| {
                let kind = CaseKind::ALL[random.random_range(0..CaseKind::ALL.len())];
                let from: &[Arc<dyn Effect>] = if kind == CaseKind::Outside { &outside } else { catalogue };
                let wanted = match kind {
                    CaseKind::None => 0,
                    CaseKind::Single | CaseKind::Outside => 1,
                    CaseKind::Pair => 2,
                };
                let mut causes: Vec<Cause> = Vec::new();
                while causes.len() < wanted.min(from.len()) {
                    let effect = from[random.random_range(0..from.len())].clone();
                    if causes.iter().all(|cause| cause.effect.info().id != effect.info().id) {
                        let values = strength(&effect, &mut random);
                        causes.push(Cause { effect, values });
                    }
                }
                // A seed of its own, from the whole range, so that no two draws share noise.
                Case { name: format!("case_{index:04}"), kind, causes, seed: random.random() }
            })
            .collect()
    }
}

fn strength(effect: &Arc<dyn Effect>, random: &mut Pcg64) -> Vec<f64> {
    let parameters = &effect.info().parameters;
    if let [phi, conductance] = parameters.as_slice() {
        // The inner wall: a share that is there at all, and a conductance of the order of the gas's own.
        let phi = random.random_range(0.15..0.6f64).clamp(phi.low, phi.high);
        let conductance_w_k = 8.0 * 5.0f64.powf(random.random());
        return vec![phi, conductance_w_k.clamp(conductance.low, conductance.high)];
    }
    parameters.iter().map(|parameter| one_strength(parameter, random)).collect()
}

fn one_strength(parameter: &EffectParameter, random: &mut Pcg64) -> f64 {
    let [weak, strong] = STRENGTH_RANGE;
    let steps = weak * (strong / weak).powf(random.random());
    let EffectParameter { low, high, neutral, typical_step, .. } = *parameter;
    let sign = if random.random() { 1.0 } else { -1.0 };
    let wanted = neutral + sign * steps * typical_step;
    // Where the effect has one sign only, that one.
    if (low..=high).contains(&wanted) { wanted } else { (neutral + steps * typical_step).clamp(low, high) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(seed: u64) -> Draw {
        Draw { seed, cases: 400, outside: OutsideUse::Check }
    }

    #[test]
    fn cases_are_repeatable_within_range_and_never_neutral() {
        let catalogue = mapper_effects::catalogue();
        let cases = draw(3).cases(&catalogue);
        let print = |cases: &[Case]| format!("{cases:?}");
        assert_eq!(print(&cases), print(&draw(3).cases(&catalogue)));
        assert_ne!(print(&cases), print(&draw(4).cases(&catalogue)));
        for kind in CaseKind::ALL {
            // A quarter of 400, with a standard deviation of 9.
            let count = cases.iter().filter(|case| case.kind == kind).count();
            assert!((60..140).contains(&count), "{count} of {kind:?}");
        }
        for cause in cases.iter().flat_map(|case| &case.causes) {
            for (parameter, value) in cause.effect.info().parameters.iter().zip(&cause.values) {
                assert!((parameter.low..=parameter.high).contains(value) && *value != parameter.neutral);
            }
        }
    }

    /// What is reserved is no candidate, and what calibrates is not what is checked.
    #[test]
    fn outside_causes_are_apart_from_the_catalogue_and_from_each_other() {
        let ids = |kinds: Vec<Arc<dyn Effect>>| -> Vec<String> {
            kinds.iter().map(|kind| kind.info().id.to_string()).collect()
        };
        let (check, calibration) =
            (ids(outside_kinds(OutsideUse::Check)), ids(outside_kinds(OutsideUse::Calibration)));
        assert!(check.len() >= 5 && calibration.len() >= 5);
        for id in check.iter().chain(&calibration) {
            assert!(id.starts_with("X_") && mapper_effects::find(id).is_none());
        }
        assert!(check.iter().all(|id| !calibration.contains(id)));
    }
}
