"""The build backend of the package: maturin's, with the command `mapper` among the scripts of the wheel."""

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

HERE = Path(__file__).resolve().parent
# maturin copies the directory of this name into the wheel: the module with `.data`.
SCRIPTS = HERE / "mapper._mapper.data" / "scripts"


def add_command() -> None:
    """Build the command with the library's cargo and put it where maturin takes it."""
    cargo = [os.environ.get("CARGO", "cargo"), "build", "--release", "--locked"]
    command = ["--package", "mapper-cli", "--bin", "mapper"]
    built = subprocess.run(
        [*cargo, *command, "--message-format=json-render-diagnostics"], cwd=HERE, check=True, stdout=subprocess.PIPE
    )
    messages = (json.loads(line) for line in built.stdout.splitlines())
    (program,) = [message["executable"] for message in messages if message.get("executable")]
    SCRIPTS.mkdir(parents=True, exist_ok=True)
    shutil.copy2(program, SCRIPTS)


def build_wheel(*arguments: Any, **named: Any) -> str:
    """Build a wheel with the command."""
    add_command()
    return maturin.build_wheel(*arguments, **named)


def build_editable(*arguments: Any, **named: Any) -> str:
    """Build an editable installation with the command."""
    add_command()
    return maturin.build_editable(*arguments, **named)
