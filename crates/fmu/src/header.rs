//! The numbers of a machine as a C header.

use crate::variables::{Causality, FmuError, FmuMachine, FmuMap, Switch, Variable};
use mapper_core::ReferenceState;
use mapper_physics::compressor_map::closed_form_map::CompressorCharacteristic;
use mapper_physics::compressor_map::tabulated_map::{Line, Node, TabulatedMap};
use mapper_physics::gas::air;
use mapper_physics::gas::mixture::{Gas, Virials};
use mapper_physics::laws::{convection, housing};
use mapper_physics::machine::params::Params;
use mapper_physics::simulation::rosenbrock;
use std::fmt::Write;

/// The shortest decimal that C reads back as the same number.
pub fn number(name: &str, value: f64) -> Result<String, FmuError> {
    if value.is_finite() {
        Ok(format!("{value:e}"))
    } else {
        Err(FmuError::NotFinite { name: name.to_owned(), value })
    }
}

/// The numbers of an array, comma-separated.
pub fn numbers(name: &str, values: impl IntoIterator<Item = f64>) -> Result<String, FmuError> {
    Ok(values.into_iter().map(|value| number(name, value)).collect::<Result<Vec<_>, _>>()?.join(", "))
}

/// `static const double NAME[] = {...};`
pub fn array(text: &mut String, name: &str, values: impl IntoIterator<Item = f64>) -> Result<(), FmuError> {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "static const double {name}[] = {{{}}};", numbers(name, values)?);
    Ok(())
}

/// A variable's name as part of a C identifier.
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

/// The header with the GUID of the model description.
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

/// The gases of both sides, and the vapour that `compressor.humidity` adds.
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
