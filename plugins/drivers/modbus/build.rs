//! Sets a flag for the tests if there is a Python with a Modbus server, as `cargo xtask test` prepares it.

fn main() {
    println!("cargo::rerun-if-env-changed=MAPPER_TEST_PYTHON");
    println!("cargo::rustc-check-cfg=cfg(with_python)");
    if let Ok(python) = std::env::var("MAPPER_TEST_PYTHON") {
        println!("cargo::rustc-cfg=with_python");
        println!("cargo::rustc-env=MAPPER_TEST_PYTHON={python}");
    }
}
