//! `mapper schema`.

use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;

/// Print the JSON schema of campaign files, for editors
#[derive(Debug, Args)]
pub struct Schema {}

impl Schema {
    pub fn run(&self) -> Result<(), Failure> {
        standard_output::print_json(&mapper_campaign::json_schema())
    }
}
