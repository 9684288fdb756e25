//! Draws a map made from closed formulas: `cargo run -p mapper-exporters --example turbo_a_map > map.svg`.

#![allow(clippy::unwrap_used)]

use std::io::Write;

#[path = "../tests/support/mod.rs"]
mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let map = support::fitted();
    let name = std::env::args().nth(1).unwrap_or_else(|| "svg".to_owned());
    let entry = mapper_exporters::find(&name).ok_or("there is no such format")?;
    std::io::stdout().write_all(&(entry.export)(&map)?)?;
    Ok(())
}
