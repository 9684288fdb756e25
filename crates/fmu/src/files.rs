//! The files of an FMU: `modelDescription.xml` of the FMI standard, version 2.0, and their archive.

use crate::header::{DEFAULT_TOLERANCE, header, number, with_guid};
use crate::variables::{Causality, FmuError, FmuMachine, Switch, UNITS, Variable, switches, variables};
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

/// Writes the description with the GUID of the sources.
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
///
/// # Errors
/// [`FmuError::Archive`] or [`FmuError::File`] if the archive cannot hold them.
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

/// Generates all files of a machine's FMU: the description, then the sources. The GUID is a hash of both, so that equal machines give
/// equal FMUs.
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
