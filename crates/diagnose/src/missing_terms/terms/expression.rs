//! Formulas that can be both evaluated and written as script.

use crate::missing_terms::terms::quantity::Quantity;
use crate::missing_terms::terms::time_history::Spans;
use mapper_physics::machine::hooks::Site;
use std::fmt::{Display, Formatter, Result};

/// A formula of machine quantities.
#[derive(Debug, Clone, PartialEq)]
pub enum Expression {
    /// A number.
    Number(f64),
    /// A quantity.
    Of(Quantity),
    /// The sensor's reading without the law; only within a reading.
    Value,
    /// First minus second.
    Minus(Box<Expression>, Box<Expression>),
    /// First times second.
    Times(Box<Expression>, Box<Expression>),
    /// A power; its base is positive.
    Power(Box<Expression>, f64),
    /// The natural logarithm.
    Ln(Box<Expression>),
    /// The spans in which it acts.
    InTime(Spans),
}

use Expression::{InTime, Ln, Minus, Number, Of, Power, Times, Value};

impl Expression {
    /// Evaluates the formula; `value` is the model's value at the calling hook.
    pub fn of(&self, site: &Site<'_>, value: f64) -> f64 {
        match self {
            Number(number) => *number,
            Of(quantity) => quantity.of(site),
            Value => value,
            Minus(a, b) => a.of(site, value) - b.of(site, value),
            Times(a, b) => a.of(site, value) * b.of(site, value),
            Power(base, exponent) => base.of(site, value).powf(*exponent),
            Ln(of) => of.of(site, value).ln(),
            InTime(spans) => spans.at(site.t_s),
        }
    }
}

/// Written as in an effect's script.
impl Display for Expression {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Number(value) => write!(f, "{}", number(*value)),
            Of(quantity) => write!(f, "at.{}", quantity.script_name()),
            Value => write!(f, "value"),
            Minus(a, b) => write!(f, "({a} - {b})"),
            Times(a, b) => write!(f, "{a} * {b}"),
            Power(base, exponent) => write!(f, "({base}) ** {}", number(*exponent)),
            Ln(of) => write!(f, "({of}).ln()"),
            InTime(spans) => write!(f, "{spans}"),
        }
    }
}

/// A number in script notation, with a decimal point so that it is not an integer.
pub fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0e{exponent}"),
        _ => text,
    }
}

/// `a - b`.
pub fn minus(a: Expression, b: Expression) -> Expression {
    Minus(Box::new(a), Box::new(b))
}

/// `a - b`.
pub fn difference(a: Quantity, b: Quantity) -> Expression {
    minus(Of(a), Of(b))
}

/// `quantity - number`.
pub fn above(quantity: Quantity, number: f64) -> Expression {
    minus(Of(quantity), Number(number))
}

/// `number - of`.
pub fn below(number: f64, of: Expression) -> Expression {
    minus(Number(number), of)
}

/// `factor * of`.
pub fn times(factor: f64, of: Expression) -> Expression {
    Times(Box::new(Number(factor)), Box::new(of))
}

/// `a * b`.
pub fn product(a: Expression, b: Expression) -> Expression {
    Times(Box::new(a), Box::new(b))
}

/// `(quantity / scale) ^ exponent`.
pub fn power(quantity: Quantity, scale: f64, exponent: f64) -> Expression {
    Power(Box::new(times(1.0 / scale, Of(quantity))), exponent)
}

/// `a^4 - b^4`.
pub fn fourth_powers(a: Quantity, b: Quantity) -> Expression {
    minus(power(a, 1.0, 4.0), power(b, 1.0, 4.0))
}
