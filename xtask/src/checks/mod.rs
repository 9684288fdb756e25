//! Checks of the repository for developers: formatting, lints, test programs with their counts, and the Python package.

pub(crate) mod formatting;
pub(crate) mod lints;
pub(crate) mod python_package;
pub(crate) mod tally;
pub(crate) mod test_programs;
