//! Selects the few library terms that explain the recording, in closed form.

use crate::gap::best_fit::normal::PRIOR_STEPS;
use crate::missing_terms::search::evidence::{LinearEvidence, linear_evidence};
use crate::missing_terms::terms::term::{Role, Term};
use nalgebra::DMatrix;

/// Some library terms, by index, with their fit to the recording.
#[derive(Debug, Clone)]
pub struct Choice {
    /// Indices in the library, ascending.
    pub terms: Vec<usize>,
    /// Log evidence relative to none, including rarity.
    pub gain: f64,
    /// Evidence penalty for one choice among many.
    pub rarity: f64,
    /// Onset step; 0 from the beginning.
    pub begin: usize,
    /// Coefficients, in steps.
    pub coefficients: Vec<f64>,
}

/// All laws of one term, and of two in the same machine part; best first. `usable` are the library indices of the products' columns.
pub fn choices(library: &[Term], usable: &[usize], products: &DMatrix<f64>) -> Vec<Choice> {
    let mut found: Vec<Choice> = Vec::new();
    let mut offer = |places: &[usize], rarity: f64| {
        let Some(LinearEvidence { gain, coefficients }) = linear_evidence(products, places, PRIOR_STEPS)
        else {
            return;
        };
        let terms: Vec<usize> = places.iter().map(|place| usable[*place]).collect();
        let wrong =
            terms.iter().zip(coefficients.iter()).any(|(term, c)| library[*term].positive && *c < 0.0);
        if !wrong && gain.is_finite() {
            let coefficients = coefficients.iter().copied().collect();
            found.push(Choice { terms, gain: gain - rarity, rarity, begin: 0, coefficients });
        }
    };
    let simple = (usable.len() as f64).ln();
    for place in 0..usable.len() {
        if library[usable[place]].role != Role::Slope {
            offer(&[place], simple);
        }
    }
    let pairs: Vec<(usize, usize)> = (0..usable.len())
        .flat_map(|a| (0..a).map(move |b| (b, a)))
        .filter(|(a, b)| go_together(&library[usable[*a]], &library[usable[*b]]))
        .collect();
    for (a, b) in &pairs {
        // Level and slope form one law, with its own temperature.
        let sink = library[usable[*a]].role == Role::Slope || library[usable[*b]].role == Role::Slope;
        offer(&[*a, *b], if sink { simple } else { 1.0 + (pairs.len() as f64).ln() });
    }
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Whether two terms form a law: both in one machine part, and a slope only with the level of its own balance.
fn go_together(a: &Term, b: &Term) -> bool {
    let same_balance = a.balance() == b.balance();
    match (a.role, b.role) {
        (Role::Slope, Role::Level) | (Role::Level, Role::Slope) => same_balance,
        (Role::Slope, _) | (_, Role::Slope) => false,
        // A level with a known sink equals an unknown sink.
        (Role::Level, Role::Exchange) | (Role::Exchange, Role::Level) => {
            !same_balance && a.submodel() == b.submodel()
        }
        _ => a.submodel() == b.submodel(),
    }
}
