//! Prints docs/reference/sequences.md.

use std::io::Write;

fn main() -> std::io::Result<()> {
    std::io::stdout().write_all(mapper_report::sequence_page().as_bytes())
}
