//! The campaign file as it is written: the structs the JSON schema is made from.
//!
//! Doc comments here become the schema's descriptions, which editors show and messages quote: they say what to
//! write. `x-quantity`, `x-min`, `x-max` and `x-above` are explained at [`crate::units::Quantity`].

mod choices;
mod conditions;
mod grid;
mod machine;
mod sensors;
mod tolerances;

pub(crate) use choices::{
    ChoiceName, ConvectionName, DisplayFile, DriftFile, EfficiencyName, FormatName, IdentificationFile,
    JointFile, MethodName, NamedRepeats, OnDriftName, OrderName, OutputsFile, RepeatedJumpFile, RepeatsFile,
    ReportFile, WindowFile,
};
pub(crate) use conditions::{
    BoundaryFile, FollowerName, LimitsFile, NamedReference, ReferenceFile, TimingFile,
};
pub(crate) use grid::{GridFile, PointFile};
pub(crate) use machine::{GeometryFile, MachineFile, MapFile, NusseltFile};
pub(crate) use sensors::{CALIBRATED, SensorsFile, TapName};
pub(crate) use tolerances::TolerancesFile;

use crate::units::{Fraction, Quantity};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// A campaign: one machine, one grid of operating points, one night on the gas stand.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "mapper campaign")]
pub(crate) struct CampaignFile {
    /// Name of the campaign; run directories begin with it. Letters, digits, `_`, `-` and `.`, at most 64, the first a letter or digit.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"), example = &"turbo_a")]
    pub campaign: String,
    /// What the campaign is for, in your own words.
    pub description: Option<String>,
    /// The turbocharger under test.
    pub machine: MachineFile,
    /// What the rig and the cell hold constant.
    pub boundary: BoundaryFile,
    /// Declared uncertainty of each measured channel, by its symbol.
    pub sensors: SensorsFile,
    /// Declared tolerances of the nominal model; the defaults where none are given.
    pub tolerances: Option<TolerancesFile>,
    /// The rig, by the name of its backend, with the backend's own settings below it, e.g. `virtual_lab: {}`. What stands there is checked by the backend.
    #[schemars(length(min = 1, max = 1), extend("minProperties" = 1, "maxProperties" = 1), example = serde_json::json!({"virtual_lab": {}}))]
    pub backend: BTreeMap<String, serde_json::Value>,
    /// The operating points: `speeds` and `openings`, or `points`.
    pub grid: GridFile,
    /// How long things take.
    pub timing: TimingFile,
    /// How efficiency and heat-transfer coefficient are found.
    pub identification: Option<IdentificationFile>,
    /// Order of the points. `sum_gradient`, the default, makes the thermal gradients large in all, `worst_gradient` the smallest of them; `information` makes the predicted error of the efficiency small; `time` makes the campaign short and chooses each dwell; `greedy` looks one step ahead; `listed` keeps the order of the grid.
    pub order: Option<OrderName>,
    /// A rhai script that says which step comes next, in place of `order`: its file, ending in `.rhai`, from the campaign's own directory. docs/sequences.md says what it may call.
    #[schemars(regex(pattern = r"\.rhai$"), example = &"scripts/zigzag.rhai")]
    pub sequence: Option<String>,
    /// Error of the efficiency (standard error and bias of the method, one standard deviation) that `order: time` has to reach at each point.
    #[schemars(extend("x-above" = "0 %", "x-max" = "100 %"), example = &"0.5 %")]
    pub required_sigma_eta: Option<Quantity<Fraction>>,
    /// A jump that is repeated, so that drift shows: at least twice, and every 12 steps where nothing else is said; `off` for none. A sequence script makes its own repeats.
    #[schemars(example = &"off")]
    pub repeats: Option<RepeatsFile>,
    /// Watches the repeats while the campaign runs: one that differs from its first visit by more than is declared is made again, and what differs again is drift.
    pub drift: Option<DriftFile>,
    /// Seed of the search and of simulated rigs: same seed, same bytes. A whole number from 0.
    #[schemars(example = 1)]
    pub seed: Option<u64>,
    /// What the run must never leave.
    pub limits: LimitsFile,
    /// State to which corrected flow and speed refer: SAE (298 K, 100 kPa), Garrett (545 degR, 13.95 psia), BorgWarner (293 K, 98.1 kPa), or `temperature` and `pressure`. SAE where none is given.
    #[schemars(example = &"SAE")]
    pub reference: Option<ReferenceFile>,
    /// What is written, and where.
    pub outputs: Option<OutputsFile>,
    /// What a test report needs and no sensor measures.
    pub report: Option<ReportFile>,
    /// Units in which people are shown results; files keep SI.
    pub display: Option<DisplayFile>,
}
