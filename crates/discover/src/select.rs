//! Which few terms of the library the recording asks for, in closed form.

use crate::evidence::{LinearEvidence, PRIOR_STEPS, weigh};
use crate::term::{Role, Term};
use nalgebra::DMatrix;

/// Some terms of the library, by place, and what they make of the recording.
#[derive(Debug, Clone)]
pub struct Choice {
    /// Places in the library, in order.
    pub terms: Vec<usize>,
    /// Logarithm of the evidence over nothing, rarity included.
    pub gain: f64,
    /// What is taken off the evidence for one choice among many.
    pub rarity: f64,
    /// Step from which on it is there; 0 from the beginning.
    pub begin: usize,
    /// Coefficients, in steps.
    pub coefficients: Vec<f64>,
}

/// All laws of one term, and of two in the same part of the machine; best first. `usable` are the places in the library that
/// the products' columns stand for.
pub fn choices(library: &[Term], usable: &[usize], products: &DMatrix<f64>) -> Vec<Choice> {
    let mut found: Vec<Choice> = Vec::new();
    let mut offer = |places: &[usize], rarity: f64| {
        let Some(LinearEvidence { gain, coefficients }) = weigh(products, places, PRIOR_STEPS) else {
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
        // Level and slope are one law, with a temperature of its own.
        let sink = library[usable[*a]].role == Role::Slope || library[usable[*b]].role == Role::Slope;
        offer(&[*a, *b], if sink { simple } else { 1.0 + (pairs.len() as f64).ln() });
    }
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Whether two terms make a law: both in one part of the machine, and a slope only with the level of its own balance.
fn go_together(a: &Term, b: &Term) -> bool {
    let same_balance = a.balance() == b.balance();
    match (a.role, b.role) {
        (Role::Slope, Role::Level) | (Role::Level, Role::Slope) => same_balance,
        (Role::Slope, _) | (_, Role::Slope) => false,
        // A level beside a known sink is a sink that is not known.
        (Role::Level, Role::Exchange) | (Role::Exchange, Role::Level) => {
            !same_balance && a.submodel() == b.submodel()
        }
        _ => a.submodel() == b.submodel(),
    }
}
