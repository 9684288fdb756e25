//! A law as an effect script, to be read, edited and used in the next diagnosis.

use crate::missing_terms::laws::sentence::{LawDescription, sink};
use crate::missing_terms::terms::balance::Balance;
use crate::missing_terms::terms::expression::Expression;
use crate::missing_terms::terms::term::Term;
use std::fmt::Write as _;

/// The script of some terms; `None` if a term cannot be written as one.
pub fn script_of(terms: &[&Term], description: &LawDescription) -> Option<String> {
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
        parameters += &line("G", term.unit, 0.0, 40.0 * term.step, 0.0, term.step);
        let sink_k = (10.0 * sink_k).round() / 10.0;
        parameters += &line("T_sink", "K", sink_k.min(200.0), sink_k.max(1000.0), sink_k, 10.0);
        // The slope is relative to the library's reference.
        let Expression::Minus(_, metal) = formula else { return None };
        put(*balance, format!("p.G * (p.T_sink - {metal})"));
    } else {
        for (place, term) in terms.iter().enumerate() {
            let name = if terms.len() == 1 { "c".to_owned() } else { format!("c{}", place + 1) };
            let most = 40.0 * term.step;
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
