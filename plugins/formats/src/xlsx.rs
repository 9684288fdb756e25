//! Maps in workbooks of Excel: the first sheet with a table of numbers.

use crate::table;
use mapper_core::MapFormat;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "xlsx",
    extension: "xlsx",
    further_extensions: &["xlsm"],
    description: "workbook of Excel with a table of points",
    write: None,
    draw: None,
    read: Some(table::read_workbook),
};
