//! Jumps between the points of a campaign: expected result and limits of each, and the steps of a complete order.

pub(crate) mod jump_forecast;
pub(crate) mod jump_graph;
pub(crate) mod visits;
pub(crate) mod walk;
