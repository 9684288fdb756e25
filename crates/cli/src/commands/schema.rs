//! `mapper schema`.

use crate::failure::Failure;
use crate::output;

/// Prints the JSON schema of campaign files.
pub fn schema() -> Result<(), Failure> {
    output::print_json(&mapper_campaign::json_schema())
}
