"""The build backend of the package: maturin's, with the command `mapper`, the drivers and the lab server among the scripts of the wheel.

`python python/with_command.py` builds these programs alone.
"""

import json
import os
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


def add_programs(packages: list[str]) -> None:
    """Build programs with the module's cargo, for its target, and put them where maturin takes them."""
    # One profile for all, so that the libraries that the module shares with them are built once.
    os.environ["CARGO_PROFILE_RELEASE_STRIP"] = "symbols"
    cargo = [os.environ.get("CARGO", "cargo"), "build", "--release", "--locked"]
    chosen = [word for package in packages for word in ("--package", package)]
    features = ["--features", "mapper-cli/hdf5,mapper-cli/parquet,mapper-cli/tdms"]
    built = subprocess.run(
        [*cargo, "--bins", *chosen, *features, "--message-format=json-render-diagnostics"],
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
