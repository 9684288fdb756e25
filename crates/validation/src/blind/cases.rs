//! Cases with withheld causes: what is drawn, how strong it is, how it is stored, its truth, and the errors of all this.

use crate::blind::outside::{OutsideUse, outside_kinds};
use mapper_campaign::NominalTableError;
use mapper_core::named_enum;
use mapper_physics::rig::effect::{Effect, EffectError, EffectParameter};
use mapper_physics::simulation::steady::SteadyError;
use mapper_recording::RecordError;
use mapper_runner::RunError;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Errors when cases are created or scored.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum BlindError {
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("{} does not contain {what}: {source}", path.display())]
    Content { path: PathBuf, what: &'static str, source: serde_json::Error },
    #[error("{} is larger than {limit} bytes, the maximum of its kind", path.display())]
    TooLarge { path: PathBuf, limit: u64 },
    #[error(
        "{} has SHA-256 {actual}, but {expected} was printed when the cases were made: the answers have been changed",
        path.display()
    )]
    Seal { path: PathBuf, actual: String, expected: String },
    #[error("case {name}: {source}")]
    Run { name: String, source: RunError },
    /// A point of the campaign that the nominal model cannot hold.
    #[error(transparent)]
    Point(#[from] SteadyError),
    /// An effect cannot be applied: a defect of the draw.
    #[error(transparent)]
    Effect(#[from] EffectError),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    NominalModel(#[from] NominalTableError),
    #[error("failed to measure signatures: {source}")]
    Signatures { source: Box<dyn std::error::Error + Send + Sync> },
    #[error("{cases} cases were requested; 1 to {max} are allowed")]
    Cases { cases: usize, max: usize },
    #[error("no effect is called {id}; those of the library are {known}. Give another cause as a sentence")]
    UnknownCause { id: String, known: String },
    #[error("{id} takes {low} to {high}{unit}, but {value} was given")]
    CauseRange { id: String, value: f64, low: f64, high: f64, unit: String },
    #[error("{id} has the parameters {parameters}; give a value for each")]
    CauseParameters { id: String, parameters: String },
}

impl BlindError {
    pub(crate) fn signatures(source: impl std::error::Error + Send + Sync + 'static) -> Self {
        BlindError::Signatures { source: Box::new(source) }
    }

    pub(crate) fn file(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| BlindError::File { path, source }
    }
}

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

    /// Draws cases, kinds in random order; causes are dealt like cards, signature lengths are log-uniform. Equal settings give equal cases.
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

fn signs(effect: &Arc<dyn Effect>) -> Vec<f64> {
    let [parameter] = effect.info().parameters.as_slice() else { return vec![1.0] };
    let has = |sign: &f64| {
        let shifted = parameter.neutral + 0.01 * sign * parameter.typical_step;
        (parameter.low..=parameter.high).contains(&shifted)
    };
    [1.0, -1.0].into_iter().filter(has).collect()
}

/// One cause with its strength.
#[derive(Debug, Clone)]
pub struct Cause {
    /// The effect.
    pub effect: Arc<dyn Effect>,
    /// Its values.
    pub values: Vec<f64>,
}

impl Cause {
    pub(crate) fn id_and_values(&self) -> (String, Vec<f64>) {
        (self.effect.info().id.to_string(), self.values.clone())
    }
}

named_enum! {
    /// The simulator that a case runs on.
    #[derive(Default)]
    pub enum Laboratory {
        /// The model that the diagnosis assumes.
        #[default]
        VirtualLab = "virtual_lab",
        /// Other equations: no model of the catalogue has the right structure, whatever its parameters.
        OtherLab = "other_lab",
        /// Other equations again, those of [`mapper_backends::other_lab::OtherStructure::two_masses`].
        TwoMasses = "two_masses",
    }
}

named_enum! {
    /// How many causes a recording has, and whether the diagnosis could know them.
    pub enum CaseKind {
        /// Nothing beyond the declared tolerances.
        None = "none",
        /// One effect of the catalogue.
        Single = "single",
        /// Two effects of the catalogue.
        Pair = "pair",
        /// A cause that is not a candidate.
        Outside = "outside",
        /// Three effects of the catalogue; drawn only on request.
        Triple = "triple",
    }
}

impl CaseKind {
    /// Default kinds of a draw.
    pub const USUAL: [CaseKind; 4] = [CaseKind::None, CaseKind::Single, CaseKind::Pair, CaseKind::Outside];
}

/// A case whose causes are stored by their ids.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredCase {
    /// Name of its files.
    pub name: String,
    /// Its kind.
    pub kind: CaseKind,
    /// Id and values of each cause.
    pub causes: Vec<(String, Vec<f64>)>,
    /// Length of each cause's signature in the presence of the others, in sigmas.
    pub sigmas: Vec<f64>,
    /// Seed of its noise, offsets, tolerances and weather.
    pub seed: u64,
}

impl From<&Case> for StoredCase {
    fn from(case: &Case) -> Self {
        let named = |cause: &Cause| (cause.effect.info().id.to_string(), cause.values.clone());
        StoredCase {
            name: case.name.clone(),
            kind: case.kind,
            causes: case.causes.iter().map(named).collect(),
            sigmas: case.sigmas.clone(),
            seed: case.seed,
        }
    }
}

impl StoredCase {
    /// The case with its causes looked up in the catalogue and among all outside causes.
    pub fn case(&self, catalogue: &[Arc<dyn Effect>]) -> Result<Case, String> {
        let mut known = catalogue.to_vec();
        known.extend([OutsideUse::Check, OutsideUse::Calibration].into_iter().flat_map(outside_kinds));
        let cause = |(id, values): &(String, Vec<f64>)| {
            let fits = |effect: &&Arc<dyn Effect>| {
                effect.info().id == *id && effect.info().parameters.len() == values.len()
            };
            let effect = known.iter().find(fits).ok_or_else(|| id.clone())?.clone();
            Ok(Cause { effect, values: values.clone() })
        };
        Ok(Case {
            name: self.name.clone(),
            kind: self.kind,
            causes: self.causes.iter().map(cause).collect::<Result<_, String>>()?,
            sigmas: self.sigmas.clone(),
            seed: self.seed,
        })
    }
}

/// Measures the signatures of causes in a recording.
pub trait SignatureMeter {
    /// Length of each cause's signature in the presence of the others, in sigmas; 0 if the rig cannot run with them.
    fn lengths(&self, causes: &[Cause]) -> Vec<f64>;
}

/// Relative tolerance of the length.
const LENGTH_TOLERANCE_RATIO: f64 = 0.1;
/// Maximum number of iterations for a strength.
const MAX_ITERATIONS: usize = 6;
/// Share of the housing that an inner wall takes.
const INNER_SHARE: std::ops::Range<f64> = 0.15..0.6;

/// Limits of a strength in the effect's typical steps, independent of its signature: from the weakest effect of interest to a user, to
/// one that makes a test impossible.
const STEPS: std::ops::RangeInclusive<f64> = 0.02..=4.0;

/// Parameter values at which the signature alone has the length `sigma`, or the maximum in range. `sign`: direction of the typical step.
fn strength(
    effect: &Arc<dyn Effect>,
    sign: f64,
    sigma: f64,
    meter: &dyn SignatureMeter,
    random: &mut Pcg64,
) -> Vec<f64> {
    let length = |values: Vec<f64>| {
        let cause = Cause { effect: effect.clone(), values };
        meter.lengths(std::slice::from_ref(&cause)).first().copied().unwrap_or(0.0)
    };
    let parameters = &effect.info().parameters;
    if let [phi, conductance] = parameters.as_slice() {
        let phi = random.random_range(INNER_SHARE).clamp(phi.low, phi.high);
        // The resistance 1/G of the wall determines the signature; it is searched like any strength and never 0.
        let values = |resistance_k_w: f64| {
            vec![phi, (1.0 / resistance_k_w).clamp(conductance.low, 0.9 * conductance.high)]
        };
        let solution = search(0.05, sigma, |resistance_k_w| length(values(resistance_k_w)));
        return values(solution);
    }
    let [parameter] = parameters.as_slice() else {
        return parameters.iter().map(|p| value_at(p, sign * 0.5)).collect();
    };
    let steps = search(0.5, sigma, |steps| length(vec![value_at(parameter, sign * steps)]));
    let steps = steps.clamp(*STEPS.start(), *STEPS.end());
    vec![value_at(parameter, sign * steps)]
}

fn has_influence(effect: &Arc<dyn Effect>, meter: &dyn SignatureMeter) -> bool {
    // A rig that cannot run with half a typical step may run with a tenth of one.
    [0.5, 0.1].into_iter().any(|steps| {
        let values = effect.info().parameters.iter().map(|parameter| value_at(parameter, steps)).collect();
        let cause = Cause { effect: effect.clone(), values };
        meter.lengths(std::slice::from_ref(&cause)).iter().any(|length| *length > 0.0)
    })
}

fn value_at(parameter: &EffectParameter, steps: f64) -> f64 {
    (parameter.neutral + steps * parameter.typical_step).clamp(parameter.low, parameter.high)
}

/// Finds the size at which `length` is `wanted`; the length increases nearly in proportion to the size.
fn search(start: f64, wanted: f64, length: impl Fn(f64) -> f64) -> f64 {
    let mut size = start;
    for _ in 0..MAX_ITERATIONS {
        let reached = length(size);
        if (reached / wanted - 1.0).abs() < LENGTH_TOLERANCE_RATIO {
            break;
        }
        // A rig that cannot run so strongly has length 0.
        size *= if reached > 0.0 { (wanted / reached).clamp(0.05, 5.0) } else { 0.4 };
    }
    size
}

/// The answer of one case, in the form that `score.py` reads as NAME.truth.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Name of the case.
    pub name: String,
    /// Strength of each cause: a number, an object with one number per parameter, or a sentence for an outside cause.
    pub effects: Map<String, Value>,
    /// Length of each cause's signature in the presence of the others, in sigmas, on a recording of the same campaign.
    #[serde(default)]
    pub sigmas: BTreeMap<String, f64>,
    /// The points, in order of their steps.
    pub points: Vec<TruthPoint>,
}

/// One point at the end of its step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TruthPoint {
    /// Valve opening relative to the nominal area.
    pub valve: f64,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Efficiency, fraction.
    pub eta: f64,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h: f64,
}

impl Truth {
    pub(crate) fn new(case: &Case, points: Vec<TruthPoint>) -> Self {
        let effects = case
            .causes
            .iter()
            .map(|cause| {
                let info = cause.effect.info();
                let value = match (info.parameters.as_slice(), cause.values.as_slice()) {
                    ([parameter], [value]) if info.id.starts_with("X_") => {
                        json!(format!(
                            "{}: {} = {value} {}",
                            info.description, parameter.name, parameter.unit
                        ))
                    }
                    (parameters, values) => strengths(parameters, values),
                };
                (info.id.to_string(), value)
            })
            .collect();
        let ids = case.causes.iter().map(|cause| cause.effect.info().id.to_string());
        let sigmas = ids.zip(case.sigmas.iter().copied()).collect();
        Truth { name: case.name.clone(), effects, sigmas, points }
    }
}

/// A number, or an object with one number per parameter.
pub(crate) fn strengths(parameters: &[EffectParameter], values: &[f64]) -> Value {
    match values {
        [value] => json!(value),
        values => {
            let named =
                parameters.iter().zip(values).map(|(one, value)| (one.name.to_string(), json!(value)));
            named.collect::<Map<String, Value>>().into()
        }
    }
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

    #[test]
    fn the_search_reaches_the_length_although_it_is_not_in_proportion() {
        // A square root and a square: neither in proportion.
        for (power, wanted) in [(0.5, 30.0), (1.5, 200.0)] {
            let solution = search(0.5, wanted, |size| 40.0 * f64::powf(size, power));
            let reached = 40.0 * f64::powf(solution, power);
            // At most six iterations; within a third for powers this far from 1.
            assert!((reached / wanted).ln().abs() < 0.3, "{power}: {reached} for {wanted}");
        }
    }
}
