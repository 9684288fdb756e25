//! Reads tables over speed and an auxiliary coordinate (beta, R line) from the scripts and files of simulation programs: arrays of MATLAB and
//! Python, nested tables of NPSS.

use crate::table::column::{Machine, column};
use crate::table::design_point::{MapDesign, design_of, flow_unit, interpolate, scale_to_design};
use crate::table::quantity::{Quantity, efficiency_in_comment, end_in, reference_in_comment};
use crate::table::rows_to_lines::{Row, check_point_count, map_of_rows};
use crate::table::sheet::points::MIN_PERCENTAGE;
use mapper_core::unit_factors::PERCENT;
use mapper_core::{CompressorMap, ImportError, ImportRemark, ImportedMap, MapDescription};
use mapper_numerics::statistics::median;

#[derive(Debug, Default)]
pub(crate) struct BetaTables {
    speeds: Vec<f64>,
    beta: Vec<f64>,
    flow: Vec<f64>,
    pressure_ratio: Vec<f64>,
    efficiency: Vec<f64>,
}

/// An array with its name, which is a path in structures: `map.flow`, `lines(2).flow`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NamedArray {
    /// Name.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// The numbers row by row.
    pub values: Vec<f64>,
}

impl NamedArray {
    /// An array whose numbers are stored column by column.
    pub fn of_columns(name: String, rows: usize, columns: usize, stored: &[f64]) -> NamedArray {
        let place = |at: usize| (at % columns.max(1)) * rows + at / columns.max(1);
        let values = (0..stored.len()).filter_map(|at| stored.get(place(at)).copied()).collect();
        NamedArray { name, rows, columns, values }
    }

    pub(crate) fn is_matrix(&self) -> bool {
        self.rows > 1 && self.columns > 1
    }

    /// The structure around the array, and its own name; the unit behind the name may have a point.
    fn parts(&self) -> (&str, &str) {
        let end = self.name.find('[').unwrap_or(self.name.len());
        self.name[..end]
            .rfind('.')
            .map_or(("", self.name.as_str()), |at| (&self.name[..at], &self.name[at + 1..]))
    }

    /// The last part of the name.
    pub(crate) fn own_name(&self) -> &str {
        self.parts().1
    }

    /// The structure around the array.
    pub(crate) fn structure(&self) -> &str {
        self.parts().0
    }

    /// The number of the structure's element, and what is around it; empty if the array is not in a list of structures.
    pub(crate) fn element(&self) -> &str {
        let (structure, _) = self.parts();
        if structure.ends_with(')') { structure } else { "" }
    }
}

/// Maximum number of numbers of a script. Bound: speed or beta, flow, pressure ratio and efficiency of each point.
const MAX_NUMBERS: usize = 4 * crate::table::rows_to_lines::MAX_POINTS;
/// Columns in the fraction of the first number of a table. Source: the format of GSP, `rows.columns` (10.021).
const COLUMNS_BASE: f64 = 1000.0;

/// The map of a script with arrays: `name = [1 2; 3 4]` or `name = np.array([[1, 2], [3, 4]])`.
pub(crate) fn read_arrays(text: &str, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let code = without_comments(text, &["%", "#"]);
    let mut tables = BetaTables::default();
    for (at, _) in code.match_indices('=') {
        let name =
            code[..at].trim_end().rsplit(|c: char| c.is_whitespace() || c == ';').next().unwrap_or_default();
        let value = code[at + 1..].trim_start();
        let value =
            value.strip_prefix("np.array(").or_else(|| value.strip_prefix("numpy.array(")).unwrap_or(value);
        if value.starts_with('[')
            && let Some(place) = tables.array_of(name)
            && place.is_empty()
        {
            *place = bracketed_numbers(value, ('[', ']'), line_of(&code, at))?;
        }
    }
    tables.map(text, &code, description)
}

/// The map of nested tables: `NcorrMap = 0.5 { RlineMap = {1, 2} WcMap = {0.1, 0.2} }`.
pub(crate) fn read_nested(text: &str, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let code = without_comments(text, &["//"]);
    let mut tables = BetaTables::default();
    let (mut speeds, mut by_beta) = (Vec::new(), false);
    for (start, part) in parts_from(&code, "Table ") {
        // Only the first vane angle counts.
        let angles: Vec<usize> = part
            .match_indices("alphaMap")
            .map(|(at, _)| at)
            .filter(|at| part[*at..].trim_start_matches("alphaMap").trim_start().starts_with('='))
            .collect();
        let part = &part[..angles.get(1).copied().unwrap_or(part.len())];
        let mut table_speeds = Vec::new();
        let mut is_known = false;
        for (at, _) in part.match_indices('=') {
            let line = line_of(&code, start + at);
            let is_name = |c: char| c.is_alphanumeric() || c == '_';
            let name = part[..at].trim_end().rsplit(|c: char| !is_name(c)).next().unwrap_or_default();
            let value = part[at + 1..].trim_start();
            let (is_speed, is_list) = (name.to_lowercase().starts_with("nc"), value.starts_with('{'));
            if is_speed && is_list {
                // Each value of beta has one list over all speeds.
                by_beta = true;
                if table_speeds.is_empty() {
                    table_speeds = bracketed_numbers(value, ('{', '}'), line)?;
                }
            } else if is_speed {
                let end =
                    value.find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c))).unwrap_or(value.len());
                table_speeds.extend(value[..end].parse::<f64>().ok());
            } else if is_list && let Some(place) = tables.array_of(name) {
                let numbers = bracketed_numbers(value, ('{', '}'), line)?;
                // The coordinate of the columns is repeated at every speed.
                if name.to_lowercase().starts_with("rline") {
                    *place = numbers;
                } else {
                    place.extend(numbers);
                    is_known = true;
                }
            }
        }
        if is_known && speeds.is_empty() {
            speeds = table_speeds;
        }
    }
    tables.speeds = speeds;
    if by_beta {
        tables.transpose();
    }
    tables.map(text, &code, description)
}

/// The map of text tables of Modelica: `double name(rows, columns)`, the first row the auxiliary coordinate after one unused number, the
/// first column the speeds.
pub(crate) fn read_modelica(text: &str, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let code = without_comments(text, &["#"]);
    let mut tables = BetaTables::default();
    for (start, part) in parts_from(&code, "double ") {
        let Some((head, body)) = part.split_once(')') else { continue };
        let Some((name, size)) = head.trim_start_matches("double ").split_once('(') else { continue };
        let columns = size.split(',').nth(1).and_then(|columns| columns.trim().parse::<usize>().ok());
        let Some(columns) = columns.filter(|columns| *columns > 1) else { continue };
        let numbers = bracketed_numbers(body, ('[', ']'), line_of(&code, start))?;
        let rows: Vec<&[f64]> = numbers.chunks(columns).collect();
        let Some(place) = tables.array_of(name.trim()) else { continue };
        let (beta, lines) = rows.split_first().map_or((&[][..], &[][..]), |(first, rest)| (*first, rest));
        *place = lines.iter().flat_map(|line| line.iter().skip(1)).copied().collect();
        tables.beta = beta.iter().skip(1).copied().collect();
        tables.speeds = lines.iter().filter_map(|line| line.first()).copied().collect();
    }
    tables.map(text, &code, description)
}

/// The tables of GSP and GasTurb: below the name of a quantity `10.021` is a table of 10 rows and 21 columns, the first row the auxiliary
/// coordinate, the first column the speeds; a row may fill several lines (as GSPy reads them, github.com/wvisser1958/GSPy).
pub(crate) fn read_gsp(text: &str, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let mut tables = BetaTables::default();
    let mut sections: Vec<(&str, usize, Vec<f64>)> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let name = line.trim();
        if name.starts_with(|c: char| c.is_alphabetic()) {
            sections.push((name, index + 1, Vec::new()));
        } else if let Some((.., numbers)) = sections.last_mut() {
            numbers.extend(bracketed_numbers(line, ('[', ']'), index + 1)?);
        }
    }
    for (name, line, numbers) in sections {
        let Some(place) = tables.array_of(&name.to_lowercase().replace(' ', "_")) else { continue };
        let Some((size, numbers)) = numbers.split_first() else { continue };
        let (rows, columns) = (size.floor() as usize, (COLUMNS_BASE * size.fract()).round() as usize);
        // The first number is the corner of the table.
        if rows < 2 || columns < 2 || numbers.len() + 1 != rows * columns {
            let form = "a table of GSP: rows.columns (10.021), the coordinates, then a speed and its values in each row";
            return Err(ImportError::RowForm { line, text: name.to_owned(), form });
        }
        let (beta, lines) = numbers.split_at(columns - 1);
        *place = lines.chunks(columns).flat_map(|line| line.iter().skip(1)).copied().collect();
        tables.beta = beta.to_vec();
        tables.speeds = lines.chunks(columns).filter_map(|line| line.first()).copied().collect();
    }
    tables.map(text, text, description)
}

/// The text without the comments that begin with one of the marks; lines keep their numbers.
fn without_comments(text: &str, marks: &[&str]) -> String {
    let end = |line: &str| marks.iter().filter_map(|mark| line.find(mark)).min().unwrap_or(line.len());
    text.lines().map(|line| &line[..end(line)]).collect::<Vec<_>>().join("\n")
}

/// The parts of a text, each with its position, that begin with a keyword.
fn parts_from<'a>(code: &'a str, keyword: &'a str) -> impl Iterator<Item = (usize, &'a str)> {
    let starts: Vec<usize> = code.match_indices(keyword).map(|(at, _)| at).collect();
    let ends: Vec<usize> = starts.iter().skip(1).copied().chain([code.len()]).collect();
    starts.into_iter().zip(ends).map(|(start, end)| (start, &code[start..end]))
}

/// Line of a position in a text, from 1.
fn line_of(text: &str, at: usize) -> usize {
    1 + text[..at].matches('\n').count()
}

/// The numbers between a bracket and its partner, in order. `line`: line of the file at which they start.
fn bracketed_numbers(text: &str, (open, close): (char, char), line: usize) -> Result<Vec<f64>, ImportError> {
    let mut depth = 0usize;
    let mut end = text.len();
    for (at, c) in text.char_indices() {
        depth += usize::from(c == open);
        if c == close {
            depth = depth.saturating_sub(1);
            if depth == 0 {
                end = at;
                break;
            }
        }
    }
    let mut numbers = Vec::new();
    let words = text[..end].split(|c: char| c.is_whitespace() || ",;[]{}()".contains(c));
    for word in words.filter(|word| !word.is_empty() && *word != "...") {
        if numbers.len() >= MAX_NUMBERS {
            return Err(ImportError::TooMany { line, limit: MAX_NUMBERS });
        }
        numbers.push(word.parse().map_err(|_| ImportError::NotANumber {
            line,
            quantity: "table".to_owned(),
            text: word.chars().take(40).collect(),
        })?);
    }
    Ok(numbers)
}

impl BetaTables {
    /// The array of a name, by the names of T-MATS, pyCycle, NPSS and `mapper`.
    fn array_of(&mut self, name: &str) -> Option<&mut Vec<f64>> {
        let name = name.rsplit('.').next().unwrap_or_default().to_lowercase();
        match name.as_str() {
            "ncvec"
            | "ncmap"
            | "nc"
            | "nc_vec"
            | "grid_nc"
            | "ncorr"
            | "ncorrmap"
            | "corrected_speed_rpm"
            | "x_c_map_ncvec" => Some(&mut self.speeds),
            "rlinevec" | "rlinemap" | "rline" | "grid_rline" | "beta" => Some(&mut self.beta),
            "wcarray"
            | "wcmap"
            | "wc"
            | "wc_map"
            | "corrected_flow_kg_s"
            | "flow_corrected_kg_s"
            | "mc"
            | "massflow"
            | "mass_flow" => Some(&mut self.flow),
            "prarray" | "prmap" | "pr" | "pr_map" | "pressure_ratio" => Some(&mut self.pressure_ratio),
            "effarray"
            | "effmap"
            | "eff"
            | "eff_map"
            | "isentropic_efficiency"
            | "isen_efficiency"
            | "efficiency"
            | "eta" => Some(&mut self.efficiency),
            _ => None,
        }
    }

    /// The tables of named arrays: matrices over speed and beta in either order, or vectors over a grid.
    pub(crate) fn of_arrays(arrays: &[NamedArray]) -> BetaTables {
        let mut tables = BetaTables::default();
        let mut wide = Vec::new();
        for array in arrays.iter().filter(|array| array.values.len() > 1 && end_in(&array.name).is_none()) {
            let column = column(0, array.own_name(), Machine::Compressor).ok().flatten();
            let name = match column.as_ref().map(|column| column.quantity) {
                Some(Quantity::Speed) => "nc",
                Some(Quantity::Flow) => "wc",
                Some(Quantity::PressureRatio) => "pr",
                Some(Quantity::Efficiency) => "eta",
                _ => array.own_name(),
            };
            let Some(place) = tables.array_of(name).filter(|place| place.is_empty()) else { continue };
            let as_stated = |value: &f64| column.as_ref().map_or(*value, |column| column.as_stated(*value));
            *place = array.values.iter().map(as_stated).collect();
            wide.extend(array.is_matrix().then(|| (name.to_owned(), array.rows, array.columns)));
        }
        let Some((_, rows, columns)) = wide.first().cloned() else { return tables };
        // A grid of speeds as large as the tables.
        if tables.speeds.len() == rows * columns {
            tables.beta.clear();
            return tables;
        }
        let (speeds, betas) = (tables.speeds.len(), tables.beta.len());
        let is_across = columns == speeds && (rows != speeds || betas == rows && betas != columns);
        let across = if is_across { rows } else { columns };
        for (name, ..) in wide.iter().filter(|_| is_across) {
            if let Some(values) = tables.array_of(name) {
                let value = |at: usize| values.get((at % rows) * columns + at / rows).copied();
                *values = (0..rows * columns).filter_map(value).collect();
            }
        }
        if tables.flow.len() == across && speeds.saturating_mul(across) == rows * columns {
            tables.flow = tables.flow.repeat(speeds);
        }
        let etas = &mut tables.efficiency;
        if median(&*etas).is_some_and(|eta| eta > MIN_PERCENTAGE) {
            etas.iter_mut().for_each(|eta| *eta *= 1.0 / PERCENT);
        }
        tables
    }

    /// Reorders the arrays from beta by beta to speed by speed.
    fn transpose(&mut self) {
        let speeds = self.speeds.len().max(1);
        for values in [&mut self.flow, &mut self.pressure_ratio, &mut self.efficiency] {
            *values =
                (0..speeds).flat_map(|speed| values.iter().skip(speed).step_by(speeds).copied()).collect();
        }
    }

    pub(crate) fn map(
        &self,
        text: &str,
        code: &str,
        description: &MapDescription,
    ) -> Result<ImportedMap, ImportError> {
        let mut rows = self.rows()?;
        let mut remarks = Vec::new();
        let unit_kg_s = flow_unit(code, description)?;
        for row in &mut rows {
            row.flow_corrected_kg_s *= unit_kg_s.unwrap_or(1.0);
        }
        let mut design: MapDesign = design_of(code);
        let at_design = |values: &[f64]| interpolate(&self.speeds, &self.beta, values, design);
        design.values =
            match [&self.flow, &self.pressure_ratio, &self.efficiency].map(|values| at_design(values)) {
                [Some(flow), Some(ratio), Some(eta)] => Some([unit_kg_s.unwrap_or(1.0) * flow, ratio, eta]),
                _ => None,
            };
        let is_relative = scale_to_design(&mut rows, design, description.design, &mut remarks)?;
        // Files of `mapper` have kg/s. A stated design flow scales the flows, so that their unit does not matter.
        let machine = text.lines().find_map(|line| line.split_once("compressor map of "));
        if unit_kg_s.is_none() && description.design.flow_corrected_kg_s.is_none() && machine.is_none() {
            if is_relative {
                return Err(ImportError::FlowUnit);
            }
            remarks.push(ImportRemark::FlowUnitAssumed);
        }
        rows.iter().try_for_each(Row::check)?;
        let found = text.lines().find_map(reference_in_comment);
        let machine = machine.map(|(_, name)| name.trim().chars().take(200).collect());
        let efficiency = text.lines().find_map(efficiency_in_comment);
        let map = map_of_rows(machine.unwrap_or_default(), &rows, found, description.reference)?;
        Ok(ImportedMap {
            map: CompressorMap { efficiency, ..map },
            columns: Vec::new(),
            remarks,
            measured: Vec::new(),
        })
    }

    fn rows(&self) -> Result<Vec<Row>, ImportError> {
        let missing = [
            (&self.speeds, "speed"),
            (&self.flow, "corrected flow"),
            (&self.pressure_ratio, "pressure ratio"),
            (&self.efficiency, "efficiency"),
        ];
        if let Some((_, missing)) = missing.iter().find(|(values, _)| values.is_empty()) {
            return Err(ImportError::NoTable { missing });
        }
        let lines = self.speeds.len();
        // A map with vanes has one table per angle; the first counts.
        let columns = if self.beta.is_empty() { self.flow.len() / lines } else { self.beta.len() };
        let table = lines * columns;
        let fits = |values: &[f64]| table > 0 && values.len().is_multiple_of(table) && !values.is_empty();
        if ![&self.flow, &self.pressure_ratio, &self.efficiency].into_iter().all(|values| fits(values)) {
            return Err(ImportError::TableSize {
                speeds: lines,
                flows: self.flow.len(),
                pressure_ratios: self.pressure_ratio.len(),
                efficiencies: self.efficiency.len(),
            });
        }
        let mut rows = Vec::with_capacity(lines * columns);
        for (line, speed_corrected_rpm) in self.speeds.iter().enumerate() {
            for place in line * columns..(line + 1) * columns {
                check_point_count(rows.len(), place + 1)?;
                let value = |values: &[f64]| values.get(place).copied().unwrap_or(f64::NAN);
                rows.push(Row {
                    at: place + 1,
                    speed_corrected_rpm: *speed_corrected_rpm,
                    flow_corrected_kg_s: value(&self.flow),
                    pressure_ratio: value(&self.pressure_ratio),
                    eta: Some(value(&self.efficiency)),
                });
            }
        }
        Ok(rows)
    }
}
