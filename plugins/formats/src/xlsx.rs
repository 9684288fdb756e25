//! Maps in workbooks of Excel: the first visible sheet with a table of numbers.

use mapper_core::MapFormat;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "xlsx",
    extension: "xlsx",
    further_extensions: &["xlsm", "xls"],
    description: "workbook of Excel with a table of points",
    read: Some(mapper_maps::table::read_workbook),
    turbine: crate::turbine::WORKBOOK,
    ..MapFormat::NONE
};
