//! Formulas of machine quantities that can be both evaluated and written as script.

use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_physics::machine::hooks::Site;
use std::fmt::{Display, Formatter, Result};

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Expression {
    Number(f64),
    Of(Quantity),
    /// The sensor's reading without the closure term; only within a reading.
    Value,
    Minus(Box<Expression>, Box<Expression>),
    Times(Box<Expression>, Box<Expression>),
    /// A power; its base is positive.
    Power(Box<Expression>, f64),
    Ln(Box<Expression>),
    InTime(Spans),
}

use Expression::{InTime, Ln, Minus, Number, Of, Power, Times, Value};

impl Expression {
    /// Evaluates the formula; `value` is the model's value at the calling hook.
    pub(crate) fn of(&self, site: &Site<'_>, value: f64) -> f64 {
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
pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0e{exponent}"),
        _ => text,
    }
}

pub(crate) fn minus(a: Expression, b: Expression) -> Expression {
    Minus(Box::new(a), Box::new(b))
}

pub(crate) fn difference(a: Quantity, b: Quantity) -> Expression {
    minus(Of(a), Of(b))
}

/// `quantity - number`.
pub(crate) fn above(quantity: Quantity, number: f64) -> Expression {
    minus(Of(quantity), Number(number))
}

/// `number - of`.
pub(crate) fn below(number: f64, of: Expression) -> Expression {
    minus(Number(number), of)
}

pub(crate) fn times(factor: f64, of: Expression) -> Expression {
    Times(Box::new(Number(factor)), Box::new(of))
}

pub(crate) fn product(a: Expression, b: Expression) -> Expression {
    Times(Box::new(a), Box::new(b))
}

/// `(quantity / scale) ^ exponent`.
pub(crate) fn power(quantity: Quantity, scale: f64, exponent: f64) -> Expression {
    Power(Box::new(times(1.0 / scale, Of(quantity))), exponent)
}

/// Source: the law of Stefan and Boltzmann.
const RADIATION_EXPONENT: f64 = 4.0;

/// `a^4 - b^4`.
pub(crate) fn fourth_powers(a: Quantity, b: Quantity) -> Expression {
    minus(power(a, 1.0, RADIATION_EXPONENT), power(b, 1.0, RADIATION_EXPONENT))
}

/// Declares the quantities: variant, name in scripts, words, value.
macro_rules! quantities {
    ($($name:ident $script:literal $words:literal $read:expr;)*) => {
        /// A machine quantity at one instant, SI.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(crate) enum Quantity {
            $(#[doc = $words] $name,)*
        }

        impl Quantity {
            /// Its name in an effect's script, after `at.`.
            pub(crate) fn script_name(self) -> &'static str {
                match self { $(Quantity::$name => $script,)* }
            }

            /// Description for sentences.
            pub(crate) fn words(self) -> &'static str {
                match self { $(Quantity::$name => $words,)* }
            }

            /// Its value; NaN if it is downstream of the calling hook in the gas path.
            pub(crate) fn of(self, site: &Site<'_>) -> f64 {
                let read: fn(&Site<'_>) -> f64 = match self { $(Quantity::$name => $read,)* };
                read(site)
            }
        }
    };
}

quantities! {
    Speed "speed_rad_s" "the speed" |site| site.state.shaft_speed_rad_s;
    P1 "p1_pa" "P1" |site| site.boundary.p1_pa;
    P2 "p2_pa" "P2" |site| site.state.p2_pa;
    P3 "p3_pa" "P3" |site| site.boundary.p3_pa;
    P4 "p4_pa" "P4" |site| site.boundary.p4_pa;
    T1 "t1_k" "the gas at the compressor inlet" |site| site.boundary.t1_k;
    T2Prime "t2_prime_k" "the gas behind the wheel" |site| site.t2_prime_k;
    T2 "t2_k" "the gas at the compressor outlet" |site| site.t2_k;
    T3 "t3_k" "the gas at the turbine inlet" |site| site.boundary.t3_k;
    Tc "tc_k" "the compressor housing" |site| site.state.tc_k;
    Tt "tt_k" "the turbine housing" |site| site.state.tt_k;
    Bearing "bearing_k" "the bearing housing" |site| site.bearing_k;
    Oil "oil_k" "the oil" |site| site.boundary.oil_temperature_k;
    Ambient "ambient_k" "the cell" |site| site.boundary.ambient_temperature_k;
    Flow "flow_kg_s" "the compressor's flow" |site| site.flow_kg_s;
    PressureRatio "pressure_ratio" "the pressure ratio" |site| site.pressure_ratio;
}

/// Decay of the part of a source term that follows a jump, s. Bound: housings of turbochargers settle within 20 to 60 s.
pub(crate) const DECAY: Shape = Shape::Decay(30.0);

/// A time history up to an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    /// History over time, s; an onset at minus infinity precedes the recording.
    pub(crate) history: TimeHistory,
    pub(crate) end_s: f64,
}

/// A source term acts in these spans.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spans(pub Vec<Span>);

impl Spans {
    /// Zero before a time, s, and 1 from then on.
    pub(crate) fn from(begin_s: f64) -> Spans {
        let history = TimeHistory { onset: begin_s, shape: Shape::Step };
        Spans(vec![Span { history, end_s: f64::INFINITY }])
    }

    /// Its value at a time; NaN means the soak before the recording.
    pub(crate) fn at(&self, t_s: f64) -> f64 {
        if t_s.is_nan() {
            let acts = |span: &Span| span.history == TimeHistory::THROUGHOUT;
            return f64::from(u8::from(self.0.iter().any(acts)));
        }
        let acts = |span: &&Span| (span.history.onset..span.end_s).contains(&t_s);
        self.0.iter().find(acts).map_or(0.0, |span| span.history.at(t_s))
    }
}

/// Written as in an effect's script; only a step can be written.
impl Display for Spans {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let begin_s = self.0.first().map_or(f64::NEG_INFINITY, |span| span.history.onset);
        write!(f, "(if at.t_s < {begin_s:?} {{ 0.0 }} else {{ 1.0 }})")
    }
}
