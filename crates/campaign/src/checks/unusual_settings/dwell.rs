//! Checks that the dwell is long enough for the window of the identification.

use crate::campaign::Campaign;
use crate::checks::concern::Concern;
use mapper_core::{Method, WindowRule};
use mapper_yaml::steps;

pub(crate) fn find_concerns(campaign: &Campaign) -> Vec<Concern> {
    let identification = &campaign.identification;
    if !matches!(identification.method, Method::Dynamic | Method::Joint) {
        return Vec::new();
    }
    // The planner only chooses dwells that are long enough for the window.
    let Some(dwell_s) = campaign.timing.dwell.fixed_s() else { return Vec::new() };
    let (earliest_s, shortest_s) = (WindowRule::EARLIEST_S, WindowRule::SHORTEST_S);
    let needed_s = earliest_s + shortest_s;
    // Methods that evaluate the transient need no settled window.
    if identification.method == Method::Joint && dwell_s > earliest_s {
        return Vec::new();
    }
    match identification.window {
        WindowRule::Auto if dwell_s < needed_s => {
            // A script may choose any dwell.
            let no_window = dwell_s <= earliest_s;
            let outcome =
                if no_window { "no point would have an efficiency" } else { "every point would be doubtful" };
            vec![Concern {
                is_error: no_window && campaign.sequence.is_none(),
                at: steps!["timing", "dwell"].to_vec(),
                message: format!(
                    "a dwell of {dwell_s} s is shorter than the {needed_s} s that `window: auto` needs (from {earliest_s} s \
                     after the jump, {shortest_s} s long): {outcome}"
                ),
                remedy: format!("stay at least {needed_s} s at each point; 120 s is usual"),
            }]
        }
        WindowRule::Fixed { start_s, end_s } if end_s - start_s < shortest_s => vec![Concern {
            is_error: false,
            at: steps!["identification", "window", "end"].to_vec(),
            message: format!(
                "the window is {} s long, shorter than the {shortest_s} s from which efficiency and heat transfer are distinguishable",
                end_s - start_s
            ),
            remedy: "lengthen the window".to_owned(),
        }],
        WindowRule::Auto | WindowRule::Fixed { .. } => Vec::new(),
    }
}
