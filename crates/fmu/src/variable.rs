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
    /// Description.
    pub description: &'static str,
}

/// A boolean parameter. Its index in the list is its value reference.
#[derive(Debug, Clone, Copy)]
pub struct Switch {
    /// Name.
    pub name: &'static str,
    /// Initial value.
    pub start: bool,
    /// Description.
    pub description: &'static str,
}

/// A unit in the standard's base units: exponents of kg, m, s, K, rad, and a factor.
#[derive(Debug, Clone, Copy)]
pub struct Unit {
    /// Name.
    pub name: &'static str,
    /// Base units and exponents, and the factor if it is not 1, as attributes of XML.
    pub base: &'static str,
}

/// Every unit of the variables.
pub const UNITS: &[Unit] = &[
    Unit { name: "1", base: "" },
    Unit { name: "m", base: r#"m="1""# },
    Unit { name: "m2", base: r#"m="2""# },
    Unit { name: "m3", base: r#"m="3""# },
    Unit { name: "kg", base: r#"kg="1""# },
    Unit { name: "kg/s", base: r#"kg="1" s="-1""# },
    Unit { name: "kg.m2", base: r#"kg="1" m="2""# },
    Unit { name: "K", base: r#"K="1""# },
    Unit { name: "Pa", base: r#"kg="1" m="-1" s="-2""# },
    Unit { name: "W", base: r#"kg="1" m="2" s="-3""# },
    Unit { name: "W/K", base: r#"kg="1" m="2" s="-3" K="-1""# },
    Unit { name: "W/(m.K)", base: r#"kg="1" m="1" s="-3" K="-1""# },
    Unit { name: "W/(m2.K)", base: r#"kg="1" s="-3" K="-1""# },
    Unit { name: "W.s2/rad2", base: r#"kg="1" m="2" s="-1" rad="-2""# },
    Unit { name: "rpm", base: r#"rad="1" s="-1" factor="0.10471975511965977""# },
];
