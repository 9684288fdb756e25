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
    /// Smallest mean square of predicted standard error and bias of the efficiency.
    Information,
    /// Shortest campaign whose points reach a required error of the efficiency; the dwell is chosen for each step.
    Time,
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
            VisitOrder::Greedy => "greedy",
            VisitOrder::Listed => "listed",
        }
    }

    /// Whether the order needs to know what the identification will find at each step.
    pub fn needs_method(self) -> bool {
        matches!(self, VisitOrder::Information | VisitOrder::Time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_in_plans_is_the_name_in_campaigns() {
        use VisitOrder::*;
        for order in [SumGradient, WorstGradient, Information, Time, Greedy, Listed] {
            assert_eq!(serde_json::to_value(order).unwrap(), order.name());
        }
    }
}
