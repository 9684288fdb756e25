//! A checked campaign, units resolved and defaults filled in.

use mapper_core::{Channel, DeclaredUncertainty, Method, ModelTolerances, OperatingPoint, ReferenceState};
use mapper_physics::params::{BoundaryConditions, Params};
use serde::Serialize;
use std::collections::BTreeMap;

/// Everything a run needs to know, without mistakes that can be known beforehand.
///
/// Its JSON is canonical (keys in order, SI values): the planner hashes it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Campaign {
    /// Name; letters, digits, `_`, `-` and `.` only, at most 64.
    pub name: String,
    /// What it is for.
    pub description: Option<String>,
    /// The machine.
    pub machine: Machine,
    /// Boundary conditions. `p3_pa` and `valve_opening_ratio` are not the campaign's: they are
    /// the turbine outlet pressure (no flow) and 1 until the plan sets them.
    pub boundary: BoundaryConditions,
    /// Declared uncertainty of each channel that has a sensor.
    pub sensors: BTreeMap<Channel, SensorDeclaration>,
    /// Declared tolerances of the nominal model.
    pub tolerances: ModelTolerances,
    /// The rig.
    pub backend: BackendChoice,
    /// The grid in the order of the file, no point twice: `points` as listed, or for each opening all speeds.
    pub points: Vec<OperatingPoint>,
    /// How long things take.
    pub timing: Timing,
    /// How points are identified.
    pub identification: Identification,
    /// Order of the points.
    pub order: Order,
    /// The script that says which step comes next, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceSource>,
    /// Error of the efficiency that `order: time` has to reach, fraction.
    pub required_sigma_eta: Option<f64>,
    /// The jump that is repeated, if any.
    pub repeats: Option<Repeats>,
    /// What is done when repeats differ by more than is declared; `None`: they are not watched.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_drift: Option<OnDrift>,
    /// Seed of the search and of simulated rigs.
    pub seed: u64,
    /// What the run must never leave.
    pub limits: Limits,
    /// State to which the results' corrected quantities refer.
    pub reference: ReferenceState,
    /// What is written.
    pub outputs: Outputs,
    /// What a test report needs.
    pub report: Report,
    /// Units shown to people.
    pub display: DisplayUnits,
}

/// The turbocharger under test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    /// Name.
    pub name: String,
    /// Serial number.
    pub serial_number: Option<String>,
    /// Parameters of the nominal model, the diameter of the declared T2 probe included.
    pub params: Params,
    /// The nominal compressor map.
    pub map: MapSource,
}

/// Where the nominal compressor map comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MapSource {
    /// The closed form of the model's description.
    ClosedForm,
    /// A table.
    Table {
        /// Path as resolved from the campaign file. Not part of the canonical JSON: the text is what counts.
        #[serde(skip)]
        path: std::path::PathBuf,
        /// The file's text, which [`crate::nominal_model`] reads.
        text: String,
        /// State to which its corrected quantities refer.
        reference: ReferenceState,
    },
}

/// One sensor as declared; one standard deviation throughout, in the channel's unit (K, Pa, kg/s, rpm).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SensorDeclaration {
    /// Noise, offset left after calibration, gain.
    pub declared: DeclaredUncertainty,
    /// Inner diameter of the pipe at a static tap, m; `None` where the total value is measured.
    pub static_tap_pipe_diameter_m: Option<f64>,
    /// Diameter of the probe's tip, m; 0 is a probe without inertia.
    pub probe_diameter_m: f64,
}

/// A backend by its name, with settings that only it understands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BackendChoice {
    /// Name, e.g. `virtual_lab`.
    pub name: String,
    /// Its settings, unchecked.
    pub settings: serde_json::Value,
}

/// How long things take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Timing {
    /// Time at the first point before its step begins, s, >= 0.
    pub warm_up_s: f64,
    /// Time without flow after the last step, s, >= 0.
    pub cool_down_s: f64,
    /// Time at each point, jump included, s, > 0.
    pub dwell_s: f64,
}

/// How points are identified.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Identification {
    /// Method.
    pub method: Method,
    /// Part of each step that is used.
    pub window: WindowChoice,
    /// Share of the internal area before compression that is assumed, alpha_A, 0..1.
    pub alpha_area_ratio: f64,
    /// When a point counts as settled.
    pub stabilisation: Stabilisation,
}

/// Part of each step that is used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WindowChoice {
    /// From where speed, flow and pressure ratio have settled to the end of the step.
    Auto,
    /// Fixed.
    Fixed {
        /// Begin after the jump, s.
        start_s: f64,
        /// End after the jump, s; after the begin, within the dwell.
        end_s: f64,
    },
}

/// Relative drifts over the window within which a point counts as settled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stabilisation {
    /// Shaft speed, ratio.
    pub speed_ratio: f64,
    /// Compressor flow, ratio.
    pub flow_ratio: f64,
    /// Pressure ratio, ratio.
    pub pressure_ratio_ratio: f64,
}

impl Default for Stabilisation {
    /// The drifts Burke et al. report for settled points: speed 0.8 %, flow 1.5 %, pressure ratio 2 %.
    fn default() -> Self {
        Stabilisation { speed_ratio: 0.008, flow_ratio: 0.015, pressure_ratio_ratio: 0.02 }
    }
}

/// Order of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Largest sum of thermal gradients.
    SumGradient,
    /// Largest smallest gradient.
    WorstGradient,
    /// Smallest predicted error of the efficiency.
    Information,
    /// Shortest campaign that reaches [`Campaign::required_sigma_eta`]; each dwell is chosen.
    Time,
    /// By predicted thermal gradient from step to step.
    Greedy,
    /// As in the grid.
    Listed,
}

/// A sequence script.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SequenceSource {
    /// Path as resolved from the campaign file. Not part of the canonical JSON: the text is what counts.
    #[serde(skip)]
    pub path: std::path::PathBuf,
    /// The script.
    pub text: String,
}

/// A jump that is made again and again, so that drift shows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Repeats {
    /// The point before the jump.
    pub from: OperatingPoint,
    /// The point after it.
    pub to: OperatingPoint,
    /// Steps between two of them at most, >= 2.
    pub every_steps: usize,
    /// Fewest of them, >= 1.
    pub at_least: usize,
}

/// What is done when repeats differ during a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OnDrift {
    /// The run is held in its safe state.
    Hold,
    /// The run goes on with a note.
    Continue,
    /// The run is stopped without flow and asks for a zero of the sensors.
    Zero,
}

/// What the run must never leave.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
    /// Lowest turbine inlet pressure the rig may be told, Pa.
    pub p3_min_pa: f64,
    /// Highest turbine inlet pressure the rig may be told, Pa.
    pub p3_max_pa: f64,
    /// Highest turbine inlet temperature, K.
    pub t3_max_k: Option<f64>,
    /// Highest compressor outlet temperature, K.
    pub t2_max_k: Option<f64>,
    /// Smallest surge margin: flow over the surge flow at equal corrected speed, minus one.
    pub surge_margin_min_ratio: Option<f64>,
    /// Largest change of the compressor housing within a window, K.
    pub housing_gradient_max_k: Option<f64>,
    /// Time the rig takes from the lowest to the highest turbine inlet pressure, s.
    pub p3_stroke_s: Option<f64>,
}

/// What is written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outputs {
    /// Directory of the run directories, as written in the file (relative to the working directory).
    pub directory: String,
    /// Formats of the map, each once.
    pub formats: Vec<OutputFormat>,
}

/// A format of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OutputFormat {
    /// Table.
    Csv,
    /// For machines.
    Json,
    /// Picture.
    Svg,
}

/// What a test report needs and no sensor measures.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Report {
    /// Who ran the test.
    pub operator: Option<String>,
    /// Where.
    pub test_cell: Option<String>,
    /// Day of each sensor's last calibration, `YYYY-MM-DD`.
    pub calibration: BTreeMap<Channel, String>,
    /// Barometric pressure, Pa.
    pub barometer_pa: Option<f64>,
    /// Relative humidity, 0..1.
    pub humidity_ratio: Option<f64>,
    /// Temperature in the cell, K.
    pub cell_temperature_k: Option<f64>,
}

/// Units shown to people, by their symbols; convert with [`crate::units::Kind::unit`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DisplayUnits {
    /// Unit of temperatures.
    pub temperature: String,
    /// Unit of pressures.
    pub pressure: String,
    /// Unit of shaft speeds.
    pub speed: String,
    /// Unit of mass flows.
    pub flow: String,
}

impl Default for DisplayUnits {
    fn default() -> Self {
        DisplayUnits {
            temperature: "degC".into(),
            pressure: "kPa".into(),
            speed: "krpm".into(),
            flow: "g/s".into(),
        }
    }
}
