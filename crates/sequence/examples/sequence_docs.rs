//! Prints docs/sequences.md.

use std::io::Write;

fn main() -> std::io::Result<()> {
    std::io::stdout().write_all(mapper_sequence::api_markdown().as_bytes())
}
