//! Unknown parameters of one side of a machine, with their priors.
//!
//! The priors cover turbochargers of cars and lorries: efficiency from published maps, heat from Burke et al., Appendix A, scaled to the declared
//! machine. They are wide, and a parameter that the log does not identify keeps its prior width.

/// Form of a prior.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Spread {
    /// Normal about the middle.
    Normal,
    /// Normal in the logarithm: the middle is the median, the width one standard deviation of the logarithm.
    LogNormal,
}

/// A parameter with its prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parameter {
    /// Short name.
    pub(crate) name: &'static str,
    /// Description.
    pub(crate) description: &'static str,
    /// Its unit; empty for a ratio.
    pub(crate) unit: &'static str,
    middle: f64,
    width: f64,
    spread: Spread,
}

type Text = &'static str;

/// A parameter with a normal prior.
pub(crate) const fn normal(name: Text, unit: Text, middle: f64, width: f64, description: Text) -> Parameter {
    Parameter { name, description, unit, middle, width, spread: Spread::Normal }
}

/// A parameter with a log-normal prior.
pub(crate) const fn log_normal(
    name: Text,
    unit: Text,
    middle: f64,
    width: f64,
    description: Text,
) -> Parameter {
    Parameter { name, description, unit, middle, width, spread: Spread::LogNormal }
}

impl Parameter {
    /// Value at this number of prior standard deviations above the middle.
    pub(crate) fn at(&self, standard: f64) -> f64 {
        match self.spread {
            Spread::Normal => self.middle + self.width * standard,
            Spread::LogNormal => self.middle * (self.width * standard).exp(),
        }
    }
}
