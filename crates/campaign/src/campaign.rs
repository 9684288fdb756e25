//! The campaign file, and the [`Campaign`] with units resolved and defaults filled in. Its elements are in `elements`.

use crate::elements::acceptance::{AcceptanceFile, DriftFile};
use crate::elements::grid::GridFile;
pub use crate::elements::identification::Identification;
use crate::elements::identification::IdentificationFile;
pub use crate::elements::output::{DisplayUnits, FormatName, Outputs, Report};
pub use crate::elements::repeats::SequenceSource;
use crate::elements::repeats::{RepeatsFile, SurgeSearchFile, repeats, sequence};
use crate::elements::rig::actuators::RigFile;
pub use crate::elements::rig::backend::{BackendChoice, ReaderChoice};
use crate::elements::rig::backend::{ReaderFile, backend, readers};
use crate::elements::rig::calibration::Calibration;
pub use crate::elements::rig::calibration::{CalibrationRule, Date};
use crate::elements::rig::control::{SafeStateFile, SpeedControlFile, speed_control};
use crate::elements::rig::guards::{GuardInputs, GuardsFile};
use crate::elements::rig::limits::{BoundaryFile, LimitsFile};
pub use crate::elements::rig::redundant_sensors::SensorDeclaration;
use crate::elements::rig::sensors::SensorsFile;
use crate::elements::timing::{TimingFile, ZeroFile};
use crate::elements::tolerances::TolerancesElement;
use crate::elements::turbocharger::gas::GasFile;
use crate::elements::turbocharger::machine::MachineFile;
pub use crate::elements::turbocharger::machine::{DescriptionSource, Machine, MapSource};
use crate::elements::turbocharger::reference::{EfficiencyFile, ReferenceFile};
use mapper_core::{
    AcceptanceCriteria, Channel, EfficiencyDefinition, GuardSet, Limits, ModelTolerances, OnDrift,
    OperatingPoint, ReferenceState, Repeats, RigActuators, SafeTrajectory, Soak, SpeedControlSettings,
    SurgeSearchSettings, Timing, VisitOrder,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::line_points::LineRequest;
use mapper_physics::operating_point::reach::FollowOutlet;
use mapper_yaml::Step;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// A checked campaign: everything that a run needs, in SI units and rpm.
///
/// Its JSON is canonical (ordered keys, SI values), because the planner hashes it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Campaign {
    /// Name; letters, digits, `_`, `-` and `.` only, at most 64.
    pub name: String,
    /// Purpose.
    pub description: Option<String>,
    /// The machine.
    pub machine: Machine,
    /// Boundary conditions. The plan sets `p3_pa` and `valve_opening_ratio`; until then they are the turbine outlet pressure
    /// (no flow) and 1.
    pub boundary: BoundaryConditions,
    /// Conditions that follow the compressor's outlet temperature of each point instead.
    pub follow_outlet: FollowOutlet,
    /// Declared uncertainty of each channel that has a sensor.
    pub sensors: BTreeMap<Channel, SensorDeclaration>,
    /// Whether every sensor needs a valid calibration.
    #[serde(skip_serializing_if = "CalibrationRule::is_optional")]
    pub calibration: CalibrationRule,
    /// Criteria of the acceptance of points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceptance: Option<AcceptanceCriteria>,
    /// Declared tolerances of the nominal model; the defaults if the file gives none.
    pub tolerances: ModelTolerances,
    /// Whether the file gives tolerances: only then the campaign declares that the machine matches its nominal map.
    pub tolerances_declared: bool,
    /// The rig.
    pub backend: BackendChoice,
    /// Auxiliary instruments: further sources of channels, which are read and never commanded.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub readers: Vec<ReaderChoice>,
    /// The grid in the order of the file, no point twice: `points` as listed, or for each opening all speeds, or line by
    /// line from choke to surge.
    pub points: Vec<OperatingPoint>,
    /// The speed lines of the points; none if the file gives openings.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<LineRequest>,
    /// Durations.
    pub timing: Timing,
    /// The soak before the warm-up, for a zero of the sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero: Option<Soak>,
    /// Settings of the identification.
    pub identification: Identification,
    /// Order of the points.
    pub order: VisitOrder,
    /// The script that chooses the next step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceSource>,
    /// The repeated jump, if there is one.
    pub repeats: Option<Repeats>,
    /// Whether the first point is visited again at the end of the plan, because no jump leads to it at the start.
    pub return_to_first: bool,
    /// Reaction to repeats that differ by more than declared; `None` if they are not monitored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_drift: Option<OnDrift>,
    /// Control of the shaft speed of each step; `None` if P3 keeps its planned value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_control: Option<SpeedControlSettings>,
    /// The search for surge after all other steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surge_search: Option<SurgeSearchSettings>,
    /// Seed of the search and of simulated rigs.
    pub seed: u64,
    /// Limits of the run.
    pub limits: Limits,
    /// Motion of the stand's actuators; `None` if the file declares neither them nor a stroke of P3.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actuators: Option<RigActuators>,
    /// The guards that the file declares; [`Campaign::guard_set`] has those in force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guards: Option<GuardSet>,
    /// The safe shutdown; `None`: the rig's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub safe_state: Option<SafeTrajectory>,
    /// Reference state of the results' corrected quantities.
    pub reference: ReferenceState,
    /// Output settings.
    pub outputs: Outputs,
    /// Additional information for a test report.
    pub report: Report,
    /// Display units.
    pub display: DisplayUnits,
}

impl Campaign {
    /// Motion of the stand's actuators: as declared, or that of a fast stand.
    pub fn rig_actuators(&self) -> RigActuators {
        self.actuators.unwrap_or_default()
    }

    /// The guards of a run: those declared, or one at each limit.
    pub fn guard_set(&self) -> GuardSet {
        let inputs = GuardInputs {
            limits: &self.limits,
            sensors: &self.sensors,
            dwell_s: self.timing.dwell.fixed_or_usual_s(),
            speed_is_held: self.speed_control.is_some(),
        };
        self.guards.clone().unwrap_or_else(|| GuardsFile::default().guards(&inputs))
    }
}

/// A campaign: one machine, one grid of operating points, one night on the gas stand.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "mapper campaign")]
#[schemars(extend("x-removed" = {
    "gradient_share": "leave it out and write `order: thermal_gradient`, which keeps the largest sum",
    "replan": "leave it out: a plan is run unchanged; a script (`sequence`) can react to results",
    "required_sigma_eta": "write it under `timing`, in place of `dwell`: `timing: {required_sigma_eta: 0.3 %}`",
}))]
pub(crate) struct CampaignFile {
    /// Name of the campaign; run directories begin with it. Letters, digits, `_`, `-` and `.`, at most 64, the first a letter or digit.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"), example = &"turbo_a")]
    campaign: String,
    /// Purpose of the campaign, in your own words.
    description: Option<String>,
    /// The turbocharger under test.
    machine: MachineFile,
    /// Conditions that the rig and the cell hold constant.
    boundary: BoundaryFile,
    /// Declared uncertainty of each measured channel, by its symbol.
    sensors: SensorsFile,
    /// Whether every sensor needs a valid calibration: `required` makes a missing or expired one, and readings outside its range, errors.
    #[serde(default)]
    #[schemars(example = &"required")]
    calibration: CalibrationRule,
    /// Criteria of a test code, which the report judges at each point: `PTC 10`, or values of another code.
    #[schemars(example = &"PTC 10")]
    acceptance: Option<AcceptanceFile>,
    /// Declared tolerances of the nominal model; the defaults if none are given.
    tolerances: Option<TolerancesElement>,
    /// The rig, by the name of its backend, with the backend's own settings below it, e.g. `virtual_lab: {}`. The backend checks its settings.
    #[schemars(length(min = 1, max = 1), extend("minProperties" = 1, "maxProperties" = 1), example = serde_json::json!({"virtual_lab": {}}))]
    backend: BTreeMap<String, serde_json::Value>,
    /// The gas stand: how fast its actuators follow their commands. If it is omitted, P3 and valve follow within a second.
    #[schemars(example = serde_json::json!({"actuators": "screw_compressor"}))]
    rig: Option<RigFile>,
    /// Auxiliary instruments by any name, e.g. a flow meter unknown to the PLC: read alongside the rig, never commanded.
    #[serde(default)]
    #[schemars(extend("maxProperties" = 16), example = serde_json::json!({"flow_meter": {"backend": {"ak": {}}}}))]
    readers: BTreeMap<String, ReaderFile>,
    /// The operating points: `speeds` and `openings`, or `lines`, or `points`.
    pub(crate) grid: GridFile,
    /// Durations of the campaign's parts.
    timing: TimingFile,
    /// The isothermal zero before the first point; no zero if it is omitted.
    zero: Option<ZeroFile>,
    /// Method that identifies efficiency and heat-transfer coefficient.
    identification: Option<IdentificationFile>,
    /// Order of the points. `thermal_gradient`, the default, maximises the sum of the housing's temperature changes (Burke et al., figure 13 b); `speed_lines` follows speed lines (figure 13 a), `conventional` too, and holds each point until it no longer drifts; `listed` keeps the order of the grid.
    #[serde(default)]
    order: VisitOrder,
    /// A rhai script that chooses the next step, in place of `order`: a `.rhai` file, relative to the campaign file. docs/reference/sequences.md lists its functions.
    #[schemars(regex(pattern = r"\.rhai$"), example = &"scripts/zigzag.rhai")]
    sequence: Option<String>,
    /// A jump that is repeated to detect drift: by default at least twice, and every 12 steps; `off` for none. A sequence script defines its own repeats.
    #[schemars(example = &"off")]
    repeats: Option<RepeatsFile>,
    /// Whether the first point is visited again at the end, with a jump that leads to it: without a jump it has no transient to identify. `true` if it is omitted; the method `steady` and sequence scripts make no such visit.
    #[schemars(example = true)]
    return_to_first: Option<bool>,
    /// Monitors the repeats while the campaign runs: a repeat that differs from its first visit by more than declared is repeated; a second difference counts as drift.
    drift: Option<DriftFile>,
    /// Holds the shaft speed of each step at its target by adjusting the planned P3; `off` leaves P3 as planned.
    #[schemars(example = &"off")]
    speed_control: Option<SpeedControlFile>,
    /// Searches for the surge line after all other steps; no search if it is omitted.
    surge_search: Option<SurgeSearchFile>,
    /// Seed of the search and of simulated rigs, a whole number from 0; equal seeds give equal bytes, at full speed or at any `--pace`.
    #[schemars(example = 1)]
    seed: Option<u64>,
    /// Limits that the run must never exceed.
    limits: LimitsFile,
    /// Guards that end a run, or a step, before damage is done; every limit is guarded even if none are given.
    guards: Option<GuardsFile>,
    /// The safe shutdown; the rig's own if it is left out.
    safe_state: Option<SafeStateFile>,
    /// State to which corrected flow and speed refer: SAE (298 K, 100 kPa), Garrett (545 degR, 13.95 psia), BorgWarner (293 K, 98.1 kPa), or `temperature` and `pressure`. SAE if none is given.
    #[schemars(example = &"SAE")]
    reference: Option<ReferenceFile>,
    /// Definition of the isentropic efficiency, of the nominal map and of the results: `enthalpy` is the ratio of the rises of specific enthalpy, and the default for a map from a table; `kappa_of_T1` takes temperatures with the heat capacity at T1 (Burke et al., eq. 2), and is the default for `closed_form`; `constant_gamma` takes a given ratio of heat capacities.
    #[schemars(example = &"enthalpy")]
    efficiency: Option<EfficiencyFile>,
    /// The gases that flow through the machine.
    #[serde(default)]
    gas: GasFile,
    /// Formats and directory of the results.
    #[serde(default)]
    outputs: Outputs,
    /// Information for the test report that no sensor measures.
    #[serde(default)]
    report: Report,
    /// Display units of the results; files keep SI.
    #[serde(default)]
    display: DisplayUnits,
}

impl CampaignFile {
    /// The campaign of a file without mistakes, and the position of each point in the file. Each line has only its first point: the others
    /// need the nominal model.
    pub(crate) fn campaign(
        self,
        origin: &Path,
        files: &dyn Fn(&Path) -> io::Result<String>,
    ) -> io::Result<(Campaign, Vec<Vec<Step>>)> {
        let (boundary, follow_outlet) = (self.boundary.conditions(), self.boundary.follow_outlet());
        let limits = Limits::from(&self.limits);
        let rig = self.rig.or_else(|| limits.p3_stroke_s.map(|_| RigFile::default()));
        let reference = self.reference.map_or(ReferenceState::SAE, ReferenceState::from);
        let lines = self.grid.lines(reference, &limits);
        let (points, point_paths) = self.grid.points(&lines, boundary.t1_k);
        let mut sensors = self.sensors.declarations();
        for (channel, date) in &self.report.calibration {
            let sensor = sensors.get_mut(channel).filter(|sensor| sensor.calibrations.is_empty());
            sensor
                .into_iter()
                .for_each(|sensor| sensor.calibrations = vec![Some(Calibration::from_date(*date))]);
        }
        let probe_diameter_m = sensors.get(&Channel::T2).map_or(0.0, |sensor| sensor.probe_diameter_m);
        let mut machine = self.machine.machine(probe_diameter_m, origin, files)?;
        let alpha_area_ratio = machine.params.compressor.alpha_area_ratio;
        let speed_control = speed_control(self.speed_control);
        let timing = self.timing.timing();
        let inputs = GuardInputs {
            limits: &limits,
            sensors: &sensors,
            dwell_s: timing.dwell.fixed_or_usual_s(),
            speed_is_held: speed_control.is_some(),
        };
        let guards = self.guards.map(|guards| guards.guards(&inputs));
        // The closed form is the paper's machine with the efficiency of eq. 2; tables have the usual definition.
        let default_efficiency = match machine.map {
            MapSource::ClosedForm => EfficiencyDefinition::KappaOfT1,
            MapSource::Table { .. } => EfficiencyDefinition::default(),
        };
        machine.params.compressor.efficiency = self.efficiency.map_or(default_efficiency, Into::into);
        self.gas.apply(&mut machine.params);
        machine.params.compressor.humidity_kg_kg = self.report.humidity_kg_kg(&boundary);
        let campaign = Campaign {
            name: self.campaign,
            description: self.description,
            boundary,
            follow_outlet,
            sensors,
            calibration: self.calibration,
            acceptance: self.acceptance.map(AcceptanceCriteria::from),
            tolerances: self.tolerances.map(TolerancesElement::tolerances).unwrap_or_default(),
            tolerances_declared: self.tolerances.is_some(),
            backend: backend(self.backend),
            readers: readers(self.readers),
            points,
            lines,
            timing,
            zero: self.zero.map(|zero| zero.soak(boundary.t1_k)),
            identification: self.identification.unwrap_or_default().identification(alpha_area_ratio),
            order: self.order,
            sequence: sequence(self.sequence.as_deref(), origin, files)?,
            repeats: repeats(self.repeats),
            return_to_first: self.return_to_first.unwrap_or(true),
            on_drift: self.drift.map(|drift| drift.on_drift),
            speed_control,
            surge_search: self.surge_search.map(SurgeSearchFile::settings),
            seed: self.seed.unwrap_or(DEFAULT_SEED),
            limits,
            actuators: rig.map(|rig| rig.actuators(&limits)),
            guards,
            safe_state: self.safe_state.map(SafeStateFile::trajectory),
            reference,
            outputs: self.outputs,
            report: self.report,
            display: self.display,
            machine,
        };
        Ok((campaign, point_paths))
    }
}

const DEFAULT_SEED: u64 = 1;
