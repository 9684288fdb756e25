//! Programs that the tests need in addition to the Rust toolchain, and their installation.

use crate::error::Error;
use crate::step::{self, say};
use crate::workspace;

/// A program that the tests need.
struct Tool {
    name: &'static str,
    used_for: &'static str,
    /// Command that succeeds if the program works.
    probe: &'static [&'static str],
    source: Source,
}

/// The origin of a program.
enum Source {
    /// Debian packages; installed if this process is root.
    Debian(&'static [&'static str]),
    /// Components of the Rust toolchain.
    Rustup(&'static [&'static str]),
}

/// Every program that the tests need: one line each.
#[rustfmt::skip]
const TOOLS: &[Tool] = &[
    Tool { name: "rustfmt", used_for: "checks the formatting", probe: &["cargo", "fmt", "--version"], source: Source::Rustup(&["rustfmt"]) },
    Tool { name: "clippy", used_for: "lints", probe: &["cargo", "clippy", "--version"], source: Source::Rustup(&["clippy"]) },
    Tool { name: "python3 with venv", used_for: "reads recordings independently", probe: &["python3", "-c", "import venv, ensurepip"], source: Source::Debian(&["python3", "python3-venv"]) },
    Tool { name: "unshare", used_for: "gives the test of a full disk a file system of its own", probe: &["unshare", "--version"], source: Source::Debian(&["util-linux", "mount"]) },
    Tool { name: "chromium", used_for: "opens the pages that the program writes", probe: &["chromium", "--version"], source: Source::Debian(&["chromium"]) },
];

/// Installs missing tools.
pub fn prepare() -> Result<(), Error> {
    let missing: Vec<&Tool> = TOOLS.iter().filter(|tool| !works(tool)).collect();
    if missing.is_empty() {
        say("all tools are installed\n");
        return Ok(());
    }
    let mut packages_listed = false;
    for tool in missing {
        say(&format!("{} is missing\n", tool.name));
        match tool.source {
            Source::Debian(packages) => install_debian(tool, packages, &mut packages_listed)?,
            Source::Rustup(components) => {
                let arguments = [&["component", "add"], components].concat();
                let install = format!("rustup {}", arguments.join(" "));
                step::run(step::command("rustup", &arguments)).map_err(|_| missing_tool(tool, install))?;
            }
        }
        if !works(tool) {
            return Err(missing_tool(tool, install_command(&tool.source)));
        }
    }
    Ok(())
}

/// Whether tests can run in parallel across programs.
pub fn has_nextest() -> bool {
    step::succeeds(&workspace::cargo(), &["nextest", "--version"])
}

/// Slurm, for a cluster on this computer.
const SLURM: Tool = Tool {
    name: "slurm",
    used_for: "runs the tasks of a fleet",
    probe: &["slurmctld", "-V"],
    source: Source::Debian(&["slurm-wlm"]),
};

/// Whether Slurm's daemons can be run here: they need root, and no systemd. Slurm is installed if possible; otherwise the cluster test is
/// skipped.
pub fn has_slurm() -> bool {
    let install = || match SLURM.source {
        Source::Debian(packages) => install_debian(&SLURM, packages, &mut false),
        Source::Rustup(_) => Ok(()),
    };
    is_root() && (works(&SLURM) || (install().is_ok() && works(&SLURM)))
}

/// Checks for Slurm; the error contains the remedy.
pub fn require_slurm() -> Result<(), Error> {
    if has_slurm() {
        return Ok(());
    }
    let install = if is_root() {
        install_command(&SLURM.source)
    } else {
        "its daemons need root: sudo --preserve-env=PATH cargo xtask fleet-test".to_owned()
    };
    Err(missing_tool(&SLURM, install))
}

/// Whether npm is installed and reaches its registry. The build does not need it.
pub fn has_npm() -> bool {
    step::succeeds("npm", &["ping"])
}

fn is_root() -> bool {
    step::output(step::command("id", &["-u"])).is_ok_and(|id| id == "0")
}

/// Whether a file system of limited size can be made here: the test of a full disk needs one.
pub fn can_mount() -> bool {
    let target = workspace::target_dir();
    let target = target.to_string_lossy();
    step::succeeds("unshare", &["--mount", "mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", &target])
}

fn works(tool: &Tool) -> bool {
    match tool.probe {
        ["cargo", arguments @ ..] => step::succeeds(&workspace::cargo(), arguments),
        [program, arguments @ ..] => step::succeeds(program, arguments),
        [] => true,
    }
}

fn install_debian(tool: &Tool, packages: &[&str], listed: &mut bool) -> Result<(), Error> {
    if !is_root() || !step::succeeds("apt-get", &["--version"]) {
        return Err(missing_tool(tool, install_command(&tool.source)));
    }
    let apt_get = |arguments: &[&str]| {
        let mut command = step::command("apt-get", arguments);
        command.env("DEBIAN_FRONTEND", "noninteractive");
        step::run(command)
    };
    if !*listed {
        apt_get(&["update", "--quiet"])?;
        *listed = true;
    }
    apt_get(&[&["install", "--yes", "--quiet", "--no-install-recommends"], packages].concat())
}

fn install_command(source: &Source) -> String {
    match source {
        Source::Debian(packages) => format!("sudo apt-get install {}", packages.join(" ")),
        Source::Rustup(components) => format!("rustup component add {}", components.join(" ")),
    }
}

fn missing_tool(tool: &Tool, install: String) -> Error {
    Error::Missing { what: tool.name, used_for: tool.used_for, install }
}
