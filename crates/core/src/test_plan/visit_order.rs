//! Order in which the points of a campaign are visited.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Criterion for the order of the points. Campaigns and plans write it in snake case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
// The schema is one list of names without descriptions, so that a message can suggest the intended name.
#[schemars(transform = crate::schema::flatten_to_names)]
#[schemars(extend("x-removed" = {
    "sum_gradient": "write `order: thermal_gradient`, its new name",
    "worst_gradient": "write `order: min_gradient`, its new name",
    "information": "write `order: thermal_gradient`, which needs no more rig time for the same error",
    "time": "write `order: thermal_gradient` with `required_sigma_eta`, which chooses one dwell for all steps",
    "best": "write `order: thermal_gradient`; `mapper plan --compare` shows the other orders",
    "greedy": "write `order: thermal_gradient`, which looks at the whole order",
}))]
pub enum VisitOrder {
    /// Largest sum of the housing's temperature changes within the windows (Burke et al., figure 13 b).
    #[default]
    ThermalGradient,
    /// Largest minimum of these changes.
    MinGradient,
    /// By speed, on each line from the widest valve opening to the narrowest (Burke et al., figure 13 a).
    SpeedLines,
    /// The order of the grid.
    Listed,
    /// As `speed_lines`, but each step lasts until T2 and the housing no longer drift: conventional mapping, for comparison.
    Conventional,
}

impl VisitOrder {
    /// All orders.
    pub const ALL: [VisitOrder; 5] = [
        VisitOrder::ThermalGradient,
        VisitOrder::MinGradient,
        VisitOrder::SpeedLines,
        VisitOrder::Listed,
        VisitOrder::Conventional,
    ];

    /// Name in campaigns and plans.
    pub fn name(self) -> &'static str {
        match self {
            VisitOrder::ThermalGradient => "thermal_gradient",
            VisitOrder::MinGradient => "min_gradient",
            VisitOrder::SpeedLines => "speed_lines",
            VisitOrder::Listed => "listed",
            VisitOrder::Conventional => "conventional",
        }
    }

    /// Whether the planner searches for the order.
    pub fn is_searched(self) -> bool {
        matches!(self, VisitOrder::ThermalGradient | VisitOrder::MinGradient)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_in_plans_is_the_name_in_campaigns() {
        for order in VisitOrder::ALL {
            assert_eq!(serde_json::to_value(order).unwrap(), order.name());
        }
    }
}
