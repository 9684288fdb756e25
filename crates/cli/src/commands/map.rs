//! `mapper map`: maps are inspected, fitted, converted, compared, scaled, merged, reduced and exported.

use crate::command_line::{MapReading, RecordingReading, reference, subcommands};
use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::standard_output::{self, FileOutput, MapTarget};
use clap::Args;
use mapper_core::{EfficiencyDefinition, MapDescription};
use mapper_maps::{MapFitOptions, MapScale};
use mapper_session::{Recorded, Session};
use std::path::{Path, PathBuf};

/// Fit, convert and compare compressor maps
#[derive(Debug, Args)]
pub struct Map {
    #[command(subcommand)]
    command: MapCommand,
}

subcommands! { MapCommand:
    Inspect,
    Fit,
    Convert,
    Compare,
    Scale,
    Merge,
    Reduce,
    Rig,
    Fmu,
}

impl Map {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}

fn paths(files: &[PathBuf]) -> Vec<&Path> {
    files.iter().map(PathBuf::as_path).collect()
}

/// Statements about a second map
#[derive(Debug, Args)]
pub struct SecondMap {
    /// Reference state of the second map, if its file does not give it
    #[arg(long, value_name = "STATE")]
    pub second_reference: Option<String>,
    /// Map description of the second map
    #[arg(long, value_name = "FILE")]
    pub second_description: Option<PathBuf>,
}

impl SecondMap {
    fn description(&self) -> Result<MapDescription, Failure> {
        let reading = MapReading {
            reference: self.second_reference.clone(),
            description: self.second_description.clone(),
            ..MapReading::default()
        };
        reading.description()
    }
}

/// Show where two maps differ, in absolute terms and relative to their uncertainty
#[derive(Debug, Args)]
pub struct Compare {
    /// Map to compare with
    pub first: PathBuf,
    /// Map to compare
    pub second: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    #[command(flatten)]
    pub of_second: SecondMap,
    /// Draw both maps and their difference in this new file (.svg or .png)
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Compare {
    pub fn run(&self) -> Result<(), Failure> {
        let (first, second) = (self.reading.description()?, self.of_second.description()?);
        let picture = self.picture.as_deref().map(|path| (path, self.output.existing()));
        let maps = [(self.first.as_path(), &first), (self.second.as_path(), &second)];
        let work = registry().compare_map_files(maps, picture)?;
        standard_output::print_map_work(&work, self.output.json)
    }
}

/// Write a map in another format, at another reference state
#[derive(Debug, Args)]
pub struct Convert {
    /// Map, in any layout that `mapper map inspect` understands; several files, one for each speed line or contour, are one map
    #[arg(required = true)]
    pub map: Vec<PathBuf>,
    /// New file; its extension gives the format unless `--to` does
    pub out: PathBuf,
    /// Format of the new file
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    #[command(flatten)]
    pub reading: MapReading,
    /// Reference state of the new file [default: unchanged]
    #[arg(long, value_name = "STATE")]
    pub to_reference: Option<String>,
    /// Definition of the file's efficiencies, if the file does not name it: enthalpy, kappa_of_T1 or "constant_gamma 1.4"
    #[arg(long, value_name = "DEFINITION")]
    pub efficiency: Option<EfficiencyDefinition>,
    /// Definition of the efficiencies of the new file [default: unchanged]
    #[arg(long, value_name = "DEFINITION")]
    pub to_efficiency: Option<EfficiencyDefinition>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Convert {
    pub fn run(&self) -> Result<(), Failure> {
        let to_reference = reference(self.to_reference.as_deref())?;
        let out = self.output.map(&self.out, self.to.as_deref());
        let efficiencies = (self.efficiency, self.to_efficiency);
        let description = self.reading.description()?;
        let registry = registry();
        let work =
            registry.convert_map_file(&paths(&self.map), &description, out, to_reference, efficiencies)?;
        standard_output::print_map_work(&work, self.output.json)
    }
}

/// Write the map of a similar machine: flow, pressure ratio, efficiency and speed times a factor
#[derive(Debug, Args)]
pub struct Scale {
    /// Map
    pub map: PathBuf,
    /// New file; its extension gives the format unless `--to` does
    pub out: PathBuf,
    /// Format of the new file
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    /// Wheel diameter over that of the map, at equal blade Mach numbers: flow times its square, speed over it
    #[arg(long, value_name = "RATIO", default_value_t = 1.0)]
    pub size: f64,
    /// Factor on the corrected flow, also of a trim in proportion to the inducer's area
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    pub flow: f64,
    /// Factor on PR - 1
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    pub pressure_ratio: f64,
    /// Factor on the efficiency
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    pub efficiency: f64,
    /// Factor on the corrected speed
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    pub speed: f64,
    #[command(flatten)]
    pub reading: MapReading,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Scale {
    pub fn run(&self) -> Result<(), Failure> {
        let Scale { flow, pressure_ratio, efficiency, speed, .. } = *self;
        let scale = MapScale::of_size(self.size).and(MapScale { flow, pressure_ratio, efficiency, speed });
        let out = self.output.map(&self.out, self.to.as_deref());
        let work = registry().scale_map_file((&self.map, &self.reading.description()?), scale, out)?;
        standard_output::print_map_work(&work, self.output.json)
    }
}

/// Write two maps of one machine, e.g. of low and of high speeds, as one, and show how well they meet
#[derive(Debug, Args)]
pub struct Merge {
    /// Map whose points are kept
    pub first: PathBuf,
    /// Map that adds lines, and points beyond the ends of common lines
    pub second: PathBuf,
    /// New file; its extension gives the format unless `--to` does
    pub out: PathBuf,
    /// Format of the new file
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    #[command(flatten)]
    pub reading: MapReading,
    #[command(flatten)]
    pub of_second: SecondMap,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Merge {
    pub fn run(&self) -> Result<(), Failure> {
        let (first, second) = (self.reading.description()?, self.of_second.description()?);
        let out = self.output.map(&self.out, self.to.as_deref());
        let maps = [(self.first.as_path(), &first), (self.second.as_path(), &second)];
        let work = registry().merge_map_files(maps, out)?;
        standard_output::print_map_work(&work, self.output.json)
    }
}

/// Fit all speed lines together and print the error at each line when it is left out
#[derive(Debug, Args)]
pub struct Fit {
    /// Map in any layout of `mapper map inspect`, also in several files, or run directory
    #[arg(required = true)]
    pub map: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: MapReading,
    /// Corrected speeds of additional lines, rpm, instead of two below and one above the measured ones
    #[arg(long, value_delimiter = ',', value_name = "RPM,...")]
    pub speeds: Option<Vec<f64>>,
    /// Nodes on each line
    #[arg(long, default_value_t = 41, value_parser = clap::value_parser!(u16).range(5..=400))]
    pub nodes: u16,
    /// Skip the error at lines that are left out
    #[arg(long)]
    pub no_leave_out: bool,
    #[command(flatten)]
    pub target: MapTarget,
}

impl Fit {
    pub fn run(&self) -> Result<(), Failure> {
        let options = MapFitOptions {
            further_speeds_rpm: self.speeds.clone(),
            nodes: usize::from(self.nodes),
            leave_one_out: !self.no_leave_out,
        };
        let description = self.reading.description()?;
        let work = registry().fit_map_file(&paths(&self.map), &description, &options, self.target.map())?;
        standard_output::print_map_work(&work, self.target.output.json)
    }
}

/// Write the machine as an FMU (FMI 2.0 co-simulation, C source): map, heat transfer, housings, shaft
#[derive(Debug, Args)]
pub struct Fmu {
    /// Run directory or recording, which is identified, or a campaign (.yaml) for its nominal machine
    pub machine: PathBuf,
    /// New file
    #[arg(long, value_name = "FILE.fmu")]
    pub out: PathBuf,
    /// Compile the sources for this computer too, by the compiler in CC [default: cc]
    #[arg(long)]
    pub compile: bool,
    #[command(flatten)]
    pub reading: RecordingReading,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Fmu {
    pub fn run(&self) -> Result<(), Failure> {
        let (registry, existing) = (registry(), self.output.existing());
        let session = Session::new(&registry);
        let nominal = self.machine.extension().is_some_and(|ending| ending == "yaml" || ending == "yml");
        let written = if nominal {
            let campaign = mapper_campaign::load(&self.machine).map_err(Failure::of_campaign)?;
            session.nominal_fmu(&campaign, self.compile, &self.out, existing)?
        } else {
            let (map, given) = self.reading.read()?;
            let recorded = Recorded::read_run(&registry, &self.machine, &map, given.as_ref())?;
            session.identified_fmu(recorded, &map, self.compile, &self.out, existing)?
        };
        if self.output.json {
            return standard_output::print_json(&written);
        }
        let library = written.binary.as_deref().unwrap_or("none; the importer compiles the sources");
        standard_output::print(&format!(
            "{}\norigin     {}\nstart      {:.0} rpm\nlibrary    {library}\n",
            written.file.display(),
            written.origin,
            written.start_speed_rpm
        ))
    }
}

/// Show how a map file is read: columns, units, reference state, speed lines, and assumptions
#[derive(Debug, Args)]
pub struct Inspect {
    /// Map file; several, one for each speed line (`45000.csv`) or contour (`eta_0.72.csv`), are one map
    #[arg(required = true)]
    pub map: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: MapReading,
    /// Write a map description, which later commands and campaigns accept, to this new file
    #[arg(long, value_name = "FILE")]
    pub write_description: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Inspect {
    pub fn run(&self) -> Result<(), Failure> {
        let description = self.write_description.as_deref().map(|file| (file, self.output.existing()));
        let work =
            registry().inspect_map_file(&paths(&self.map), &self.reading.description()?, description)?;
        standard_output::print_map_work(&work, self.output.json)
    }
}

/// Make a map from a table of steady points: corrected, with uncertainty by source, and without heat transfer if Tc or T3 was measured
#[derive(Debug, Args)]
pub struct Reduce {
    /// Table of N, flow, P1, T1, P2, T2, optionally Tc, T3, P3, P4, oil and humidity, or of a turbine (N, flow, P3, T3, P4, T4), in any layout of
    /// `mapper map inspect`
    pub points: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Campaign with sensors, machine and reference state, or run directory whose identified thermal model is used
    #[arg(long, value_name = "CAMPAIGN|RUN")]
    pub machine: Option<PathBuf>,
    /// Write the uncertainty budget of every point to this new file (CSV)
    #[arg(long, value_name = "FILE")]
    pub budget: Option<PathBuf>,
    /// Make the turbine's map from a table with points of both machines
    #[arg(long, conflicts_with = "budget")]
    pub turbine: bool,
    #[command(flatten)]
    pub target: MapTarget,
}

impl Reduce {
    pub fn run(&self) -> Result<(), Failure> {
        let (description, target) = (self.reading.description()?, &self.target);
        let budget = self.budget.as_deref().map(|file| (file, target.output.existing()));
        let machine = self.machine.as_deref();
        let registry = registry();
        let work = if self.turbine {
            registry.reduce_turbine_points(&self.points, &description, machine, target.map())?
        } else {
            registry.reduce_points(&self.points, &description, machine, target.map(), budget)?
        };
        standard_output::print_map_work(&work, target.output.json)
    }
}

/// Write the other results of a run: thermal model, turbine, pictures of h and of errors
#[derive(Debug, Args)]
pub struct Rig {
    /// Run directory, MCAP file, or log of another program
    pub recording: PathBuf,
    /// Directory for the files; existing files are not replaced
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub reading: RecordingReading,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Rig {
    /// Identifies a recording by its campaign's method and writes thermal model, turbine and pictures.
    pub fn run(&self) -> Result<(), Failure> {
        let (map, given) = self.reading.read()?;
        let registry = registry();
        let recorded = Recorded::read_run(&registry, &self.recording, &map, given.as_ref())?;
        let written = Session::new(&registry).rig_files(recorded, &map, &self.out)?;
        if self.json {
            return standard_output::print_json(&written);
        }
        let lines: String = written.files.iter().map(|path| format!("{}\n", path.display())).collect();
        standard_output::print(&lines)
    }
}
