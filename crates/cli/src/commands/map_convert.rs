//! `mapper map convert`: a map in another format, at another reference state.

use crate::arguments::MapConvertArguments;
use crate::failure::Failure;
use crate::{map_file, output};
use mapper_assemble::{MapFitOptions, fit_map};
use mapper_core::ExportError;
use serde_json::json;

/// Reads a map and writes it again.
pub fn convert(arguments: &MapConvertArguments) -> Result<(), Failure> {
    let format = map_file::format(&arguments.out, arguments.to.as_deref())?;
    let to_reference = map_file::reference(arguments.to_reference.as_deref())?;
    let mut map = map_file::read(&arguments.map, map_file::reference(arguments.reference.as_deref())?)?;
    if let Some(reference) = to_reference {
        map = map.at_reference(reference);
    }
    let mut fitted_here = false;
    if map.fitted.is_none() && matches!(format.write(&map), Err(ExportError::NeedsFit { .. })) {
        let options = MapFitOptions { leave_one_out: false, ..MapFitOptions::default() };
        map = fit_map(map, &options).map_err(|error| {
            let message = format!("`{}` needs a fitted map: {error}", format.name);
            Failure::new(crate::exit_code::Code::BadInput, message)
        })?;
        fitted_here = true;
    }
    map_file::write(&arguments.out, format, &map)?;
    let points: usize = map.lines.iter().map(|line| line.points.len()).sum();
    if arguments.json {
        return output::print_json(&json!({
            "file": arguments.out,
            "format": format.name,
            "reference": map.reference,
            "lines": map.lines.len(),
            "points": points,
            "fitted": fitted_here || map.fitted.is_some(),
        }));
    }
    output::print(&format!(
        "{}: {}, {points} points on {} speed lines, corrected to {}{}\n",
        arguments.out.display(),
        format.name,
        map.lines.len(),
        map.reference,
        if fitted_here { "; the format is a table, so the map was fitted" } else { "" },
    ))
}
