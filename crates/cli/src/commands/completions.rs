//! `mapper completions`.

use crate::output::failure::Failure;
use crate::output::{output_options, standard_output};
use clap::Args;
use clap_complete::Shell;

/// Print completions for a shell, e.g. `mapper completions bash > /etc/bash_completion.d/mapper`
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell
    pub shell: Shell,
}

impl Completions {
    pub fn run(&self) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut output_options::commands(), "mapper", &mut script);
        standard_output::print(&String::from_utf8_lossy(&script))
    }
}
