//! Tables of the points of a map, as engineers have them. The nominal map of a campaign and the map formats are read here alike.

mod columns;
mod description;
mod efficiency_comment;
mod gas_turbine;
mod read;
mod read_turbine;
mod reference;
mod rows_to_lines;
mod sheet;
mod units_row;

pub use description::{
    DESCRIPTION_KEYS, DescriptionError, DescriptionKey, KeyError, describe, describe_turbine,
    description_from_yaml, read_description, set_key,
};
pub use efficiency_comment::{DEFINITION, efficiency_in_comment};
pub use read::{read_any_bytes, read_any_text, read_text, read_workbook};
pub use read_turbine::{read_turbine_text, read_turbine_workbook, reduced_turbine_point};
pub use reference::{in_comment, parse_reference, settle};
pub use rows_to_lines::{POINT_LIMIT, Row, line, map_of_rows, room_for_one_more};
pub use sheet::file_text::{file_text, unpacked};
pub use sheet::grid::text_of;
