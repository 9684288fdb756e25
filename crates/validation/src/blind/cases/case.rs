//! Draws the causes of a case and their strengths.

use crate::blind::cases::cause::Cause;
use crate::blind::cases::equations::Laboratory;
use crate::blind::cases::kind::CaseKind;
use crate::blind::cases::strength::{SignatureMeter, has_influence, strength};
use crate::blind::outside::{OutsideUse, outside_kinds};
use mapper_physics::rig::effect::Effect;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

/// One case before it is run.
#[derive(Debug, Clone)]
pub struct Case {
    /// Name of its files.
    pub name: String,
    /// Its kind.
    pub kind: CaseKind,
    /// Its causes.
    pub causes: Vec<Cause>,
    /// Length of each cause's signature in the presence of the others, in sigmas.
    pub sigmas: Vec<f64>,
    /// Seed of its noise, offsets, tolerances and weather.
    pub seed: u64,
}

/// Settings of the random draw.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// Seed of all random draws.
    pub seed: u64,
    /// Number of cases.
    pub cases: usize,
    /// Kinds to draw from; if empty, [`CaseKind::USUAL`].
    pub kinds: Vec<CaseKind>,
    /// The set of outside causes to draw from.
    pub outside: OutsideUse,
    /// Weakest and strongest signature of a single cause, in sigmas.
    pub sigma_range: [f64; 2],
    /// The simulator of the cases.
    pub laboratory: Laboratory,
    /// Whether each rig is also recorded on a night without its causes.
    pub baseline: bool,
}

/// From barely visible to impossible to overlook.
pub const SIGMA_RANGE: [f64; 2] = [6.0, 400.0];

impl Draw {
    /// The default draw: all kinds, strengths from barely visible to gross.
    pub fn new(seed: u64, cases: usize, outside: OutsideUse) -> Draw {
        Draw {
            seed,
            cases,
            kinds: Vec::new(),
            outside,
            sigma_range: SIGMA_RANGE,
            laboratory: Laboratory::default(),
            baseline: false,
        }
    }

    /// Draws the cases. Kinds are in random order. Causes are dealt like cards: each effect with each sign occurs once before any repeats.
    /// Signature lengths are uniform in their logarithm. Equal settings give equal cases.
    pub fn cases(&self, catalogue: &[Arc<dyn Effect>], meter: &dyn SignatureMeter) -> Vec<Case> {
        let mut random = Pcg64::seed_from_u64(self.seed);
        // Effects without influence on this machine are not causes, e.g. convection before the wheel without area there.
        let influential: Vec<Arc<dyn Effect>> =
            catalogue.iter().filter(|effect| has_influence(effect, meter)).cloned().collect();
        let mut catalogue = Deck::new(&influential);
        let mut outside = Deck::new(&outside_kinds(self.outside));
        let kinds = if self.kinds.is_empty() { &CaseKind::USUAL[..] } else { &self.kinds[..] };
        (0..self.cases)
            .map(|index| {
                let kind = kinds[random.random_range(0..kinds.len())];
                let deck = if kind == CaseKind::Outside { &mut outside } else { &mut catalogue };
                let wanted = match kind {
                    CaseKind::None => 0,
                    CaseKind::Single | CaseKind::Outside => 1,
                    CaseKind::Pair => 2,
                    CaseKind::Triple => 3,
                };
                let mut causes: Vec<Cause> = Vec::new();
                while causes.len() < wanted.min(deck.effects.len()) {
                    let (effect, sign) = deck.deal(&mut random);
                    if causes.iter().all(|cause| cause.effect.info().id != effect.info().id) {
                        let [weak, strong] = self.sigma_range;
                        let sigma = weak * (strong / weak).powf(random.random());
                        let values = strength(&effect, sign, sigma, meter, &mut random);
                        causes.push(Cause { effect, values });
                    }
                }
                let sigmas = meter.lengths(&causes);
                // A separate seed from the whole range, so that no two draws have the same noise.
                Case { name: format!("case_{index:04}"), kind, causes, sigmas, seed: random.random() }
            })
            .collect()
    }
}

/// All effects with each of their signs, dealt like cards: none repeats until the deck is empty.
struct Deck {
    effects: Vec<Arc<dyn Effect>>,
    left: Vec<(usize, f64)>,
}

impl Deck {
    fn new(effects: &[Arc<dyn Effect>]) -> Deck {
        Deck { effects: effects.to_vec(), left: Vec::new() }
    }

    fn deal(&mut self, random: &mut Pcg64) -> (Arc<dyn Effect>, f64) {
        if self.left.is_empty() {
            self.left = self
                .effects
                .iter()
                .enumerate()
                .flat_map(|(index, effect)| signs(effect).into_iter().map(move |sign| (index, sign)))
                .collect();
            self.left.shuffle(random);
        }
        let (index, sign) = self.left.pop().unwrap_or((0, 1.0));
        (self.effects[index].clone(), sign)
    }
}

/// Signs that an effect can have relative to its typical step.
fn signs(effect: &Arc<dyn Effect>) -> Vec<f64> {
    let [parameter] = effect.info().parameters.as_slice() else { return vec![1.0] };
    let has = |sign: &f64| {
        let shifted = parameter.neutral + 0.01 * sign * parameter.typical_step;
        (parameter.low..=parameter.high).contains(&shifted)
    };
    [1.0, -1.0].into_iter().filter(has).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A rig on which every typical step is 50 sigmas long.
    struct EqualSteps;

    impl SignatureMeter for EqualSteps {
        fn lengths(&self, causes: &[Cause]) -> Vec<f64> {
            let of = |cause: &Cause| {
                let parameter = &cause.effect.info().parameters[0];
                50.0 * ((cause.values[0] - parameter.neutral) / parameter.typical_step).abs()
            };
            causes.iter().map(of).collect()
        }
    }

    #[test]
    fn cases_are_repeatable_within_range_and_never_neutral() {
        let catalogue = mapper_effects::catalogue();
        let drawn = |seed| Draw::new(seed, 400, OutsideUse::Check).cases(&catalogue, &EqualSteps);
        let cases = drawn(3);
        let print = |cases: &[Case]| format!("{cases:?}");
        assert_eq!(print(&cases), print(&drawn(3)));
        assert_ne!(print(&cases), print(&drawn(4)));
        for kind in CaseKind::USUAL {
            // A quarter of 400, with a standard deviation of 9.
            let count = cases.iter().filter(|case| case.kind == kind).count();
            assert!((60..140).contains(&count), "{count} of {kind:?}");
        }
        for cause in cases.iter().flat_map(|case| &case.causes) {
            for (parameter, value) in cause.effect.info().parameters.iter().zip(&cause.values) {
                assert!((parameter.low..=parameter.high).contains(value) && *value != parameter.neutral);
            }
        }
        // The deck ensures that as many single cases as there are signed effects contain every effect of the catalogue.
        let dealt = catalogue.iter().map(|effect| signs(effect).len()).sum();
        let singles =
            Draw { kinds: vec![CaseKind::Single], cases: dealt, ..Draw::new(5, 1, OutsideUse::Check) }
                .cases(&catalogue, &EqualSteps);
        let seen: BTreeSet<String> =
            singles.iter().map(|c| c.causes[0].effect.info().id.to_string()).collect();
        assert_eq!(seen.len(), catalogue.len());
    }

    /// Reserved causes are not candidates, and calibration and check use different causes.
    #[test]
    fn outside_causes_are_apart_from_the_catalogue_and_from_each_other() {
        let ids = |kinds: Vec<Arc<dyn Effect>>| -> Vec<String> {
            kinds.iter().map(|kind| kind.info().id.to_string()).collect()
        };
        let (check, calibration) =
            (ids(outside_kinds(OutsideUse::Check)), ids(outside_kinds(OutsideUse::Calibration)));
        assert!(check.len() >= 4 && calibration.len() >= 4);
        for id in check.iter().chain(&calibration) {
            assert!(id.starts_with("X_") && mapper_effects::find(id).is_none());
        }
        assert!(check.iter().all(|id| !calibration.contains(id)));
    }
}
