//! Tells the tests what this machine offers, as `cargo xtask test` found it.
//!
//! A test that needs more than Rust is marked ignored where that is not there, with the reason, so that `cargo test`
//! shows it as left out instead of passed.

fn main() {
    for (name, flag) in [
        ("MAPPER_TEST_PYTHON", "with_python"),
        ("MAPPER_TEST_TMPFS", "with_tmpfs"),
        ("MAPPER_TEST_CHROMIUM", "with_chromium"),
        ("MAPPER_TEST_SLURM", "with_slurm"),
        ("MAPPER_TEST_NPM", "with_npm"),
    ] {
        println!("cargo::rerun-if-env-changed={name}");
        println!("cargo::rustc-check-cfg=cfg({flag})");
        if let Ok(value) = std::env::var(name) {
            println!("cargo::rustc-cfg={flag}");
            println!("cargo::rustc-env={name}={value}");
        }
    }
}
