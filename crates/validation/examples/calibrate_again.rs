//! Fits the calibration again to diagnoses that a study of calibrations has made: their fit takes a second, they take hours.
//!
//!     cargo run --release --locked -p mapper-validation --example calibrate_again -- DIR/result/observed.json MADE_BY OUT
//!
//! MADE_BY is the command that is written into the calibration; OUT a directory.

#![allow(clippy::print_stdout)]

use mapper_validation::studies::fit_calibration;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [observed, made_by, out] = arguments.as_slice() else {
        return Err("usage: calibrate_again OBSERVED MADE_BY OUT".into());
    };
    let observed = serde_json::from_str::<Vec<_>>(&std::fs::read_to_string(observed)?)?;
    let made = fit_calibration(&observed, made_by.clone())?;
    for (name, text) in &made.files {
        std::fs::write(Path::new(out).join(name), text)?;
    }
    println!("{}", made.summary);
    Ok(())
}
