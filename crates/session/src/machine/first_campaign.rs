//! The first campaign of a machine, with its nominal map.

use crate::errors::FirstMapError;
use crate::plan::campaign_forecast::longer_soak_s;
use crate::recording::files::write_new;
use crate::{Registry, SessionError};
use mapper_campaign::{
    AssumedSize, Campaign, CampaignError, MapMisfit, USUAL_WHEEL_DIAMETERS_M, find_map_misfit, nominal_table,
    similar_sizes,
};
use mapper_chart::efficiency_mesh::{InterpolatedLine, SUBDIVISIONS, interpolated_lines};
use mapper_core::{ImportError, NAMED_REFERENCES, ReferenceState, one_line};
use mapper_physics::compressor_map::closed_form_map::{
    ClosedFormMap, CompressorCharacteristic, TURBO_A_WHEEL_M,
};
use mapper_report::significant_digits;
use serde::Serialize;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// Template of the campaign. Its steps dwell 60 s: most machines of `benches/first_campaign.py` then have at least 80 % good points.
const CAMPAIGN: &str = include_str!("../../templates/campaign.yaml");
const CHANNELS: &str = include_str!("../../templates/channels.yaml");
const ZERO: &str = include_str!("../../templates/zero.yaml");
/// Noise of the flow meter of campaigns/turbo_a.yaml, whose wheel has 52 mm, kg/s; meters are chosen by their full scale.
const FLOW_NOISE_KG_S: f64 = 1.5e-4;
/// Speed limit over the highest speed of the grid, until the user writes the machine's own limit: room for the overshoot of a jump.
const SPEED_LIMIT_RATIO: f64 = 1.1;
/// The same on the virtual lab, whose pressure and valve move at once: with the narrow maps of a 52 mm wheel jumps overshoot by
/// up to 18 %.
const SPEED_LIMIT_IN_LAB_RATIO: f64 = 1.2;
/// Diameter of the sheath of a T2 probe that is not given, m. Judgement: 1.5 mm is the usual one of gas stands.
const USUAL_PROBE_M: f64 = 1.5e-3;
/// Points of a speed line.
const POINTS: usize = 6;

impl FirstRig {
    fn backend(self) -> &'static str {
        match self {
            FirstRig::VirtualLab => include_str!("../../templates/virtual_lab.yaml"),
            FirstRig::GasStand => include_str!("../../templates/gas_stand.yaml"),
            FirstRig::Log => include_str!("../../templates/log.yaml"),
        }
    }

    fn title(self) -> &'static str {
        match self {
            FirstRig::VirtualLab => "The map of a compressor on the virtual lab.",
            FirstRig::GasStand => "The map of a compressor on a gas stand.",
            FirstRig::Log => "The map of a compressor from a log of another program.",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstCampaign {
    pub campaign: PathBuf,
    pub map: PathBuf,
    pub channels: Option<PathBuf>,
    pub points: usize,
    pub assumed: Vec<AssumedSize>,
}

/// Writes the first campaign of a machine after checking it. No existing file is replaced.
pub fn first_campaign(
    registry: &Registry,
    request: &FirstCampaignRequest,
) -> Result<FirstCampaign, SessionError> {
    let map = FirstMap::of(registry, request)?;
    let file = |ending: &str| request.directory.join(format!("{}{ending}", request.name));
    let (campaign_path, map_path) = (file(".yaml"), request.directory.join(&map.file_name));
    let mut text = campaign_text(request, &map);
    let mut campaign = check_campaign(&text, &campaign_path, &map)?;
    // The housings of large machines take longer to reach the temperature of the cell.
    if let Some(soak_s) = longer_soak_s(&campaign) {
        text = text.replacen("soak: 30 min", &format!("soak: {:.0} min", soak_s / 60.0), 1);
        campaign = check_campaign(&text, &campaign_path, &map)?;
    }
    let channels = (request.rig != FirstRig::VirtualLab).then(|| file("_channels.yaml"));
    std::fs::create_dir_all(&request.directory).map_err(SessionError::file("create", &request.directory))?;
    for path in [Some(&campaign_path), channels.as_ref()].into_iter().flatten() {
        if path.exists() {
            return Err(SessionError::Exists(path.clone()));
        }
    }
    write_new(&map_path, map.text.as_bytes())?;
    if let Some(path) = &channels {
        write_new(path, fill_template(CHANNELS, &[("reference", reference_yaml(map.reference))]).as_bytes())?;
    }
    // The campaign comes last, because it refers to the other files.
    write_new(&campaign_path, text.as_bytes())?;
    Ok(FirstCampaign {
        campaign: campaign_path,
        map: map_path,
        channels,
        points: campaign.points.len(),
        assumed: campaign.machine.assumed,
    })
}

fn check_campaign(text: &str, path: &Path, map: &FirstMap) -> Result<Campaign, SessionError> {
    let files = |path: &Path| match path.file_name() {
        Some(name) if name == map.file_name.as_str() => Ok(map.text.clone()),
        _ => Err(Error::from(ErrorKind::NotFound)),
    };
    mapper_campaign::check(text, path, &files)
        .map_err(|findings| CampaignError::Mistakes(Box::new(findings)).into())
}

fn campaign_text(request: &FirstCampaignRequest, map: &FirstMap) -> String {
    let wheel_ratio = request.wheel_diameter_m / TURBO_A_WHEEL_M;
    let name = &request.name;
    let commands = match request.rig {
        FirstRig::VirtualLab | FirstRig::GasStand => format!(
            "#   mapper plan  {name}.yaml     the steps and their expected errors\n\
             #   mapper run   {name}.yaml     map and report\n#"
        ),
        FirstRig::Log => format!(
            "#   mapper identify LOG --channels {name}_channels.yaml --campaign {name}.yaml --out {name}\n#"
        ),
    };
    let tap = |diameter_m: Option<f64>, size: &str| match request.has_static_taps {
        true => {
            let diameter_mm = diameter_m.map(|m| 1e3 * m).or_else(|| similar_mm(request, size));
            format!("static, pipe_diameter: {} mm", significant_digits(diameter_mm.unwrap_or(0.0), 3))
        }
        false => "total".to_owned(),
    };
    let in_lab = request.rig == FirstRig::VirtualLab;
    let probe_m = request.probe_diameter_m.unwrap_or(if in_lab { 0.0 } else { USUAL_PROBE_M });
    let speed_limit_ratio = if in_lab { SPEED_LIMIT_IN_LAB_RATIO } else { SPEED_LIMIT_RATIO };
    let values = [
        ("title", request.rig.title().to_owned()),
        ("commands", commands),
        ("name", name.clone()),
        // In quotes if it would be read as a number or another word of YAML.
        (
            "yaml_name",
            serde_yaml::to_string(name).map_or_else(|_| name.clone(), |text| text.trim().to_owned()),
        ),
        ("geometry", geometry(request, map)),
        ("map_file", map.file_name.clone()),
        ("reference", reference_yaml(map.reference)),
        ("flow_noise", significant_digits(FLOW_NOISE_KG_S * wheel_ratio * wheel_ratio, 2)),
        ("inlet_tap", tap(request.inlet_diameter_m, "compressor.inlet_diameter")),
        ("outlet_tap", tap(request.outlet_diameter_m, "compressor.outlet_diameter")),
        ("probe", format!("{} mm", significant_digits(1e3 * probe_m, 3))),
        ("lines", lines(&map.speeds_rpm)),
        // A log contains its own standstill, if there was one.
        ("zero", if request.rig == FirstRig::Log { String::new() } else { ZERO.to_owned() }),
        (
            "speed_limit",
            format!(
                "{} krpm",
                (speed_limit_ratio * map.speeds_rpm.last().copied().unwrap_or(0.0) / 1e3).ceil()
            ),
        ),
    ];
    let values = [values.to_vec(), sensor_classes(request.rig)].concat();
    // The backend has placeholders of its own.
    fill_template(&CAMPAIGN.replace("{{backend}}\n", request.rig.backend()), &values)
}

/// The errors of the sensors: as bought on a stand, by their classes; those of a calibrated chain on the virtual lab.
fn sensor_classes(rig: FirstRig) -> Vec<(&'static str, String)> {
    let values = match rig {
        FirstRig::VirtualLab => [
            ("sensor_words", "# left after a two-point calibration of the whole chain."),
            ("speed_class", ""),
            ("flow_class", "gain: 0.5 %"),
            ("p1_class", "offset: 50 Pa, gain: 0.05 %"),
            ("p2_class", "offset: 100 Pa, gain: 0.05 %"),
            ("p3_class", "offset: 150 Pa, gain: 0.05 %"),
            ("gas_class", "offset: 0.25 K, gain: 0.05 %"),
            ("housing_class", "offset: 0.3 K, gain: 0.05 %, mounting: embedded"),
            ("hot_class", "offset: 0.5 K, gain: 0.05 %"),
        ],
        FirstRig::GasStand | FirstRig::Log => [
            (
                "sensor_words",
                "# by class, as bought: assumed here, write yours (K1, K2, N1, N2, Pt100_A, Pt100_B; per cent of full scale; type of the flow meter;\n\
                 # blades of the wheel). After a calibration write its offset and gain instead, e.g. `offset: 0.1 K, gain: 0.05 %`. The probe's diameter\n\
                 # (0 mm: without inertia) and the taps (total, or static with pipe_diameter) are assumed unless they were given.",
            ),
            ("speed_class", ", blades: 12"),
            ("flow_class", "class: orifice"),
            ("p1_class", "class: 0.1 %, full_scale: 200 kPa"),
            ("p2_class", "class: 0.1 %, full_scale: 500 kPa"),
            ("p3_class", "class: 0.1 %, full_scale: 500 kPa"),
            ("gas_class", "class: K1"),
            ("housing_class", "class: K1, mounting: glued"),
            ("hot_class", "class: K1"),
        ],
    };
    values.map(|(key, text)| (key, text.to_owned())).to_vec()
}

fn lines(speeds_rpm: &[f64]) -> String {
    let line = |rpm: &f64| {
        format!("    - {{speed_corrected: {} krpm, points: {POINTS}}}", significant_digits(rpm / 1e3, 6))
    };
    speeds_rpm.iter().map(line).collect::<Vec<_>>().join("\n")
}

fn similar_mm(request: &FirstCampaignRequest, key: &str) -> Option<f64> {
    similar_sizes(request.wheel_diameter_m).into_iter().find(|size| size.key == key).map(|size| size.value)
}

/// The geometry: known sizes as keys, the others as comments with their assumed values.
fn geometry(request: &FirstCampaignRequest, map: &FirstMap) -> String {
    let sizes = similar_sizes(request.wheel_diameter_m);
    let mm = |diameter_m: Option<f64>| diameter_m.map(|m| format!("{} mm", significant_digits(1e3 * m, 4)));
    let known = |size: &AssumedSize| match size.key.as_str() {
        "compressor.inlet_diameter" => mm(request.inlet_diameter_m),
        "compressor.outlet_diameter" => mm(request.outlet_diameter_m),
        // A turbine and a valve that fit the flow of the machine's own map.
        "turbine.choked_flow" | "outlet.valve_area" => map.flow_ratio.map(|ratio| {
            format!(
                "{} {}    # fits the map's choke flow",
                significant_digits(ratio * size.value, 3),
                size.unit
            )
        }),
        _ => None,
    };
    let wheel = format!("{} mm", significant_digits(1e3 * request.wheel_diameter_m, 6));
    let mut text = String::new();
    for side in ["compressor", "turbine", "bearing", "outlet"] {
        let mut rows = Vec::new();
        if side == "compressor" {
            rows.push((true, format!("wheel_diameter: {wheel}")));
        }
        for size in &sizes {
            let Some(key) = size.key.strip_prefix(side).and_then(|rest| rest.strip_prefix('.')) else {
                continue;
            };
            // Coefficients of Nusselt laws are dimensionless and do not scale with the wheel.
            if key.contains('.') {
                continue;
            }
            rows.push(match known(size) {
                Some(value) => (true, format!("{key}: {value}")),
                None => (false, format!("{key}: {} {}", significant_digits(size.value, 3), size.unit)),
            });
        }
        let mark = |is_known: bool| if is_known { "" } else { "# " };
        let has_known = rows.iter().any(|(is_known, _)| *is_known);
        text += &format!("    {}{side}:\n", mark(has_known));
        for (is_known, row) in rows {
            text += &format!("      {}{row}\n", mark(is_known));
        }
    }
    if let Some(inertia) = sizes.iter().find(|size| size.key == "shaft_inertia") {
        text += &format!("    # shaft_inertia: {} {}", significant_digits(inertia.value, 3), inertia.unit);
    }
    text
}

fn fill_template(template: &str, values: &[(&str, String)]) -> String {
    values
        .iter()
        .fold(template.to_owned(), |text, (key, value)| text.replace(&format!("{{{{{key}}}}}"), value))
}

/// Source of the recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FirstRig {
    /// The simulated stand.
    VirtualLab,
    /// A stand behind a PLC.
    GasStand,
    /// A log of another program.
    Log,
}

/// What is known of a machine.
#[derive(Debug, Clone)]
pub struct FirstCampaignRequest {
    /// Name of the campaign, and of its files.
    pub name: String,
    /// Directory of the files.
    pub directory: PathBuf,
    /// Source of the recordings.
    pub rig: FirstRig,
    /// Diameter of the compressor's wheel at its exit, m.
    pub wheel_diameter_m: f64,
    /// Diameter of the compressor's inlet pipe, m; scaled from the wheel if `None`.
    pub inlet_diameter_m: Option<f64>,
    /// Diameter of the compressor's outlet pipe, m; scaled from the wheel if `None`.
    pub outlet_diameter_m: Option<f64>,
    /// Whether P1 and P2 are measured at the wall.
    pub has_static_taps: bool,
    /// Diameter of the T2 probe, m; if `None`, an ideal probe on the virtual lab, and a usual sheath elsewhere.
    pub probe_diameter_m: Option<f64>,
    /// The machine's own map; that of a similar compressor if `None`.
    pub map: Option<PathBuf>,
    /// Reference state of the map and of the results; if `None`, that of the map's file, or else SAE.
    pub reference: Option<ReferenceState>,
    /// Lowest and highest corrected speed, rpm; those of the map if `None`.
    pub speeds_rpm: Option<(f64, f64)>,
}

/// Lowest and highest corrected speed of campaigns/turbo_a.yaml, rpm: tip speeds of 136 and 422 m/s.
const TURBO_A_SPEEDS_RPM: (f64, f64) = (50e3, 155e3);
/// Speed lines of a grid that is not taken from a map.
const GRID_LINES: usize = 8;
/// A map with this many lines is measured on all of them. Fewer lines have too few steps to determine alpha_A and the probe: the forecast for
/// 24 steps on four lines is doubtful. More lines take longer than a night.
const MAP_LINE_COUNTS: std::ops::RangeInclusive<usize> = 7..=10;
/// Every so many interpolated lines become lines of the table: three between two measured ones. Linear interpolation then deviates from the
/// cubic by a sixteenth as much as without.
const LINE_STRIDE: usize = SUBDIVISIONS / 4;
/// Points of a line in the table of a similar compressor. They are densest near surge, where the flow changes most with pressure.
const POINTS_PER_LINE: usize = 13;

fn reference_yaml(state: ReferenceState) -> String {
    let named = NAMED_REFERENCES.iter().find(|row| row.state == state);
    let ReferenceState { t_ref_k, p_ref_pa } = state;
    named.map_or_else(
        || format!("{{temperature: {t_ref_k} K, pressure: {p_ref_pa} Pa}}"),
        |row| row.name.to_owned(),
    )
}

fn evenly_spaced_rpm((low_rpm, high_rpm): (f64, f64)) -> Vec<f64> {
    let step_rpm = (high_rpm - low_rpm) / (GRID_LINES - 1) as f64;
    let speed = |index: usize| (low_rpm + step_rpm * index as f64).clamp(low_rpm, high_rpm);
    (0..GRID_LINES).map(|index| (speed(index) / 100.0).round() * 100.0).collect()
}

#[derive(Debug)]
pub(crate) struct FirstMap {
    pub file_name: String,
    pub text: String,
    /// Corrected speeds of the grid in order, rpm.
    pub speeds_rpm: Vec<f64>,
    pub reference: ReferenceState,
    /// Choke flow of the machine's own map over that of a similar compressor at equal speed; `None` without an own map.
    pub flow_ratio: Option<f64>,
}

impl FirstMap {
    pub(crate) fn of(registry: &Registry, request: &FirstCampaignRequest) -> Result<Self, SessionError> {
        let (wheel_m, (low_m, high_m)) = (request.wheel_diameter_m, USUAL_WHEEL_DIAMETERS_M);
        if !(low_m..=high_m).contains(&wheel_m) {
            return Err(Box::new(FirstMapError::Wheel { wheel_m }).into());
        }
        match &request.map {
            Some(path) => map_from_file(registry, request, path),
            None => Ok(similar_map(request)),
        }
    }
}

/// The table of a nominal map: monotone cubics through the file's points, on its lines and others between, or the points themselves if too
/// few. Kinks of linear interpolation would be taken for heat transfer, and a fitted surface misses the points.
fn resample_table(
    registry: &Registry,
    path: &Path,
    reference: Option<ReferenceState>,
) -> Result<(String, ReferenceState), SessionError> {
    let map = match registry.read_map(path, reference) {
        Err(SessionError::Import(_, ImportError::NoReference)) => {
            registry.read_map(path, Some(ReferenceState::SAE))?
        }
        map => map?,
    };
    let misfit = |misfit| FirstMapError::Misfit { path: path.to_owned(), misfit };
    let efficiencies = map.lines.iter().flat_map(|line| &line.points).filter_map(|point| point.eta);
    if let Some(poor) = efficiencies.reduce(f64::max).and_then(MapMisfit::of_peak_efficiency) {
        return Err(Box::new(misfit(poor)).into());
    }
    let mut text = format!(
        "# Monotone cubics through the points of {}.\nspeed [rpm],flow [kg/s],pressure ratio,efficiency\n",
        one_line(&path.display().to_string())
    );
    let mut row = |rpm: f64, flow_kg_s: f64, pressure_ratio: f64, eta: f64| {
        text += &format!("{rpm:.1},{flow_kg_s:.6},{pressure_ratio:.5},{eta:.5}\n");
    };
    match interpolated_lines(&map) {
        Some(lines) => {
            for InterpolatedLine { speed_corrected_rpm, nodes } in lines.iter().step_by(LINE_STRIDE) {
                for [flow_kg_s, pressure_ratio, eta] in nodes.iter().filter(|node| node[2].is_finite()) {
                    row(*speed_corrected_rpm, *flow_kg_s, *pressure_ratio, *eta);
                }
            }
        }
        None => {
            for line in &map.lines {
                for (point, eta) in line.points.iter().filter_map(|point| Some((point, point.eta?))) {
                    row(line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio, eta);
                }
            }
        }
    }
    Ok((text, map.reference))
}

fn map_from_file(
    registry: &Registry,
    request: &FirstCampaignRequest,
    path: &Path,
) -> Result<FirstMap, SessionError> {
    let (text, reference) = resample_table(registry, path, request.reference)?;
    let map = nominal_table(&text, Some(reference))
        .map_err(|source| Box::new(FirstMapError::NotAMap(path.to_owned(), source)))?;
    if let Some(misfit) = find_map_misfit(&map, request.wheel_diameter_m) {
        return Err(Box::new(FirstMapError::Misfit { path: path.to_owned(), misfit }).into());
    }
    let map_speeds_rpm = map.speeds_corrected_rpm();
    let map_rpm =
        (map_speeds_rpm.first().copied().unwrap_or(0.0), map_speeds_rpm.last().copied().unwrap_or(0.0));
    let requested_rpm = request.speeds_rpm.unwrap_or(map_rpm);
    let selected_rpm: Vec<f64> = map_speeds_rpm
        .iter()
        .copied()
        .filter(|rpm| (requested_rpm.0..=requested_rpm.1).contains(rpm))
        .collect();
    let speeds_rpm = match (selected_rpm.first(), selected_rpm.last()) {
        _ if MAP_LINE_COUNTS.contains(&selected_rpm.len()) => selected_rpm,
        (Some(low), Some(high)) if low < high => evenly_spaced_rpm((*low, *high)),
        _ => return Err(Box::new(FirstMapError::NoLines { requested_rpm, map_rpm }).into()),
    };
    let similar = ClosedFormMap { wheel_diameter_m: request.wheel_diameter_m };
    let choke = |map: &dyn CompressorCharacteristic| map.choke_flow_corrected_kg_s(map_rpm.1);
    Ok(FirstMap {
        file_name: format!("{}_map.csv", request.name),
        flow_ratio: Some(choke(&map) / choke(&similar)),
        text,
        speeds_rpm,
        reference,
    })
}

fn similar_map(request: &FirstCampaignRequest) -> FirstMap {
    let wheel_diameter_m = request.wheel_diameter_m;
    let map = ClosedFormMap { wheel_diameter_m };
    let reference = request.reference.unwrap_or(ReferenceState::SAE);
    let speed_factor = TURBO_A_WHEEL_M / wheel_diameter_m;
    let default = (speed_factor * TURBO_A_SPEEDS_RPM.0, speed_factor * TURBO_A_SPEEDS_RPM.1);
    let speeds_rpm = evenly_spaced_rpm(request.speeds_rpm.unwrap_or(default));
    let mut text = format!(
        "# Nominal map of a compressor with a {} mm wheel, geometrically similar to turbo_a. Replace it with your own map if you have one.\n\
         # Corrected to {reference}.\n\
         speed [rpm],flow [kg/s],pressure ratio,efficiency\n",
        significant_digits(1e3 * wheel_diameter_m, 6)
    );
    for rpm in &speeds_rpm {
        let speed_sae_rpm = rpm * reference.speed_factor_to(ReferenceState::SAE);
        let (surge_pr, choke_pr) =
            (map.surge_point(speed_sae_rpm).1, 1.0 + 0.15 * (map.surge_point(speed_sae_rpm).1 - 1.0));
        for index in 0..POINTS_PER_LINE {
            // Close to surge the flow changes steeply with pressure.
            let from_surge = (index as f64 / (POINTS_PER_LINE - 1) as f64).powi(2);
            let pressure_ratio = surge_pr - from_surge * (surge_pr - choke_pr);
            let point = map.evaluate(speed_sae_rpm, pressure_ratio);
            let flow_kg_s = point.flow_corrected_kg_s * ReferenceState::SAE.flow_factor_to(reference);
            text += &format!("{rpm:.0},{flow_kg_s:.6},{pressure_ratio:.5},{:.5}\n", point.efficiency);
        }
    }
    FirstMap { file_name: format!("{}_map.csv", request.name), text, speeds_rpm, reference, flow_ratio: None }
}
