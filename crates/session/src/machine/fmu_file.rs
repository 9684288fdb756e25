//! A machine as an FMU file, with its binary if a C compiler is there.

use crate::errors::FmuExportError;
use crate::machine::identified_machine::{with_identified, with_identified_turbine};
use crate::recording::files::{Existing, read_at_most, write_file, write_new};
use crate::recording::recording_file::Recorded;
use crate::{Session, SessionError};
use mapper_campaign::Campaign;
use mapper_core::TurbinePoint;
use mapper_fmu::{FmuFile, FmuMachine, FmuMap, archive, files, table_of_fit};
use mapper_maps::{MapFitOptions, fit_map};
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_physics::machine::params::Params;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::{SteadyError, SteadyState, hold_speed};
use mapper_recording::ChannelMap;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WrittenFmu {
    pub file: PathBuf,
    pub origin: String,
    pub start_speed_rpm: f64,
    /// Folder of the library for this computer; `None` if the FMU contains sources only.
    pub binary: Option<String>,
}

struct FmuExport {
    name: String,
    origin: String,
    params: Params,
    map: FmuMap,
}

impl Session<'_> {
    /// Writes the nominal machine of a campaign.
    pub fn nominal_fmu(
        &self,
        campaign: &Campaign,
        compile: bool,
        out: &Path,
        existing: Existing,
    ) -> Result<WrittenFmu, SessionError> {
        let machine = &campaign.machine;
        let params = machine.params;
        let (map, form) = match machine.map.table() {
            None => {
                let wheel_diameter_m = params.compressor.wheel_diameter_m;
                (FmuMap::ClosedForm(ClosedFormMap { wheel_diameter_m }), "closed-form map")
            }
            Some(table) => (FmuMap::Table(table?), "map from its table"),
        };
        let origin = format!("nominal machine of a campaign: {form}, thermal model as declared");
        write(FmuExport { name: machine.name.clone(), origin, params, map }, campaign, compile, out, existing)
    }

    /// Identifies a recording and writes the identified map and, for the joint method, the thermal model. Unidentified parameters stay.
    pub fn identified_fmu(
        &self,
        recorded: Vec<Recorded>,
        channels: &ChannelMap,
        compile: bool,
        out: &Path,
        existing: Existing,
    ) -> Result<WrittenFmu, SessionError> {
        let first = recorded.first().ok_or(SessionError::NoRecording)?;
        let campaign = first.require_campaign()?.clone();
        let identified = self.identify(recorded, channels, None)?;
        // Points without map coordinates are skipped; the others may still form a map.
        let no_map = |why: String| FmuExportError::NoMap(why);
        let map = identified.map(&campaign.machine.name).map_err(|error| no_map(error.to_string()))?;
        let options = MapFitOptions { leave_one_out: false, ..MapFitOptions::default() };
        let map = fit_map(map, &options).map_err(|error| no_map(error.to_string()))?;
        let fitted = map.fitted.as_ref().ok_or_else(|| no_map("it is not fitted".to_owned()))?;
        let table = table_of_fit(fitted, map.reference).map_err(FmuExportError::Map)?;
        let thermal = identified.thermal.as_ref();
        let law = if thermal.is_some_and(|found| found.convection.is_some()) {
            "as identified"
        } else {
            "as declared"
        };
        let compressor =
            thermal.map_or(campaign.machine.params, |found| with_identified(&campaign.machine.params, found));
        let points: Vec<&TurbinePoint> = identified.turbine.iter().map(|scored| &scored.point).collect();
        let whole = with_identified_turbine(&compressor, &points, identified.turbine_housing.as_ref());
        let turbine = match whole {
            Some(_) => {
                "turbine and its housing as identified, bearing loss in its efficiency; mass of the compressor as declared"
            }
            None => "turbine, bearing and masses as declared",
        };
        let export = FmuExport {
            name: campaign.machine.name.clone(),
            origin: format!(
                "identified by the {} method: fitted map of {} points on {} speed lines, compressor's heat transfer {law}; \
                 {turbine}",
                identified.config.method,
                map.lines.iter().map(|line| line.points.len()).sum::<usize>(),
                map.lines.len()
            ),
            params: whole.unwrap_or(compressor),
            map: FmuMap::Table(table),
        };
        write(export, &campaign, compile, out, existing)
    }
}

fn write(
    export: FmuExport,
    campaign: &Campaign,
    compile: bool,
    out: &Path,
    existing: Existing,
) -> Result<WrittenFmu, SessionError> {
    let start = start(&export, campaign).map_err(FmuExportError::Start)?;
    let machine = FmuMachine {
        name: &export.name,
        origin: &export.origin,
        params: &export.params,
        map: &export.map,
        boundary: &start.boundary,
        start: &start.state,
    };
    let mut files = files(&machine).map_err(FmuExportError::Fmu)?;
    let binary = if compile { Some(with_binary(&mut files, &machine.identifier())?) } else { None };
    write_file(out, &archive(&files).map_err(FmuExportError::Fmu)?, existing)?;
    Ok(WrittenFmu {
        file: out.to_owned(),
        origin: export.origin.clone(),
        start_speed_rpm: start.state.shaft_speed_rpm(),
        binary,
    })
}

/// Start state: steady at the middle point of the grid, or at the first other point with a steady state.
fn start(export: &FmuExport, campaign: &Campaign) -> Result<SteadyState, SteadyError> {
    let model = match &export.map {
        FmuMap::ClosedForm(map) => Model::new(export.params, Arc::new(*map)),
        FmuMap::Table(map) => Model::new(export.params, Arc::new(map.clone())),
    };
    let mut points = campaign.points.clone();
    points.sort_by(|a, b| a.speed_rpm.total_cmp(&b.speed_rpm));
    let half = points.len() / 2;
    points.rotate_left(half);
    let mut refused = SteadyError::NoHeatBalance { speed_rpm: f64::NAN, valve_opening_ratio: f64::NAN };
    for point in points {
        let boundary = mapper_physics::machine::params::BoundaryConditions {
            valve_opening_ratio: point.valve_opening_ratio,
            ..campaign.boundary
        };
        match hold_speed(&model, point.speed_rpm, &boundary) {
            Ok(steady_state) => return Ok(steady_state),
            Err(error) => refused = error,
        }
    }
    Err(refused)
}

/// Largest library accepted into an archive, bytes.
const LIBRARY_MAX_BYTES: u64 = 64 << 20;

/// FMI platform name of this computer and its library extension; `None` if FMI has no such name.
const PLATFORM: Option<(&str, &str)> = if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    Some(("linux64", "so"))
} else if cfg!(all(target_os = "macos", target_arch = "x86_64")) {
    Some(("darwin64", "dylib"))
} else {
    None
};

/// Adds the compiled library to the files of an FMU and returns its folder. The compiler is `$CC`, or `cc` by default.
pub(crate) fn with_binary(fmu: &mut Vec<FmuFile>, identifier: &str) -> Result<String, SessionError> {
    let compiler =
        std::env::var("CC").ok().filter(|name| !name.trim().is_empty()).unwrap_or_else(|| "cc".to_owned());
    let failed = |why: String| FmuExportError::Compiler { compiler: compiler.clone(), why };
    let Some((platform, ending)) = PLATFORM else {
        return Err(FmuExportError::Platform.into());
    };
    let scratch =
        tempfile::tempdir().map_err(SessionError::file("create", Path::new("a temporary directory")))?;
    let mut sources = Vec::new();
    for file in fmu.iter() {
        let Some(name) = file.path.strip_prefix("sources/") else { continue };
        let path = scratch.path().join(name);
        write_new(&path, &file.bytes)?;
        if name.ends_with(".c") {
            sources.push(path);
        }
    }
    let library = scratch.path().join(format!("{identifier}.{ending}"));
    // As in a makefile, CC may contain options. A path with blanks is one word if it names a file.
    let words: Vec<&str> = compiler.split_whitespace().collect();
    let (program, options) = match words.as_slice() {
        [program, options @ ..] if !Path::new(&compiler).is_file() => (*program, options),
        _ => (compiler.as_str(), &[][..]),
    };
    let output = Command::new(program)
        .args(options)
        .args([
            "-std=c99",
            "-O2",
            "-shared",
            "-fPIC",
            "-fvisibility=hidden",
            "-DFMI2_Export=__attribute__((visibility(\"default\")))",
        ])
        .arg("-o")
        .arg(&library)
        .args(&sources)
        .arg("-lm")
        .output()
        .map_err(|error| failed(error.to_string()))?;
    if !output.status.success() {
        let stderr = String::from_utf8_lossy(&output.stderr);
        return Err(failed(stderr.chars().take(2000).collect()).into());
    }
    let bytes = read_at_most(&library, LIBRARY_MAX_BYTES)?;
    let folder = format!("binaries/{platform}");
    fmu.push(FmuFile { path: format!("{folder}/{identifier}.{ending}"), bytes });
    Ok(folder)
}
