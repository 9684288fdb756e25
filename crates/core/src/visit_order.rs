//! In which order the points of a campaign are visited.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the order of the points is chosen by. Campaigns and plans write it in snake case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
// Without descriptions of its own the schema is one list of names: a message can say which of them was meant.
#[schemars(transform = crate::schema::names_alone)]
pub enum VisitOrder {
    /// Largest sum of the housing's temperature changes within the windows.
    #[default]
    SumGradient,
    /// Largest smallest change.
    WorstGradient,
    /// Smallest mean square of what the identification method is forecast to err.
    Information,
    /// As `information`, with `required_sigma_eta`: each step's dwell is chosen so that its point reaches that error.
    Time,
    /// Whichever of the other orders is forecast to give the smallest error for the time it takes.
    Best,
    /// By speed, on each line from the widest valve opening to the narrowest, as conventional mapping goes.
    SpeedLines,
    /// Next comes the point whose jump moves the housing most.
    Greedy,
    /// As in the grid.
    Listed,
}

impl VisitOrder {
    /// Name in campaigns and plans.
    pub fn name(self) -> &'static str {
        match self {
            VisitOrder::SumGradient => "sum_gradient",
            VisitOrder::WorstGradient => "worst_gradient",
            VisitOrder::Information => "information",
            VisitOrder::Time => "time",
            VisitOrder::Best => "best",
            VisitOrder::SpeedLines => "speed_lines",
            VisitOrder::Greedy => "greedy",
            VisitOrder::Listed => "listed",
        }
    }

    /// Whether the order needs to know what the identification will find at each step.
    pub fn needs_method(self) -> bool {
        matches!(self, VisitOrder::Information | VisitOrder::Time | VisitOrder::Best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_in_plans_is_the_name_in_campaigns() {
        use VisitOrder::*;
        for order in [SumGradient, WorstGradient, Information, Time, Best, SpeedLines, Greedy, Listed] {
            assert_eq!(serde_json::to_value(order).unwrap(), order.name());
        }
    }
}
