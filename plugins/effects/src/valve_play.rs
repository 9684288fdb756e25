//! Play in the drive of the back-pressure valve.

use mapper_physics::effect;

effect! {
    pub(crate) struct ValvePlay "valve_play";
    name: "play of the back-pressure valve",
    description: "a reversing drive moves by more than the declared play before the back-pressure valve follows",
    equation: "x_command - s/2 <= x <= x_command + s/2",
    source: "backlash (play) of a drive: Visintin, Differential Models of Hysteresis, chapter III",
    submodel: Outlet, also_shows_in: [];
    /// Play in addition to the declared one, opening.
    play_ratio = "valve_play" ["1"] 0.0 .. 0.5, neutral 0.0, step 0.05;
    |effect, rig| rig.instruments.valve.play_ratio += effect.play_ratio
}
