//! The first campaign of a machine: a commented file, its nominal map and a channel map, made from the wheel diameter.

use crate::machine::first_map::FirstMap;
use crate::machine::first_request::{FirstCampaignRequest, FirstRig};
use crate::plan::campaign_forecast::longer_soak_s;
use crate::recording::files::write_new;
use crate::{Registry, SessionError};
use mapper_campaign::{AssumedSize, Campaign, CampaignError, similar_sizes};
use mapper_physics::compressor_map::closed_form_map::TURBO_A_WHEEL_M;
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

/// The files that were written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstCampaign {
    /// The campaign.
    pub campaign: PathBuf,
    /// The nominal map.
    pub map: PathBuf,
    /// The channel map; `None` for the virtual lab.
    pub channels: Option<PathBuf>,
    /// Points of the grid.
    pub points: usize,
    /// Sizes that the campaign assumes.
    pub assumed: Vec<AssumedSize>,
}

/// Writes the first campaign of a machine after checking it. No existing file is replaced.
///
/// # Errors
/// [`SessionError::Campaign`] with the mistakes that the campaign would have, e.g. a map that does not fit the wheel;
/// [`SessionError::FirstMap`] for a map without enough points; as [`Registry::read_map`] for one that cannot be read; [`SessionError::Exists`] and [`SessionError::File`] for its files.
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
        write_new(
            path,
            fill_template(CHANNELS, &[("reference", request.reference.name.to_owned())]).as_bytes(),
        )?;
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

/// Checks the campaign, and returns it or its mistakes.
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
        ("reference", request.reference.name.to_owned()),
        ("flow_noise", significant_digits(FLOW_NOISE_KG_S * wheel_ratio * wheel_ratio, 2)),
        ("inlet_tap", tap(request.inlet_diameter_m, "compressor.inlet_diameter")),
        ("outlet_tap", tap(request.outlet_diameter_m, "compressor.outlet_diameter")),
        ("probe", format!("{} mm", significant_digits(1e3 * request.probe_diameter_m.unwrap_or(0.0), 3))),
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
    // The backend has placeholders of its own.
    fill_template(&CAMPAIGN.replace("{{backend}}\n", request.rig.backend()), &values)
}

fn lines(speeds_rpm: &[f64]) -> String {
    let line = |rpm: &f64| {
        format!("    - {{speed_corrected: {} krpm, points: {POINTS}}}", significant_digits(rpm / 1e3, 6))
    };
    speeds_rpm.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// A size of the similar machine in mm.
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

/// A template with its placeholders replaced.
fn fill_template(template: &str, values: &[(&str, String)]) -> String {
    values
        .iter()
        .fold(template.to_owned(), |text, (key, value)| text.replace(&format!("{{{{{key}}}}}"), value))
}
