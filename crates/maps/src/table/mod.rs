//! Reads tables of map points in any usual layout, for the nominal map of a campaign and for the map formats.

pub(crate) mod beta_tables;
pub(crate) mod column;
mod description;
pub(crate) mod design_point;
mod named_arrays;
pub(crate) mod quantity;
mod read;
mod read_turbine;
mod rows_to_lines;
mod sheet;

pub use crate::assemble::line;
pub use beta_tables::NamedArray;
pub use description::{
    DescriptionError, description_from_yaml, description_text, read_description, set_key,
    turbine_description_text,
};
pub use mapper_table::is_mat5;
pub use named_arrays::{mat5_arrays, read_json_map, read_named_arrays, read_turbine_arrays};
pub use quantity::{
    DEFINITION_PREFIX, efficiency_in_comment, parse_reference, reference_in_comment, resolve_reference,
};
pub use read::{CORRECTED_TO, UNNAMED_MACHINE, read_any_bytes, read_any_text, read_text, read_workbook};
pub use read_turbine::{read_turbine_text, read_turbine_workbook, reduced_turbine_point};
pub use rows_to_lines::{MAX_POINTS, Row, check_point_count, map_of_rows, shift_remark};
pub use sheet::grid::text_of;
pub use sheet::workbook::{file_text, text_of_lines, unpack};
