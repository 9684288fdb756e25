//! Draws a map made from closed formulas: `cargo run -p mapper-formats --example turbo_a_map > map.svg`.

#![allow(clippy::unwrap_used)]

use std::io::Write;

#[path = "../tests/support/mod.rs"]
mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let map = support::fitted();
    let name = std::env::args().nth(1).unwrap_or_else(|| "svg".to_owned());
    let entry = mapper_formats::FORMATS.find(&name).ok_or("unknown format")?;
    std::io::stdout().write_all(&entry.write(&map)?)?;
    Ok(())
}
