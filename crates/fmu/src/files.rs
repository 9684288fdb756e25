//! The files of an FMU.

use crate::variables::{
    Causality, FmuError, FmuMachine, FmuMap, Switch, UNITS, Variable, switches, variables,
};
use mapper_core::ReferenceState;
use mapper_physics::compressor_map::closed_form_map::CompressorCharacteristic;
use mapper_physics::compressor_map::tabulated_map::{Line, Node, TabulatedMap};
use mapper_physics::gas::air;
use mapper_physics::gas::mixture::{Gas, Virials};
use mapper_physics::laws::{convection, housing};
use mapper_physics::machine::params::Params;
use mapper_physics::simulation::rosenbrock;
use quick_xml::escape::escape;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Name and text of the C files that all FMUs share.
const SOURCES: &[(&str, &str)] = &[
    ("fmu.c", include_str!("../c/fmu.c")),
    ("machine.c", include_str!("../c/machine.c")),
    ("machine.h", include_str!("../c/machine.h")),
    ("map.c", include_str!("../c/map.c")),
    ("rodas5p.c", include_str!("../c/rodas5p.c")),
    // Unchanged headers of the standard (2-clause BSD, Modelica Association).
    ("fmi2Functions.h", include_str!("../c/fmi2/fmi2Functions.h")),
    ("fmi2FunctionTypes.h", include_str!("../c/fmi2/fmi2FunctionTypes.h")),
    ("fmi2TypesPlatform.h", include_str!("../c/fmi2/fmi2TypesPlatform.h")),
];

pub fn description(
    machine: &FmuMachine<'_>,
    variables: &[Variable],
    switches: &[Switch],
    guid: &str,
) -> Result<String, FmuError> {
    let identifier = machine.identifier();
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing to a String cannot fail.
    let _ = writeln!(
        xml,
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{}\" guid=\"{guid}\" description=\"{}\" generationTool=\"mapper {}\" \
         variableNamingConvention=\"structured\" numberOfEventIndicators=\"0\">",
        escape(machine.name),
        escape(machine.origin),
        env!("CARGO_PKG_VERSION"),
    );
    let _ = writeln!(
        xml,
        "  <CoSimulation modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"true\" \
         canGetAndSetFMUstate=\"true\">\n    <SourceFiles>"
    );
    for (name, _) in SOURCES.iter().filter(|(name, _)| name.ends_with(".c")) {
        let _ = writeln!(xml, "      <File name=\"{name}\"/>");
    }
    xml += "    </SourceFiles>\n  </CoSimulation>\n  <UnitDefinitions>\n";
    for (name, base) in UNITS {
        let _ = writeln!(xml, "    <Unit name=\"{name}\"><BaseUnit {base}/></Unit>");
    }
    xml += "  </UnitDefinitions>\n  <LogCategories>\n    <Category name=\"logStatusWarning\"/>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n";
    let _ = writeln!(
        xml,
        "  <DefaultExperiment startTime=\"0\" stopTime=\"110\" tolerance=\"{DEFAULT_TOLERANCE:e}\" stepSize=\"0.1\"/>\n  <ModelVariables>"
    );
    for (reference, variable) in variables.iter().enumerate() {
        write_variable(&mut xml, reference, variable)?;
    }
    for (reference, switch) in switches.iter().enumerate() {
        let _ = writeln!(
            xml,
            "    <ScalarVariable name=\"{}\" valueReference=\"{reference}\" causality=\"parameter\" variability=\"fixed\" description=\"{}\">\
             <Boolean start=\"{}\"/></ScalarVariable>",
            switch.name,
            escape(switch.description),
            switch.start
        );
    }
    xml += "  </ModelVariables>\n  <ModelStructure>\n";
    // The standard counts from 1. No list of dependencies is given, because every output may depend on every input.
    let outputs: Vec<usize> = variables
        .iter()
        .enumerate()
        .filter(|(_, variable)| variable.causality == Causality::Output)
        .map(|(index, _)| index + 1)
        .collect();
    for list in ["Outputs", "InitialUnknowns"] {
        let _ = writeln!(xml, "    <{list}>");
        for index in &outputs {
            let _ = writeln!(xml, "      <Unknown index=\"{index}\"/>");
        }
        let _ = writeln!(xml, "    </{list}>");
    }
    xml += "  </ModelStructure>\n</fmiModelDescription>\n";
    Ok(xml)
}

fn write_variable(xml: &mut String, reference: usize, variable: &Variable) -> Result<(), FmuError> {
    let (causality, variability) = match variable.causality {
        Causality::Parameter => ("parameter", "fixed"),
        Causality::Input => ("input", "continuous"),
        Causality::Output => ("output", "continuous"),
    };
    let start = match variable.start {
        Some(value) => format!(" start=\"{}\"", number(variable.name, value)?),
        None => String::new(),
    };
    let _ = writeln!(
        xml,
        "    <ScalarVariable name=\"{}\" valueReference=\"{reference}\" causality=\"{causality}\" variability=\"{variability}\" \
         description=\"{}\"><Real unit=\"{}\"{start}/></ScalarVariable>",
        variable.name,
        escape(variable.description),
        variable.unit,
    );
    Ok(())
}

/// Packs the files of an FMU.
pub fn archive(files: &[FmuFile]) -> Result<Vec<u8>, FmuError> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // No time stamp, so that equal files give equal bytes.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    for file in files {
        zip.start_file(file.path.as_str(), options)?;
        zip.write_all(&file.bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// A file of an FMU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FmuFile {
    /// Path in the archive, with `/`.
    pub path: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// Generates the description and the sources of an FMU. The GUID is a hash of both, so that equal machines give equal FMUs.
pub fn files(machine: &FmuMachine<'_>) -> Result<Vec<FmuFile>, FmuError> {
    let (variables, switches) = (variables(machine), switches(machine));
    let header = header(machine, &variables, &switches)?;
    let mut hash = Sha256::new();
    hash.update(description(machine, &variables, &switches, "")?);
    hash.update(&header);
    SOURCES.iter().for_each(|(_, text)| hash.update(text));
    let guid = guid(&hash.finalize());
    let description = description(machine, &variables, &switches, &guid)?;
    let source = |name: &str, text: &str| FmuFile { path: format!("sources/{name}"), bytes: text.into() };
    let mut files = vec![FmuFile { path: "modelDescription.xml".to_owned(), bytes: description.into() }];
    files.extend(SOURCES.iter().map(|(name, text)| source(name, text)));
    files.push(source("model_data.h", &with_guid(&header, &guid)));
    Ok(files)
}

/// The first 16 bytes of a hash as `{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}`.
fn guid(hash: &[u8]) -> String {
    let mut text = String::from("{");
    for (index, byte) in hash.iter().take(16).enumerate() {
        if [4, 6, 8, 10].contains(&index) {
            text.push('-');
        }
        // Writing to a String cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text + "}"
}

/// The shortest decimal that C reads back as the same number.
pub fn number(name: &str, value: f64) -> Result<String, FmuError> {
    if value.is_finite() {
        Ok(format!("{value:e}"))
    } else {
        Err(FmuError::NotFinite { name: name.to_owned(), value })
    }
}

pub fn numbers(name: &str, values: impl IntoIterator<Item = f64>) -> Result<String, FmuError> {
    Ok(values.into_iter().map(|value| number(name, value)).collect::<Result<Vec<_>, _>>()?.join(", "))
}

/// `static const double NAME[] = {...};`
pub fn array(text: &mut String, name: &str, values: impl IntoIterator<Item = f64>) -> Result<(), FmuError> {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "static const double {name}[] = {{{}}};", numbers(name, values)?);
    Ok(())
}

pub fn identifier(name: &str) -> String {
    name.replace('.', "_")
}

/// Default tolerance, relative to each state.
pub const DEFAULT_TOLERANCE: f64 = 1e-8;

/// Writes the header without the GUID, which depends on its contents; see [`with_guid`].
pub fn header(
    machine: &FmuMachine<'_>,
    variables: &[Variable],
    switches: &[Switch],
) -> Result<String, FmuError> {
    let mut text = String::from("/* Written by `mapper map fmu`: the numbers of this machine. */\n");
    text += "#ifndef MODEL_DATA_H\n#define MODEL_DATA_H\n\n";
    let reference = match machine.map {
        FmuMap::ClosedForm(map) => map.reference(),
        FmuMap::Table(map) => map.reference(),
    };
    constants(&mut text, reference)?;
    value_references(&mut text, variables, switches)?;
    match machine.map {
        FmuMap::ClosedForm(_) => text += "#define MAP_CLOSED_FORM\n\n",
        FmuMap::Table(map) => table(&mut text, map)?,
    }
    gases(&mut text, machine.params)?;
    tableau(&mut text)?;
    text += "\n#endif\n";
    Ok(text)
}

pub fn with_guid(header: &str, guid: &str) -> String {
    header.replacen(
        "#define MODEL_DATA_H\n",
        &format!("#define MODEL_DATA_H\n\n#define MODEL_GUID \"{guid}\"\n"),
        1,
    )
}

fn constants(text: &mut String, reference: ReferenceState) -> Result<(), FmuError> {
    for (name, value) in [
        ("PI", std::f64::consts::PI),
        ("GAS_CONSTANT", air::GAS_CONSTANT_J_KGK),
        ("REAL_AIR_GAS_CONSTANT", Gas::AIR_GAS_CONSTANT_J_KGK),
        ("GAMMA_AIR", air::HEAT_CAPACITY_RATIO),
        ("STEFAN_BOLTZMANN", housing::STEFAN_BOLTZMANN_W_M2K4),
        ("WALL_EXPONENT", convection::WALL_EXPONENT),
        ("MAP_T_REF_K", reference.t_ref_k),
        ("MAP_P_REF_PA", reference.p_ref_pa),
        ("DEFAULT_TOLERANCE", DEFAULT_TOLERANCE),
    ] {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "#define {name} {}", number(name, value)?);
    }
    text.push('\n');
    Ok(())
}

fn gases(text: &mut String, params: &Params) -> Result<(), FmuError> {
    text.push_str(
        "typedef struct {\n    double constant, cp[7];\n    int is_real;\n    double virial[5], virial_with_vapour[5];\n} Gas;\n",
    );
    for (name, gas) in [
        ("COMPRESSOR_GAS", params.compressor.gas),
        ("TURBINE_GAS", params.turbine.gas),
        ("VAPOUR", Gas::vapour()),
    ] {
        let list =
            |values: &[f64]| numbers(name, values.iter().copied()).map(|numbers| format!("{{{numbers}}}"));
        let virials = gas.virials.unwrap_or(Virials { own: [0.0; 5], with_vapour: [0.0; 5] });
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "static const Gas {name} = {{{}, {}, {}, {}, {}}};",
            number(name, gas.gas_constant_j_kgk)?,
            list(&gas.heat_capacity)?,
            u8::from(gas.virials.is_some()),
            list(&virials.own)?,
            list(&virials.with_vapour)?
        );
    }
    text.push('\n');
    Ok(())
}

fn value_references(text: &mut String, variables: &[Variable], switches: &[Switch]) -> Result<(), FmuError> {
    text.push_str("enum {\n");
    for variable in variables {
        let _ = writeln!(text, "    VR_{},", identifier(variable.name));
    }
    text.push_str("    VR_COUNT\n};\n");
    for (name, causality) in [("VR_FIRST_INPUT", Causality::Input), ("VR_FIRST_OUTPUT", Causality::Output)] {
        let first = variables.iter().position(|variable| variable.causality == causality);
        let _ = writeln!(text, "#define {name} {}u", first.unwrap_or(variables.len()));
    }
    text.push_str("enum {\n");
    for switch in switches {
        let _ = writeln!(text, "    SW_{},", identifier(switch.name));
    }
    text.push_str("    SW_COUNT\n};\n");
    let starts = variables
        .iter()
        .map(|variable| number(variable.name, variable.start.unwrap_or(0.0)))
        .collect::<Result<Vec<_>, _>>()?;
    let _ = writeln!(text, "static const double real_start[VR_COUNT] = {{{}}};", starts.join(", "));
    let on: Vec<&str> = switches.iter().map(|switch| if switch.start { "1" } else { "0" }).collect();
    let _ = writeln!(text, "static const int switch_start[SW_COUNT] = {{{}}};\n", on.join(", "));
    Ok(())
}

/// A column of a table: its name in C, and the function that gives its value in a row.
type Column<T> = (&'static str, fn(&T) -> f64);

fn table(text: &mut String, map: &TabulatedMap) -> Result<(), FmuError> {
    let lines = map.lines();
    let _ = writeln!(text, "#define MAP_LINES {}", lines.len());
    let line_columns: [Column<Line>; 3] = [
        ("map_speed_rpm", |line| line.speed_corrected_rpm),
        ("map_choke_pr", |line| line.choke_pressure_ratio),
        ("map_surge_pr", |line| line.surge_pressure_ratio),
    ];
    for (name, column) in line_columns {
        array(text, name, lines.iter().map(column))?;
    }
    let mut first = vec![0];
    for line in lines {
        first.push(first.last().copied().unwrap_or(0) + line.nodes.len());
    }
    let first: Vec<String> = first.iter().map(usize::to_string).collect();
    let _ = writeln!(text, "static const int map_first_node[] = {{{}}};", first.join(", "));
    let columns: [Column<Node>; 3] = [
        ("map_x", |node| node.x),
        ("map_flow_kg_s", |node| node.flow_kg_s),
        ("map_efficiency", |node| node.efficiency),
    ];
    for (name, column) in columns {
        array(text, name, lines.iter().flat_map(|line| &line.nodes).map(column))?;
    }
    text.push('\n');
    Ok(())
}

fn tableau(text: &mut String) -> Result<(), FmuError> {
    let _ = writeln!(text, "#define RODAS_STAGES {}", rosenbrock::STAGES);
    let _ = writeln!(text, "static const double rodas_gamma = {};", number("gamma", rosenbrock::GAMMA)?);
    for (name, rows) in [("rodas_a", &rosenbrock::A), ("rodas_c", &rosenbrock::C)] {
        let rows = rows
            .iter()
            .map(|row| Ok(format!("    {{{}}}", numbers(name, row.iter().copied())?)))
            .collect::<Result<Vec<_>, FmuError>>()?;
        let _ = writeln!(
            text,
            "static const double {name}[RODAS_STAGES][RODAS_STAGES - 1] = {{\n{}\n}};",
            rows.join(",\n")
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_and_nonsense_is_refused() {
        for value in [0.1, 29e-3, 1e300, -0.0, f64::MIN_POSITIVE] {
            assert_eq!(number("", value).unwrap().parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
        assert!(number("flow", f64::NAN).unwrap_err().to_string().contains("flow"));
    }
}
