//! `mapper schema`.

use crate::failure::Failure;
use crate::output;
use clap::Args;

/// Print the JSON schema of campaign files, for editors
#[derive(Debug, Args)]
pub struct Schema {}

impl Schema {
    /// Prints the schema.
    pub fn run(&self) -> Result<(), Failure> {
        output::print_json(&mapper_campaign::json_schema())
    }
}
