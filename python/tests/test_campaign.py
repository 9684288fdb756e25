"""Campaigns and plans: mistakes have their place, and plans are those of the command."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mapper
import matplotlib as mpl
import pytest

mpl.use("agg")


def place_of(message: str, file: str) -> tuple[str, str]:
    """Return the line of text at the first place of a message, and the text over its carets."""
    lines = message.splitlines()
    at = next(index for index, line in enumerate(lines) if f"--> {file}" in line)
    number = lines[at].rpartition(f"{file}:")[2].split(":")[0]
    shown = next(index for index in range(at, len(lines)) if lines[index].lstrip().startswith(f"{number} |"))
    carets = lines[shown + 1]
    marked = lines[shown][carets.index("^") : carets.rindex("^") + 1]
    return lines[shown].partition("|")[2], marked


def test_a_mistake_has_line_and_caret(campaign_file: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(campaign_file.read_text().replace("warm_up: 60 min", "warm_up: 60 krpm"))
    with pytest.raises(mapper.CampaignError) as caught:
        mapper.Campaign.load(wrong)
    line, marked = place_of(str(caught.value), str(wrong))
    assert "warm_up" in line
    assert marked == "60 krpm"


def test_a_mistake_in_a_dict_has_line_and_caret() -> None:
    with pytest.raises(mapper.CampaignError) as caught:
        mapper.Campaign.from_dict({"campaign": "x", "machine": {"nam": "y"}})
    assert '"nam"' in str(caught.value)
    assert isinstance(caught.value, mapper.MapperError)


def test_a_missing_file_is_a_campaign_error(tmp_path: Path) -> None:
    with pytest.raises(mapper.CampaignError):
        mapper.Campaign.load(tmp_path / "none.yaml")


def test_the_backend_s_settings_are_shown_in_the_text(campaign: mapper.Campaign, tmp_path: Path) -> None:
    wrong = mapper.Campaign.from_text(campaign.text.replace("virtual_lab: {}", "virtual_lab: {sensors: 3}"))
    with pytest.raises(mapper.CampaignError) as caught:
        wrong.run(tmp_path)
    assert "virtual_lab: {sensors: 3}" in place_of(str(caught.value), "campaign.yaml")[0]
    assert not list(tmp_path.iterdir())


def test_the_plan_is_that_of_the_command(
    campaign: mapper.Campaign, campaign_file: Path, command: Callable[..., Any]
) -> None:
    plan, expected = campaign.plan(), command("plan", campaign_file)
    assert plan.json == expected
    steps = plan.steps
    assert list(steps.index) == [step["step"] for step in expected["steps"]]
    assert list(steps["speed_rpm"]) == [step["speed_rpm"] for step in expected["steps"]]
    assert steps.attrs["units"]["p3_pa"] == "Pa"
    assert len(plan.plot().texts) == len(steps)


def test_a_dict_gives_the_campaign_of_the_file() -> None:
    sensors = {
        "N": "30 rpm",
        "m_c": "1.5e-4 kg/s",
        "P1": "20 Pa",
        "T1": "0.1 K",
        "P2": "20 Pa",
        "T2": "0.1 K",
        "Tc": "0.1 K",
    }
    campaign = {
        "campaign": "of_a_dict",
        "machine": {"name": "turbo_a", "map": "closed_form"},
        "boundary": {
            "inlet_temperature": "25 degC",
            "inlet_pressure": "100 kPa",
            "turbine_inlet_temperature": "500 degC",
            "turbine_outlet_pressure": "110 kPa",
            "oil_temperature": "50 degC",
        },
        "sensors": {symbol: {"noise": noise} for symbol, noise in sensors.items()},
        "backend": {"virtual_lab": {}},
        "grid": {"speeds": ["80 krpm", "110 krpm"], "openings": [0.7, 1.0]},
        "timing": {"dwell": "60 s", "warm_up": "10 min"},
        "limits": {"speed": "180 krpm", "turbine_inlet_pressure": {"min": "110 kPa", "max": "400 kPa"}},
    }
    as_dict = mapper.Campaign.from_dict(campaign)
    as_text = mapper.Campaign.from_text(json.dumps(campaign))
    assert as_dict.plan().json["made_from"] == as_text.plan().json["made_from"]


@pytest.mark.parametrize("rig", ["virtual_lab", "gas_stand", "log"])
def test_a_template_is_the_campaign_of_init(rig: str, tmp_path: Path, command: Callable[..., Any]) -> None:
    made = mapper.Campaign.template(rig, wheel_diameter_m=0.06, name="t", directory=tmp_path / "a")
    rig_option = rig.replace("_", "-")
    written = command("init", "t", "--wheel", "60mm", "--rig", rig_option, "--out", tmp_path / "b")
    assert made.text == Path(written["campaign"]).read_text()


def test_an_unknown_template_names_the_known_ones() -> None:
    with pytest.raises(mapper.MapperError):
        mapper.Campaign.template("hot_stand")
