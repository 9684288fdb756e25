//! `cargo xtask fleet-test`: only the fleet tests, including the cluster test.

use crate::checks::tally::Tally;
use crate::environment::capabilities::{Capabilities, with_program};
use crate::error::Error;
use crate::step::{Steps, command, run};
use crate::{
    checks::test_programs,
    environment::{machine, python_env},
    workspace,
};

/// Builds and runs the fleet tests: the contract, the studies, the commands, and a cluster on this computer. Unlike
/// `cargo xtask test`, it always includes the cluster.
pub fn fleet_test() -> Result<(), Error> {
    machine::require_slurm()?;
    let capabilities = Capabilities::with(python_env::prepare()?);
    let mut steps = Steps::default();
    steps.run("building", || {
        let all = ["build", "--locked", "--workspace", "--all-features", "--bins", "--tests", "--quiet"];
        run(capabilities.to(command(workspace::cargo(), &all)))
    });
    steps.run("tests", || {
        let (mut tally, mut well) = (Tally::default(), true);
        for tests in [
            &["-p", "mapper-fleet", "-p", "mapper-validation", "--tests"][..],
            &["-p", "mapper-tests", "--test", "all", "fleet"],
        ] {
            let arguments = [&["test", "--locked", "--all-features", "--no-fail-fast"], tests].concat();
            let tests = with_program(capabilities.to(command(workspace::cargo(), &arguments)));
            well &= test_programs::run(tests, &mut tally)?;
        }
        test_programs::close(&tally, well)
    });
    steps.finish()
}
