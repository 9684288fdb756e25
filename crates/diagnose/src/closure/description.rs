//! A closure term as a sentence with numbers, and as an effect script.

use crate::closure::expression::Expression;
use crate::closure::library::REFERENCE_K;
use crate::closure::select::FittedClosure;
use crate::closure::term::{Balance, Role, Term};
use crate::gap::report::ClosureCoefficient;
use mapper_core::unit_factors::ICE_POINT_K;
use mapper_core::{half_width_95, with_unit};
use std::fmt::Write as _;

/// Maximum number of decimals. Bound: no coefficient needs more.
const MAX_DECIMALS: f64 = 9.0;
/// Range of a coefficient in a script, in steps. Bound: four sigmas of its prior.
const RANGE_STEPS: f64 = 40.0;
/// Range of the temperature of a sink in a script, K. Bound: no part of a gas stand is colder or hotter.
const SINK_RANGE_K: (f64, f64) = (200.0, 1000.0);
/// Step of the temperature of a sink in a script, K. Bound: a fifth of the uncertainty of a sink that is well determined.
const SINK_STEP_K: f64 = 10.0;
/// Tenths in 1, the decimals of a sink. Source: a definition.
const TENTHS: f64 = 10.0;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Uncertain {
    pub(crate) value: f64,
    /// Half of its 95 % interval.
    pub(crate) half: f64,
}

impl Uncertain {
    /// As text, with as many figures as the interval justifies.
    pub(crate) fn words(self, unit: &str) -> String {
        let Uncertain { value, half } = self;
        if !half.is_finite() || half <= 0.0 {
            return with_unit(value, unit).to_string();
        }
        // Two figures of the interval.
        let decimals = (1.0 - half.log10().floor()).clamp(0.0, MAX_DECIMALS) as usize;
        format!("({value:.decimals$} +/- {half:.decimals$}) {}", if unit == "1" { "" } else { unit })
            .trim_end()
            .to_owned()
    }
}

/// A closure term's numbers and its sentence.
#[derive(Debug, Clone)]
pub(crate) struct ClosureDescription {
    pub(crate) sentence: String,
    pub(crate) terms: Vec<ClosureCoefficient>,
    /// Temperature of the heat exchange partner, K, if it is one of the numbers.
    pub(crate) sink_k: Option<f64>,
}

/// Describes a closure term; `interval_factor` widens its standard errors.
pub(crate) fn describe(
    library: &[Term],
    candidate: &FittedClosure,
    interval_factor: f64,
) -> ClosureDescription {
    let terms = candidate.terms(library);
    let values = candidate.coefficients();
    let covariance = &candidate.fit.covariance;
    // The closure term's coordinates are the last of the fit, in steps.
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
    let row = |term: String, number: Uncertain, unit: &str| ClosureCoefficient {
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
        let in_celsius = Uncertain { value: sink.value - ICE_POINT_K, ..sink };
        let from = terms[slope].balance().properties().place_words;
        let sentence = format!(
            "{} from {from} to something at {}",
            numbers[slope].words(terms[slope].unit),
            in_celsius.words("degC")
        );
        let numbers_found = vec![
            row(format!("conductance from {from}"), numbers[slope], terms[slope].unit),
            row("temperature of what it goes to".to_owned(), sink, "K"),
        ];
        return ClosureDescription { sentence, terms: numbers_found, sink_k: Some(sink.value) };
    }
    let sentences: Vec<String> = terms
        .iter()
        .zip(&numbers)
        .map(|(term, number)| term.words.replacen("{}", &number.words(term.unit), 1))
        .collect();
    let numbers_found = terms
        .iter()
        .zip(&numbers)
        .map(|(term, number)| row(term.words.replacen("{}", "x", 1), *number, term.unit))
        .collect();
    ClosureDescription { sentence: sentences.join(", and "), terms: numbers_found, sink_k: None }
}

/// Indices of slope and level if the closure term is heat exchange with an unknown temperature.
pub(crate) fn sink(terms: &[&Term]) -> Option<(usize, usize)> {
    match terms {
        [a, b] if a.role == Role::Slope && b.role == Role::Level => Some((0, 1)),
        [a, b] if a.role == Role::Level && b.role == Role::Slope => Some((1, 0)),
        _ => None,
    }
}

/// The script of some terms; `None` if a term cannot be written as one.
pub(crate) fn script_of(terms: &[&Term], description: &ClosureDescription) -> Option<String> {
    let submodel = terms.first()?.submodel().name();
    let mut parameters = String::new();
    // Each balance with the sum that acts on it.
    let mut sums: Vec<(Balance, Vec<String>)> = Vec::new();
    let mut put = |balance: Balance, text: String| match sums.iter_mut().find(|(other, _)| *other == balance)
    {
        Some((_, texts)) => texts.push(text),
        None => sums.push((balance, vec![text])),
    };
    let line = |name: &str, unit: &str, low: f64, high: f64, neutral: f64, step: f64| {
        format!("//! parameter: {name} [{unit}] {low} .. {high}, neutral {neutral}, step {step}\n")
    };
    if let (Some((slope, _)), Some(sink_k)) = (sink(terms), description.sink_k) {
        let term = terms[slope];
        let (balance, formula) = term.acts_on.first()?;
        parameters += &line("G", term.unit, 0.0, RANGE_STEPS * term.step, 0.0, term.step);
        let sink_k = (TENTHS * sink_k).round() / TENTHS;
        let (low_k, high_k) = (sink_k.min(SINK_RANGE_K.0), sink_k.max(SINK_RANGE_K.1));
        parameters += &line("T_sink", "K", low_k, high_k, sink_k, SINK_STEP_K);
        // The slope is relative to the library's reference.
        let Expression::Minus(_, metal) = formula else { return None };
        put(*balance, format!("p.G * (p.T_sink - {metal})"));
    } else {
        for (place, term) in terms.iter().enumerate() {
            let name = if terms.len() == 1 { "c".to_owned() } else { format!("c{}", place + 1) };
            let most = RANGE_STEPS * term.step;
            let low = if term.positive { 0.0 } else { -most };
            parameters += &line(&name, term.unit, low, most, 0.0, term.step);
            for (balance, formula) in &term.acts_on {
                if let Balance::Lag(channel) = balance {
                    parameters += &format!("//! lag: {} {name}\n", channel.symbol());
                } else {
                    put(*balance, format!("p.{name} * ({formula})"));
                }
            }
        }
    }
    let mut text = format!(
        "//! effect: law_of_{submodel}\n//! description: {}\n//! equation: as below\n//! source: found by mapper gap diagnose\n//! submodel: {submodel}\n{parameters}",
        description.sentence
    );
    let found: Vec<String> = description
        .terms
        .iter()
        .map(|t| format!("{}: {} ({} .. {}) {}", t.term, t.value, t.low, t.high, t.unit))
        .collect();
    write!(text, "\n// Found, with 95 % intervals: {}.\n// `at` is the machine at one instant, `p` the parameters; SI.\n", found.join("; ")).ok()?;
    let mut gas = false;
    for (balance, texts) in &sums {
        let name = balance.properties().hook_name?;
        let sum = texts.join(" + ");
        let (arguments, body) = match balance {
            Balance::CompressorHousing | Balance::TurbineHousing | Balance::Shaft | Balance::Outlet => {
                ("at, p", sum)
            }
            Balance::GasBefore | Balance::GasAfter | Balance::GasOutlet => {
                gas = true;
                ("at, p, value", format!("value + ({sum}) / (at.flow_kg_s * cp_j_kgk(value))"))
            }
            Balance::Work | Balance::Convection | Balance::MapFlow => {
                ("at, p, value", format!("value * (1.0 + {sum})"))
            }
            Balance::Reading(_) => ("at, p, value", format!("value + {sum}")),
            Balance::Lag(_) => continue,
        };
        write!(text, "\nfn {name}({arguments}) {{\n    {body}\n}}\n").ok()?;
    }
    if gas {
        text += "\n// Heat capacity of air, as the model has it.\nfn cp_j_kgk(t_k) {\n    1002.5 + 0.000275 * (t_k - 200.0) * (t_k - 200.0)\n}\n";
    }
    Some(text)
}
