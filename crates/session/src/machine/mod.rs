//! Machine data before and after a test: first campaign, nominal map, work on map files, and FMU export.

pub(crate) mod first_campaign;
pub(crate) mod fmu_file;
pub(crate) mod identified_machine;
pub(crate) mod map_file;
pub(crate) mod map_work;
pub(crate) mod reduce;
