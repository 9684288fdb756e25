//! Order in which the points of a campaign are visited.

use crate::named_enum::named_enum;
use schemars::JsonSchema;

named_enum! {
    /// Criterion for the order of the points. Campaigns and plans write it in snake case.
    #[derive(Default, JsonSchema)]
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
        ThermalGradient = "thermal_gradient",
        /// Largest minimum of these changes.
        MinGradient = "min_gradient",
        /// By speed, on each line from the widest valve opening to the narrowest (Burke et al., figure 13 a).
        SpeedLines = "speed_lines",
        /// The order of the grid.
        Listed = "listed",
        /// As `speed_lines`, but each step lasts until T2 and the housing no longer drift: conventional mapping, for comparison.
        Conventional = "conventional",
    }
}

impl VisitOrder {
    /// Whether the planner searches for the order.
    pub fn is_searched(self) -> bool {
        matches!(self, VisitOrder::ThermalGradient | VisitOrder::MinGradient)
    }
}
