//! Describes a law in words and numbers.

use crate::gap::findings::report::LawTerm;
use crate::missing_terms::laws::candidate::Candidate;
use crate::missing_terms::terms::library::REFERENCE_K;
use crate::missing_terms::terms::term::{Role, Term};
use mapper_core::{half_width_95, with_unit};

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// Value.
    pub value: f64,
    /// Half of its 95 % interval.
    pub half: f64,
}

impl Uncertain {
    /// As text, with as many figures as the interval justifies.
    pub fn words(self, unit: &str) -> String {
        let Uncertain { value, half } = self;
        if !half.is_finite() || half <= 0.0 {
            return with_unit(value, unit).to_string();
        }
        // Two figures of the interval.
        let decimals = (1.0 - half.log10().floor()).clamp(0.0, 9.0) as usize;
        format!("({value:.decimals$} +/- {half:.decimals$}) {}", if unit == "1" { "" } else { unit })
            .trim_end()
            .to_owned()
    }
}

/// A law's numbers and its sentence.
#[derive(Debug, Clone)]
pub struct LawDescription {
    /// The sentence.
    pub sentence: String,
    /// Its numbers.
    pub terms: Vec<LawTerm>,
    /// Temperature of the heat exchange partner, K, if it is one of the numbers.
    pub sink_k: Option<f64>,
}

/// Describes a law; `interval_factor` widens its standard errors.
pub fn tell(library: &[Term], candidate: &Candidate, interval_factor: f64) -> LawDescription {
    let terms = candidate.terms(library);
    let values = candidate.coefficients();
    let covariance = &candidate.fit.covariance;
    // The law's coordinates are the last of the fit, in steps.
    let first = covariance.nrows().saturating_sub(terms.len());
    let cov = |i: usize, j: usize| {
        covariance.get((first + i, first + j)).copied().unwrap_or(f64::INFINITY)
            * terms[i].step
            * terms[j].step
    };
    let widened = half_width_95(interval_factor);
    let numbers: Vec<Uncertain> = (0..terms.len())
        .map(|i| Uncertain { value: values[i], half: widened * cov(i, i).max(0.0).sqrt() })
        .collect();
    let row = |term: String, number: Uncertain, unit: &str| LawTerm {
        term,
        value: number.value,
        low: number.value - number.half,
        high: number.value + number.half,
        unit: unit.to_owned(),
    };
    if let Some((slope, level)) = sink(&terms) {
        let ratio = values[level] / values[slope];
        let variance = (cov(level, level) - 2.0 * ratio * cov(level, slope)
            + ratio * ratio * cov(slope, slope))
            / (values[slope] * values[slope]);
        let sink = Uncertain { value: REFERENCE_K + ratio, half: widened * variance.max(0.0).sqrt() };
        let in_celsius = Uncertain { value: sink.value - 273.15, ..sink };
        let from = terms[slope].words_of_place();
        let sentence = format!(
            "{} from {from} to something at {}",
            numbers[slope].words(terms[slope].unit),
            in_celsius.words("degC")
        );
        let law_terms = vec![
            row(format!("conductance from {from}"), numbers[slope], terms[slope].unit),
            row("temperature of what it goes to".to_owned(), sink, "K"),
        ];
        return LawDescription { sentence, terms: law_terms, sink_k: Some(sink.value) };
    }
    let sentences: Vec<String> = terms
        .iter()
        .zip(&numbers)
        .map(|(term, number)| term.words.replacen("{}", &number.words(term.unit), 1))
        .collect();
    let law_terms = terms
        .iter()
        .zip(&numbers)
        .map(|(term, number)| row(term.words.replacen("{}", "x", 1), *number, term.unit))
        .collect();
    LawDescription { sentence: sentences.join(", and "), terms: law_terms, sink_k: None }
}

/// Indices of slope and level if the law is heat exchange with an unknown temperature.
pub fn sink(terms: &[&Term]) -> Option<(usize, usize)> {
    match terms {
        [a, b] if a.role == Role::Slope && b.role == Role::Level => Some((0, 1)),
        [a, b] if a.role == Role::Level && b.role == Role::Slope => Some((1, 0)),
        _ => None,
    }
}
