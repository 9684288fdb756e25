//! `mapper init`.

use crate::command_line::reference;
use crate::environment::registry;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output;
use clap::{Args, ValueEnum};
use mapper_campaign::units::{Kind, parse};
use mapper_session::{FirstCampaignRequest, FirstRig, first_campaign};
use std::io::{BufRead, IsTerminal, Read};
use std::path::PathBuf;

/// Write the first campaign of a machine: a commented campaign, its nominal map, a channel map
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  mapper init my_turbo --wheel 60mm
  mapper init my_turbo --wheel 60mm --map map.csv --reference Garrett --rig gas-stand
Then: mapper check my_turbo.yaml, and mapper run my_turbo.yaml")]
pub struct Init {
    /// Name of the campaign and of its files
    #[arg(default_value = "my_turbo")]
    pub name: String,
    /// Diameter of the compressor wheel at its exit, e.g. 60mm; asked for on a terminal if omitted
    #[arg(long, value_name = "LENGTH", value_parser = parse_length_m)]
    pub wheel: Option<f64>,
    /// Diameter of the compressor's inlet pipe
    #[arg(long, value_name = "LENGTH", value_parser = parse_length_m)]
    pub inlet_pipe: Option<f64>,
    /// Diameter of the compressor's outlet pipe
    #[arg(long, value_name = "LENGTH", value_parser = parse_length_m)]
    pub outlet_pipe: Option<f64>,
    /// P1 and P2 are measured at the wall, not as total pressures
    #[arg(long)]
    pub static_taps: bool,
    /// Diameter of the T2 probe
    #[arg(long, value_name = "LENGTH", value_parser = parse_length_m)]
    pub probe: Option<f64>,
    /// The machine's own map, in any layout that `mapper map inspect` understands
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Reference state of the map and the results: SAE, Garrett, BorgWarner or "T, P"; that of the map's file if not given, or else SAE
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// Lowest and highest corrected speed, e.g. 45krpm 140krpm; those of the map if they are not given
    #[arg(long, num_args = 2, value_names = ["LOW", "HIGH"], value_parser = parse_speed_rpm)]
    pub speeds: Vec<f64>,
    /// Source of the recordings
    #[arg(long, value_enum, default_value = "virtual-lab")]
    pub rig: Rig,
    /// Directory of the files
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    pub out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// Source of the recordings.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Rig {
    /// The simulated stand
    VirtualLab,
    /// A stand behind a PLC
    GasStand,
    /// A log of another program
    Log,
}

impl Init {
    pub fn run(&self) -> Result<(), Failure> {
        let named = self.name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
        if !named || self.name.is_empty() || self.name.len() > 64 || self.name.starts_with(['-', '_']) {
            let message = "the name becomes part of file names; use at most 64 letters from a to z, digits, `_` and `-`";
            return Err(Failure::new(Code::BadInput, message));
        }
        let request = FirstCampaignRequest {
            name: self.name.clone(),
            directory: self.out.clone(),
            rig: match self.rig {
                Rig::VirtualLab => FirstRig::VirtualLab,
                Rig::GasStand => FirstRig::GasStand,
                Rig::Log => FirstRig::Log,
            },
            wheel_diameter_m: self.wheel.map_or_else(ask_wheel_diameter_m, Ok)?,
            inlet_diameter_m: self.inlet_pipe,
            outlet_diameter_m: self.outlet_pipe,
            has_static_taps: self.static_taps,
            probe_diameter_m: self.probe,
            map: self.map.clone(),
            reference: reference(self.reference.as_deref())?,
            speeds_rpm: match self.speeds.as_slice() {
                [low, high] if low < high => Some((*low, *high)),
                [] => None,
                _ => return Err(Failure::new(Code::BadInput, "--speeds takes the lower speed first")),
            },
        };
        let written = first_campaign(&registry(), &request)?;
        match self.json {
            true => standard_output::print_json(&written),
            false => standard_output::show(&mapper_report::first_campaign(
                &written.campaign,
                &written.map,
                written.channels.as_deref(),
                written.points,
                &written.assumed,
            )),
        }
    }
}

fn ask_wheel_diameter_m() -> Result<f64, Failure> {
    let missing = |why: &str| Failure::new(Code::BadInput, format!("{why}; give it with `--wheel 60mm`"));
    if !std::io::stdin().is_terminal() {
        return Err(missing("the diameter of the compressor wheel is required"));
    }
    standard_output::say("Diameter of the compressor's wheel at its exit, mm: ");
    let mut line = String::new();
    // Limited, because a diameter has only a few characters.
    let read = std::io::stdin().lock().take(64).read_line(&mut line);
    read.map_err(|error| missing(&format!("failed to read the diameter: {error}")))?;
    let length = parse_length_m(&line).or_else(|_| parse_length_m(&format!("{} mm", line.trim())));
    length.map_err(|error| missing(&error))
}

/// Parses a quantity whose unit may follow the number without a blank, because a shell would need quotes around a blank.
fn parse_quantity(kind: Kind, text: &str) -> Result<f64, String> {
    let unit = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let spaced = format!("{} {}", text[..unit].trim(), text[unit..].trim());
    let value = parse(kind, spaced.trim()).map_err(|error| format!("{error}: {}", error.remedy(kind)))?;
    if value > 0.0 { Ok(value) } else { Err("it must be above 0".to_owned()) }
}

fn parse_length_m(text: &str) -> Result<f64, String> {
    parse_quantity(Kind::Length, text)
}

fn parse_speed_rpm(text: &str) -> Result<f64, String> {
    parse_quantity(Kind::Speed, text)
}
