"""What the tests share: the command of the same source, and a campaign of a few points."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mapper
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def program() -> Path:
    """Return the command ``mapper``: that of MAPPER_TEST_PROGRAM, or one built from this source."""
    given = os.environ.get("MAPPER_TEST_PROGRAM")
    if given is not None:
        return Path(given)
    cargo = shutil.which("cargo")
    assert cargo is not None, "the tests compare with the command: give it by MAPPER_TEST_PROGRAM, or install cargo"
    build = [
        cargo,
        "build",
        "--package",
        "mapper-cli",
        "--bin",
        "mapper",
        "--message-format",
        "json-render-diagnostics",
    ]
    lines = subprocess.run(build, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    made = [message["executable"] for message in map(json.loads, lines) if message.get("executable")]
    return Path(made[-1])


@pytest.fixture(scope="session")
def command(program: Path) -> Callable[..., Any]:
    """Return a function that runs the command and returns its JSON."""

    def run(*arguments: object) -> Any:
        words = [str(program), *map(str, arguments), "--json"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.fixture(scope="session")
def campaign_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the shipped grid of 18 points with two of its speeds left out, to be quick."""
    text = (ROOT / "campaigns/grid18.yaml").read_text()
    fewer = text.replace(
        "50 krpm, 70 krpm, 90 krpm, 110 krpm, 130 krpm, 150 krpm", "50 krpm, 80 krpm, 110 krpm, 140 krpm"
    )
    assert fewer != text
    file = tmp_path_factory.mktemp("campaign") / "small.yaml"
    file.write_text(fewer)
    return file


@pytest.fixture(scope="session")
def campaign(campaign_file: Path) -> mapper.Campaign:
    return mapper.Campaign.load(campaign_file)


@pytest.fixture(scope="session")
def run(campaign: mapper.Campaign, tmp_path_factory: pytest.TempPathFactory) -> mapper.Run:
    return campaign.run(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def gap_rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the shipped campaign of the gap rig on three points: a diagnosis of each step takes long."""
    text = (ROOT / "campaigns/gap_rig.yaml").read_text()
    for old, new in [
        ("speeds: [90 krpm, 150 krpm, 50 krpm, 130 krpm, 70 krpm, 110 krpm]", "speeds: [90 krpm, 150 krpm, 60 krpm]"),
        ("openings: [0.5, 0.7, 1.0]", "openings: [0.9]"),
    ]:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path_factory.mktemp("gap") / "gap_rig.yaml"
    file.write_text(text)
    return file


@pytest.fixture(scope="session")
def gap_run(gap_rig: Path, tmp_path_factory: pytest.TempPathFactory) -> mapper.Run:
    return mapper.Campaign.load(gap_rig).run(tmp_path_factory.mktemp("gap_runs"))
