//! How often one faulty sensor of four is found and rightly named, and how often a fault-free recording is called faulty:
//! `cargo run --release --locked -p mapper-observe --example element_study -- SEEDS` (200 where it is left out).
#![allow(clippy::print_stdout, missing_docs, reason = "what it prints is all it is for")]
#[path = "../tests/common/mod.rs"]
#[allow(clippy::unwrap_used, reason = "shared with the tests")]
mod common;

use common::{Fault, Verdict, clean, judged};

fn main() {
    let seeds: u64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(200);
    let clean = clean();
    println!(
        "{seeds} recordings each; four thermocouples and two taps at each of four ports, six steps of 60 s"
    );
    for (what, fault) in [
        ("fault-free", Fault::None),
        ("off by 6 sigma", Fault::Off(6.0)),
        ("off by -6 sigma", Fault::Off(-6.0)),
        ("6 sigma beyond its own draw", Fault::OffBeyondItsDraw(6.0)),
        ("stuck", Fault::Stuck),
        ("stuck, with its noise", Fault::StuckWithNoise),
        ("slow: a tip of 2 mm for 1 mm", Fault::Slow(2e-3)),
        ("slow: a tip of 4 mm for 1 mm", Fault::Slow(4e-3)),
    ] {
        let results: Vec<Verdict> = (0..seeds).map(|seed| judged(&clean, fault, seed)).collect();
        let share = |of: Verdict| {
            100.0 * results.iter().filter(|result| **result == of).count() as f64 / seeds as f64
        };
        println!(
            "{what:<30} right {:5.1} %, wrong {:4.1} %, missed {:4.1} %",
            share(Verdict::Right),
            share(Verdict::Wrong),
            share(Verdict::Missed)
        );
    }
}
