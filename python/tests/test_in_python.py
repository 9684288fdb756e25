"""Rigs, effects and MATLAB data from Python."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import math
import os
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mapper
import numpy as np
import numpy.typing as npt
import pytest
import scipy.io

ROOT = Path(__file__).parents[2]
DRIVERS = ROOT / "plugins/drivers/python"


def python_rig() -> Any:
    """Return the module of the example driver."""
    path = str(DRIVERS / "mapper-backend-python_rig")
    loader = importlib.machinery.SourceFileLoader("python_rig", path)
    spec = importlib.util.spec_from_loader("python_rig", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


RIG = python_rig()


class InProcess(mapper.Backend):
    """The rig of the example driver as a backend of this process."""

    channels = (*RIG.NOISE, *RIG.COMMANDS)
    sample_rate_hz = RIG.RATE_HZ
    accepts = RIG.ACCEPTS
    safe = RIG.SAFE
    needs_guarded = ("overspeed", "turbine_inlet_pressure")

    def __init__(self, settings: dict[str, Any]) -> None:
        self.rig = RIG.PythonRig(settings)
        self.calls: list[str] = []

    def arm(self) -> None:
        self.rig.arm()

    def set(self, setpoints: dict[str, Any]) -> None:
        self.calls.append("set")
        self.rig.set(setpoints)

    def poll(self, until_s: float) -> tuple[npt.ArrayLike, Mapping[str, npt.ArrayLike]]:
        times, columns, _ = self.rig.poll(until_s)
        return np.array(times), {name: np.array(values, dtype=float) for name, values in columns.items()}

    def make_safe(self) -> None:
        self.calls.append("make_safe")
        self.rig.make_safe()

    def disarm(self) -> None:
        self.calls.append("disarm")
        self.rig.disarm()


@pytest.fixture(scope="module")
def short(campaign_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the campaign on four points of the rig in Python, of a minute each."""
    text = campaign_file.read_text()
    for old, new in [
        ("virtual_lab: {}", "python_rig: {seed: 3}"),
        ("50 krpm, 80 krpm, 110 krpm, 140 krpm", "80 krpm, 110 krpm"),
        ("openings: [0.5, 0.7, 1.0]", "openings: [0.7, 1.0]"),
        ("warm_up: 60 min", "warm_up: 1 min"),
        ("dwell: 120 s", "dwell: 60 s"),
        ("end: 110 s", "end: 55 s"),
    ]:
        assert old in text, old
        text = text.replace(old, new)
    file = tmp_path_factory.mktemp("short") / "short.yaml"
    file.write_text(text)
    return file


def test_a_rig_in_python_gives_the_points_of_its_driver(
    short: Path, command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[InProcess] = []

    def make(settings: dict[str, Any]) -> InProcess:
        made.append(InProcess(settings))
        return made[-1]

    run = mapper.Campaign.load(short).run(tmp_path / "here", backend=make)
    path = [str(DRIVERS), str(Path(sys.executable).parent), os.environ["PATH"]]
    monkeypatch.setenv("PATH", os.pathsep.join(path))
    expected = command("run", short, "--out", tmp_path / "driver")
    assert run.json is not None
    assert len(expected["points"]) >= 4
    assert run.json["points"] == expected["points"]
    assert "set" in made[-1].calls
    assert made[-1].calls.index("make_safe") < made[-1].calls.index("disarm")
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("mapper rig")]


def test_an_exception_of_a_rig_is_the_cause_and_the_rig_is_made_safe(short: Path, tmp_path: Path) -> None:
    class Broken(InProcess):
        def poll(self, until_s: float) -> tuple[npt.ArrayLike, Mapping[str, npt.ArrayLike]]:
            if until_s > 5.0:
                raise ZeroDivisionError("no air")
            return super().poll(until_s)

    rig = Broken({})
    with pytest.raises(mapper.MapperError) as caught:
        mapper.Campaign.load(short).run(tmp_path, backend=rig)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert rig.calls[-2:] == ["make_safe", "disarm"] or "make_safe" in rig.calls


def test_fast_samples_of_a_rig_give_their_coefficient_of_variation(short: Path, tmp_path: Path) -> None:
    amplitude, rate_hz = 0.01, 1000

    class Swinging(InProcess):
        def arm(self) -> None:
            super().arm()
            self.sent_s = 0.0

        def poll(self, until_s: float) -> Any:
            times, columns = super().poll(until_s)
            # A sine of 40 Hz: its standard deviation is the amplitude over the root of two.
            swing_s = np.arange(round(self.sent_s * rate_hz), round(until_s * rate_hz)) / rate_hz
            pressure = 150e3 * (1.0 + amplitude * np.sin(2 * np.pi * 40 * swing_s))
            fast = [("P2", self.sent_s, 1 / rate_hz, pressure)]
            self.sent_s = until_s
            return times, columns, fast if len(swing_s) else []

    run = mapper.Campaign.load(short).run(tmp_path, backend=Swinging({}))
    variation = run.recording["P2_cov"].dropna()
    assert len(variation) > 0.9 * len(run.recording["P2"])
    np.testing.assert_allclose(variation.iloc[20:], amplitude / math.sqrt(2), rtol=0.01)


def test_a_rig_that_no_one_gave_is_a_mistake_of_the_campaign(short: Path, tmp_path: Path) -> None:
    with pytest.raises(mapper.CampaignError):
        mapper.Campaign.load(short).run(tmp_path)


COOLANT = {"submodel": "compressor_housing", "parameters": {"G": ("W/K", 0, 20, 1.5)}}


def coolant() -> mapper.Effect:
    """Return examples/effects/coolant_passage.rhai as a function."""
    return mapper.Effect(
        "coolant_passage",
        submodel="compressor_housing",
        parameters={"G": mapper.Parameter("W/K", 0, 20, step=1.5)},
        heat_to_compressor_w=lambda at, p: p.G * (358.15 - at.tc_k),
    )


def test_an_effect_in_python_is_the_script_that_it_stands_for(gap_rig: Path, gap_run: mapper.Run) -> None:
    campaign = mapper.Campaign.load(gap_rig)

    def sizes(effect: mapper.Effect | Path) -> list[Any]:
        found = mapper.diagnose(gap_run, campaign, effects=[effect]).json["candidates"]
        return [(candidate["effects"], candidate["parameters"], candidate["probability"]) for candidate in found]

    assert sizes(coolant()) == sizes(ROOT / "examples/effects/coolant_passage.rhai")


def test_arithmetic_becomes_a_script() -> None:
    effect = mapper.Effect(
        "odd",
        submodel="shaft",
        parameters={"a": ("1", 0, 1, 0.1), "b": ("1", -1, 1, 0.1)},
        efficiency=lambda at, p, value: value * (1 - p.a * np.exp(-abs(at.tc_k - 300)) ** 2) / np.float64(2),
        shaft_torque_nm=lambda at, p: -p.b + 3,
    )
    assert "fn efficiency(at, p, value)" in effect.text
    assert "exp((-abs((at.tc_k - 300.0)))) ** 2.0" in effect.text
    assert "((-p.b) + 3.0)" in effect.text


@pytest.mark.parametrize(
    "hook",
    [
        lambda at, p: p.G if at.tc_k > 300 else 0,
        lambda at, p: math.exp(at.tc_k),
        lambda at, p: p.G * float("nan"),
        lambda at, p: "text",
    ],
)
def test_what_is_no_arithmetic_is_refused(hook: Callable[..., object]) -> None:
    with pytest.raises(TypeError):
        mapper.Effect("wrong", heat_to_compressor_w=hook, **COOLANT)


def test_an_unknown_parameter_is_refused() -> None:
    with pytest.raises(AttributeError):
        mapper.Effect("wrong", heat_to_compressor_w=lambda at, p: p.H, **COOLANT)


def test_scipy_reads_the_matlab_data(run: mapper.Run, tmp_path: Path) -> None:
    file = tmp_path / "map.mat"
    run.map.to("mat", file)
    read = scipy.io.loadmat(file)
    reference = run.map.reference
    assert read["reference_temperature_K"] == reference["t_ref_k"]
    points = run.map.points
    expected = points[["line_speed_corrected_rpm", "flow_corrected_kg_s", "pressure_ratio", "eta"]].to_numpy()
    np.testing.assert_array_equal(read["points_rpm_kg_s_pressure_ratio_efficiency"], expected)
    # Where a table ends, so does the fitted line: at the surge end, beta is 1.
    fitted = run.map.fitted
    assert fitted is not None
    ends = fitted[fitted["beta_ratio"] == 1.0].set_index("line_speed_corrected_rpm")
    ends = ends.loc[read["corrected_speed_rpm"][0]]
    assert read["beta"][0, -1] == 1.0
    np.testing.assert_array_equal(read["pressure_ratio"][:, -1], ends["pressure_ratio"])
    np.testing.assert_array_equal(read["corrected_flow_kg_s"][:, -1], ends["flow_corrected_kg_s"])
    np.testing.assert_array_equal(read["isentropic_efficiency"][:, -1], ends["eta"])
    assert run.map.machine in str(read["about"][0])
