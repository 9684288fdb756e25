//! Lag of the back-pressure valve behind its command.

use mapper_physics::effect;

effect! {
    pub(crate) struct SlowValve "slow_valve";
    name: "slow back-pressure valve",
    description: "the back-pressure valve follows its command more slowly than declared",
    equation: "dx/dt = (x_command - x)/tau",
    source: "first-order positioner",
    submodel: Outlet, also_shows_in: [];
    /// Time constant in addition to the declared one, s.
    lag_s = "slow_valve" ["s"] 0.0 .. 20.0, neutral 0.0, step 1.0;
    |effect, rig| rig.instruments.valve.lag_s += effect.lag_s
}
