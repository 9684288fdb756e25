//! Commands on map files, of compressors and turbines: the result as text for people and as JSON for programs.

use crate::errors::MapWorkError;
use crate::machine::map_file::{name_of, write_map_fitted_if_needed};
use crate::recording::files::Existing;
use crate::{Registry, SessionError, write_file, write_map};
use mapper_core::{
    CompressorMap, EfficiencyDefinition, ExportError, ImportError, ImportRemark, ImportedMap,
    ImportedTurbine, MapDescription, MapFormat, MapPoint, ReferenceState, TurbineMap, Verdict,
};
use mapper_maps::table::{description_text, turbine_description_text};
use mapper_maps::{
    MapFitOptions, MapScale, compare, compare_turbines, convert_efficiency, fit_map, fit_turbine, merge,
    scaled,
};
use mapper_report::{
    Describe, Document, Message, distinct_names, map_comparison_figure, map_fit, turbine_fit,
};
use serde_json::{Value, json};
use std::path::Path;

/// The result of an operation on map files.
#[derive(Debug)]
pub struct MapWork {
    /// The result for people.
    pub document: Document,
    /// The result for programs.
    pub json: Value,
    /// Assumptions about the files.
    pub warnings: Vec<String>,
}

/// A map that was read from a file.
#[derive(Debug)]
pub enum MapFile {
    /// A compressor map.
    Compressor(ImportedMap),
    /// A turbine map.
    Turbine(ImportedTurbine),
}

/// A new file with a map.
#[derive(Debug, Clone, Copy)]
pub struct MapOut<'a> {
    /// The file.
    pub path: &'a Path,
    /// Name of its format; `None` selects it by the extension.
    pub format: Option<&'a str>,
    /// Treatment of an existing file.
    pub existing: Existing,
}

impl MapOut<'_> {
    pub(crate) fn format(&self, registry: &Registry) -> Result<&'static MapFormat, SessionError> {
        registry.format_of(self.path, self.format)
    }
}

/// What was written: `kind` follows the numbers of points and lines, and `more` the keys that every map has.
fn written(
    (out, format): (MapOut<'_>, &MapFormat),
    (points, lines): (usize, usize),
    (is_fitted, fitted_here): (bool, bool),
    (kind, more): (String, Value),
) -> (Document, Value) {
    let (file, name) = (out.path.display(), format.name);
    let note = if fitted_here { "; the format is a table, so the map was fitted" } else { "" };
    let mut document = Document::default();
    document.text(format!("{file}: {name}, {points} points on {lines} speed lines, {kind}{note}"));
    let mut json = json!({
        "file": out.path, "format": name, "lines": lines, "points": points, "fitted": is_fitted,
    });
    if let (Some(json), Value::Object(more)) = (json.as_object_mut(), more) {
        json.extend(more);
    }
    (document, json)
}

/// Writes a compressor map, fitted first if the format needs it.
fn write_derived(
    map: CompressorMap,
    out: MapOut<'_>,
    format: &MapFormat,
) -> Result<(Document, Value), SessionError> {
    let (map, fitted_here) = write_map_fitted_if_needed(out.path, format, map, out.existing)?;
    let counts = (map.lines.iter().map(|line| line.points.len()).sum(), map.lines.len());
    let more = json!({ "reference": map.reference, "efficiency": map.efficiency });
    let kind = format!("corrected to {}", map.reference);
    Ok(written((out, format), counts, (map.fitted.is_some(), fitted_here), (kind, more)))
}

pub(crate) fn warnings(path: &Path, remarks: &[ImportRemark]) -> Vec<String> {
    remarks.iter().map(|remark| format!("{}: {}", path.display(), remark.message())).collect()
}

impl Registry {
    /// Reads the map of a compressor or of a turbine.
    pub fn read_map_file(
        &self,
        files: &[&Path],
        user_description: &MapDescription,
    ) -> Result<MapFile, SessionError> {
        match self.inspect_map_of(files, user_description) {
            Ok(imported) => Ok(MapFile::Compressor(imported)),
            Err(SessionError::Import(_, ImportError::Turbine { .. })) => {
                self.inspect_turbine_of(files, user_description).map(MapFile::Turbine)
            }
            Err(error) => Err(error),
        }
    }

    /// Shows how a map file is read. `description` is a new file for the map description.
    pub fn inspect_map_file(
        &self,
        files: &[&Path],
        user_description: &MapDescription,
        description: Option<(&Path, Existing)>,
    ) -> Result<MapWork, SessionError> {
        let name = files.first().and_then(|path| path.file_name()).unwrap_or_default().to_string_lossy();
        let (described, document, json) = match self.read_map_file(files, user_description)? {
            MapFile::Compressor(imported) => {
                let lines = imported.map.lines.iter().map(|line| {
                    let is_unusable = |point: &&MapPoint| point.identified.verdict == Verdict::Unusable;
                    json!({
                        "speed_corrected_rpm": line.speed_corrected_rpm,
                        "points": line.points.len(),
                        "unusable": line.points.iter().filter(is_unusable).count(),
                    })
                });
                let json = json!({
                    "machine": "compressor",
                    "reference": imported.map.reference,
                    "efficiency": imported.map.efficiency,
                    "columns": imported.columns,
                    "remarks": imported.remarks,
                    "lines": lines.collect::<Vec<_>>(),
                    "surge": imported.map.surge,
                });
                (description_text(&name, &imported, user_description), imported.document(), json)
            }
            MapFile::Turbine(imported) => {
                let lines = imported.map.lines().map(|line| {
                    json!({
                        "vane_position": line.first().and_then(|point| point.vane_position),
                        "speed_parameter_rpm_sqrt_k": line.first().map(|point| point.speed_parameter_rpm_sqrt_k),
                        "points": line.len(),
                    })
                });
                let json = json!({
                    "machine": "turbine",
                    "columns": imported.columns,
                    "remarks": imported.remarks,
                    "lines": lines.collect::<Vec<_>>(),
                });
                (turbine_description_text(&name, &imported, user_description), imported.document(), json)
            }
        };
        if let Some((file, existing)) = description {
            write_file(file, described.as_bytes(), existing)?;
        }
        Ok(MapWork { document, json, warnings: Vec::new() })
    }

    /// Fits a map, and writes it to `out`.
    pub fn fit_map_file(
        &self,
        files: &[&Path],
        user_description: &MapDescription,
        options: &MapFitOptions,
        out: Option<MapOut<'_>>,
    ) -> Result<MapWork, SessionError> {
        let path = &name_of(files);
        let format = out.map(|out| Ok::<_, SessionError>((out, out.format(self)?))).transpose()?;
        let file = out.map(|out| out.path);
        let (mut document, json, remarks) = match self.read_map_file(files, user_description)? {
            MapFile::Compressor(imported) => {
                let map = fit_map(imported.map, options)
                    .map_err(|source| MapWorkError::NotFitted(path.to_owned(), source))?;
                if let Some((out, format)) = format {
                    write_map(out.path, format, &map, out.existing)?;
                }
                let json =
                    json!({"map": path, "reference": map.reference, "fitted": map.fitted, "file": file});
                let document = map.fitted.as_ref().map(|fitted| map_fit(&map, fitted)).unwrap_or_default();
                (document, json, imported.remarks)
            }
            MapFile::Turbine(imported) => {
                let map = fit_turbine(imported.map)
                    .map_err(|source| MapWorkError::TurbineNotFitted(path.to_owned(), source))?;
                if let Some((out, format)) = format {
                    write_file(out.path, &format.write_turbine(&map)?, out.existing)?;
                }
                let json = json!({"map": path, "fitted": map.fitted, "file": file});
                let document = map.fitted.as_ref().map(|fitted| turbine_fit(&map, fitted));
                (document.unwrap_or_default(), json, imported.remarks)
            }
        };
        if let Some(file) = file {
            document.facts("", [("map", file.display().to_string())]);
        }
        Ok(MapWork { document, json, warnings: warnings(path, &remarks) })
    }

    /// Writes a map in another format, at another reference state, with efficiencies of another definition.
    pub fn convert_map_file(
        &self,
        files: &[&Path],
        user_description: &MapDescription,
        out: MapOut<'_>,
        to_reference: Option<ReferenceState>,
        efficiencies: (Option<EfficiencyDefinition>, Option<EfficiencyDefinition>),
    ) -> Result<MapWork, SessionError> {
        let path = &name_of(files);
        let format = out.format(self)?;
        match self.read_map_file(files, user_description)? {
            MapFile::Compressor(imported) => {
                let mut map = imported.map;
                if let Some(reference) = to_reference {
                    map = map.at_reference(reference);
                }
                let efficiency = map.efficiency.or(efficiencies.0);
                match (efficiency, efficiencies.1) {
                    (Some(from), Some(to)) => map = convert_efficiency(map, from, to),
                    (None, Some(_)) => return Err(MapWorkError::NoDefinition.into()),
                    (_, None) => map.efficiency = efficiency,
                }
                let (document, json) = write_derived(map, out, format)?;
                Ok(MapWork { document, json, warnings: warnings(path, &imported.remarks) })
            }
            MapFile::Turbine(imported) => {
                let requested = [
                    (to_reference.is_some(), "reference state"),
                    (efficiencies.0.is_some() || efficiencies.1.is_some(), "definition of efficiency"),
                ];
                if let Some((_, property)) = requested.into_iter().find(|(requested, _)| *requested) {
                    return Err(MapWorkError::NotOfTurbine { path: path.to_owned(), property }.into());
                }
                let (map, fitted_here) = write_turbine_fitted_if_needed(path, out, format, imported.map)?;
                let counts = (map.points.len(), map.lines().count());
                let of_turbine = ("turbine".to_owned(), json!({ "machine": "turbine" }));
                let fitted = (map.fitted.is_some(), fitted_here);
                let (document, json) = written((out, format), counts, fitted, of_turbine);
                Ok(MapWork { document, json, warnings: warnings(path, &imported.remarks) })
            }
        }
    }

    /// Writes a map with its quantities multiplied.
    pub fn scale_map_file(
        &self,
        (path, user_description): (&Path, &MapDescription),
        scale: MapScale,
        out: MapOut<'_>,
    ) -> Result<MapWork, SessionError> {
        let format = out.format(self)?;
        let imported = self.inspect_map(path, user_description)?;
        let map =
            scaled(imported.map, scale).map_err(|source| MapWorkError::NotScaled(path.to_owned(), source))?;
        let (mut document, mut json) = write_derived(map, out, format)?;
        document.text(format!(
            "Flow times {:.4}, PR - 1 times {:.4}, efficiency times {:.4}, speed times {:.4}. The intervals are those of the points, in proportion; \
             the error of the scaling is not in them.",
            scale.flow, scale.pressure_ratio, scale.efficiency, scale.speed
        ));
        json["scale"] = serde_json::to_value(scale)?;
        Ok(MapWork { document, json, warnings: warnings(path, &imported.remarks) })
    }

    /// Writes two maps of one machine as one.
    pub fn merge_map_files(
        &self,
        [first, second]: [(&Path, &MapDescription); 2],
        out: MapOut<'_>,
    ) -> Result<MapWork, SessionError> {
        let format = out.format(self)?;
        let maps = [self.inspect_map(first.0, first.1)?, self.inspect_map(second.0, second.1)?];
        let merged = merge(&maps[0].map, &maps[1].map);
        let mut document = merged.document();
        let (lines, seam) = (serde_json::to_value(&merged.lines)?, serde_json::to_value(&merged.seam)?);
        let (written, mut json) = write_derived(merged.map, out, format)?;
        document.append(written);
        (json["of_lines"], json["seam"]) = (lines, seam);
        let warnings = [warnings(first.0, &maps[0].remarks), warnings(second.0, &maps[1].remarks)].concat();
        Ok(MapWork { document, json, warnings })
    }

    /// Compares two maps of the same machine. `picture` is a new file that shows both.
    pub fn compare_map_files(
        &self,
        [first, second]: [(&Path, &MapDescription); 2],
        picture: Option<(&Path, Existing)>,
    ) -> Result<MapWork, SessionError> {
        let paths = [first.0, second.0];
        let maps = (self.read_map_file(&[first.0], first.1)?, self.read_map_file(&[second.0], second.1)?);
        let (document, json, remarks) = match maps {
            (MapFile::Compressor(a), MapFile::Compressor(b)) => {
                let comparison = compare(&a.map, &b.map).map_err(MapWorkError::from)?;
                if let Some((path, existing)) = picture {
                    let names = distinct_names(paths);
                    let figure = map_comparison_figure(&a.map, &b.map, &comparison, &names);
                    let png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
                    let bytes = if png {
                        figure.to_png(2.0).map_err(|error| MapWorkError::Picture(error.to_string()))?
                    } else {
                        figure.to_svg().into_bytes()
                    };
                    write_file(path, &bytes, existing)?;
                }
                let json = serde_json::to_value(&comparison)?;
                (comparison.document(), json, [a.remarks, b.remarks])
            }
            (MapFile::Turbine(a), MapFile::Turbine(b)) => {
                if picture.is_some() {
                    let property = "picture of a comparison";
                    return Err(MapWorkError::NotOfTurbine { path: paths[0].to_owned(), property }.into());
                }
                let comparison = compare_turbines(&a.map, &b.map)
                    .map_err(|source| MapWorkError::TurbineNotFitted(paths[0].to_owned(), source))?;
                let json = serde_json::to_value(&comparison)?;
                (comparison.document(), json, [a.remarks, b.remarks])
            }
            (MapFile::Turbine(_), _) => return Err(MapWorkError::TwoMachines(paths[0].to_owned()).into()),
            (_, MapFile::Turbine(_)) => return Err(MapWorkError::TwoMachines(paths[1].to_owned()).into()),
        };
        let warnings = [warnings(paths[0], &remarks[0]), warnings(paths[1], &remarks[1])].concat();
        Ok(MapWork { document, json, warnings })
    }
}

/// Writes a turbine map, fitted first if the format tabulates the whole map. Returns the written map and whether it was fitted here.
pub(crate) fn write_turbine_fitted_if_needed(
    path: &Path,
    out: MapOut<'_>,
    format: &MapFormat,
    map: TurbineMap,
) -> Result<(TurbineMap, bool), SessionError> {
    let needs_fit =
        map.fitted.is_none() && matches!(format.write_turbine(&map), Err(ExportError::NeedsFit { .. }));
    let map = if needs_fit {
        fit_turbine(map).map_err(|source| MapWorkError::TurbineNotFitted(path.to_owned(), source))?
    } else {
        map
    };
    write_file(out.path, &format.write_turbine(&map)?, out.existing)?;
    Ok((map, needs_fit))
}
