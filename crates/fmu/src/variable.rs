//! Variables of an FMU and their units.

/// Role of a variable for the importer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Fixed before the simulation runs.
    Parameter,
    /// Set at communication points.
    Input,
    /// Read at communication points.
    Output,
}

/// A real variable. Its index in the list is its value reference.
#[derive(Debug, Clone, Copy)]
pub struct Variable {
    /// Name; dots separate groups.
    pub name: &'static str,
    /// Role.
    pub causality: Causality,
    /// Unit, one of [`UNITS`].
    pub unit: &'static str,
    /// Initial value; `None` for outputs.
    pub start: Option<f64>,
    pub description: &'static str,
}

/// A boolean parameter. Its index in the list is its value reference.
#[derive(Debug, Clone, Copy)]
pub struct Switch {
    pub name: &'static str,
    /// Initial value.
    pub start: bool,
    pub description: &'static str,
}

/// Every unit of the variables, with its base units of the standard and their exponents (kg, m, s, K, rad), and the factor if it is not 1, as
/// attributes of XML.
pub const UNITS: &[(&str, &str)] = &[
    ("1", ""),
    ("m", r#"m="1""#),
    ("m2", r#"m="2""#),
    ("m3", r#"m="3""#),
    ("kg", r#"kg="1""#),
    ("kg/s", r#"kg="1" s="-1""#),
    ("kg.m2", r#"kg="1" m="2""#),
    ("K", r#"K="1""#),
    ("Pa", r#"kg="1" m="-1" s="-2""#),
    ("W", r#"kg="1" m="2" s="-3""#),
    ("W/K", r#"kg="1" m="2" s="-3" K="-1""#),
    ("W/(m.K)", r#"kg="1" m="1" s="-3" K="-1""#),
    ("W/(m2.K)", r#"kg="1" s="-3" K="-1""#),
    ("W.s2/rad2", r#"kg="1" m="2" s="-1" rad="-2""#),
    ("rpm", r#"rad="1" s="-1" factor="0.10471975511965977""#),
];
