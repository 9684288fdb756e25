//! A back-pressure valve that does not follow its commands.

use mapper_physics::effect;

effect! {
    pub(crate) struct ValveStuck "valve_stuck";
    name: "back-pressure valve that does not follow",
    description: "the back-pressure valve makes a part of its commanded motion only, and at 1 stays at its nominal area",
    equation: "x = 1 + (1 - s) (x_command - 1)",
    source: "a slipping or jammed linkage between drive and valve",
    submodel: Outlet, also_shows_in: [];
    /// Share of the commanded motion that it does not make.
    share_ratio = "valve_stuck" ["1"] 0.0 .. 1.0, neutral 0.0, step 0.25;
    |effect, rig| rig.instruments.valve.stuck_ratio += effect.share_ratio
}
