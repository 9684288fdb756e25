"""The build backend of the package: maturin's, with the command `mapper`, the drivers and the lab server among the scripts of the wheel.

`python python/with_command.py` builds these programs alone.
"""

import argparse
import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import maturin
from maturin import (  # noqa: F401
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

ROOT = Path(__file__).resolve().parents[1]
# maturin copies the directory of this name into the wheel: the module with `.data`.
SCRIPTS = ROOT / "mapper._mapper.data" / "scripts"
COMMAND = ["mapper-cli"]
# A driver is found next to the command.
DRIVERS = ["mapper-backend-ak", "mapper-backend-modbus", "mapper-backend-opcua", "mapper-lab-server"]


def cargo_build() -> list[str]:
    """Return the command that builds for the target of maturin's options, by zig if they say so."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("--zig", action="store_true")
    parser.add_argument("--target")
    parser.add_argument("--compatibility", default="")
    options, _ = parser.parse_known_args(shlex.split(os.environ.get("MATURIN_PEP517_ARGS", "")))
    build = ["cargo-zigbuild", "zigbuild"] if options.zig else [os.environ.get("CARGO", "cargo"), "build"]
    # cargo-zigbuild has the oldest version of glibc in the target: manylinux_2_28 is `.2.28`.
    _, _, glibc = options.compatibility.partition("manylinux_")
    target = options.target and options.target + (f".{glibc.replace('_', '.')}" if options.zig and glibc else "")
    return [*build, "--release", "--locked", *(["--target", target] if target else [])]


def add_programs(packages: list[str]) -> None:
    """Build programs with the library's cargo and put them where maturin takes them."""
    # The whole build has one profile, so that the module is linked with the same libraries.
    os.environ["CARGO_PROFILE_RELEASE_STRIP"] = "symbols"
    chosen = [word for package in packages for word in ("--package", package)]
    features = ["--features", "mapper-cli/parquet,mapper-cli/tdms"]
    built = subprocess.run(
        [*cargo_build(), "--bins", *chosen, *features, "--message-format=json-render-diagnostics"],
        cwd=ROOT,
        check=True,
        stdout=subprocess.PIPE,
    )
    shutil.rmtree(SCRIPTS, ignore_errors=True)
    SCRIPTS.mkdir(parents=True)
    for message in map(json.loads, built.stdout.splitlines()):
        if message.get("executable"):
            shutil.copy2(message["executable"], SCRIPTS)


def build_wheel(*arguments: Any, **named: Any) -> str:
    """Build a wheel with the programs."""
    add_programs(COMMAND + DRIVERS)
    return maturin.build_wheel(*arguments, **named)


def build_editable(*arguments: Any, **named: Any) -> str:
    """Build an editable installation with the command; drivers are built by cargo while working on them."""
    add_programs(COMMAND)
    return maturin.build_editable(*arguments, **named)


if __name__ == "__main__":
    add_programs(COMMAND + DRIVERS)
